//! A service whose sites run on the nodes of a cluster.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    thread::sleep,
    time::{Duration, Instant},
};

use common::{
    long_test,
    mission::succeed,
    slurm::{virtual_cluster, with_programs, write_programs},
};
use rustix::process::{Pid, Signal, kill_process};

use crate::service_run::{Mission, OWN, Service, other_version, shorten_waiting};

/// A stand-in of srun: notes its options, and runs the worker here.
const SRUN: &str = r#"echo "$*" >>"$state/started"
while [ "${1#--}" != "$1" ]; do shift; done
exec "$@""#;
/// One of scancel: notes its options.
const SCANCEL: &str = r#"echo "$*" >>"$state/cancelled""#;

/// A mission whose sites run on a cluster.
fn mission() -> Mission {
    let mission = Mission::new();
    let file = mission.file("areograph.toml");
    let text = fs::read_to_string(&file).unwrap();
    let (local, slurm) = (
        "kind = \"local\"",
        "kind = \"slurm\"\noptions = [\"--comment=a b\"]",
    );
    assert_eq!(text.matches(local).count(), 1);
    fs::write(file, text.replace(local, slurm)).unwrap();
    mission
}

fn programs(mission: &Mission, srun: &str) -> PathBuf {
    let folder = mission.path("slurm");
    write_programs(&folder, &[("srun", srun), ("scancel", SCANCEL)]);
    folder
}

fn start(mission: &Mission, programs: &Path) -> Service {
    let serve = with_programs(mission.serve(), programs);
    mission.start_as(serve).0
}

fn noted(programs: &Path, name: &str) -> String {
    fs::read_to_string(programs.join(name)).unwrap_or_default()
}

#[test]
fn sites_run_as_jobs_of_the_cluster_and_short_work_remains_here() {
    let mission = mission();
    let programs = programs(&mission, SRUN);
    let service = start(&mission, &programs);
    mission.wait_for_jobs(2);
    mission.assert_clean("isidis");
    let started = noted(&programs, "started");
    assert_eq!(started.lines().count(), 2, "{started}");
    for (line, run) in started
        .lines()
        .zip(mission.ask("SELECT id FROM run ORDER BY job"))
    {
        // 8192 MiB and a margin; six hours and a margin.
        for option in [
            "--ntasks=1",
            "--cpus-per-task=1",
            "--mem=8448M",
            "--time=365",
            "--comment=a b",
            "worker --lease-s=30",
        ] {
            assert!(line.contains(option), "{line}");
        }
        assert!(
            line.contains(&format!("--job-name=areograph-{run} ")),
            "{line} {run}"
        );
    }
    assert_eq!(noted(&programs, "cancelled"), "");
    assert!(mission.file("products/.hashes").is_file());
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

#[test]
fn a_refusal_of_the_cluster_is_the_reason_of_the_attempt() {
    let mission = mission();
    let refusal = "echo 'srun: error: invalid partition specified: none' >&2; exit 1";
    let programs = programs(&mission, refusal);
    let service = start(&mission, &programs);
    let outcome = "SELECT how FROM attempt WHERE how LIKE '%invalid partition specified: none'";
    mission.wait_for("a refusal", || mission.ask(outcome).len() == 2);
    let expected =
        "the worker could not be started: srun: error: invalid partition specified: none";
    assert_eq!(mission.ask(outcome)[0], expected);
    // The cluster is repaired.
    write_programs(&programs, &[("srun", SRUN)]);
    shorten_waiting(&mission);
    mission.wait_for_jobs(2);
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

/// A worker is lost and lives on, as on a node: it must not publish, and ends. `lose` ends its srun, whose number it receives, and
/// returns the service that continues.
fn lose_worker(lose: impl FnOnce(&Mission, &Path, Service, i32) -> Service) {
    let mission = mission();
    let text = fs::read_to_string(mission.file("areograph.toml")).unwrap();
    let count = text.replace("count = 2", "count = 1");
    assert_ne!(text, count);
    fs::write(mission.file("areograph.toml"), count).unwrap();
    // The first worker is on a node: it receives its task when `go` appears, and does not end with srun.
    let lost = r#"while [ "${1#--}" != "$1" ]; do shift; done
if mkdir "$state/first" 2>/dev/null; then
  read -r task; printf '%s\n' "$task" >"$state/task"
  setsid sh -c 'state=$1; shift
    (while [ ! -e "$state/go" ]; do sleep 0.05; done; cat "$state/task"; sleep 20) | "$@" >"$state/output" 2>&1' - "$state" "$@" &
  echo >"$state/ready"
  while :; do sleep 1; done
fi
exec "$@""#;
    let programs = programs(&mission, lost);
    let service = start(&mission, &programs);
    mission.wait_for("an attempt", || programs.join("ready").exists());
    let pid = "SELECT CAST(pid AS TEXT) FROM attempt WHERE job = 1 AND pid IS NOT NULL";
    mission.wait_for("a process", || !mission.ask(pid).is_empty());
    let pid = mission.ask(pid).remove(0).parse().unwrap();
    let service = lose(&mission, &programs, service, pid);
    let lost =
        "SELECT CAST(job AS TEXT) FROM attempt WHERE job = 1 AND n = 1 AND ended_ms IS NOT NULL";
    mission.wait_for("the loss", || !mission.ask(lost).is_empty());
    mission.wait_for("scancel", || programs.join("cancelled").exists());
    let job = noted(&programs, "cancelled");
    assert!(job.starts_with("--quiet --me --name=areograph-"), "{job}");
    // Its name is taken.
    let run = job.trim().rsplit("areograph-").next().unwrap().to_owned();
    let site = mission.ask("SELECT site FROM job WHERE id = 1").remove(0);
    let place = mission.file(&format!("products/{site}/runs/{run}"));
    assert!(place.is_file(), "{}", place.display());
    fs::write(programs.join("go"), "").unwrap();
    mission.wait_for("the end of the lost worker", || {
        noted(&programs, "output").contains("rename into place")
    });
    assert!(
        mission
            .ask("SELECT id FROM run WHERE job = 1 AND attempt = 1")
            .is_empty()
    );
    shorten_waiting(&mission);
    mission.wait_for_jobs(2);
    mission.assert_clean(&site);
    assert!(place.is_file());
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

#[test]
fn a_worker_that_was_lost_does_not_publish() {
    lose_worker(|mission, _, service, srun| {
        kill_process(Pid::from_raw(srun).unwrap(), Signal::KILL).unwrap();
        let killed = "SELECT how FROM attempt WHERE job = 1 AND n = 1 AND how LIKE '%signal 9%'";
        mission.wait_for("the signal", || !mission.ask(killed).is_empty());
        service
    });
}

/// The attempt is on the cluster, whatever the configuration states when it ends.
#[test]
fn an_attempt_on_the_cluster_cannot_publish_after_the_executor_was_changed() {
    lose_worker(|mission, programs, mut service, _| {
        service.signal(Signal::KILL);
        service.0.wait().unwrap();
        let file = mission.file("areograph.toml");
        let text = fs::read_to_string(&file).unwrap();
        let local = text.replace("kind = \"slurm\"", "kind = \"local\"");
        assert_ne!(text, local);
        fs::write(file, local).unwrap();
        start(mission, programs)
    });
}

/// Kills of the service and of all node daemons by turns, at other moments of a run each time. The queue is full first: a run may
/// wait longer than a worker on this machine has for its hello.
#[test]
fn whatever_is_killed_on_a_cluster_each_job_ends_once() {
    if !long_test("whatever_is_killed_on_a_cluster_each_job_ends_once") {
        return;
    }
    let mission = mission();
    let file = mission.file("areograph.toml");
    let mut text = fs::read_to_string(&file).unwrap();
    for (from, to) in [
        ("memory_mib = 8192", "memory_mib = 1024"),
        ("silence_s = 30.0", "silence_s = 6.0"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    fs::write(&file, text).unwrap();
    let cluster = mission.path("cluster");
    virtual_cluster("start", &cluster);
    let slurm_conf = cluster.join("slurm.conf");
    let start = || {
        let mut serve = mission.serve();
        serve.env("SLURM_CONF", &slurm_conf);
        mission.start_as(serve).0
    };
    for _ in 0..4 {
        let mut sbatch = Command::new("sbatch");
        sbatch.env("SLURM_CONF", &slurm_conf);
        succeed(sbatch.args(["--output=/dev/null", "--mem=100M", "--wrap=sleep 30"]));
    }
    let mut service = start();
    let begun = Instant::now();
    mission.wait_for_jobs(2);
    assert!(begun.elapsed() > Duration::from_secs(22));
    let attempts = "SELECT CAST(count(*) AS TEXT) FROM attempt";
    assert_eq!(mission.ask(attempts), ["2"]);
    let kernel = fs::read(mission.file(OWN)).unwrap();
    for (kill, wait_ms) in [0, 300, 600, 900, 1_200, 1_500].into_iter().enumerate() {
        let name = [b'C', b'0' + u8::try_from(kill).unwrap(), b' ', b' '];
        let fresh = mission.path("fresh");
        fs::write(&fresh, other_version(&kernel, name)).unwrap();
        fs::rename(&fresh, mission.file(OWN)).unwrap();
        let begun = format!(
            "SELECT CAST(pid AS TEXT) FROM attempt WHERE job = {} AND pid IS NOT NULL",
            3 + kill
        );
        mission.wait_for("an attempt", || !mission.ask(&begun).is_empty());
        sleep(Duration::from_millis(wait_ms));
        if kill % 2 == 0 {
            service.signal(Signal::KILL);
            service.0.wait().unwrap();
            service = start();
        } else {
            // Workers live on; their nodes return.
            let daemons = format!("slurmd -f {}", slurm_conf.display());
            let killed = Command::new("pkill").args(["-9", "-f", &daemons]).status();
            assert!(killed.unwrap().success(), "no daemon was killed");
            sleep(Duration::from_secs(12));
            virtual_cluster("start", &cluster);
        }
        shorten_waiting(&mission);
        mission.wait_for_jobs(3 + kill);
        mission.assert_clean("isidis");
    }
    let doubled = mission.ask("SELECT site FROM run GROUP BY job HAVING count(*) > 1");
    assert_eq!(doubled, [""; 0]);
    // No folder of a run is unknown to the database.
    let mut folders = Vec::new();
    for site in mission.ask("SELECT DISTINCT site FROM run") {
        let runs = mission.file(&format!("products/{site}/runs"));
        let entries = fs::read_dir(runs).unwrap().flatten();
        let found = entries.filter(|entry| entry.path().join("manifest.json").is_file());
        folders.extend(found.map(|entry| entry.file_name().into_string().unwrap()));
    }
    folders.sort();
    assert_eq!(
        folders,
        mission.ask("SELECT id FROM run WHERE removed_ms IS NULL ORDER BY id")
    );
    let code = service.end().code();
    virtual_cluster("stop", &cluster);
    assert_eq!(code, Some(0), "{}", mission.log());
}
