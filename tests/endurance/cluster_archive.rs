//! The range check of an archive on four virtual nodes of Slurm whose daemons are killed: the products are those of one machine.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{
    path::Path,
    process::{Child, Command},
    thread,
    time::{Duration, Instant},
};

use common::{
    long_test,
    mission::{areograph, products, succeed},
    slurm::virtual_cluster,
};

use crate::cluster::kill_daemon;

/// Size of the archive: 31 files.
const ARCHIVE: [&str; 2] = ["--gb", "1"];
/// Tasks, and daemons of the cluster, that are killed while the check runs.
const KILLED: [&str; 5] = [TASKS, "n1", "slurmctld", "n3", TASKS];
const TASKS: &str = "archive-task";
/// The check takes less than a minute; a task that Slurm holds delays it by minutes.
const LONGEST: Duration = Duration::from_mins(20);

/// The check of the archive in `folder`, with products in `folder/out`.
fn check(folder: &Path, out: &str) -> Command {
    let mut command = areograph();
    command
        .args(["--quiet", "pedr", "qa"])
        .arg(folder.join("archive/pedr"));
    command
        .arg("--kernels")
        .arg(folder.join("archive/kernels/archive.tm"));
    command.arg("--out").arg(folder.join(out));
    command
}

fn ended(child: &mut Child) -> Option<i32> {
    let begun = Instant::now();
    while begun.elapsed() < LONGEST {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        thread::sleep(Duration::from_millis(200));
    }
    child.kill().unwrap();
    None
}

/// Kills the tasks of the check in `folder` that run, at least one; false if the check has ended before.
fn kill_tasks(folder: &Path, check: &mut Child) -> bool {
    // The command of sbatch has a quotation mark before the folder.
    let tasks = format!("{TASKS} {}/", folder.display());
    let begun = Instant::now();
    while check.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < LONGEST, "no task runs");
        let killed = Command::new("pkill").args(["-9", "-f", &tasks]).status();
        if killed.unwrap().success() {
            return true;
        }
        thread::sleep(Duration::from_millis(50));
    }
    false
}

#[test]
fn killed_daemons_of_a_cluster_change_no_range_check() {
    if !long_test("killed_daemons_of_a_cluster_change_no_range_check") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut scene = areograph();
    scene.args(["--quiet", "scene", "archive"]).args(ARCHIVE);
    succeed(scene.arg(path("archive")));
    // 5: the archive has faulty orbits.
    let local = ended(&mut check(folder.path(), "local").spawn().unwrap());
    assert_eq!(local, Some(5));
    let cluster = path("cluster");
    virtual_cluster("start", &cluster);
    let mut far = check(folder.path(), "far");
    far.env("SLURM_CONF", cluster.join("slurm.conf"));
    far.args([
        "--executor",
        "slurm",
        "--mb-per-task",
        "40",
        "--memory-mb",
        "400",
    ]);
    let mut far = far.spawn().unwrap();
    let mut disturbed = 0;
    for killed in KILLED {
        thread::sleep(Duration::from_secs(2));
        if killed == TASKS {
            disturbed += u32::from(kill_tasks(folder.path(), &mut far));
        } else {
            disturbed += u32::from(far.try_wait().unwrap().is_none());
            kill_daemon(&cluster, killed);
        }
        virtual_cluster("start", &cluster);
    }
    // Otherwise the archive is too small for this machine.
    assert!(disturbed >= 3, "{disturbed}");
    let code = ended(&mut far);
    virtual_cluster("stop", &cluster);
    assert_eq!(code, Some(5));
    assert_eq!(products(&path("far")), products(&path("local")));
}
