//! Binary kernels with one damaged word: CSPICE believes the counts of a segment, and reads beyond its arrays.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests outside a test function"
)]

use crate::common;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    error::Kind,
    spice::{KernelSet, Session},
    time::Et,
};
use common::{
    case::Case,
    daf::{segment_words, set_word, word},
    mission::products,
    real_data,
};
use tempfile::tempdir;

/// Its name, and what it makes of a word.
type Damage = (&'static str, fn(f64) -> f64);

/// What a damaged word may become.
const DAMAGE: [Damage; 7] = [
    ("large", |_| 1e300),
    ("negative", |value| -value - 1.0),
    ("NaN", |_| f64::NAN),
    ("infinite", |_| f64::INFINITY),
    ("zero", |_| 0.0),
    ("beyond 31 bits", |_| 2_147_483_653.0),
    ("one more", |value| value + 1.0),
];

/// How many damaged kernels are checked, and with how many a site is run; in the short run every damage of each
/// kernel, the places by turns, and every change of each state and attitude once.
const DAMAGED: [usize; 2] = [21, 300];
const RUN: [usize; 2] = [16, 24];

/// Numbers that look drawn, the same in every run (Knuth's multiplicative hashing).
fn drawn(index: usize, below: usize) -> usize {
    (index + 1).wrapping_mul(2_654_435_761) % 4_294_967_296 * below / 4_294_967_296
}

#[test]
fn no_damaged_word_ends_the_program_and_each_failure_names_the_kernel() {
    let case = Case::pair();
    let damaged = DAMAGED[usize::from(common::long())];
    let mut refused = 0;
    for index in 0..damaged {
        let kernel = ["mgs_nav_scene.bsp", "mgs_sc_scene.bc", "mars_sun_scene.bsp"][index % 3];
        let path = format!("kernels/{kernel}");
        let good = case.read(&path);
        let segments = segment_words(&good);
        let (first, last) = segments[drawn(index, segments.len())];
        // Counts stand at the end of a segment.
        let at = match index % 2 {
            0 => last - drawn(index, 4),
            _ => first + drawn(index, last - first),
        };
        let (name, damage) = DAMAGE[index % DAMAGE.len()];
        let mut bytes = good.clone();
        set_word(&mut bytes, at, damage(word(&good, at)));
        case.write(&path, bytes);
        let output = case.check().output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        let what = format!("{kernel}, word {at} of {first}..{last}, {name}: {told}");
        match output.status.code() {
            Some(0) => {}
            Some(_) => {
                assert!(told.contains(kernel), "{what}");
                refused += 1;
            }
            None => panic!("ended by a signal: {what}"),
        }
        case.write(&path, good);
    }
    // Half of the words are counts or times near them.
    assert!(2 * refused >= damaged, "{refused} of {damaged} refused");
}

/// What the numbers of a site rest on.
fn numbers(case: &Case) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut products = products(&case.path("out"));
    products.retain(|path, _| path.extension().is_some_and(|of| of == "parquet"));
    products
}

/// States and attitudes of the exposures, each with one word of another number: what is not refused with the name of the
/// kernel gives the numbers of the sound kernel, or products that are marked invalid.
#[test]
fn no_damaged_word_gives_other_numbers_that_pass_for_valid() {
    let case = Case::pair();
    assert_eq!(case.run().output().unwrap().status.code(), Some(0));
    let sound = numbers(&case);
    assert!(sound.len() > 5);
    let run = RUN[usize::from(common::long())];
    let mut refused = 0;
    for index in 0..run {
        // Segments of the two images, which were taken in the middle of each.
        let segment = [2, 4][index % 2];
        let (kernel, size) = [("mgs_nav_scene.bsp", 6), ("mgs_sc_scene.bc", 7)][index / 2 % 2];
        let path = format!("kernels/{kernel}");
        let good = case.read(&path);
        let (first, last) = segment_words(&good)[segment];
        let middle = (last - first) / (size + 1) / 2;
        let at = first + size * (middle - 3 + drawn(index, 7)) + drawn(index + 500, size.min(4));
        let mut bytes = good.clone();
        let (was, next) = (word(&good, at), word(&good, at + 1));
        let what = match index / 4 % 4 {
            0 => {
                set_word(&mut bytes, at, -was);
                "negative"
            }
            1 => {
                set_word(&mut bytes, at, 0.0);
                "zero"
            }
            2 => {
                set_word(&mut bytes, at, next);
                set_word(&mut bytes, at + 1, was);
                "swapped"
            }
            _ => {
                set_word(&mut bytes, at, was + 0.5);
                "half more"
            }
        };
        case.write(&path, bytes);
        let output = case.run().output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        let what = format!("{kernel}, word {at} of {first}..{last}, {was} {what}: {told}");
        match output.status.code() {
            Some(0) => assert!(numbers(&case) == sound, "{what}"),
            // The products exist, and say that they must not be used.
            Some(5) => {}
            Some(_) => {
                assert!(told.contains(kernel), "{what}");
                refused += 1;
            }
            None => panic!("ended by a signal: {what}"),
        }
        case.write(&path, good);
    }
    assert!(2 * refused >= run, "{refused} of {run} refused");
}

#[test]
fn what_is_wrong_is_told_with_segment_and_number() {
    let case = Case::pair();
    let spk = case.read("kernels/mgs_nav_scene.bsp");
    let ck = case.read("kernels/mgs_sc_scene.bc");
    let folder = tempdir().unwrap();
    let says = |good: &[u8], at: usize, value: f64| {
        let mut bytes = good.to_vec();
        set_word(&mut bytes, at, value);
        told(folder.path(), &bytes)
    };
    let (first, last) = segment_words(&spk)[0];
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count"
    )]
    let states = word(&spk, last) as usize;
    let epochs = first + 6 * states;
    for (at, value, expected) in [
        (
            last,
            1e300,
            "segment 1 (SPK of -94, type 13): its number of states is 1e300, in a segment of ",
        ),
        (last, 10.0, "words; its counts account for"),
        (last - 1, 1e9, "interpolation of degree 1000000000.0 over"),
        (last - 1, 28.0, "interpolation of degree 28.0 over"),
        (first + 7, f64::INFINITY, "record 2 holds inf"),
        (
            first + 6 * 50 + 1,
            word(&spk, first + 6 * 50 + 1) + 1.0,
            "record 51 lies 0.9995",
        ),
        (
            first + 6 * 50 + 5,
            word(&spk, first + 6 * 50 + 5) - 0.1,
            "record 51 has a velocity 0.",
        ),
        (epochs + 3, word(&spk, epochs + 2), "time 4 is "),
        (
            epochs + states,
            0.0,
            "entry 1 of the time directory is 0.0; expected the time",
        ),
    ] {
        let told = says(&spk, at, value);
        assert!(told.contains(expected), "{told}, not {expected}");
    }
    let (first, last) = segment_words(&ck)[1];
    for (at, value, expected) in [
        (
            first,
            3.0,
            "segment 2 (CK of -94000, type 3): quaternion 1 has a norm of 3.",
        ),
        (
            first + 7 * 50 + 1,
            word(&ck, first + 7 * 50 + 1) + 1e-5,
            "quaternion 51 has a norm of 1.0000",
        ),
        (last - 1, 1e6, "its number of intervals is 1000000.0"),
        (last, 0.5, "its number of pointings is 0.5"),
    ] {
        let told = says(&ck, at, value);
        assert!(told.contains(expected), "{told}, not {expected}");
    }
}

/// What loading these bytes as a kernel ends with.
#[allow(clippy::disallowed_methods, reason = "input of a test, not a product")]
fn told(folder: &Path, bytes: &[u8]) -> String {
    let path = folder.join("damaged.bsp");
    fs::write(&path, bytes).unwrap();
    KernelSet::from_files(&[path]).map_or_else(|error| error.to_string(), |_| String::new())
}

/// SPK types 1, 2, 3 and 18 as NAIF and ESA write them: sound as they are, and no damaged count reaches CSPICE.
#[test]
#[allow(clippy::disallowed_methods, reason = "input of a test, not a product")]
fn damaged_words_of_real_kernels_are_found_or_do_no_harm() {
    let Some(folder) = real_data("ale_mgs/m0402852", "damaged real kernels") else {
        return;
    };
    let work = tempdir().unwrap();
    let path = work.path().join("damaged.bsp");
    let times = folder.join("naif0012.tls");
    let mut refused = 0;
    for kernel in [
        "m0402852.ale_0.bsp",
        "../../ale_mex/H0010_0023_SR2/H0010_0023_SR2.IMG_0.bsp",
    ] {
        let good = fs::read(folder.join(kernel)).unwrap();
        assert_eq!(told(work.path(), &good), "", "{kernel} as it is");
        for (first, last) in segment_words(&good) {
            let counts = last.saturating_sub(5).max(first)..=last;
            let within = (0..20).map(|index| first + drawn(index, last - first));
            for at in counts.chain(within) {
                for (name, damage) in DAMAGE {
                    let mut bytes = good.clone();
                    set_word(&mut bytes, at, damage(word(&good, at)));
                    fs::write(&path, &bytes).unwrap();
                    match KernelSet::from_files(&[times.clone(), path.clone()]) {
                        Err(error) => {
                            assert_eq!(error.kind(), Kind::Input, "{name}: {error}");
                            refused += 1;
                        }
                        Ok(set) => ask(&set),
                    }
                }
            }
        }
    }
    assert!(refused > 500, "{refused} refused");
}

/// Asks for the spacecraft throughout what the kernel holds; numbers or an error, both are an answer.
fn ask(set: &KernelSet) {
    let session = Session::open(set).unwrap();
    let held = session.coverage().unwrap().spk.clone();
    for interval in held.as_slice() {
        let (start, stop) = (interval.start.seconds(), interval.stop.seconds());
        for part in 0..=4 {
            let et = f64::from(part).mul_add(0.25 * (stop - start), start);
            let _ = session.state(Et::from_seconds(et));
        }
    }
}
