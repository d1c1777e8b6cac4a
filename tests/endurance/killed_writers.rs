//! Every command that writes, killed at changes of files: no file under its final name is half-made, the next run of the same
//! command ends with the bytes of an undisturbed one, and nothing incomplete remains.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use areograph_testing::track;

use crate::common::{
    case::Case,
    long,
    mission::{areograph, mission, products, site_run, succeed},
    traced::{Call, Then, traced},
};

/// Largest number of kills of one command; those of few changes are killed at each of them.
fn kills() -> usize {
    if long() { 300 } else { 3 }
}

/// What the commands read.
struct Inputs {
    folder: tempfile::TempDir,
    case: Case,
}

impl Inputs {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, kind) in [("net", "net"), ("lines", "calibration")] {
            succeed(areograph().args(["--quiet", "scene", kind]).arg(at(name)));
        }
        let mut copy = Command::new("cp");
        succeed(copy.arg("-r").arg(site_run("isidis")).arg(at("isidis")));
        track::write(
            &at("ap19020l.b"),
            areograph::body::Datum::Iau2000,
            0,
            |_, _| (),
        );
        Self {
            folder,
            case: Case::new(),
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// A command that writes into its current folder.
type Writer = (&'static str, fn(&Inputs, &mut Command));

/// Scenes and configurations, searches, tables, nets, calibrations, sites and pages. An index, which has the dates of its files,
/// and `fetch` have tests of their own.
const WRITERS: [Writer; 12] = [
    ("scene", |_, command| {
        command.args(["scene", "net", "scene"]);
    }),
    ("init", |_, command| {
        command.args(["init", "gale", "--box", "137.0,138.0,-5.5,-4.0"]);
        command
            .arg("--kernels")
            .arg(mission().join("kernels/nav.tm"));
        command.arg("--pedr").arg(mission().join("pedr/*.b"));
    }),
    ("man", |_, command| {
        command.args(["man", "."]);
    }),
    ("search to Parquet", |inputs, command| {
        search(inputs, command, "shots.parquet");
    }),
    ("search to CSV", |inputs, command| {
        search(inputs, command, "shots.csv");
    }),
    ("search to GeoJSON", |inputs, command| {
        search(inputs, command, "shots.geojson");
    }),
    ("tables of pedr2tab", |inputs, command| {
        command.args(["pedr", "tab"]).arg(inputs.path("ap19020l.b"));
    }),
    ("triangulate", |inputs, command| {
        command.arg("triangulate").arg(inputs.path("net/net.toml"));
    }),
    ("calibrate", |inputs, command| {
        let calibration = inputs.path("lines/calibration.toml");
        command.arg("calibrate").arg(calibration);
    }),
    ("run", |inputs, command| {
        command.arg("run").arg(inputs.case.path("site.toml"));
    }),
    ("page of a report", |_, command| {
        command.arg("report").arg(site_run("isidis"));
        command.args(["--page", "isidis.html"]);
    }),
    ("page of a comparison", |inputs, command| {
        command.args(["report", "diff"]).arg(inputs.path("isidis"));
        command.arg(site_run("isidis"));
        command.args(["--page", "difference.html"]);
    }),
];

fn search(inputs: &Inputs, command: &mut Command, out: &str) {
    command
        .args(["pedr", "search"])
        .arg(inputs.path("ap19020l.b"));
    command.args(["--box=-180,180,-60,60", "--out", out]);
}

/// An empty folder in which a command runs.
fn begun(inputs: &Inputs, writer: &Writer) -> (tempfile::TempDir, PathBuf, Command) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().canonicalize().unwrap();
    let mut command = areograph();
    command.arg("--quiet").current_dir(&root);
    writer.1(inputs, &mut command);
    (folder, root, command)
}

/// The files under their final names, without the page over all sites, which shows the time of day.
fn written(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut written = products(root);
    written.remove(Path::new("out/index.html"));
    written
}

/// Whether a call changes a file below `root`.
fn changes_file(call: &Call, root: &Path) -> bool {
    call.changes() && call.path.starts_with(root)
}

/// Incomplete files and folders below a folder.
fn incomplete(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with(".partial-") {
            found.push(path);
        } else if path.is_dir() {
            found.extend(incomplete(&path));
        }
    }
    found
}

/// Kills of a command, each in a folder of its own; returns how many hit.
fn survives(inputs: &Inputs, writer: &Writer) -> usize {
    let (_folder, root, command) = begun(inputs, writer);
    let mut count = 0;
    let ended = traced(&command, |call| {
        count += usize::from(changes_file(call, &root));
        Then::GoOn
    });
    assert_eq!(ended.code, Some(0), "{}: {}", writer.0, ended.stderr);
    let undisturbed: BTreeMap<PathBuf, Vec<u8>> = written(&root);
    assert!(!undisturbed.is_empty(), "{}", writer.0);
    let kills = kills().min(count);
    for number in 0..kills {
        let place = number * (count - 1) / (kills - 1).max(1);
        let (_folder, root, mut command) = begun(inputs, writer);
        let (mut made, mut last) = (0, None);
        let ended = traced(&command, |call| {
            if !changes_file(call, &root) {
                return Then::GoOn;
            }
            made += 1;
            last = Some(call.clone());
            if made > place { Then::Kill } else { Then::GoOn }
        });
        // Threads may save a change or two.
        assert!(
            ended.code.is_none() || ended.code == Some(0),
            "{}",
            ended.stderr
        );
        for (path, bytes) in written(&root) {
            assert!(
                undisturbed.get(&path) == Some(&bytes),
                "{}: half-made {} after a kill before {last:?}",
                writer.0,
                path.display()
            );
        }
        // A command that never replaces its file has nothing to do once that is whole.
        if written(&root) == undisturbed {
            command.output().unwrap();
        } else {
            succeed(&mut command);
        }
        let found = written(&root);
        let paths = undisturbed.keys().chain(found.keys());
        let other: BTreeSet<&PathBuf> = paths
            .filter(|path| undisturbed.get(*path) != found.get(*path))
            .collect();
        assert!(
            other.is_empty(),
            "{}: {other:?} differ after a kill before {last:?}",
            writer.0
        );
        let left = incomplete(&root);
        assert!(left.is_empty(), "{}: {left:?} after {last:?}", writer.0);
    }
    kills
}

#[test]
fn no_command_leaves_a_half_made_file() {
    let inputs = Inputs::new();
    let hit: usize = WRITERS.iter().map(|writer| survives(&inputs, writer)).sum();
    println!("{hit} kills of {} commands", WRITERS.len());
    assert!(hit >= 2 * WRITERS.len(), "{hit}");
}
