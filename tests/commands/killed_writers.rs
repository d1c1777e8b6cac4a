//! What a killed command leaves half-written is removed by the next command that writes there; nothing else is.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use areograph::body::Datum;
use areograph_testing::track;

use crate::common::{
    case::Case,
    mission::{areograph, succeed},
    traced::{Call, Then, traced},
};

/// Files of other programs that resemble incomplete ones.
const FOREIGN: [&str; 3] = [
    ".partial-mine",
    ".partial-a1B2c3",
    ".partial-areograph-notes.txt",
];

/// Incomplete files and folders in a folder.
fn partial(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with(".partial-")).collect()
}

fn foreign() -> BTreeSet<String> {
    FOREIGN.map(str::to_owned).into()
}

/// Kills a command before it gives a file in `folder` its name.
fn kill_before_a_rename(command: &Command, folder: &Path) {
    let is_rename = |call: &Call| call.name == "rename" && call.path.parent() == Some(folder);
    let ended = traced(command, |call| {
        if is_rename(call) {
            Then::Kill
        } else {
            Then::GoOn
        }
    });
    assert_eq!(ended.code, None, "{}", ended.stderr);
}

#[test]
fn a_killed_search_leaves_nothing_to_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let root: PathBuf = folder.path().canonicalize().unwrap();
    track::write(&root.join("ap19020l.b"), Datum::Iau2000, 0, |_, _| ());
    for name in FOREIGN {
        fs::write(root.join(name), "mine").unwrap();
    }
    let search = |out: &str| {
        let mut command = areograph();
        command.current_dir(&root);
        command.args([
            "--quiet",
            "pedr",
            "search",
            "ap19020l.b",
            "--box=-180,180,-60,60",
        ]);
        command.arg("--out").arg(root.join(out));
        command
    };
    for out in ["a.parquet", "a.csv"] {
        kill_before_a_rename(&search(out), &root);
        assert!(!root.join(out).exists());
        assert!(
            partial(&root).len() > FOREIGN.len(),
            "nothing was left: the kill was too early"
        );
        succeed(&mut search("b.geojson"));
        assert_eq!(partial(&root), foreign(), "after {out}");
    }
}

#[test]
fn a_killed_run_leaves_nothing_to_the_next() {
    let case = Case::new();
    let out = case.path("").canonicalize().unwrap().join("out");
    fs::create_dir(&out).unwrap();
    for name in FOREIGN {
        fs::write(out.join(name), "mine").unwrap();
    }
    let run = || {
        let mut command = case.areograph();
        command
            .args(["--quiet", "run", "site.toml", "--out"])
            .arg(&out);
        command
    };
    for folder in [out.clone(), out.join("case"), out.join("case/.cache")] {
        kill_before_a_rename(&run(), &folder);
        let named: usize = if folder == out { FOREIGN.len() } else { 0 };
        assert!(
            partial(&folder).len() > named,
            "nothing was left in {}",
            folder.display()
        );
        succeed(&mut run());
        assert_eq!(partial(&out), foreign());
        assert_eq!(partial(&out.join("case")), BTreeSet::new());
        assert_eq!(partial(&out.join("case/.cache")), BTreeSet::new());
        // The next kill is one of a first run.
        fs::remove_dir_all(out.join("case")).unwrap();
    }
}

#[test]
fn a_killed_scene_gives_the_older_one_back() {
    let folder = tempfile::tempdir().unwrap();
    let root: PathBuf = folder.path().canonicalize().unwrap();
    let scene = |name: &str| {
        let mut command = areograph();
        command
            .args(["--quiet", "scene", "net"])
            .arg(root.join(name));
        command
    };
    succeed(&mut scene("plane"));
    let truth = fs::read(root.join("plane/README.txt")).unwrap();
    // The older scene has been moved aside, the new one has not its name yet.
    let mut renames = 0;
    let ended = traced(&scene("plane"), |call| {
        renames += usize::from(call.name == "rename");
        if renames > 1 { Then::Kill } else { Then::GoOn }
    });
    assert_eq!(ended.code, None, "{}", ended.stderr);
    assert!(!root.join("plane").exists());
    assert_eq!(partial(&root).len(), 1);
    succeed(&mut scene("other"));
    assert_eq!(partial(&root), BTreeSet::new());
    assert!(fs::read(root.join("plane/README.txt")).unwrap() == truth);
}
