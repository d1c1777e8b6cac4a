//! Board, alert rules and hooks of `config/monitoring` and `config/hooks`, held against a service.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead as _, BufReader, Read as _, Write as _},
    net::TcpListener,
    process::{Child, Command, Stdio},
    thread,
};

use areograph_testing::checkout;
use serde_json::Value;

use crate::{
    common::{
        mission::{areograph, succeed},
        outside,
    },
    world::World,
};

/// Names of metrics in a text.
fn names(text: &str) -> BTreeSet<String> {
    let is_part = |of: char| of.is_ascii_alphanumeric() || of == '_';
    let words = text.split(|of: char| !is_part(of));
    words
        .filter(|word| word.starts_with("areograph_"))
        .map(str::to_owned)
        .collect()
}

/// The metrics of a service with nights, checks of products and a lost database: all that one ever exposes.
fn exposed() -> String {
    let world = World::new();
    world.get("/");
    world.sql(
        "INSERT OR REPLACE INTO fact VALUES ('database_lost', '{\"at_ms\": 1, \"found\": \"x\", \"sites\": 0, \"runs\": 0}');",
    );
    world.get("/metrics").text()
}

#[test]
fn board_and_rules_name_metrics_that_the_service_exposes() {
    let text = exposed();
    let samples: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    let known: BTreeSet<String> = names(&samples.join("\n"));
    // Exposed only after a loss of the database, and after a check of products.
    let sometimes = [
        "areograph_database_lost_seconds",
        "areograph_last_scrub_seconds",
    ];
    let source =
        fs::read_to_string(checkout().join("crates/service/src/http/api/measures.rs")).unwrap();
    for name in sometimes {
        assert!(
            source.contains(&format!("\"{}\"", &name["areograph_".len()..])),
            "{name}"
        );
    }
    for file in ["areograph.rules.yml", "areograph.grafana.json"] {
        let used = fs::read_to_string(checkout().join("config/monitoring").join(file)).unwrap();
        // Names are those of metrics in expressions; the file names itself elsewhere.
        let used = names(&used);
        assert!(used.len() > 8, "{file}: {used:?}");
        let unknown: Vec<&String> = used
            .iter()
            .filter(|name| !known.contains(*name) && !sometimes.contains(&&***name))
            .collect();
        assert!(
            unknown.is_empty(),
            "{file} names {unknown:?}; the service exposes {known:?}"
        );
    }
    for sample in [
        concat!(
            "areograph_build_info{version=\"",
            env!("CARGO_PKG_VERSION"),
            "\"} 1"
        ),
        "areograph_sites_by_verdict{verdict=\"remarks\"} 1",
        "areograph_sites_by_verdict{verdict=\"valid\"} 1",
        "areograph_sites_by_verdict{verdict=\"none\"} 1",
        "areograph_sites_waiting 0",
        // The clock of the world, 2026-03-01 02:30 UTC, less an hour and a day.
        "areograph_newest_kernel_seconds{kind=\"ck\"} 1772328600",
        "areograph_newest_kernel_seconds{kind=\"lsk\"} 1772245800",
        "areograph_next_night_seconds 1772415000",
    ] {
        assert!(samples.contains(&sample), "no {sample} in {text}");
    }
}

#[test]
fn the_board_is_one_that_grafana_imports() {
    let path = checkout().join("config/monitoring/areograph.grafana.json");
    let board: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let panels = board["panels"].as_array().unwrap();
    let ids: BTreeSet<i64> = panels
        .iter()
        .map(|panel| panel["id"].as_i64().unwrap())
        .collect();
    assert_eq!(ids.len(), panels.len());
    for panel in panels {
        assert!(!panel["targets"].as_array().unwrap().is_empty(), "{panel}");
        assert_eq!(panel["datasource"]["uid"], "${datasource}");
    }
}

/// Answers one mail on a free port; gives its text.
fn mail_sink() -> (u16, thread::JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let receive = move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
        stream.write_all(b"220 sink\r\n").unwrap();
        let mut text = String::new();
        let mut in_data = false;
        while let Some(Ok(line)) = lines.next() {
            let answer: &[u8] = match (&*line, in_data) {
                (".", true) => {
                    in_data = false;
                    b"250 taken\r\n"
                }
                (_, true) => b"",
                ("DATA" | "data", false) => {
                    in_data = true;
                    b"354 go on\r\n"
                }
                ("QUIT" | "quit", false) => {
                    let _ = stream.write_all(b"221 bye\r\n");
                    break;
                }
                _ => b"250 well\r\n",
            };
            text.push_str(&line);
            text.push('\n');
            stream.write_all(answer).unwrap();
        }
        text
    };
    (port, thread::spawn(receive))
}

/// Answers one request over HTTP; gives its text.
fn web_sink() -> (u16, thread::JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let receive = move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut text = String::new();
        let mut reader = BufReader::new(stream.try_clone().unwrap());
        let mut length = 0;
        loop {
            let mut line = String::new();
            reader.read_line(&mut line).unwrap();
            if let Some(value) = line.to_lowercase().strip_prefix("content-length: ") {
                length = value.trim().parse().unwrap();
            }
            text.push_str(&line);
            if line.trim().is_empty() {
                break;
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).unwrap();
        stream
            .write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n")
            .unwrap();
        text + &String::from_utf8(body).unwrap()
    };
    (port, thread::spawn(receive))
}

/// A process that is ended with its test.
struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn an_alert_arrives_as_mail_and_at_a_web_address() {
    let test = "an_alert_arrives_as_mail_and_at_a_web_address";
    let has = |program: &str| Command::new(program).arg("--version").output().is_ok();
    // Where a hook finds them.
    if !["/usr/bin/python3", "/usr/bin/curl"].into_iter().all(has) {
        outside::skipped(test, "no /usr/bin/python3, or no /usr/bin/curl");
        return;
    }
    outside::found(test);
    let folder = tempfile::tempdir().unwrap();
    let mars = folder.path().join("mars");
    succeed(areograph().args(["service", "init"]).arg(&mars));
    let ((mail, letter), (web, request)) = (mail_sink(), web_sink());
    let script = checkout().join("config/hooks/mail");
    let file = mars.join("areograph.toml");
    let text = fs::read_to_string(&file).unwrap();
    // A disk that is too full for a run is an alert at once.
    let text = text.replace("min_free_mib = 1024", "min_free_mib = 16777216");
    let hooks = format!(
        "[[hooks]]\ncommand = [\"{}\", \"127.0.0.1:{mail}\", \"areograph@example.org\", \"ops@example.org\"]\n\
         events = [\"disk_low\"]\n\
         [[hooks]]\ncommand = [\"curl\", \"-fsS\", \"-H\", \"Content-Type: application/json\", \"--data-binary\", \"@-\", \
         \"http://127.0.0.1:{web}/hook\"]\nevents = [\"disk_low\"]\n",
        script.display()
    );
    fs::write(&file, text + &hooks).unwrap();
    let mut serve = areograph();
    serve
        .arg("serve")
        .arg(&file)
        .args(["--listen", "127.0.0.1:0"]);
    let _served = Served(
        serve
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap(),
    );
    let request = request.join().unwrap();
    let (head, body) = request.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("POST /hook HTTP/1.1"), "{head}");
    let event: Value = serde_json::from_str(body).unwrap();
    assert_eq!(
        (&event["kind"], &event["service"]),
        (&"disk_low".into(), &"areograph".into())
    );
    let letter = letter.join().unwrap();
    for part in [
        "Subject: [areograph] disk low",
        "To: ops@example.org",
        "less than workers.min_free_mib",
    ] {
        assert!(letter.contains(part), "no {part} in {letter}");
    }
}
