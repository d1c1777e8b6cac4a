//! A run that is killed leaves nothing half-made, and the next one ends with the same bytes, in an
//! empty folder as over a published site.
//!
//! Kills hit at chosen system calls, so that none depends on how fast the machine is.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;
use crate::common::traced;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::Command,
};

use common::{
    case::Case,
    long,
    mission::{areograph, mission, products, succeed},
};
use traced::{Call, Then, traced};

/// Kills of first runs: half of them at any change of a file, half where files get their names; 20 in the long run. Each
/// is followed by a whole run.
fn kills() -> usize {
    if long() { 20 } else { 4 }
}

/// Kills of each part of a run over a published site; 12 in the long run. Four are one of each kind: images come or go, and the
/// next run is of this configuration or of the one before.
fn kills_republishing() -> usize {
    if long() { 12 } else { 4 }
}

fn run(site: &Path, out: &Path, threads: &str) -> Command {
    let mut command = areograph();
    command
        .args(["--quiet", "run"])
        .arg(site)
        .arg("--out")
        .arg(out)
        .args(["--threads", threads]);
    command
}

/// Whether a call changes a file below `out`. Hashes of input files do not count: whether a run keeps them depends on how long
/// ago the files changed. Nor do folders: of two threads that need the same new ones, either makes them, so that their number varies.
fn changes_file(call: &Call, out: &Path) -> bool {
    let name = call.path.file_name().unwrap_or_default().to_string_lossy();
    let of_hashes = name.starts_with(".hashes") || name.starts_with(".partial-");
    // Each writing of them makes and flushes their folder as well.
    let of_own = call.path.ends_with(".cache/.hashes");
    let is_hashes = call.path == out || of_own || (call.path.parent() == Some(out) && of_hashes);
    call.changes() && call.name != "mkdir" && call.path.starts_with(out) && !is_hashes
}

/// Every change of a file below `out` that an undisturbed run makes, in order.
fn changes(command: &Command, out: &Path) -> Vec<Call> {
    let mut changes = Vec::new();
    let ended = traced(command, |call| {
        if changes_file(call, out) {
            changes.push(call.clone());
        }
        Then::GoOn
    });
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    changes
}

/// Runs until just before the change at `place` in their order, and kills there.
fn kill_before(command: &Command, out: &Path, place: usize) {
    let mut made = 0;
    let ended = traced(command, |call| {
        if !changes_file(call, out) {
            return Then::GoOn;
        }
        made += 1;
        if made > place { Then::Kill } else { Then::GoOn }
    });
    assert_eq!(ended.code, None, "ended before change {place}");
}

/// Places of the calls that `of` wants.
fn places(changes: &[Call], of: impl Fn(&Call) -> bool) -> Vec<usize> {
    let required = changes.iter().enumerate().filter(|(_, call)| of(call));
    required.map(|(place, _)| place).collect()
}

/// So many of `places`, equally spaced, both ends among them.
fn spread(places: &[usize], count: usize) -> Vec<usize> {
    let last = places.len() - 1;
    (0..count)
        .map(|index| places[index * last / (count - 1)])
        .collect()
}

fn names_files(call: &Call) -> bool {
    matches!(call.name, "rename" | "remove")
}

#[test]
fn killed_at_changes_of_a_first_run() {
    let site = mission().join("sites/isidis.toml");
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().canonicalize().unwrap();
    let undisturbed_out = root.join("undisturbed");
    let changes = changes(&run(&site, &undisturbed_out, "2"), &undisturbed_out);
    let undisturbed = products(&undisturbed_out);
    assert!(undisturbed.len() > 10);
    let all = places(&changes, |_| true);
    let mut chosen = spread(&all, kills() / 2);
    chosen.extend(spread(&places(&changes, names_files), kills() / 2));
    // The last change gives a file its name.
    chosen.sort_unstable();
    chosen.dedup();
    for place in chosen {
        let call = &changes[place];
        let out = root.join(format!("killed-{place}"));
        kill_before(&run(&site, &out, "2"), &out, place);
        for (path, bytes) in products(&out) {
            assert!(
                undisturbed.get(&path) == Some(&bytes),
                "half-made {} after a kill before {call:?}",
                path.display()
            );
        }
        succeed(&mut run(&site, &out, "2"));
        assert!(
            products(&out) == undisturbed,
            "products differ after a kill before {call:?}"
        );
    }
}

/// Adds a second image, the same label under another name, or takes it away.
fn change(case: &Case, second_image: bool) {
    let second = "[[images]]\nid = \"second\"\nlabel = \"image.lbl\"\n";
    if second_image {
        let text = String::from_utf8(case.read("site.toml")).unwrap();
        case.write("site.toml", text + second);
    } else {
        case.replace("site.toml", second, "");
    }
}

/// Paths that the manifest lists, and its own.
fn listed(case: &Case) -> BTreeSet<PathBuf> {
    let manifest: serde_json::Value =
        serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap();
    manifest["products"]
        .as_array()
        .unwrap()
        .iter()
        .map(|product| product["path"].as_str().unwrap())
        .chain(["manifest.json"])
        .map(PathBuf::from)
        .collect()
}

/// Kills runs over a published site at the changes that `of` chooses, each followed by a run to the end. By turns
/// they add the second image and take it away, and by turns the run to the end is of the new configuration and of
/// the one before.
fn kill_republishing(of: fn(&[Call]) -> Vec<usize>) {
    let case = Case::new();
    let out = case.path("").canonicalize().unwrap().join("out");
    succeed(&mut case.run());
    // What a run changes that adds the second image, and one that takes it away; and what they leave.
    let measured = [true, false].map(|second_image| {
        change(&case, second_image);
        let changes = changes(&case.run(), &out);
        (changes, products(&case.path("out/case")))
    });
    let [(adding, with), (removing, without)] = &measured;
    assert!(with.len() > without.len());
    let [adding, removing] =
        [adding, removing].map(|changes| (changes, spread(&of(changes), kills_republishing() / 2)));
    let mut second_image = false;
    for attempt in 0..kills_republishing() {
        second_image = !second_image;
        change(&case, second_image);
        let (changes, kills) = if second_image { &adding } else { &removing };
        let place = kills[attempt / 2];
        let call = &changes[place];
        kill_before(&case.run(), &out, place);
        // By turns of two: each direction meets both.
        if attempt / 2 % 2 == 1 {
            second_image = !second_image;
            change(&case, second_image);
        }
        succeed(&mut case.run());
        let found = products(&case.path("out/case"));
        let files: BTreeSet<PathBuf> = found.keys().cloned().collect();
        assert_eq!(files, listed(&case), "after a kill before {call:?}");
        let undisturbed = if second_image { with } else { without };
        assert!(
            found == *undisturbed,
            "products differ after a kill before {call:?}"
        );
    }
}

/// Where the journal of the publication gets its name.
fn publication(changes: &[Call]) -> usize {
    let journal = |call: &Call| call.name == "rename" && call.path.ends_with(".publishing");
    changes.iter().position(journal).unwrap()
}

#[test]
fn killed_while_staging_over_a_published_site() {
    kill_republishing(|changes| {
        let staged = places(changes, |call| {
            call.path.iter().any(|part| part == ".staging")
        });
        let begun = publication(changes);
        staged.into_iter().filter(|place| *place < begun).collect()
    });
}

#[test]
fn killed_while_publishing_over_a_published_site() {
    kill_republishing(|changes| (publication(changes)..changes.len()).collect());
}

#[test]
fn killed_when_an_image_comes_or_goes() {
    kill_republishing(|changes| {
        let begun = publication(changes);
        let of_the_image = places(changes, |call| {
            call.path.iter().any(|part| part == "second")
        });
        of_the_image
            .into_iter()
            .filter(|place| *place > begun)
            .collect()
    });
}

/// A signal while forty large PEDR files are hashed and searched: the run ends soon, says where, and the
/// next run begins where it was.
fn stopped_by(signal: libc::c_int) {
    let case = Case::new();
    let large = mission().join("pedr/ap18933l.b");
    for number in 0..40 {
        let link = case.path(&format!("pedr/link{number:02}.b"));
        std::os::unix::fs::symlink(&large, link).unwrap();
    }
    let tagged = case.path("out/case/.cache/tag_times+image");
    let mut told = false;
    let ended = traced(&case.run(), |call| {
        let searching = call.path.ends_with("pedr/link00.b") && tagged.exists();
        if told || !searching {
            return Then::GoOn;
        }
        told = true;
        Then::Signal(signal)
    });
    assert!(told, "never begun");
    assert_eq!(ended.code, Some(130), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("case/search_footprints: interrupted"),
        "{}",
        ended.stderr
    );
    assert!(tagged.exists());
    assert!(!case.path("out/case/.cache/search_footprints").exists());
}

#[test]
fn an_interrupt_leaves_the_search_and_keeps_finished_stages() {
    stopped_by(libc::SIGINT);
}

#[test]
fn what_systemd_and_slurm_send_means_the_same() {
    stopped_by(libc::SIGTERM);
}

/// The clock kernel is replaced when the images have their times and the PEDR file is about to be read: the run ends
/// with the name of the kernel, and what it made is forgotten.
#[test]
#[cfg(unix)]
fn a_kernel_that_is_replaced_during_a_run_ends_it() {
    let case = Case::new();
    let (tagged, clock) = (
        case.path("out/case/.cache/tag_times+image"),
        "kernels/mgs_clock.tsc",
    );
    let before = case.read(clock);
    let mut replaced = false;
    let ended = traced(&case.run(), |call| {
        if !replaced && call.path.ends_with("pedr/ap19117l.b") && tagged.exists() {
            replaced = true;
            case.write(
                clock,
                [&before[..], b"\nA remark after the last table.\n"].concat(),
            );
        }
        Then::GoOn
    });
    assert!(replaced, "the search was not seen");
    assert_eq!(ended.code, Some(3), "{}", ended.stderr);
    let said = "mgs_clock.tsc: the file changed while it was in use";
    assert!(ended.stderr.contains(said), "{}", ended.stderr);
    assert!(!tagged.exists(), "times of the earlier clock are kept");
    assert!(!case.path("out/case/manifest.json").exists());
    case.write(clock, before);
    succeed(&mut case.run());
}

#[test]
fn one_and_eight_threads_give_the_same_bytes() {
    let site = mission().join("sites/gusev_crater.toml");
    let folder = tempfile::tempdir().unwrap();
    let outs = ["1", "8"].map(|threads| {
        let out = folder.path().join(threads);
        succeed(&mut run(&site, &out, threads));
        products(&out)
    });
    assert!(!outs[0].is_empty() && outs[0] == outs[1]);
}
