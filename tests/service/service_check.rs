//! `service init` and `service check`: what the check states is what a service does.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use std::{
    fs,
    io::{BufRead as _, BufReader, Read as _},
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

use rusqlite::Connection;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::common::{
    mission::{areograph, succeed},
    slurm::write_programs,
};

/// A configuration of `service init`, whose service listens at a free port.
struct Service {
    folder: tempfile::TempDir,
}

impl Service {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let service = Self { folder };
        succeed(areograph().args(["service", "init"]).arg(service.path("")));
        service.change("listen = \"127.0.0.1:8470\"", "listen = \"127.0.0.1:0\"");
        service.change("min_free_mib = 1024", "min_free_mib = 1");
        service
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join("mars").join(name)
    }

    fn change(&self, from: &str, to: &str) {
        let file = self.path("areograph.toml");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(file, text.replace(from, to)).unwrap();
    }

    fn check(&self) -> Output {
        let mut check = areograph();
        check
            .args(["service", "check"])
            .arg(self.path("areograph.toml"));
        check.arg("--json").output().unwrap()
    }

    /// Serves until the service listens, and stops it then; otherwise returns the exit code of the refusal.
    fn serve(&self) -> Option<i32> {
        let mut serve: Command = areograph();
        serve.arg("serve").arg(self.path("areograph.toml"));
        let mut child = serve
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        output.read_line(&mut line).unwrap();
        if line.starts_with("listening") {
            let pid = Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap();
            kill_process(pid, Signal::TERM).unwrap();
            let _ = output.read_to_string(&mut line);
            child.wait().unwrap();
            return None;
        }
        child.wait().unwrap().code()
    }

    fn sql(&self, text: &str) {
        let database = Connection::open(self.path("state/areograph.db")).unwrap();
        database.execute_batch(text).unwrap();
    }
}

/// The subjects of faults.
fn faults(answer: &Value) -> Vec<&str> {
    let findings = answer["findings"].as_array().unwrap().iter();
    let faults = findings.filter(|finding| finding["state"] == "failure");
    faults
        .map(|fault| fault["subject"].as_str().unwrap())
        .collect()
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

#[test]
fn a_configuration_is_complete_valid_and_written_once() {
    let service = Service::new();
    for name in [
        "sites", "kernels", "pedr", "labels", "ties", "products", "state",
    ] {
        assert!(service.path(name).is_dir(), "{name}");
    }
    let written = text(&service.path("areograph.toml"));
    assert!(written.contains("# Time zone") || written.contains("# IANA time zone"));
    let refused = |path: &Path| {
        let refused = areograph()
            .args(["service", "init"])
            .arg(path)
            .output()
            .unwrap();
        assert_eq!(refused.status.code(), Some(2));
        String::from_utf8(refused.stderr).unwrap()
    };
    assert!(refused(&service.path("")).contains("already exists"));
    assert_eq!(text(&service.path("areograph.toml")), written);
    // A mistyped parent folder, and a file: nothing is created.
    assert!(refused(&service.folder.path().join("typo/mars")).contains("parent folder"));
    assert!(!service.folder.path().join("typo").exists());
    assert!(refused(&service.path("areograph.toml/mars")).contains("parent folder"));
    fs::write(service.path("file"), "").unwrap();
    assert!(refused(&service.path("file")).contains("not a folder"));
}

/// A service is brought into a state; the subjects of the faults, and whether they stop it.
type Case = (&'static str, fn(&Service), &'static [&'static str], bool);

#[test]
fn a_check_states_what_a_service_does() {
    let cases: [Case; 12] = [
        ("nothing", |_| {}, &[], true),
        (
            "a key that is unknown",
            |service| service.change("[schedule]", "[schedule]\ncorn = 1"),
            &["configuration"],
            false,
        ),
        (
            "a schedule without an instant",
            |service| service.change("cron = \"30 2 * * *\"", "cron = \"30 2 30 2 *\""),
            &["configuration"],
            false,
        ),
        (
            "an input folder that does not exist",
            |service| fs::remove_dir(service.path("ties")).unwrap(),
            &["data"],
            false,
        ),
        (
            "products that are a file",
            |service| {
                fs::remove_dir_all(service.path("products")).unwrap();
                fs::write(service.path("products"), "").unwrap();
            },
            &["products"],
            false,
        ),
        (
            "a database that is none",
            |service| fs::write(service.path("state/areograph.db"), "x".repeat(5000)).unwrap(),
            &["database"],
            false,
        ),
        (
            "a database of a later version",
            |service| {
                service.serve();
                service.sql("PRAGMA user_version = 99");
            },
            &["database"],
            false,
        ),
        (
            "a database of another service",
            |service| {
                service.serve();
                let mark = service.path("products/.areograph-service");
                fs::write(mark, "0".repeat(32)).unwrap();
            },
            &["database"],
            false,
        ),
        (
            "an input folder that was there before",
            |service| {
                // The folder becomes known in the first poll.
                service.serve();
                let ties = service.path("ties").display().to_string();
                service.sql(&format!(
                    "INSERT OR IGNORE INTO root (path, kind, files, state, since_ms, detail) VALUES ('{ties}', 'data', 0, 'available', 0, '')"
                ));
                fs::remove_dir(service.path("ties")).unwrap();
            },
            &[],
            true,
        ),
        (
            "a hook that does not exist",
            |service| service.change("# [[hooks]]", "[[hooks]]\ncommand = [\"./no-such-hook\"]"),
            &["hook"],
            true,
        ),
        (
            "a full disk",
            |service| service.change("min_free_mib = 1", "min_free_mib = 16777216"),
            &["disk", "disk"],
            true,
        ),
        (
            "a site file that is invalid",
            |service| fs::write(service.path("sites/a.toml"), "site = \"a\"\n").unwrap(),
            &["site"],
            true,
        ),
    ];
    for (what, prepare, expected, starts) in cases {
        let service = Service::new();
        prepare(&service);
        let checked = service.check();
        let answer: Value = serde_json::from_slice(&checked.stdout).unwrap();
        assert_eq!(faults(&answer), expected, "{what}: {answer:#}");
        assert_eq!(answer["starts"], starts, "{what}");
        assert_eq!(checked.status.success(), expected.is_empty(), "{what}");
        let refused = service.serve();
        assert_eq!(refused.is_none(), starts, "{what}");
        if !starts {
            assert_eq!(checked.status.code(), refused, "{what}");
        }
    }
}

#[test]
fn a_machine_without_slurm_is_told() {
    let service = Service::new();
    service.change("kind = \"local\"", "kind = \"slurm\"");
    let programs = service.folder.path().join("programs");
    let subjects = || {
        let mut check = areograph();
        check
            .args(["service", "check"])
            .arg(service.path("areograph.toml"));
        let checked = check.env("PATH", &programs).arg("--json").output().unwrap();
        let answer: Value = serde_json::from_slice(&checked.stdout).unwrap();
        assert_eq!(answer["starts"], true);
        faults(&answer).len()
    };
    write_programs(&programs, &[]);
    assert_eq!(subjects(), 2);
    write_programs(&programs, &[("srun", "exit"), ("scancel", "exit")]);
    assert_eq!(subjects(), 0);
}

#[test]
fn a_port_in_use_is_a_fault_and_a_running_service_is_none() {
    let service = Service::new();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    service.change("127.0.0.1:0", &address);
    let checked = service.check();
    let answer: Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert_eq!(faults(&answer), ["port"]);
    assert_eq!((checked.status.code(), service.serve()), (Some(6), Some(6)));
    // The address is that of the service itself.
    drop(taken);
    let mut serve: Command = areograph();
    serve.arg("serve").arg(service.path("areograph.toml"));
    let mut child = serve
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let checked = service.check();
    child.kill().unwrap();
    child.wait().unwrap();
    let answer: Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert_eq!(faults(&answer), [""; 0], "{line} {answer:#}");
    assert!(
        answer.to_string().contains("runs now: areograph serve"),
        "{answer:#}"
    );
}
