//! Nights that begin with files of archives: what a site lacks is fetched, failures are alerts, and the night continues.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use std::{
    fs,
    path::PathBuf,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::common::{
    archive_server::{ArchiveServer, Fault, Listing, write, write_kernels},
    mission::{areograph, succeed},
};

/// The query of the site's window.
const QUERY: &str = "/livegds?query=molapedr&results=v&output=J&minlat=-15.1&maxlat=-14.1&westernlon=175&easternlon=178.2";
const KERNELS: &str = "/naif/dsindex.tab";

/// A service with one site, whose table of shots a service of archives makes.
struct Night {
    folder: tempfile::TempDir,
    server: ArchiveServer,
}

impl Night {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let demo = folder.path().join("demo");
        succeed(areograph().args(["serve", "--init"]).arg(&demo));
        let server = ArchiveServer::of(&folder.path().join("archive"), Listing::Plain);
        let night = Self { folder, server };
        for entry in fs::read_dir(demo.join("sites")).unwrap() {
            fs::remove_file(entry.unwrap().path()).unwrap();
        }
        let leap_seconds = fs::read_dir(demo.join("kernels")).unwrap();
        let leap_seconds = leap_seconds.map(|entry| entry.unwrap().path());
        let leap_seconds = leap_seconds
            .into_iter()
            .find(|path| path.extension().is_some_and(|end| end == "tls"));
        let name = leap_seconds
            .unwrap()
            .file_name()
            .unwrap()
            .to_string_lossy()
            .into_owned();
        let site = format!(
            "site = \"tables\"\nkernels.files = [\"../kernels/{name}\"]\n[[shots]]\nfiles = [\"../pedr/shots/*.csv\"]\n\
             layout = \"ode_pedr\"\n[[windows]]\nid = \"gusev\"\nlongitude_deg = [175.0, 178.2]\nlatitude_deg = [-15.1, -14.1]\n"
        );
        write(&night.path("demo/sites/tables.toml"), site.as_bytes());
        night.configure();
        night.serve();
        night
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    fn configure(&self) {
        let file = self.path("demo/areograph.toml");
        let mut text = fs::read_to_string(&file).unwrap();
        for (from, to) in [
            ("quiet_period_s = 5.0", "quiet_period_s = 0.5"),
            ("scan_interval_s = 2.0", "scan_interval_s = 0.3"),
            ("min_free_mib = 1024", "min_free_mib = 1"),
            ("nightly = \"no\"", "nightly = \"yes\""),
            ("# generic_kernels = ", "generic_kernels = "),
            (
                "# archives = \"archives.toml\"",
                "archives = \"hosts.toml\"",
            ),
        ] {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        fs::write(&file, text).unwrap();
        let url = self.server.url();
        let hosts = format!(
            "[network]\nattempts = 2\npause_s = 0.01\npause_max_s = 1\n[kernels]\nurl = '{url}/naif/'\n[generic]\nurl = '{url}/generic/'\n[pedr]\nurl = '{url}/pedr/'\n\
             folders = ['ap18xxx']\n[images]\nurl = '{url}/moc/'\n[shots]\nurl = '{url}/livegds'\nanswer_s = 20\n"
        );
        write(&self.path("demo/hosts.toml"), hosts.as_bytes());
    }

    /// Indexes, a table of a pass over the window, and the answer that names it.
    fn serve(&self) {
        let root = self.path("archive");
        write_kernels(
            &root.join("naif"),
            &[("LSK", "naif0010.tls", ["", ""], b"text".to_vec())],
        );
        write(&root.join("generic/lsk/naif0012.tls"), b"leap seconds");
        write(&root.join("pedr/ap18xxx/ap18933l.b"), b"shots");
        write(&root.join("moc/mgsc_1578/index/cumindex.tab"), b"\r\n");
        let heading =
            "long_East,lat_North,topography,MOLArange,planet_rad,c,A,Ephermis Time,UTC,Orbit\r\n";
        // 0.1 s and 304 m from shot to shot, as real passes have them.
        let rows = (0..120).map(|row| {
            let along = f64::from(row);
            format!(
                "{:.5},{:.5},{:.2},379838.56,{:.2},1,0,{:.5},1999-03-16T16:41:04.142,10094\r\n",
                176.0 - along * 6.8e-4,
                -14.2 - along * 5.1e-3,
                -1929.58 + along.sin(),
                3_392_380.98 + along.sin(),
                -25_125_471.672_53 + 0.1 * along
            )
        });
        let table = heading.to_owned() + &rows.collect::<String>();
        write(&root.join("output/MolaPEDR_pts_csv.csv"), table.as_bytes());
        let answer = format!(
            r#"{{"GDSResults": {{"Status": "Success", "Count": "120", "ResultFiles": {{"ResultFile": {{"URL":
            "{}/output/MolaPEDR_pts_csv.csv"}}}}}}}}"#,
            self.server.url()
        );
        write(&root.join(&QUERY[1..]), answer.as_bytes());
    }

    fn command(&self) -> Command {
        let mut command = areograph();
        command
            .args(["--quiet", "nightly"])
            .arg(self.path("demo/areograph.toml"));
        command
    }

    fn night(&self) -> String {
        let Output { stdout, stderr, .. } = self.command().output().unwrap();
        String::from_utf8([stdout, stderr].concat()).unwrap()
    }

    fn events(&self, what: &str) -> Vec<String> {
        let database = rusqlite::Connection::open(self.path("demo/state/areograph.db")).unwrap();
        let mut select = database.prepare(what).unwrap();
        let rows = select.query_map([], |row| row.get(0)).unwrap();
        rows.map(|row| row.unwrap()).collect()
    }

    fn alerts(&self) -> Vec<String> {
        self.events(
            "SELECT json_extract(data, '$.alert') FROM event WHERE kind = 'alert' ORDER BY seq",
        )
    }

    fn table(&self) -> PathBuf {
        self.path("demo/pedr/shots/gusev.csv")
    }
}

#[test]
fn a_night_fetches_what_its_sites_lack() {
    let night = Night::new();
    // The archive of kernels does not answer: the night is done without its files.
    night.server.always(KERNELS, Fault::Status(403));
    let words = night.night();
    assert!(
        words.contains("1 site compared, 0 runs, 1 failure"),
        "{words}"
    );
    assert!(!night.table().exists());
    // Generic kernels come from another host.
    assert!(night.path("demo/kernels/generic/naif0012.tls").is_file());
    let alerts = night.alerts();
    assert!(alerts.contains(&"fetch_failed".to_owned()), "{alerts:?}");
    let text = "SELECT json_extract(data, '$.text') FROM event WHERE json_extract(data, '$.alert') = 'fetch_failed'";
    let texts = night.events(text);
    assert!(
        texts[0].contains("indexes: ") && texts[0].contains("HTTP status 403"),
        "{texts:?}"
    );
    assert!(night.server.requests(QUERY).is_empty());
    // The service that makes tables refuses: still wrong, so that no second alert is sent.
    night.server.always(KERNELS, Fault::Slow);
    night.server.always(QUERY, Fault::Page);
    night.night();
    assert_eq!(night.events(text).len(), 1);
    let failures =
        "SELECT json_extract(data, '$.failures') FROM event WHERE kind = 'fetch' ORDER BY seq";
    let failures = night.events(failures);
    assert!(
        failures[1].contains("tables.toml: ") && failures[1].contains("Please sign in"),
        "{failures:?}"
    );
    // All well: fetched before the comparison, and run in the same night.
    night.server.always(QUERY, Fault::Slow);
    let words = night.night();
    let events = night
        .events("SELECT data FROM event WHERE kind IN ('fetch', 'job', 'changed') ORDER BY seq");
    assert!(night.table().is_file(), "{words}{events:?}");
    assert!(
        words.contains("1 site compared, 1 run, "),
        "{words}{events:?}"
    );
    let alerts = night.alerts();
    let of_fetch = alerts
        .iter()
        .filter(|alert| *alert == "fetch_failed")
        .count();
    assert!(
        of_fetch == 1 && alerts.contains(&"recovered".to_owned()),
        "{alerts:?}"
    );
    let before = night.server.requests(QUERY).len();
    let words = night.night();
    assert!(words.contains("1 site compared, 0 runs, "), "{words}");
    assert_eq!(
        night.server.requests(QUERY).len(),
        before,
        "nothing is missing"
    );
}

/// A stop does not wait for an archive.
#[test]
fn a_stopped_night_ends_its_fetch() {
    let night = Night::new();
    night.server.always(QUERY, Fault::Hangs);
    let mut child: Child = night
        .command()
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while night.server.requests(QUERY).is_empty() {
        assert!(
            start.elapsed() < Duration::from_mins(1),
            "the query is asked for"
        );
        assert!(
            child.try_wait().unwrap().is_none(),
            "the night waits for it"
        );
        thread::sleep(Duration::from_millis(20));
    }
    let stop = Instant::now();
    let interrupt = Command::new("kill")
        .arg("-INT")
        .arg(child.id().to_string())
        .status();
    assert!(interrupt.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    // Below the limit of an answer, 20 s.
    assert!(
        stop.elapsed() < Duration::from_secs(15),
        "{:?}",
        stop.elapsed()
    );
}
