//! A service whose files are those of an earlier version: the database in the tables of that time (`layout_1.sql`), and
//! manifests and stored outputs that name version 0.0.9 wherever the program writes its version.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Output,
};

use rusqlite::Connection;

use crate::common::{
    files_below,
    mission::{areograph, succeed},
};

const EARLIER: &str = "0.0.9";
const PRESENT: &str = env!("CARGO_PKG_VERSION");
const LAYOUT_1: &str = include_str!("layout_1.sql");

struct Service {
    folder: tempfile::TempDir,
}

impl Service {
    /// A demonstration of one site, after its first night.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let service = Self { folder };
        succeed(areograph().args(["serve", "--init"]).arg(service.path("")));
        for other in ["eos_chasma", "gusev_context", "gusev_crater"] {
            fs::remove_file(service.path(&format!("sites/{other}.toml"))).unwrap();
        }
        let file = service.path("areograph.toml");
        let mut text = fs::read_to_string(&file).unwrap();
        for (from, to) in [
            ("scan_interval_s = 2.0", "scan_interval_s = 0.3"),
            ("quiet_period_s = 5.0", "quiet_period_s = 0.5"),
            ("min_free_mib = 1024", "min_free_mib = 1"),
        ] {
            text = text.replace(from, to);
        }
        fs::write(file, text).unwrap();
        assert_eq!(
            said(&service.nightly()),
            "1 site compared, 1 run, 0 failures\n"
        );
        service
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join("demo").join(name)
    }

    fn nightly(&self) -> Output {
        let mut nightly = areograph();
        nightly
            .args(["--quiet", "nightly"])
            .arg(self.path("areograph.toml"));
        nightly.output().unwrap()
    }

    fn ask(&self, database: &str, question: &str) -> Vec<String> {
        let database = Connection::open(self.path(&format!("state/{database}"))).unwrap();
        let mut query = database.prepare(question).unwrap();
        let rows = query.query_map([], |row| row.get::<_, String>(0)).unwrap();
        rows.map(Result::unwrap).collect()
    }

    /// Every file of the runs of the earlier version.
    fn runs(&self, ids: &[String]) -> BTreeMap<PathBuf, Vec<u8>> {
        let places = ids
            .iter()
            .map(|id| self.path(&format!("products/isidis/runs/{id}")));
        let files = places
            .filter(|run| run.is_dir())
            .flat_map(|run| files_below(&run));
        files
            .map(|file| (file.clone(), fs::read(file).unwrap()))
            .collect()
    }

    /// Makes the files those of the earlier version.
    fn age(&self) {
        let folder = self.path("products/isidis");
        let runs = fs::read_dir(folder.join("runs")).unwrap();
        for run in runs.map(|run| run.unwrap().path()) {
            let before = hash(&run.join("manifest.json"));
            replace(
                &run.join("manifest.json"),
                &format!("\"version\": \"{PRESENT}\""),
                &format!("\"version\": \"{EARLIER}\""),
            );
            replace(
                &run.join("run.json"),
                &before,
                &hash(&run.join("manifest.json")),
            );
        }
        let working = folder.join("working/isidis");
        for name in ["manifest.json", ".previous.json"] {
            let path = working.join(name);
            if path.exists() {
                replace(
                    &path,
                    &format!("\"version\": \"{PRESENT}\""),
                    &format!("\"version\": \"{EARLIER}\""),
                );
            }
        }
        for stored in files_below(&working.join(".cache")) {
            let (from, to) = (format!("{PRESENT}, method "), format!("{EARLIER}, method "));
            assert_eq!(from.len(), to.len(), "stored outputs state lengths");
            let bytes = fs::read(&stored).unwrap();
            let mut aged = bytes.clone();
            for place in 0..aged.len().saturating_sub(from.len()) {
                if aged[place..].starts_with(from.as_bytes()) {
                    aged[place..place + to.len()].copy_from_slice(to.as_bytes());
                }
            }
            if aged != bytes {
                overwrite(&stored, &aged);
            }
        }
        self.age_database();
    }

    fn age_database(&self) {
        let path = self.path("state/areograph.db");
        let present = self.path("state/present.db");
        // All of it is in one file.
        let whole = Connection::open(&path).unwrap();
        let truncate = "PRAGMA wal_checkpoint(TRUNCATE)";
        whole.query_row(truncate, [], |_| Ok(())).unwrap();
        drop(whole);
        fs::rename(&path, &present).unwrap();
        for ending in ["-wal", "-shm"] {
            let _ = fs::remove_file(self.path(&format!("state/areograph.db{ending}")));
        }
        let database = Connection::open(&path).unwrap();
        database.execute_batch(LAYOUT_1).unwrap();
        database
            .execute("ATTACH ?1 AS present", [present.to_str().unwrap()])
            .unwrap();
        let names = |sql: &str| -> Vec<String> {
            let mut query = database.prepare(sql).unwrap();
            let rows = query.query_map([], |row| row.get(0)).unwrap();
            rows.map(Result::unwrap).collect()
        };
        let tables = names(
            "SELECT name FROM main.sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%'",
        );
        database.execute_batch("PRAGMA foreign_keys = OFF").unwrap();
        for table in &tables {
            let columns = names(&format!(
                "SELECT name FROM pragma_table_info('{table}', 'main')"
            ))
            .join(", ");
            let copy = format!(
                "INSERT INTO main.{table} ({columns}) SELECT {columns} FROM present.{table}"
            );
            database.execute_batch(&copy).unwrap();
        }
        database
            .execute_batch(&format!(
                "UPDATE run SET version = '{EARLIER}'; UPDATE fact SET value = '{EARLIER}' WHERE value LIKE '{PRESENT} %';
                 PRAGMA user_version = 1"
            ))
            .unwrap();
        let current = self.path("products/isidis/current/manifest.json");
        let put = "UPDATE run SET manifest_blake3 = ?1";
        database.execute(put, [&hash(&current)]).unwrap();
        database.execute_batch("DETACH present").unwrap();
        drop(database);
        fs::remove_file(present).unwrap();
    }
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8(text).unwrap()
}

fn hash(path: &Path) -> String {
    blake3::hash(&fs::read(path).unwrap()).to_hex().to_string()
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{}: no {from}", path.display());
    overwrite(path, text.replace(from, to).as_bytes());
}

/// Under a new inode: files of runs are links to those of the working folder.
fn overwrite(path: &Path, bytes: &[u8]) {
    fs::remove_file(path).unwrap();
    fs::write(path, bytes).unwrap();
}

#[test]
fn files_of_an_earlier_version_are_kept_named_and_made_again_once() {
    let service = Service::new();
    service.age();
    let former = service.ask("areograph.db", "SELECT id FROM run ORDER BY id");
    let kept = service.runs(&former);
    assert!(
        former.len() == 1 && kept.len() > 50,
        "{former:?} {}",
        kept.len()
    );
    // What the new version states before it is started.
    let mut check = areograph();
    check
        .args(["service", "check"])
        .arg(service.path("areograph.toml"));
    let checked = check.output().unwrap();
    let text = said(&checked);
    assert!(
        text.contains("layout 1: the next start copies and migrates it"),
        "{text}"
    );
    let mut export = areograph();
    export
        .arg("export")
        .arg(service.path("products/isidis/current"))
        .arg("csv");
    let refused = said(&export.output().unwrap());
    assert!(
        refused.contains(&format!("products of areograph {EARLIER}"))
            && refused.contains("run the site again"),
        "{refused}"
    );
    assert_eq!(
        said(&service.nightly()),
        "1 site compared, 1 run, 0 failures\n"
    );
    // The database as it was, and in the present layout.
    let layout = "SELECT CAST(user_version AS TEXT) FROM pragma_user_version";
    assert_eq!(service.ask("before-layout-4.db", layout), ["1"]);
    assert_eq!(service.ask("areograph.db", layout), ["4"]);
    // The runs of the earlier version are there, byte for byte, and named as such.
    assert_eq!(service.runs(&former), kept);
    let versions = "SELECT version || ' ' || count(*) FROM run GROUP BY version ORDER BY version";
    assert_eq!(
        service.ask("areograph.db", versions),
        [format!("{EARLIER} 1"), format!("{PRESENT} 1")]
    );
    let reasons = service.ask(
        "areograph.db",
        "SELECT DISTINCT detail FROM cause WHERE kind = 'tool_changed'",
    );
    assert!(
        reasons
            .iter()
            .all(|reason| reason
                .starts_with(&format!("areograph {EARLIER} was replaced by {PRESENT}")))
            && !reasons.is_empty(),
        "{reasons:?}"
    );
    // No stored output of the earlier version was used.
    let new = format!("version = '{PRESENT}'");
    let stored = format!(
        "SELECT json_extract(value, '$.stage') FROM run, json_each(stages) WHERE {new} AND json_extract(value, '$.runs') = 0"
    );
    assert_eq!(service.ask("areograph.db", &stored), [""; 0]);
    let ran = format!(
        "SELECT DISTINCT json_extract(value, '$.stage') FROM run, json_each(stages) WHERE {new}"
    );
    assert!(service.ask("areograph.db", &ran).len() > 20);
    assert_eq!(
        said(&service.nightly()),
        "1 site compared, 0 runs, 0 failures\n"
    );
    // The effect of the new version, compared with the last run of the earlier one.
    let moved = format!("SELECT json_extract(moved, '$.headline') FROM run WHERE {new}");
    assert_eq!(service.ask("areograph.db", &moved), ["nothing moved"]);
    // Back to the database of the earlier version: the later runs are found on the disk.
    for ending in ["", "-wal", "-shm"] {
        let _ = fs::remove_file(service.path(&format!("state/areograph.db{ending}")));
    }
    fs::rename(
        service.path("state/before-layout-4.db"),
        service.path("state/areograph.db"),
    )
    .unwrap();
    assert_eq!(
        said(&service.nightly()),
        "1 site compared, 0 runs, 0 failures\n"
    );
    assert_eq!(
        service.ask("areograph.db", versions),
        [format!("{EARLIER} 1"), format!("{PRESENT} 1")]
    );
}

#[test]
fn a_copy_in_another_folder_continues_without_a_run() {
    let service = Service::new();
    let copy = service.folder.path().join("copy.db");
    let mut backup = areograph();
    backup
        .args(["service", "backup"])
        .arg(service.path("areograph.toml"));
    succeed(backup.arg(&copy));
    let current = fs::read_link(service.path("products/isidis/current")).unwrap();
    // As the guide states: the folder without `state`, and the copy of the database in its place.
    let elsewhere = tempfile::tempdir().unwrap();
    let place = elsewhere.path().join("demo");
    let mut copied = std::process::Command::new("cp");
    succeed(copied.arg("-a").arg(service.path("")).arg(&place));
    fs::remove_dir_all(place.join("state")).unwrap();
    fs::create_dir(place.join("state")).unwrap();
    fs::copy(&copy, place.join("state/areograph.db")).unwrap();
    // Nothing of the first machine can be reached.
    drop(service);
    let other = Service { folder: elsewhere };
    assert_eq!(
        said(&other.nightly()),
        "1 site compared, 0 runs, 0 failures\n"
    );
    assert_eq!(
        fs::read_link(other.path("products/isidis/current")).unwrap(),
        current
    );
    let nights = "SELECT CAST(count(*) AS TEXT) FROM night WHERE ended_ms IS NOT NULL";
    assert_eq!(
        other.ask("areograph.db", nights),
        ["2"],
        "the history goes on"
    );
}
