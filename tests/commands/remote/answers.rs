//! Answers from an archive on its server, and faults of transfers.

use std::{
    fs,
    os::unix::fs::FileExt as _,
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use areograph::{body::Datum, files::stand_in::StandIn};
use areograph_testing::track::write;

use super::{Archive, FIRST, LARGE, SECOND, SMALL, below_data};
use crate::common::{
    self,
    archive_server::{ArchiveServer, Fault, Listing},
    case::Case,
    mission::{areograph, succeed},
};

#[test]
fn rows_are_those_of_the_local_archive_and_few_bytes_are_read() {
    for listing in [Listing::Plain, Listing::Table] {
        let archive = Archive::new(listing);
        let told = succeed(&mut archive.index(&["--json"])).stdout;
        let told: serde_json::Value = serde_json::from_slice(&told).unwrap();
        assert_eq!((&told["files"], &told["read"]), (&2.into(), &2.into()));
        assert_eq!(told["bytes_of_files"], archive.bytes());
        let share = told["bytes"].as_f64().unwrap() / archive.bytes() as f64;
        assert!(share < 0.0015, "{share}");
        for file in [FIRST, SECOND] {
            let path = archive.path("mola").join(below_data(file));
            let of = StandIn::of_open(&fs::File::open(path).unwrap())
                .unwrap()
                .unwrap();
            let bytes = fs::read(archive.path("archive").join(file)).unwrap();
            assert_eq!(of.blake3(), blake3::hash(&bytes).to_hex().to_string());
        }
        let streamed = archive.sent();
        // And one byte, to find out whether the server sends parts.
        assert_eq!(streamed, archive.bytes() + 1);
        for window in [SMALL, LARGE] {
            assert!(archive.found("archive", window) == archive.found("mola", window));
            if window == SMALL {
                let read = archive.sent() - streamed;
                assert!(read > 0 && read < archive.bytes() / 5, "{read}");
            }
        }
        // Every block once.
        let read = archive.sent() - streamed;
        assert!(read < archive.bytes() * 11 / 10, "{read}");
        let requests = archive.server.request_count();
        assert!(archive.found("archive", LARGE) == archive.found("mola", LARGE));
        assert_eq!(archive.server.request_count(), requests);
        assert!(archive.server.open_max() <= 2);
        let asked = &archive.server.requests(&format!("/{FIRST}"))[0];
        let agent = &asked.headers["user-agent"];
        assert!(
            agent.starts_with("areograph/") && agent.contains("tester@example.org"),
            "{agent}"
        );
        // All of a file, such as for a table of its records.
        let info = |folder: &str, file: &str| {
            let mut info = areograph();
            info.args(["--quiet", "pedr", "info", "--json"]);
            succeed(info.arg(archive.path(folder).join(file))).stdout
        };
        let [here, there] = [info("archive", FIRST), info("mola", below_data(FIRST))];
        let apart_from_path = |bytes: &[u8]| -> serde_json::Value {
            let mut stated: serde_json::Value = serde_json::from_slice(bytes).unwrap();
            let stated_file = match &mut stated {
                serde_json::Value::Array(files) => &mut files[0],
                one => one,
            };
            assert!(
                stated_file
                    .as_object_mut()
                    .unwrap()
                    .remove("file")
                    .is_some()
            );
            stated
        };
        assert_eq!(apart_from_path(&here), apart_from_path(&there));
    }
}

#[test]
fn passing_faults_end_in_the_right_rows() {
    let archive = Archive::indexed();
    let right = archive.found("archive", SMALL);
    let path = format!("/{FIRST}");
    let own = format!("{}/{FIRST}", archive.server.url());
    for fault in [
        Fault::Status(503),
        Fault::RetryAfter(429, 1),
        Fault::ResetAfter(1_000),
        Fault::ShortBy(1),
        Fault::Longer { is_announced: true },
        Fault::Longer {
            is_announced: false,
        },
        Fault::WrongBytes,
        Fault::WrongRange,
        Fault::Hangs,
        Fault::NoLength,
        Fault::Slow,
        Fault::Redirect(own),
    ] {
        archive.forget_blocks();
        archive.server.next(&path, [fault.clone()]);
        let before = archive.server.requests(&path).len();
        assert!(archive.found("mola", SMALL) == right, "{fault:?}");
        assert!(archive.server.requests(&path).len() > before, "{fault:?}");
    }
}

#[test]
fn lasting_faults_are_errors_and_never_short_answers() {
    let archive = Archive::indexed();
    let path = format!("/{FIRST}");
    for (fault, expected, code) in [
        (Fault::Status(404), "HTTP status 404", 6),
        (Fault::Status(403), "does not permit access", 6),
        (Fault::Status(503), "HTTP status 503; attempts: 3", 6),
        (Fault::RetryAfter(429, 0), "HTTP status 429; attempts: 3", 6),
        (Fault::ResetAfter(1_000), "attempts: 3", 6),
        (Fault::ShortBy(1), "attempts: 3", 6),
        (Fault::Longer { is_announced: true }, "attempts: 3", 6),
        (
            Fault::WrongRange,
            "other bytes of the file than requested",
            6,
        ),
        (Fault::Hangs, "attempts: 3", 6),
        (Fault::WrongBytes, "has changed since it was indexed", 3),
        (Fault::IgnoresRange, "no range requests", 6),
        (
            Fault::Redirect("http://example.org/a.b".to_owned()),
            "the redirection is not followed",
            6,
        ),
        (
            Fault::Redirect(format!("/{FIRST}")),
            "too many redirections",
            6,
        ),
    ] {
        archive.forget_blocks();
        archive.server.always(&path, fault.clone());
        let (found, stated, error) = archive.refused(SMALL);
        assert!(error.contains(expected), "{fault:?}: {error}");
        assert!(error.contains("AP19030L.B"), "{fault:?}: {error}");
        for advice_of_another_command in ["fetch --", "--archives"] {
            assert!(
                !error.contains(advice_of_another_command),
                "{fault:?}: {error}"
            );
        }
        assert_eq!(found, code, "{fault:?}: {error}");
        assert_eq!(stated["complete"], false, "{fault:?}");
    }
}

#[test]
fn a_file_that_changes_on_the_server_is_noticed_until_it_is_indexed_again() {
    let archive = Archive::indexed();
    let served = archive.path("archive").join(FIRST);
    let good = fs::read(&served).unwrap();
    let changed: [(&str, Vec<u8>); 3] = [
        ("block", good.iter().map(|byte| byte ^ 1).collect()),
        ("the file has", good[..good.len() - 776].to_vec()),
        ("the file has", [&good[..], &good[7_760..8_536]].concat()),
    ];
    for (expected, content) in changed {
        archive.forget_blocks();
        fs::write(&served, &content).unwrap();
        let (code, _, error) = archive.refused(SMALL);
        for part in [
            expected,
            "AP19030L.B",
            "according to the index",
            "pedr index URL",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert_eq!(code, 3);
    }
    // What has arrived before is what was indexed, and is still used.
    fs::write(&served, &good).unwrap();
    let right = archive.found("mola", SMALL);
    // Other shots, in a file of the same length.
    write(&served, Datum::Iau2000, 100, |_, _| ());
    assert!(archive.found("mola", SMALL) == right);
    let told = succeed(&mut archive.index(&["--json"])).stdout;
    let told: serde_json::Value = serde_json::from_slice(&told).unwrap();
    assert_eq!((&told["files"], &told["read"]), (&2.into(), &1.into()));
    let now = archive.found("mola", SMALL);
    assert!(now == archive.found("archive", SMALL) && now != right);
    // A file that has gone.
    fs::remove_file(&served).unwrap();
    let told = succeed(&mut archive.index(&["--json"])).stdout;
    let told: serde_json::Value = serde_json::from_slice(&told).unwrap();
    assert_eq!((&told["files"], &told["removed"]), (&1.into(), &1.into()));
}

#[test]
fn blocks_on_this_computer_are_verified() {
    let archive = Archive::indexed();
    let right = archive.found("mola", LARGE);
    let blocks = archive.path("mola/.fetch/blocks");
    for entry in fs::read_dir(&blocks).unwrap() {
        let file = fs::OpenOptions::new()
            .write(true)
            .open(entry.unwrap().path())
            .unwrap();
        file.write_all_at(b"damage", 200_000).unwrap();
        file.set_len(1_500_000).unwrap();
    }
    let before = archive.server.request_count();
    assert!(archive.found("mola", LARGE) == right);
    assert!(archive.server.request_count() > before);
    // Nothing can be kept: a file has the place of the folder.
    archive.forget_blocks();
    fs::write(&blocks, "").unwrap();
    assert!(archive.found("mola", LARGE) == right);
}

#[test]
fn processes_at_the_same_time_have_the_same_answer() {
    let archive = Archive::indexed();
    let right = archive.found("archive", LARGE);
    archive.server.always(&format!("/{FIRST}"), Fault::Slow);
    let searches: Vec<Child> = (0..4)
        .map(|number| {
            let mut search = archive.search("mola", LARGE, &format!("{number}.csv"));
            search.stdout(Stdio::piped()).spawn().unwrap()
        })
        .collect();
    for (number, search) in searches.into_iter().enumerate() {
        let output = search.wait_with_output().unwrap();
        assert!(output.status.success());
        let rows = fs::read(archive.path(&format!("{number}.csv"))).unwrap();
        assert!([rows, output.stdout] == right);
    }
}

#[test]
fn killed_processes_leave_nothing_wrong_and_what_has_arrived_is_kept() {
    let archive = Archive::new(Listing::Plain);
    archive.server.always(&format!("/{SECOND}"), Fault::Slow);
    let kill = |mut command: Command, after_ms: u64| {
        let mut child = command.stdout(Stdio::null()).spawn().unwrap();
        thread::sleep(Duration::from_millis(after_ms));
        child.kill().unwrap();
        child.wait().unwrap();
    };
    for after_ms in [300, 500, 700] {
        kill(archive.index(&[]), after_ms);
        for file in [FIRST, SECOND] {
            let path = archive.path("mola").join(below_data(file));
            if let Ok(bytes) = fs::read(&path)
                && bytes != StandIn::pending()
            {
                let file = fs::File::open(path).unwrap();
                assert!(StandIn::of_open(&file).unwrap().is_some());
            }
        }
    }
    succeed(&mut archive.index(&[]));
    let asked = archive.server.requests(&format!("/{SECOND}"));
    assert!(asked.iter().any(|request| request.from() > 0));
    let right = archive.found("archive", LARGE);
    for after_ms in [50, 100, 200] {
        kill(archive.search("mola", LARGE, "killed.csv"), after_ms);
        assert!(!archive.path("killed.csv").exists());
    }
    assert!(archive.found("mola", LARGE) == right);
}

#[test]
fn a_server_that_goes_is_reported_once_and_for_all_files() {
    let archive = Archive::indexed();
    for file in [FIRST, SECOND] {
        archive
            .server
            .always(&format!("/{file}"), Fault::ResetAfter(10));
    }
    let before = archive.server.request_count();
    let (code, stated, error) = archive.refused(LARGE);
    assert_eq!(archive.server.request_count() - before, 3);
    assert_eq!(
        error.matches("check the address and the network").count(),
        1,
        "{error}"
    );
    assert_eq!(
        error.matches("not requested, because").count(),
        1,
        "{error}"
    );
    assert_eq!((code, &stated["complete"]), (6, &false.into()));
    assert_eq!(stated["rows"], 0);
    let text = fs::read_to_string(archive.path("mola/areograph-archive.toml")).unwrap();
    let gone = text.replace(&archive.server.url(), "http://127.0.0.1:1");
    fs::write(archive.path("mola/areograph-archive.toml"), gone).unwrap();
    let (code, _, error) = archive.refused(LARGE);
    assert!(
        code == 6 && error.contains("http://127.0.0.1:1/"),
        "{error}"
    );
}

#[test]
fn a_site_has_the_same_products_and_keeps_what_it_computed() {
    let case = Case::new();
    succeed(&mut case.run());
    let before = common::mission::products(&case.path("out"));
    fs::create_dir(case.path("served")).unwrap();
    fs::rename(case.path("pedr"), case.path("served/pedr")).unwrap();
    let server = ArchiveServer::of(&case.path("served"), Listing::Table);
    let mut index = case.areograph();
    let url = format!("{}/pedr/", server.url());
    index.args(["--quiet", "pedr", "index", &url, "--into", "pedr"]);
    succeed(&mut index);
    // The stand-in has the hash of the file: nothing is computed, and nothing is read.
    let requests = server.request_count();
    assert_eq!(case.stages_run(), Vec::<String>::new());
    assert_eq!(server.request_count(), requests);
    fs::remove_dir_all(case.path("out")).unwrap();
    succeed(&mut case.run());
    assert!(common::mission::products(&case.path("out")) == before);
    assert!(server.sent("/pedr/ap19117l.b") > 0);
}
