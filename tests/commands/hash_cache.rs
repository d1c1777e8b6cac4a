//! Input files that did not change are not read again, and nothing that changed is missed.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use crate::common;
use crate::common::traced;

#[allow(dead_code, reason = "what kills programs is for other tests")]
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::{self, File},
    os::unix::fs::{FileExt, MetadataExt},
    path::Path,
    process::Command,
    thread,
    time::Duration,
};

use areograph::{
    files::{Identity, KnownFile, hash_file},
    store::{
        atomic,
        hashes::{HASHES, HashCache},
    },
};
use common::{
    case::Case,
    daf::{segment_words, set_word},
    mission::{areograph, mission, products, succeed},
};
use traced::{Then, traced};

const PEDR: &str = "pedr/ap19117l.b";

/// A hash is believed when the file had stood still for 2 s before it was read; with what a clock's tick adds.
fn stand_still() {
    thread::sleep(Duration::from_millis(2_100));
}

/// A site that ran over files which had stood still.
fn ran() -> Case {
    let case = Case::new();
    stand_still();
    succeed(&mut case.run());
    case
}

fn plan(case: &Case, further: &[&str]) -> Command {
    let mut command = case.areograph();
    command.args(["-v", "plan", "site.toml", "--out", "out"]);
    command.args(further);
    command
}

/// What a plan prints of the search of the PEDR files.
fn search(case: &Case, further: &[&str]) -> String {
    let printed = succeed(&mut plan(case, further)).stdout;
    let printed = String::from_utf8(printed).unwrap();
    let line = printed.lines().find(|of| of.contains("search_footprints"));
    line.unwrap().trim().to_owned()
}

/// Names of the files in `pedr` that a command opens.
fn shots_opened(command: &Command) -> BTreeSet<String> {
    let mut opened = BTreeSet::new();
    let ended = traced(command, |call| {
        if call.path.parent().is_some_and(|of| of.ends_with("pedr")) {
            let name = call.path.file_name().unwrap();
            opened.insert(name.to_string_lossy().into_owned());
        }
        Then::GoOn
    });
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    opened
}

#[test]
fn shots_that_did_not_change_are_not_opened() {
    let case = ran();
    assert_eq!(shots_opened(&plan(&case, &[])), BTreeSet::new());
    assert_eq!(shots_opened(&case.run()), BTreeSet::new());
    let rehashed = shots_opened(&plan(&case, &["--rehash"]));
    assert_eq!(rehashed, ["ap19117l.b".to_owned()].into());
    let again = shots_opened(case.run().arg("--rehash"));
    assert_eq!(again, ["ap19117l.b".to_owned()].into());
}

#[test]
fn what_changed_just_before_is_read_again() {
    let case = Case::new();
    succeed(&mut case.run());
    let opened = shots_opened(&plan(&case, &[]));
    assert_eq!(opened, ["ap19117l.b".to_owned()].into());
}

/// Changes a byte of the PEDR file in place; size, inode and the time of modification stay.
fn change_in_secret(case: &Case) {
    let path = case.path(PEDR);
    let file = File::options().write(true).open(&path).unwrap();
    let modified = file.metadata().unwrap().modified().unwrap();
    // An engineering byte, far from every footprint.
    let (place, was) = (7_760 + 480, case.read(PEDR)[7_760 + 480]);
    file.write_all_at(&[was ^ 1], place).unwrap();
    file.set_modified(modified).unwrap();
    assert_eq!(path.metadata().unwrap().modified().unwrap(), modified);
}

#[test]
fn a_change_that_keeps_size_and_time_is_noticed() {
    let case = ran();
    change_in_secret(&case);
    let line = search(&case, &[]);
    assert!(line.ends_with("pedr ap19117l.b changed"), "{line}");
}

/// Products that a command opens.
fn products_opened(command: &Command) -> BTreeSet<String> {
    let mut opened = BTreeSet::new();
    let ended = traced(command, |call| {
        let below = call.path.to_string_lossy().into_owned();
        if let Some((_, product)) = below.split_once("out/case/")
            && !product.starts_with('.')
        {
            opened.insert(product.to_owned());
        }
        Then::GoOn
    });
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    opened
}

#[test]
fn products_that_did_not_change_are_not_opened_and_changed_ones_are_replaced() {
    let case = ran();
    stand_still();
    // The first run without changes reads them.
    assert!(products_opened(&case.run()).contains("ranges.json"));
    // The page over all sites reads the manifest, and would read an adjustment.
    let opened = products_opened(&case.run());
    let of_page = ["manifest.json", "adjustment.json"];
    assert!(
        opened.iter().all(|path| of_page.contains(&&**path)),
        "{opened:?}"
    );
    assert!(products_opened(case.run().arg("--rehash")).contains("ranges.json"));
    // A digit; size and time of modification stay.
    let good = case.read("out/case/ranges.json");
    let digit = good.iter().position(u8::is_ascii_digit).unwrap();
    let path = case.path("out/case/ranges.json");
    let file = File::options().write(true).open(&path).unwrap();
    let modified = file.metadata().unwrap().modified().unwrap();
    file.write_all_at(&[good[digit] ^ 1], digit as u64).unwrap();
    file.set_modified(modified).unwrap();
    assert_eq!(case.stages_run(), ["publish"]);
    assert!(case.read("out/case/ranges.json") == good);
}

/// Stores in a folder of hashes that the file, as it is now, has this hash.
fn hide(folder: &Path, file: &Path, blake3: &str) {
    let mut known = HashCache::in_folder(folder, false).known();
    known.add(KnownFile {
        identity: Identity::of(&file.metadata().unwrap()),
        blake3: *blake3::Hash::from_hex(blake3).unwrap().as_bytes(),
        checked: 0,
        read_s: 0,
    });
    let entries: Vec<KnownFile> = known.iter().copied().collect();
    let entries = postcard::to_stdvec(&entries).unwrap();
    let hash = blake3::hash(&entries);
    let bytes = [b"areograph hashes 1\n", &hash.as_bytes()[..], &entries[..]];
    atomic::write(&folder.join(HASHES), &bytes.concat()).unwrap();
}

/// Inputs by name, BLAKE3 and size of an output (`store::cache`).
type Head = (BTreeMap<String, String>, String, u64);

/// A large stored output is read only when a stage uses it.
#[test]
fn damage_that_the_file_system_hides_is_noticed_when_a_stored_output_is_used() {
    let case = Case::new();
    let small = "longitude_deg = [87.5, 88.5]\nlatitude_deg = [4.0, 5.0]";
    let large = "longitude_deg = [0.0, 360.0]\nlatitude_deg = [-20.0, 20.0]";
    case.replace("site.toml", small, large);
    succeed(&mut case.run());
    let stored = "out/case/.cache/convert_datum";
    let mut bytes = case.read(stored);
    assert!(bytes.len() > 1 << 16, "{}", bytes.len());
    let ((_, blake3, _), _) = postcard::take_from_bytes::<Head>(&bytes).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    case.write(stored, &bytes);
    hide(&case.path("out/case/.cache"), &case.path(stored), &blake3);
    assert_eq!(case.stages_run(), [""; 0]);
    let limit = "[range_check]\nmean_max_m = 9.0\n[[images]]";
    case.replace("site.toml", "[[images]]", limit);
    succeed(&mut plan(&case, &[]));
    assert!(case.read(stored) == bytes, "a plan changes nothing");
    let ran = case.stages_run();
    for stage in ["convert_datum", "check_ranges", "publish"] {
        assert!(ran.iter().any(|of| of == stage), "{ran:?}");
    }
    assert!(case.read(stored) != bytes);
    assert_eq!(case.stages_run(), [""; 0]);
}

/// What no file system does: the content is another one, and all that is said of the file stays.
#[test]
fn rehash_finds_what_the_file_system_hides() {
    let case = ran();
    let (was, _) = hash_file(&case.path(PEDR)).unwrap();
    change_in_secret(&case);
    hide(&case.path("out"), &case.path(PEDR), &was);
    assert!(search(&case, &[]).starts_with("keep"));
    // Hashes of files that had not stood still are not kept.
    stand_still();
    let line = search(&case, &["--rehash"]);
    assert!(line.ends_with("pedr ap19117l.b changed"), "{line}");
    // What was read is believed from then on.
    let line = search(&case, &[]);
    assert!(line.ends_with("pedr ap19117l.b changed"), "{line}");
}

#[test]
fn damaged_hashes_are_no_hashes() {
    let case = ran();
    let path = case.path("out").join(HASHES);
    let good = fs::read(&path).unwrap();
    for bit in (0..8 * good.len()).step_by(8 * good.len() / 12) {
        let mut bytes = good.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        atomic::write(&path, &bytes).unwrap();
        assert!(search(&case, &[]).starts_with("keep"), "bit {bit}");
        // All files were read, and what was found was kept.
        assert_eq!(fs::read(&path).unwrap().len(), good.len());
    }
    fs::remove_file(&path).unwrap();
    fs::create_dir(&path).unwrap();
    assert!(search(&case, &[]).starts_with("keep"));
    succeed(&mut case.run());
}

#[test]
fn runs_side_by_side_keep_what_each_has_read() {
    let case = Case::new();
    let other = case.path("pedr/ap19019k.b");
    fs::copy(mission().join("pedr/ap19019k.b"), other).unwrap();
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let second = site.replace("site = \"case\"", "site = \"second\"");
    case.write("site.toml", site.replace("pedr/*.b", PEDR));
    case.write("second.toml", second.replace("pedr/*.b", "pedr/ap19019k.b"));
    stand_still();
    let run = |file: &str, out: &str| {
        let mut command = case.areograph();
        command.args(["--quiet", "run", file, "--out", out]);
        command
    };
    let started = ["site.toml", "second.toml"].map(|file| run(file, "out").spawn().unwrap());
    for mut child in started {
        assert!(child.wait().unwrap().code().is_some());
    }
    for file in ["site.toml", "second.toml"] {
        assert_eq!(shots_opened(&run(file, "out")), BTreeSet::new(), "{file}");
        run(file, "alone").status().unwrap();
    }
    assert!(products(&case.path("out")) == products(&case.path("alone")));
}

/// The hash of a kernel is known, and that it is sound is not.
#[test]
fn a_damaged_kernel_is_refused_again_and_again() {
    let case = Case::new();
    let kernel = "kernels/mgs_nav_scene.bsp";
    let mut bytes = case.read(kernel);
    let (_, last) = segment_words(&bytes)[0];
    set_word(&mut bytes, last, 1e300);
    case.write(kernel, bytes);
    stand_still();
    for _ in 0..3 {
        let told = case.outcome(case.run());
        assert!(told.starts_with("exit 3"), "{told}");
        assert!(told.contains("its number of states is 1e300"), "{told}");
    }
    let inode = case.path(kernel).metadata().unwrap().ino();
    let known = HashCache::in_folder(&case.path("out"), false).known();
    let known = known.iter().find(|of| of.identity.inode == inode);
    assert_eq!(known.unwrap().checked, 0);
}

#[test]
fn a_plan_writes_no_folder() {
    let case = Case::new();
    stand_still();
    succeed(&mut plan(&case, &[]));
    assert!(!case.path("out").exists());
    let mut check = areograph();
    check
        .current_dir(case.path(""))
        .args(["--quiet", "check", "site.toml", "--rehash"]);
    succeed(&mut check);
    assert!(!case.path("out").exists());
}
