//! The data of the service as a process: databases that are lost, locked or of others; limits of memory.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{
    fs,
    io::{BufRead as _, BufReader, Read as _, Write as _},
    net::TcpStream,
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::{Child, Output, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use common::mission::{areograph, succeed};
use rusqlite::Connection;
use rustix::process::{Pid, Signal, kill_process};

/// Longest time for anything, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_mins(4);

/// The demonstration with one site.
struct Demo {
    folder: tempfile::TempDir,
}

impl Demo {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        succeed(
            areograph()
                .args(["serve", "--init"])
                .arg(folder.path().join("demo")),
        );
        let demo = Self { folder };
        demo.replace("quiet_period_s = 5.0", "quiet_period_s = 0.5");
        demo.replace("scan_interval_s = 2.0", "scan_interval_s = 0.3");
        demo.replace("min_free_mib = 1024", "min_free_mib = 1");
        for entry in fs::read_dir(demo.file("sites")).unwrap() {
            let path = entry.unwrap().path();
            if path.file_name() != Some("isidis.toml".as_ref()) {
                fs::remove_file(path).unwrap();
            }
        }
        demo
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join("demo").join(name)
    }

    fn replace(&self, from: &str, to: &str) {
        let file = self.file("areograph.toml");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(file, text.replace(from, to)).unwrap();
    }

    fn nightly(&self) -> Output {
        let mut command = areograph();
        command
            .args(["--quiet", "nightly"])
            .arg(self.file("areograph.toml"));
        command.output().unwrap()
    }

    fn service(&self, arguments: &[&str], more: &[&str]) -> Output {
        let mut command = areograph();
        command.arg("service").args(arguments);
        command.arg(self.file("areograph.toml")).args(more);
        command.output().unwrap()
    }

    fn database(&self) -> PathBuf {
        self.file("state/areograph.db")
    }

    fn lose_database(&self) {
        for ending in ["", "-wal", "-shm"] {
            let _ = fs::remove_file(self.file(&format!("state/areograph.db{ending}")));
        }
    }

    fn serve(&self) -> Served {
        let log = self.folder.path().join("log");
        let mut child = areograph()
            .arg("serve")
            .arg(self.file("areograph.toml"))
            .args(["--listen", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .stderr(fs::File::create(&log).unwrap())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        output.read_line(&mut line).unwrap();
        let address = line.trim().rsplit("http://").next().unwrap().to_owned();
        Served {
            child,
            address,
            log,
        }
    }
}

/// A service that ends with its test.
struct Served {
    child: Child,
    address: String,
    log: PathBuf,
}

impl Served {
    /// Status, head and body of an answer.
    fn get(&self, path: &str) -> (u16, String, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let request = format!(
            "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
            self.address
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, head.to_owned(), body.to_owned())
    }

    fn json(&self, path: &str) -> serde_json::Value {
        let (status, head, body) = self.get(path);
        assert_eq!(status, 200, "{path}: {head}{body}");
        serde_json::from_str(&body).unwrap()
    }

    fn log(&self) -> String {
        fs::read_to_string(&self.log).unwrap()
    }

    fn wait_for(&self, what: &str, is_so: impl Fn() -> bool) {
        let begun = Instant::now();
        while !is_so() {
            assert!(begun.elapsed() < PATIENCE, "{what}\n{}", self.log());
            sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let pid = Pid::from_raw(i32::try_from(self.child.id()).unwrap()).unwrap();
        let _ = kill_process(pid, Signal::TERM);
        let _ = self.child.wait();
    }
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8(text).unwrap()
}

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().permissions().mode() & 0o777
}

#[test]
fn a_lost_database_is_made_again_and_the_loss_is_reported() {
    let demo = Demo::new();
    let first = demo.nightly();
    assert_eq!(said(&first), "1 site compared, 1 run, 0 failures\n");
    let added = demo.service(&["token", "add"], &["--role", "read"]);
    assert!(added.status.success(), "{}", said(&added));
    demo.lose_database();
    let served = demo.serve();
    served.wait_for("ready", || served.get("/readyz").0 == 200);
    let site = served.json("/api/v1/sites/isidis");
    assert!(
        site["verdict"].as_str().unwrap().starts_with("valid"),
        "{site}"
    );
    let (status, head, _) = served.get("/api/v1/sites/isidis/current/footprints.csv");
    assert_eq!(status, 307, "{head}");
    let place = head
        .lines()
        .find_map(|line| line.strip_prefix("location: "));
    let (status, head, body) = served.get(place.unwrap());
    assert_eq!(status, 200, "{head}{body}");
    let loss = served.json("/api/v1/status")["database_loss"]["text"].clone();
    for text in [loss.as_str().unwrap(), &served.log()] {
        for part in [
            "1 site, 1 run.",
            "Earlier tokens",
            "audit records",
            "token add",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    // The site is compared with its file, and nothing runs.
    served.wait_for("a comparison", || {
        served.json("/api/v1/sites/isidis")["enabled"] == true
    });
    served.wait_for("a plan", || {
        !served.json("/api/v1/sites/isidis")["checked_utc"].is_null()
    });
    assert_eq!(served.json("/api/v1/jobs")["items"], serde_json::json!([]));
    drop(served);
    // The token is gone, and the list does not make up a database where there is none.
    assert_eq!(said(&demo.service(&["token", "list"], &[])), "");
    demo.lose_database();
    let list = demo.service(&["token", "list"], &[]);
    assert_eq!(list.status.code(), Some(2), "{}", said(&list));
    assert!(!demo.database().exists());
}

#[test]
fn a_database_that_cannot_be_used_is_refused_in_words() {
    let demo = Demo::new();
    let added = demo.service(&["token", "add"], &["--role", "read"]);
    assert!(added.status.success(), "{}", said(&added));
    // Hashes of tokens are for the user of the service alone.
    assert_eq!(mode(&demo.file("state")), 0o700);
    assert_eq!(mode(&demo.database()), 0o600);
    let refused = |code: i32, parts: &[&str]| {
        let night = demo.nightly();
        let text = said(&night);
        assert_eq!(night.status.code(), Some(code), "{text}");
        for part in parts {
            assert!(text.contains(part), "{part}: {text}");
        }
        for part in ["CREATE", "SELECT", "tries again", "panicked"] {
            assert!(!text.contains(part), "{part}: {text}");
        }
    };
    let sql = |text: &str| {
        let connection = Connection::open(demo.database()).unwrap();
        connection.execute_batch(text).unwrap();
        connection
    };
    let holder = sql("PRAGMA locking_mode = EXCLUSIVE; BEGIN EXCLUSIVE");
    refused(
        6,
        &[
            "another program has locked the database",
            "close the program",
        ],
    );
    drop(holder);
    drop(sql("PRAGMA user_version = 0"));
    refused(3, &["its layout is 0", "areograph service rebuild"]);
    demo.lose_database();
    drop(sql("CREATE TABLE a (b); PRAGMA user_version = 1"));
    refused(
        3,
        &[
            "tables belong to another program",
            "areograph service rebuild",
        ],
    );
    demo.lose_database();
    fs::create_dir(demo.database()).unwrap();
    refused(3, &["not a regular file", "areograph service rebuild"]);
    // What is advised works.
    fs::create_dir_all(demo.file("products")).unwrap();
    let rebuilt = demo.service(&["rebuild"], &[]);
    assert_eq!(said(&rebuilt), "0 sites, 0 runs\n");
    assert!(demo.database().is_file());
}

#[test]
fn too_little_memory_is_refused_at_the_start() {
    let demo = Demo::new();
    demo.replace("memory_mib = 8192", "memory_mib = 64");
    let night = demo.nightly();
    let text = said(&night);
    assert_eq!(night.status.code(), Some(2), "{text}");
    assert!(
        text.contains("memory_mib") && text.contains("512"),
        "{text}"
    );
}
