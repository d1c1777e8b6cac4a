//! SQL queries of an archive on its server.

use std::{fs, process::Command};

use super::{Archive, FIRST, failed};
use crate::common::{
    archive_server::Fault,
    mission::{areograph, succeed},
};

/// A band that both tracks cross.
const BAND: &str = "latitude_deg between 20 and 21";

impl Archive {
    fn ask(&self, folder: &str, question: &str) -> Command {
        let mut command = areograph();
        command.args(["--quiet", "pedr", "sql"]);
        command.arg(self.path(folder)).arg(question);
        command.args(["--format", "csv"]);
        command
    }
}

#[test]
fn answers_are_those_of_the_local_archive_and_few_bytes_are_read() {
    let archive = Archive::indexed();
    let streamed = archive.sent();
    let in_band = format!("select * from shots where {BAND}");
    let questions = [
        &*in_band,
        "select count(*), min(radius_m), max(et_s) from shots where longitude_deg > 350 or longitude_deg < 10",
        "select orbit, count(*) as shots, avg(topography_m) from shots group by orbit order by orbit",
        "select source_file, min(et_s), max(record) from shots group by source_file order by source_file",
        "select * from shots where et_s < -19999990.0",
        "select shot, range_m from shots where source_file = 'ap19020k.b' order by range_m desc, et_s limit 20",
        "select count(*) from shots where latitude_deg > 91",
    ];
    for question in questions {
        let here = succeed(&mut archive.ask("archive", question)).stdout;
        let there = succeed(&mut archive.ask("mola", question)).stdout;
        assert!(here == there, "{question}");
        let rows = String::from_utf8_lossy(&here).lines().count() - 1;
        assert!(rows > 0, "{question}");
        if question == in_band {
            let read = archive.sent() - streamed;
            assert!(
                rows > 300 && read > 0 && read < archive.bytes() / 5,
                "{rows} {read}"
            );
        }
    }
    // Every block once.
    let read = archive.sent() - streamed;
    assert!(read < archive.bytes() * 11 / 10, "{read}");
}

#[test]
fn faults_of_the_server_are_errors_and_never_short_answers() {
    let archive = Archive::indexed();
    let path = format!("/{FIRST}");
    let question = format!("select * from shots where {BAND}");
    let out = archive.path("answer.csv");
    for (fault, expected, code) in [
        (Fault::Status(404), "HTTP status 404", 6),
        (Fault::WrongBytes, "has changed since it was indexed", 3),
        (Fault::IgnoresRange, "no range requests", 6),
    ] {
        archive.forget_blocks();
        archive.server.always(&path, fault.clone());
        let refused = archive.ask("mola", &question).output().unwrap();
        let (found, error) = failed(&refused);
        assert_eq!(found, code, "{fault:?}: {error}");
        for part in [expected, "AP19030L.B"] {
            assert!(error.contains(part), "{fault:?}, {part}: {error}");
        }
        let mut written = areograph();
        written.args(["--quiet", "pedr", "sql"]);
        written.arg(archive.path("mola")).arg(&question);
        failed(&written.arg("--out").arg(&out).output().unwrap());
        assert!(!out.exists(), "{fault:?}");
    }
    // A file without its index entry.
    fs::write(archive.path("mola/ap19xxx/ap19020k.b"), b"").unwrap();
    let (_, error) = failed(&archive.ask("mola", &question).output().unwrap());
    assert!(error.contains("ap19020k.b"), "{error}");
}
