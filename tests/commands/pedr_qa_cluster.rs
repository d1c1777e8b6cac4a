//! The range check of an archive by tasks of a cluster.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    sync::{LazyLock, atomic::AtomicBool},
    thread::sleep,
    time::{Duration, Instant},
};

use areograph::{
    altimetry::{BiasScope, MolaClock, TagSign},
    files::Identity,
    flow::{ArchiveFile, ArchiveTask},
    scene::{ArchiveOptions, write_archive},
    watch::Watch,
};
use common::{
    long_test,
    mission::{areograph, products},
    slurm::{cluster, with_programs, write_programs},
};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

/// The metakernel.
const KERNELS: &str = "archive/kernels/archive.tm";

/// Three files, with the folder of their products on one machine.
static ARCHIVE: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let options = ArchiveOptions { seed: 4, days: 3 };
    let stop = AtomicBool::new(false);
    write_archive(&folder.path().join("archive"), &options, Watch::from(&stop)).unwrap();
    let (code, _) = ended(qa(&folder.path().join("archive"), folder.path(), "one"));
    assert_eq!(code, 5); // the archive has faulty orbits
    folder
});

/// The check of `archive/pedr`; products go to `folder/out`.
fn qa(archive: &Path, folder: &Path, out: &str) -> Command {
    let mut command = areograph();
    command.current_dir(folder);
    command
        .args(["--quiet", "pedr", "qa"])
        .arg(archive.join("pedr"));
    // Folders with other files are beside the archive.
    let mut above = archive.ancestors().map(|above| above.join(KERNELS));
    let kernels = above.find(|path| path.exists()).unwrap();
    command.arg("--kernels").arg(kernels).args(["--out", out]);
    command
}

/// The same by tasks of one file each.
fn far(archive: &Path, folder: &Path, cluster: &Path) -> Command {
    let mut command = with_programs(qa(archive, folder, "far"), cluster);
    command.args(["--executor", "slurm", "--mb-per-task", "1"]);
    command.args(["--memory-mb", "300"]);
    command
}

/// Exit code and standard error.
fn ended(mut command: Command) -> (i32, String) {
    let output = command.output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    (output.status.code().unwrap(), text)
}

fn clock() -> MolaClock {
    MolaClock {
        bias_s: 0.117,
        sign: TagSign::Late,
        scope: BiasScope::SpkLookup,
        source: String::new(),
    }
}

#[test]
fn tasks_of_a_cluster_give_the_products_of_one_machine() {
    let archive = ARCHIVE.path().join("archive");
    let folder = tempfile::tempdir().unwrap();
    let slurm = cluster(&folder.path().join("cluster"));
    let read = |name: &str| fs::read_to_string(slurm.join(name)).unwrap();
    let (code, told) = ended(far(&archive, folder.path(), &slurm));
    assert_eq!(code, 5, "{told}");
    let one = products(&ARCHIVE.path().join("one"));
    assert_eq!(products(&folder.path().join("far")), one);
    // Three tasks; the lost one was submitted again, with twice the memory.
    assert_eq!(read("memory"), "300M\n600M\n");
    assert_eq!(read("tasks-1").lines().count(), 2);
    assert_eq!(read("tasks-2").lines().count(), 1);
    assert!(!folder.path().join("far/.tasks").exists());

    // Stored results need no task.
    assert_eq!(ended(far(&archive, folder.path(), &slurm)).0, 5);
    assert_eq!(read("jobs"), "2\n");
    // Tasks check all files again.
    let mut forced = far(&archive, folder.path(), &slurm);
    forced.arg("--force");
    assert_eq!(ended(forced).0, 5);
    assert_eq!(read("tasks-3").lines().count(), 3);
    assert_eq!(products(&folder.path().join("far")), one);
}

#[test]
fn bad_files_are_told_as_on_one_machine() {
    let folder = tempfile::tempdir_in(ARCHIVE.path()).unwrap();
    let pedr = folder.path().join("pedr");
    fs::create_dir(&pedr).unwrap();
    let whole = ARCHIVE.path().join("archive/pedr");
    fs::copy(whole.join("ap10013l.b"), pedr.join("ap10013l.b")).unwrap();
    let bytes = fs::read(whole.join("ap10001l.b")).unwrap();
    fs::write(pedr.join("ap10001l.b"), &bytes[..2_000_000]).unwrap();
    fs::write(pedr.join("ap19999l.b"), "no PEDR file\n".repeat(2_000)).unwrap();
    std::os::unix::fs::symlink("nowhere", pedr.join("ap19997l.b")).unwrap();
    let (code, here) = ended(qa(folder.path(), folder.path(), "here"));
    assert_eq!(code, 5, "{here}");
    let slurm = cluster(&folder.path().join("cluster"));
    // No task is lost.
    fs::write(slurm.join("jobs"), "1\n").unwrap();
    let (code, there) = ended(far(folder.path(), folder.path(), &slurm));
    assert_eq!((code, there), (5, here));
    let [here, there] = ["here", "far"].map(|out| products(&folder.path().join(out)));
    assert_eq!(here, there);
}

#[test]
fn a_cluster_that_refuses_is_told() {
    let archive = ARCHIVE.path().join("archive");
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let mut command = far(&archive, folder.path(), &empty);
    command.env("PATH", &empty);
    let (code, told) = ended(command);
    assert!(code == 6 && told.contains("cannot start sbatch"), "{told}");
    let refusal = "echo 'sbatch: error: invalid partition specified: none' >&2; exit 1";
    write_programs(&empty, &[("sbatch", refusal)]);
    let (code, told) = ended(far(&archive, folder.path(), &empty));
    assert!(
        code == 6 && told.contains("invalid partition specified: none"),
        "{told}"
    );
    // Options of an executor that is not named.
    let mut command = qa(&archive, folder.path(), "far");
    command.args(["--tasks-max", "3"]);
    let (code, told) = ended(command);
    assert!(code == 2 && told.contains("--executor"), "{told}");
    assert!(!folder.path().join("far/manifest.json").exists());
}

#[test]
fn an_interrupted_check_cancels_its_tasks_and_goes_on_later() {
    let archive = ARCHIVE.path().join("archive");
    let folder = tempfile::tempdir().unwrap();
    let slurm = cluster(&folder.path().join("cluster"));
    let mut command = far(&archive, folder.path(), &slurm);
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let begun = Instant::now();
    while !folder.path().join("far/.tasks/job").exists() {
        assert!(begun.elapsed() < Duration::from_mins(1));
        sleep(Duration::from_millis(10));
    }
    let pid = Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap();
    kill_process(pid, Signal::INT).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let cancelled = fs::read_to_string(slurm.join("cancelled")).unwrap();
    assert_eq!(cancelled, "--me --name=areograph-archive 1\n");
    assert!(!folder.path().join("far/manifest.json").exists());
    assert_eq!(ended(far(&archive, folder.path(), &slurm)).0, 5);
    let one = products(&ARCHIVE.path().join("one"));
    assert_eq!(products(&folder.path().join("far")), one);
}

/// Another computer numbers the device of a shared file system differently: the same file. Another inode is another file.
#[test]
fn a_task_checks_the_file_of_the_command_only() {
    let archive = ARCHIVE.path().join("archive");
    let out = tempfile::tempdir().unwrap();
    let path = out.path().join("ap10001l.b");
    fs::copy(archive.join("pedr/ap10001l.b"), &path).unwrap();
    let identity = Identity::of(&fs::metadata(&path).unwrap());
    let task = |identity: Identity| ArchiveTask {
        folder: out.path().to_owned(),
        kernels: archive.join("kernels/archive.tm"),
        clock: clock(),
        out: out.path().to_owned(),
        files: vec![ArchiveFile {
            path: path.clone(),
            identity,
        }],
        threads: 1,
    };
    let stored = || match fs::read_dir(out.path().join(".cache")) {
        Ok(entries) => entries.count(),
        Err(_) => 0,
    };
    let stop = AtomicBool::new(false);
    let other = Identity {
        inode: identity.inode + 1,
        ..identity
    };
    assert_eq!(task(other).run(&stop).unwrap(), 0);
    assert_eq!(stored(), 0);
    let elsewhere = Identity {
        device: identity.device + 1,
        ..identity
    };
    assert_eq!(task(elsewhere).run(&stop).unwrap(), 1);
    assert_eq!(stored(), 1);
    // Every computer finds it again: the file itself is no longer read. It is not the result of another file.
    fs::remove_file(&path).unwrap();
    assert_eq!(task(identity).run(&stop).unwrap(), 1);
    assert_eq!(task(other).run(&stop).unwrap(), 0);
}

#[test]
fn without_results_of_tasks_the_command_checks_the_files() {
    if !long_test("without_results_of_tasks_the_command_checks_the_files") {
        return;
    }
    let told = check_without_results(r#"echo x >>"$state/jobs"; echo 7"#, 3);
    assert!(!told.contains("cannot be submitted again"), "{told}");
    // No node has twice the memory.
    let refusal = r#"echo x >>"$state/jobs"
[ "$(wc -l <"$state/jobs")" = 1 ] || { echo 'sbatch: error: no such node' >&2; exit 1; }
echo 7"#;
    let told = check_without_results(refusal, 2);
    assert!(
        told.contains("cannot be submitted again") && told.contains("no such node"),
        "{told}"
    );
}

/// Standard error of a check whose tasks never run, with this sbatch, which is called `calls` times.
fn check_without_results(sbatch: &str, calls: usize) -> String {
    let archive = ARCHIVE.path().join("archive");
    let folder = tempfile::tempdir().unwrap();
    let slurm = folder.path().join("cluster");
    write_programs(
        &slurm,
        &[
            ("sbatch", sbatch),
            ("squeue", "exit 0"),
            ("scancel", "exit 0"),
        ],
    );
    let mut command = far(&archive, folder.path(), &slurm);
    // Warnings appear.
    let arguments: Vec<_> = command.get_args().map(ToOwned::to_owned).collect();
    let mut told = with_programs(areograph(), &slurm);
    told.current_dir(folder.path()).args(&arguments[1..]);
    command = told;
    let (code, told) = ended(command);
    assert_eq!(code, 5, "{told}");
    assert!(
        told.contains("3 files without a result from the cluster"),
        "{told}"
    );
    let jobs = fs::read_to_string(slurm.join("jobs")).unwrap();
    assert_eq!(jobs.lines().count(), calls);
    let one = products(&ARCHIVE.path().join("one"));
    assert_eq!(products(&folder.path().join("far")), one);
    told
}
