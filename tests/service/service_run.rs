//! The service as a process on the synthetic mission: what runs when files change, and what is left when it is killed.
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
    os::unix::process::ExitStatusExt as _,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use common::{
    long,
    mission::{areograph, products, succeed},
};
use rusqlite::{Connection, OpenFlags};
use rustix::process::{Pid, Signal, kill_process};

/// Longest time for anything, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_mins(4);
/// The kernel that only `isidis` reads.
pub(crate) const OWN: &str = "kernels/mgs_sc_isidis.bc";

/// A folder with a mission and a configuration that sees changes after a second.
pub(crate) struct Mission {
    folder: tempfile::TempDir,
}

impl Mission {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mission = Self { folder };
        succeed(
            areograph()
                .args(["serve", "--init"])
                .arg(mission.path("demo")),
        );
        let file = mission.path("demo/areograph.toml");
        let mut text = fs::read_to_string(&file).unwrap();
        for (from, to) in [
            ("scan_interval_s = 2.0", "scan_interval_s = 0.2"),
            ("quiet_period_s = 5.0", "quiet_period_s = 1.5"),
            ("threads = 2", "threads = 1"),
            ("min_free_mib = 1024", "min_free_mib = 1"),
        ] {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        fs::write(file, text).unwrap();
        // One site gets attitude of its own.
        let kernels = mission.path("demo/kernels");
        fs::copy(
            kernels.join("mgs_sc_scene.bc"),
            mission.path("demo").join(OWN),
        )
        .unwrap();
        let list = fs::read_to_string(kernels.join("nav.tm")).unwrap();
        let list = list.replace("mgs_sc_scene.bc", "mgs_sc_isidis.bc");
        fs::write(kernels.join("isidis.tm"), list).unwrap();
        let site = mission.path("demo/sites/isidis.toml");
        let text = fs::read_to_string(&site).unwrap();
        fs::write(site, text.replace("kernels/nav.tm", "kernels/isidis.tm")).unwrap();
        // A site that reads the changed kernel and one that does not are enough.
        for other in ["gusev_context", "gusev_crater"] {
            fs::remove_file(mission.file(&format!("sites/{other}.toml"))).unwrap();
        }
        mission
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.path("demo").join(name)
    }

    pub(crate) fn serve(&self) -> Command {
        let mut command = areograph();
        command.arg("serve").arg(self.file("areograph.toml"));
        command.args(["--listen", "127.0.0.1:0"]);
        command
    }

    /// Starts the service; gives its address.
    pub(crate) fn start(&self) -> (Service, String) {
        self.start_as(self.serve())
    }

    /// Starts the service by this command; gives its address.
    pub(crate) fn start_as(&self, mut serve: Command) -> (Service, String) {
        let log = fs::File::options()
            .create(true)
            .append(true)
            .open(self.path("log"))
            .unwrap();
        let mut child = serve.stdout(Stdio::piped()).stderr(log).spawn().unwrap();
        let mut line = String::new();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        output.read_line(&mut line).unwrap();
        let address = line.trim().rsplit("http://").next().unwrap().to_owned();
        assert!(line.starts_with("listening at "), "{line}{}", self.log());
        (Service(child), address)
    }

    pub(crate) fn log(&self) -> String {
        fs::read_to_string(self.path("log")).unwrap_or_default()
    }

    /// The answer to a question to the database, first columns as text.
    pub(crate) fn ask(&self, question: &str) -> Vec<String> {
        let path = self.file("state/areograph.db");
        let database = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).unwrap();
        database.busy_timeout(Duration::from_secs(5)).unwrap();
        let mut query = database.prepare(question).unwrap();
        let rows = query.query_map([], |row| row.get::<_, String>(0)).unwrap();
        rows.map(Result::unwrap).collect()
    }

    pub(crate) fn wait_for(&self, what: &str, is_so: impl Fn() -> bool) {
        let begun = Instant::now();
        while !is_so() {
            assert!(begun.elapsed() < PATIENCE, "{what}\n{}", self.log());
            sleep(Duration::from_millis(50));
        }
    }

    /// Waits until so many jobs have ended, all well, and nothing is open.
    pub(crate) fn wait_for_jobs(&self, count: usize) {
        let open = "SELECT site FROM job WHERE ended_ms IS NULL";
        self.wait_for(&format!("{count} jobs"), || {
            self.states().len() >= count && self.ask(open).is_empty()
        });
        assert_eq!(self.states(), vec!["succeeded"; count], "{}", self.log());
    }

    pub(crate) fn states(&self) -> Vec<String> {
        self.ask("SELECT state FROM job ORDER BY id")
    }

    /// Lets several polls go by, longer than the quiet period.
    fn several_polls(&self) {
        let round = || -> u64 {
            self.ask("SELECT value FROM fact WHERE name = 'round'")[0]
                .parse()
                .unwrap()
        };
        let begun = (round(), Instant::now());
        self.wait_for("polls", || {
            round() >= begun.0 + 5 && begun.1.elapsed() > Duration::from_secs(3)
        });
    }

    /// What readers of a site get, without the record of the run.
    fn current(&self, site: &str) -> std::collections::BTreeMap<PathBuf, Vec<u8>> {
        let mut found = products(&self.file("products").join(site).join("current"));
        found.remove(Path::new("run.json")).unwrap();
        found
    }

    /// What a run from scratch gives, as deep in folders: metakernels name kernels by the way from there.
    fn clean(&self, site: &str) -> std::collections::BTreeMap<PathBuf, Vec<u8>> {
        let folder = tempfile::tempdir_in(self.path("demo")).unwrap();
        let out = folder.path().join("clean/working");
        let mut command = areograph();
        command
            .args(["--quiet", "run"])
            .arg(self.file(&format!("sites/{site}.toml")));
        succeed(command.arg("--out").arg(&out));
        products(&out.join(site))
    }

    /// Makes sure that readers of a site get what a run from scratch gives.
    pub(crate) fn assert_clean(&self, site: &str) {
        let (found, expected) = (self.current(site), self.clean(site));
        let files = |products: &std::collections::BTreeMap<PathBuf, Vec<u8>>| -> Vec<PathBuf> {
            products.keys().cloned().collect()
        };
        assert_eq!(files(&found), files(&expected));
        let differ = found
            .iter()
            .filter(|(path, bytes)| expected[*path] != **bytes);
        let differ: Vec<&PathBuf> = differ.map(|(path, _)| path).collect();
        assert!(differ.is_empty(), "{differ:?}");
    }
}

/// A process that is ended with its test.
pub(crate) struct Service(pub(crate) Child);

impl Service {
    pub(crate) fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(i32::try_from(self.0.id()).unwrap()).unwrap();
        kill_process(pid, signal).unwrap();
    }

    pub(crate) fn end(mut self) -> std::process::ExitStatus {
        self.signal(Signal::TERM);
        self.0.wait().unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The same attitude under another name of the file inside: another content.
pub(crate) fn other_version(kernel: &[u8], name: [u8; 4]) -> Vec<u8> {
    let mut other = kernel.to_vec();
    // The internal file name of a DAF begins at byte 16.
    other[16..20].copy_from_slice(&name);
    other
}

#[test]
fn a_second_service_is_sent_to_the_first_and_a_touched_file_runs_nothing() {
    let mission = Mission::new();
    let (service, address) = mission.start();
    mission.wait_for_jobs(2);
    mission.assert_clean("isidis");

    // A second service is sent to the first one.
    let second = mission.serve().output().unwrap();
    let refusal = String::from_utf8(second.stderr).unwrap();
    assert_eq!(second.status.code(), Some(6));
    assert!(
        refusal.contains(&format!("open http://{address}")),
        "{refusal}"
    );

    // Touched: nothing runs.
    let kernel = fs::read(mission.file(OWN)).unwrap();
    fs::write(mission.file(OWN), &kernel).unwrap();
    mission.several_polls();
    assert_eq!(mission.states().len(), 2, "{}", mission.log());
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

#[test]
fn a_kernel_that_is_copied_slowly_runs_its_site_once() {
    let mission = Mission::new();
    let (service, _) = mission.start();
    mission.wait_for_jobs(2);
    let kernel = fs::read(mission.file(OWN)).unwrap();

    // Copied in slow pieces: used once, at the end, by the one site that reads it, and only in what it touches.
    let other = other_version(&kernel, *b"SLOW");
    let mut copy = fs::File::create(mission.file(OWN)).unwrap();
    for piece in other.chunks(other.len().div_ceil(4)) {
        copy.write_all(piece).unwrap();
        sleep(Duration::from_millis(700));
    }
    drop(copy);
    mission.wait_for_jobs(3);
    mission.several_polls();
    assert_eq!(mission.ask("SELECT site FROM job WHERE id > 2"), ["isidis"]);
    let why = mission.ask("SELECT detail FROM cause WHERE job = 3");
    let expected = "`mgs_sc_isidis.bc` changed; its coverage overlaps images E02-01301 and E02-02016; stages sample_orientation, ";
    assert!(why.len() == 1 && why[0].starts_with(expected), "{why:?}");
    let ran = mission.ask(
        "SELECT DISTINCT json_extract(value, '$.stage') FROM run, json_each(stages) WHERE job = 3",
    );
    assert!(
        ran.contains(&"sample_orientation/E02-01301".to_owned()),
        "{ran:?}"
    );
    for stage in ["search_footprints", "tag_times/E02-01301", "check_ranges"] {
        assert!(!ran.contains(&stage.to_owned()), "{ran:?}");
    }
    mission.wait_for("a comparison of the runs", || {
        let page = "SELECT id FROM run WHERE job = 3 AND json_extract(moved, '$.headline') = 'nothing moved'";
        mission.ask(page).len() == 1
    });
    let run = mission
        .ask("SELECT current_run FROM site WHERE name = 'isidis'")
        .remove(0);
    assert!(
        mission
            .file(&format!("products/isidis/diffs/{run}.html"))
            .is_file()
    );
    mission.assert_clean("isidis");
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

#[test]
fn a_folder_that_is_away_for_a_while_runs_nothing() {
    let mission = Mission::new();
    let (service, _) = mission.start();
    mission.wait_for_jobs(2);

    // One alert for each change of state.
    fs::rename(mission.file("kernels"), mission.path("away")).unwrap();
    mission.wait_for("an alert", || {
        mission
            .ask("SELECT path FROM root WHERE state = 'unavailable'")
            .len()
            == 1
    });
    mission.several_polls();
    // A service that begins meanwhile waits for the folder as well.
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
    let (service, _) = mission.start();
    mission.several_polls();
    fs::rename(mission.path("away"), mission.file("kernels")).unwrap();
    mission.several_polls();
    assert_eq!(mission.states().len(), 2, "{}", mission.log());
    let alerts =
        mission.ask("SELECT json_extract(data, '$.alert') FROM event WHERE kind = 'alert'");
    assert_eq!(alerts, ["root_unavailable", "root_back"]);
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

#[test]
fn an_invalid_configuration_is_refused_while_the_service_runs() {
    let mission = Mission::new();
    let (service, _) = mission.start();
    mission.wait_for_jobs(2);

    // A configuration that is not valid is refused while the service runs.
    let file = mission.file("areograph.toml");
    let valid = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{valid}\n[nonsense]\n")).unwrap();
    service.signal(Signal::HUP);
    mission.wait_for("a refusal", || {
        mission
            .ask("SELECT data FROM event WHERE kind = 'config' AND data LIKE '%nonsense%'")
            .len()
            == 1
    });
    fs::write(&file, valid).unwrap();
    service.signal(Signal::HUP);
    mission.wait_for("a reload", || {
        let taken =
            "SELECT data FROM event WHERE kind = 'config' AND json_extract(data, '$.taken')";
        mission.ask(taken).len() == 1
    });
    let ended = service.end();
    assert_eq!(ended.code(), Some(0), "{}", mission.log());
}

#[test]
fn whatever_is_killed_each_job_ends_once() {
    let mission = Mission::new();
    let (mut service, _) = mission.start();
    mission.wait_for_jobs(2);
    let kernel = fs::read(mission.file(OWN)).unwrap();
    // The service and its worker are killed by turns, at other moments of a run each time.
    let waits_ms: &[u64] = if long() {
        &[0, 150, 300, 450, 600, 800]
    } else {
        &[300, 600]
    };
    for (kill, &wait_ms) in waits_ms.iter().enumerate() {
        let name = [b'K', b'0' + u8::try_from(kill).unwrap(), b' ', b' '];
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
            let ended = service.0.wait().unwrap();
            assert_eq!(ended.signal(), Some(9));
            (service, _) = mission.start();
        } else {
            let pid: i32 = mission.ask(&begun).remove(0).parse().unwrap();
            // It may have ended by itself.
            let _ = kill_process(Pid::from_raw(pid).unwrap(), Signal::KILL);
        }
        // A worker that was killed is tried again after half a minute: a person can wait less.
        shorten_waiting(&mission);
        mission.wait_for_jobs(3 + kill);
        mission.assert_clean("isidis");
    }
    let doubled = mission.ask("SELECT site FROM run GROUP BY job, attempt HAVING count(*) > 1");
    assert_eq!(doubled, [""; 0]);
    let lost =
        mission.ask("SELECT site FROM job j WHERE NOT EXISTS (SELECT 1 FROM run WHERE job = j.id)");
    assert_eq!(lost, [""; 0], "{}", mission.log());
    assert_eq!(service.end().code(), Some(0));
}

/// Lets jobs that wait go on at once.
pub(crate) fn shorten_waiting(mission: &Mission) {
    let database = Connection::open(mission.file("state/areograph.db")).unwrap();
    database.busy_timeout(Duration::from_secs(5)).unwrap();
    mission.wait_for("the end of an attempt", || {
        let at_work =
            "SELECT site FROM job WHERE state IN ('held', 'queued', 'starting', 'running')";
        mission.ask(at_work).is_empty()
    });
    database
        .execute(
            "UPDATE job SET not_before_ms = 0 WHERE state = 'waiting'",
            [],
        )
        .unwrap();
}

/// The norm of a vector of a JSON document.
fn norm(vector: &serde_json::Value) -> f64 {
    let parts = vector.as_array().unwrap().iter();
    parts
        .map(|part| part.as_f64().unwrap().powi(2))
        .sum::<f64>()
        .sqrt()
}

#[test]
fn the_new_orbit_of_a_demonstration_moves_every_camera_by_its_error() {
    let mission = Mission::new();
    let (service, address) = mission.start();
    mission.wait_for_jobs(2);
    let orbit = "mgs_nav_scene.bsp";
    fs::copy(
        mission.file(&format!("updates/{orbit}")),
        mission.file(&format!("kernels/{orbit}")),
    )
    .unwrap();
    mission.wait_for_jobs(4);
    mission.wait_for("comparisons of the runs", || {
        mission
            .ask("SELECT id FROM run WHERE moved IS NOT NULL")
            .len()
            == 2
    });
    let sentences = mission.ask("SELECT value FROM run, json_each(moved, '$.sentences')");
    let truth = fs::read_to_string(mission.file("truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let profiles = truth["profiles"].as_array().unwrap().iter();
    let of_sites = profiles.filter(|profile| profile["window"] != "gusev_crater");
    let mut compared = 0;
    for profile in of_sites {
        let image = profile["image"].as_str().unwrap();
        let error_m = norm(&profile["orbit_differences"]["nav"]["radial_along_cross_m"]);
        let start = format!("image {image}: moved by ");
        let moved = sentences.iter().find_map(|text| text.strip_prefix(&start));
        let moved = moved.unwrap_or_else(|| panic!("no {start} in {sentences:?}"));
        let moved_m: f64 = moved.split(' ').next().unwrap().parse().unwrap();
        // The truth states the error at the middle of a profile: it varies by less than 0.1 m over a site.
        assert!(
            (moved_m - error_m).abs() < 0.1,
            "{image}: {moved_m} m, {error_m} m"
        );
        compared += 1;
    }
    assert_eq!(compared, 4);
    let run = mission
        .ask("SELECT current_run FROM site WHERE name = 'isidis'")
        .remove(0);
    let page = http_get(&address, &format!("/runs/{run}"));
    assert!(page.contains("moved: cameras by up to"), "{page}");
    assert_eq!(service.end().code(), Some(0), "{}", mission.log());
}

/// The answer to `GET path`.
fn http_get(address: &str, path: &str) -> String {
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}
