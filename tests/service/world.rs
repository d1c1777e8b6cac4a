//! A service with a filled database, answering over loopback as the real one does.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use std::{
    fs,
    io::{Read as _, Write as _},
    net::{Shutdown, SocketAddr, TcpStream},
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use areograph::{
    config::{Document as _, ServiceConfig},
    service::{
        clock::Clock,
        database::Database,
        http::serve,
        shared::Shared,
        tokens::{Role, add_token, revoke_token},
    },
    store::manifest::{
        Complaints, ConfigurationEntry, KernelEntry, Manifest, ProductEntry, Verdict,
    },
};
use rusqlite::params;
use tokio::{net::TcpListener, runtime::Runtime};

/// 2026-03-01 02:30 UTC.
pub(crate) const NOW_MS: i64 = 1_772_332_200_000;
/// The current run of the site alpha.
pub(crate) const RUN: &str = "20260301_010000_j2_a1";
/// The run before it.
pub(crate) const BEFORE: &str = "20260228_010000_j1_a1";
/// BLAKE3 of a kernel.
pub(crate) const KERNEL: &str = "00000000000000000000000000000000000000000000000000000000000000ab";

/// Tokens of the test.
#[allow(dead_code, reason = "each test program uses a part")]
pub(crate) struct Tokens {
    pub(crate) read: String,
    pub(crate) operate: String,
    pub(crate) expired: String,
    pub(crate) revoked: String,
}

/// A service that answers until it is dropped.
pub(crate) struct World {
    pub(crate) folder: tempfile::TempDir,
    pub(crate) shared: Arc<Shared>,
    pub(crate) clock: Clock,
    pub(crate) address: SocketAddr,
    pub(crate) tokens: Tokens,
    runtime: Option<Runtime>,
}

impl World {
    /// With further lines in the table `[http]`.
    pub(crate) fn with(http: &str) -> Self {
        Self::at("127.0.0.1:0", http, NOW_MS)
    }

    pub(crate) fn new() -> Self {
        Self::with("")
    }

    pub(crate) fn at(address: &str, http: &str, now_ms: i64) -> Self {
        let folder = tempfile::Builder::new()
            .prefix("areograph-secret-place-")
            .tempdir()
            .unwrap();
        for name in ["sites", "kernels", "data", "products", "state/logs"] {
            fs::create_dir_all(folder.path().join(name)).unwrap();
        }
        let text = format!(
            "[inputs]\nsites = [\"sites\"]\nkernels = [\"kernels\"]\ndata = [\"data\"]\n[outputs]\n[schedule]\nzone = \
             \"Europe/Berlin\"\n[workers]\nmin_free_mib = 0\n[http]\n{http}\n"
        );
        let config = ServiceConfig::parse(&text, &folder.path().join("areograph.toml"))
            .unwrap()
            .config;
        let database = Database::open(&folder.path().join("state")).unwrap();
        let clock = Clock::set_to(now_ms);
        let program = PathBuf::from(env!("CARGO_BIN_EXE_areograph"));
        let shared = Shared::new(config, database, clock.clone(), program).unwrap();
        let shared = Arc::new(shared);
        let tokens = tokens(&shared);
        fill(&shared, folder.path());
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .unwrap();
        let listener = runtime.block_on(TcpListener::bind(address)).unwrap();
        let address = listener.local_addr().unwrap();
        runtime.spawn(serve(listener, Arc::clone(&shared)));
        Self {
            folder,
            shared,
            clock,
            address,
            tokens,
            runtime: Some(runtime),
        }
    }

    /// A path of the service's machine.
    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    pub(crate) fn sql(&self, text: &str) {
        self.shared
            .write(|transaction| Ok(transaction.execute_batch(text)?))
            .unwrap();
    }

    pub(crate) fn number(&self, text: &str) -> i64 {
        self.shared
            .read(|connection| Ok(connection.query_row(text, [], |row| row.get(0))?))
            .unwrap()
    }

    /// Sends `GET path`.
    pub(crate) fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[], "")
    }

    /// Sends a request with the right host and further header lines.
    pub(crate) fn request(&self, method: &str, path: &str, headers: &[&str], body: &str) -> Answer {
        let mut text = format!(
            "{method} {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n",
            self.address
        );
        for header in headers {
            text.push_str(header.as_ref());
            text.push_str("\r\n");
        }
        if !body.is_empty() || method == "POST" || method == "PATCH" {
            let length = body.len().to_string();
            text.extend(["Content-Length: ", &length, "\r\n"]);
        }
        self.raw(format!("{text}\r\n{body}").as_bytes())
    }

    /// The same by a client with the token that may operate.
    pub(crate) fn operate(&self, method: &str, path: &str, headers: &[&str], body: &str) -> Answer {
        let token = format!("Authorization: Bearer {}", self.tokens.operate);
        let mut all = vec![&*token, "Content-Type: application/json"];
        all.extend_from_slice(headers);
        self.request(method, path, &all, body)
    }

    /// Sends these bytes, and takes everything that comes back within 15 s.
    pub(crate) fn raw(&self, bytes: &[u8]) -> Answer {
        let mut stream = self.connect();
        // A service that refuses early closes while we still write.
        let _ = stream.write_all(bytes);
        Answer::of(&mut stream)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(15)))
            .unwrap();
        stream
            .set_write_timeout(Some(Duration::from_secs(15)))
            .unwrap();
        stream
    }

    /// Ends the service in order, and says how long that took.
    pub(crate) fn end(&mut self) -> Duration {
        let began = std::time::Instant::now();
        self.shared.ending.cancel();
        while TcpStream::connect(self.address).is_ok() {
            std::thread::sleep(Duration::from_millis(10));
        }
        let runtime = self.runtime.take().unwrap();
        runtime.shutdown_timeout(Duration::from_secs(15));
        began.elapsed()
    }
}

impl Drop for World {
    fn drop(&mut self) {
        self.shared.ending.cancel();
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// An answer as it came.
#[derive(Debug)]
pub(crate) struct Answer {
    /// 0 when the connection ended without an answer.
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn of(stream: &mut TcpStream) -> Self {
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        let _ = stream.shutdown(Shutdown::Both);
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n");
        let (head, body) = bytes.split_at(end.map_or(bytes.len(), |end| end + 4));
        let head = String::from_utf8_lossy(head).into_owned();
        let status = head
            .split(' ')
            .nth(1)
            .and_then(|status| status.parse().ok());
        let chunked = head.to_lowercase().contains("transfer-encoding: chunked");
        let body = if chunked { joined(body) } else { body.to_vec() };
        Self {
            status: status.unwrap_or(0),
            body,
            head,
        }
    }

    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let lines = self.head.lines();
        let mut named = lines.filter_map(|line| line.split_once(": "));
        let found = named.find(|(given, _)| given.eq_ignore_ascii_case(name));
        found.map(|(_, value)| value)
    }

    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub(crate) fn json(&self) -> serde_json::Value {
        let text = self.text();
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {}{text}", self.head))
    }
}

/// The content of chunks.
fn joined(mut body: &[u8]) -> Vec<u8> {
    let mut all = Vec::new();
    while let Some(end) = body.windows(2).position(|two| two == b"\r\n") {
        let size = std::str::from_utf8(&body[..end]).unwrap_or_default();
        let size = usize::from_str_radix(size, 16).unwrap_or(0);
        let start = end + 2;
        if size == 0 || body.len() < start + size {
            break;
        }
        all.extend_from_slice(&body[start..start + size]);
        body = &body[(start + size + 2).min(body.len())..];
    }
    all
}

fn tokens(shared: &Shared) -> Tokens {
    let now_ms = shared.now_ms();
    let add = |role, expires_ms| {
        shared
            .write(|transaction| add_token(transaction, now_ms - 1000, role, "test", expires_ms))
            .unwrap()
    };
    let revoked = add(Role::Operate, None);
    let id = revoked.split('_').nth(1).unwrap();
    shared
        .write(|transaction| revoke_token(transaction, now_ms - 500, id))
        .unwrap();
    Tokens {
        read: add(Role::Read, None),
        operate: add(Role::Operate, Some(now_ms + 86_400_000 * 30)),
        expired: add(Role::Operate, Some(now_ms - 1)),
        revoked,
    }
}

/// Writes a product and tells its entry of the manifest.
fn put(folder: &Path, path: &str, content: &str) -> ProductEntry {
    let file = folder.join(path);
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&file, content).unwrap();
    ProductEntry {
        path: path.to_owned(),
        bytes: content.len() as u64,
        blake3: blake3::hash(content.as_bytes()).to_hex().to_string(),
        rows: content.lines().count() as u64,
    }
}

/// A run on the disk; gives the BLAKE3 of its manifest.
fn publish(products: &Path, site: &str, run: &str, valid: bool) -> String {
    let folder = products.join(site).join("runs").join(run);
    fs::create_dir_all(&folder).unwrap();
    let page = "<!DOCTYPE html><html lang=\"en\"><title>Report</title><h1>Report</h1>";
    let mut products = vec![
        put(&folder, "report/index.html", page),
        put(
            &folder,
            "tables/footprints.csv",
            &"orbit,shot,range_m\n10001,1,400000.25\n".repeat(500),
        ),
        put(&folder, "damaged.json", "{}"),
    ];
    // Longer than its entry says, and a product that a link leads out with.
    fs::write(folder.join("damaged.json"), "{\"longer\": true}").unwrap();
    let link = ProductEntry {
        path: "link.csv".to_owned(),
        bytes: 10,
        blake3: "0".repeat(64),
        rows: 1,
    };
    symlink("/etc/passwd", folder.join("link.csv")).unwrap();
    symlink("/etc", folder.join("etc")).unwrap();
    products.push(link.clone());
    products.push(ProductEntry {
        path: "etc/passwd".to_owned(),
        ..link.clone()
    });
    products.push(ProductEntry {
        path: "../../../../areograph.toml".to_owned(),
        ..link.clone()
    });
    products.push(ProductEntry {
        path: "/etc/passwd".to_owned(),
        ..link
    });
    let kernel = |name: &str, role: &str, digit: char| KernelEntry {
        name: name.to_owned(),
        role: role.to_owned(),
        bytes: 1000,
        blake3: digit.to_string().repeat(64),
        coverage_used: Vec::new(),
    };
    let manifest = Manifest {
        tool: "areograph".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        site: site.to_owned(),
        verdict: Verdict {
            valid,
            reasons: Vec::new(),
            remarks: Vec::new(),
            untested: Vec::new(),
            checks: Vec::new(),
        },
        configuration: ConfigurationEntry {
            file_name: format!("{site}.toml"),
            blake3: "1".repeat(64),
            keys: std::collections::BTreeMap::default(),
        },
        biases: Vec::new(),
        kernels: vec![
            kernel("naif0012.tls", "lsk", '1'),
            kernel("mgs_sc_ext1.bc", "ck", '2'),
        ],
        kernel_choice: Vec::new(),
        stages: Vec::new(),
        products,
        counts: std::collections::BTreeMap::default(),
        figures: std::collections::BTreeMap::default(),
        rejected: std::collections::BTreeMap::default(),
        complaints: Complaints {
            count: 0,
            texts: Vec::new(),
        },
        notes: Vec::new(),
        finished_utc: "2026-03-01T01:00:00Z".to_owned(),
    };
    let text = serde_json::to_string_pretty(&manifest).unwrap();
    fs::write(folder.join("manifest.json"), &text).unwrap();
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

const RUNS: &str = "INSERT INTO run (id, site, job, attempt, version, manifest_blake3, valid, verdict, reasons, because, stages,
    counts, figures, kernels, predecessor, moved, published_ms)
    VALUES (?1, ?2, ?3, 1, '0.1.0', ?4, ?5, ?6, ?7, '[\"mgs_sc_ext1.bc changed\"]', ?8, '{\"footprints\": 500}', ?9, ?10, ?11, ?12, ?13)";

struct RunRow<'a> {
    id: &'a str,
    site: &'a str,
    job: i64,
    valid: bool,
    verdict: &'a str,
    range_mean_m: f64,
    ck: char,
    predecessor: Option<&'a str>,
    moved: Option<&'a str>,
    age_ms: i64,
}

fn add_run(shared: &Shared, products: &Path, row: &RunRow<'_>) {
    let manifest = publish(products, row.site, row.id, row.valid);
    let reasons = if row.valid {
        "[]"
    } else {
        "[\"profile 10001: mean of range residuals is 83 m, limit 50 m\"]"
    };
    let stages = "[{\"stage\": \"sample_orientation/E02-01453\", \"runs\": true, \"because\": \"mgs_sc_ext1.bc changed\"}, \
                  {\"stage\": \"search_footprints\", \"runs\": false, \"because\": \"nothing changed\"}]";
    let figures = format!(
        "{{\"range_mean_m\": {}, \"position_rmse_m\": 0.0213, \"along_track_parallax_m\": {}}}",
        row.range_mean_m,
        row.range_mean_m * 3.0
    );
    let kernels = format!(
        "[{{\"name\": \"naif0012.tls\", \"role\": \"lsk\", \"blake3\": \"{}\"}}, {{\"name\": \"mgs_sc_ext1.bc\", \"role\": \"ck\", \"blake3\": \"{}\"}}]",
        "1".repeat(64),
        row.ck.to_string().repeat(64)
    );
    shared
        .write(|transaction| {
            Ok(transaction.execute(
                RUNS,
                params![
                    row.id,
                    row.site,
                    row.job,
                    manifest,
                    row.valid,
                    row.verdict,
                    reasons,
                    stages,
                    figures,
                    kernels,
                    row.predecessor,
                    row.moved,
                    shared.now_ms() - row.age_ms
                ],
            )?)
        })
        .unwrap();
}

/// Three sites as a week of work leaves them.
fn fill(shared: &Shared, folder: &Path) {
    let products = folder.join("products");
    let root = |name: &str| folder.join(name).display().to_string();
    let (now_ms, hour_ms) = (shared.now_ms(), 3_600_000);
    let kernels = root("kernels");
    let text = format!(
        "INSERT INTO root (path, kind, device, files, state, since_ms, detail) VALUES ('{kernels}', 'kernels', 1, 2, 'available', {since}, '');
         INSERT INTO root (path, kind, device, files, state, since_ms, detail) VALUES ('{}', 'data', 1, 9, 'available', {since}, '');
         INSERT INTO site (name, file, config_blake3, enabled, problem, current_run, checked_ms, current_since_ms, stale_since_ms, stale_because, last_note, west_deg, south_deg, east_deg, north_deg) VALUES ('alpha', '{sites}/alpha.toml', 'c', 1, NULL, '{RUN}', {checked}, {since}, NULL, NULL,
           'checked, nothing changed', 350.5, -2.0, 2.5, 1.0);
         INSERT INTO site (name, file, config_blake3, enabled, problem, current_run, checked_ms, current_since_ms, stale_since_ms, stale_because, last_note, west_deg, south_deg, east_deg, north_deg) VALUES ('beta', '{sites}/beta.toml', 'c', 1, NULL, '20260227_010000_j3_a1', {checked}, {since}, {checked},
           '{kernels}/mgs_sc_ext1.bc changed; waiting for the quiet period', NULL, 120.0, 20.0, 121.0, 22.0);
         INSERT INTO site (name, file, config_blake3, enabled, problem, current_run, checked_ms, current_since_ms, stale_since_ms, stale_because, last_note, west_deg, south_deg, east_deg, north_deg) VALUES ('gamma', '{sites}/gamma.toml', 'c', 1, NULL, NULL, NULL, NULL, NULL, NULL, NULL, 250.0, -60.0, 252.0, -58.0);
         INSERT INTO site (name, file, config_blake3, enabled, problem, current_run, checked_ms, current_since_ms, stale_since_ms, stale_because, last_note, west_deg, south_deg, east_deg, north_deg) VALUES ('retired', '{sites}/retired.toml', 'c', 0, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL);
         INSERT INTO night (id, due_ms, zone, started_ms, ended_ms, how, sites_checked, runs, failures) VALUES (1, {night}, 'Europe/Berlin', {night}, {night} + 60000, 'due', 3, 2, 1);
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (1, 'alpha', 'succeeded', 1, 1, 0, 0, 0, 0, 1, NULL, {since}, {since}, {since}, '{{\"text\": \"published\"}}');
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (2, 'alpha', 'succeeded', 2, 1, 0, 0, 0, 0, 1, NULL, {checked}, {checked}, {checked}, '{{\"text\": \"published\"}}');
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (3, 'beta', 'succeeded', 1, 1, 0, 0, 0, 0, 1, NULL, {since}, {since}, {since}, NULL);
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (4, 'beta', 'running', 2, 1, 0, 0, 0, 0, NULL, NULL, {checked}, {checked}, NULL, NULL);
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (5, 'beta', 'queued', 2, 0, 0, 0, 0, 0, NULL, NULL, {checked}, {checked}, NULL, NULL);
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (6, 'gamma', 'blocked', 2, 1, 1, 0, 0, 0, 1, NULL, {checked}, {checked}, NULL,
           '{{\"text\": \"{kernels}/mgs_sc_ext1.bc does not cover image E02-01453\"}}');
         INSERT INTO job (id, site, state, priority, attempt, failures, not_before_ms, force, cancel_asked, night, asked_by, created_ms, changed_ms, ended_ms, outcome) VALUES (7, 'gamma', 'failed', 2, 3, 3, 0, 0, 0, NULL, NULL, {checked}, {checked}, {checked}, '{{\"text\": \"crashed at stage register\"}}');
         INSERT INTO cause (job, kind, path, old_blake3, new_blake3, detail, at_ms) VALUES (4, 'kernel_changed', '{kernels}/mgs_sc_ext1.bc', '{a}', '{b}', 'its coverage overlaps image E02-01453', {checked});
         INSERT INTO attempt (job, n, pid, pid_start, boot_id, started_ms, beat_ms, rss_kib, stage, done, of, unit, ended_ms, how, exit, signal, log) VALUES (4, 1, 4711, 1, 'boot', {checked}, {checked}, 58000, 'register/E02-01453', 7, 20, 'stages', NULL, NULL, NULL, NULL, 'logs/4-1.log');
         INSERT INTO attempt (job, n, pid, pid_start, boot_id, started_ms, beat_ms, rss_kib, stage, done, of, unit, ended_ms, how, exit, signal, log) VALUES (7, 3, 4712, 1, 'boot', {checked}, {checked}, 58000, 'register', NULL, NULL, NULL, {checked}, 'ended by signal 11', NULL, 11, '/etc/passwd');
         INSERT INTO file_version (path, device, inode, size, mtime_ns, ctime_ns, blake3, first_seen_ms, changed_ms, checked_ms, state, detail) VALUES ('{kernels}/ck/mgs_sc_ext1.bc', 1, 2, 1000000, 1, 1, '{KERNEL}', {since}, {checked}, {checked}, 'ready', '');
         INSERT INTO file_version (path, device, inode, size, mtime_ns, ctime_ns, blake3, first_seen_ms, changed_ms, checked_ms, state, detail) VALUES ('{kernels}/naif0012.tls', 1, 3, 5000, 1, 1, '{b}', {since}, {since}, {checked}, 'ready', '');
         INSERT INTO file_version (path, device, inode, size, mtime_ns, ctime_ns, blake3, first_seen_ms, changed_ms, checked_ms, state, detail) VALUES ('{data}/ap10001l.b', 1, 4, 5000, 1, 1, '{a}', {since}, {since}, {checked}, 'ready', '');
         INSERT INTO kernel_coverage VALUES ('{KERNEL}', '{{\"position\": [{{\"start\": -3.0e7, \"stop\": 1.0e7}}],
           \"attitude\": [{{\"start\": -3.0e7, \"stop\": -1.0e7}}, {{\"start\": -0.9e7, \"stop\": 1.0e7}}]}}');
         INSERT INTO site_input VALUES ('alpha', '{kernels}/ck/mgs_sc_ext1.bc', 'kernel', '{KERNEL}');
         INSERT INTO site_input VALUES ('beta', '{kernels}/ck/mgs_sc_ext1.bc', 'kernel', '{KERNEL}');
         INSERT INTO event (at_ms, kind, site, job, run, data) VALUES ({since}, 'job', 'alpha', 1, NULL, '{{\"state\": \"succeeded\"}}');
         INSERT INTO event (at_ms, kind, site, job, run, data) VALUES ({checked}, 'run', 'alpha', 2, '{RUN}', '{{\"file\": \"{kernels}/naif0012.tls\"}}');",
        root("data"),
        sites = root("sites"),
        data = root("data"),
        since = now_ms - 24 * hour_ms,
        checked = now_ms - hour_ms,
        night = now_ms - 25 * hour_ms,
        a = "a".repeat(64),
        b = "b".repeat(64),
    );
    shared
        .write(|transaction| Ok(transaction.execute_batch(&text)?))
        .unwrap();
    let log = "{\"level\":\"info\",\"message\":\"register E02-01453\"}\n".repeat(3)
        + "<script>alert(1)</script>\n";
    fs::write(folder.join("state/logs/4-1.log"), log).unwrap();
    let first = RunRow {
        id: BEFORE,
        site: "alpha",
        job: 1,
        valid: true,
        verdict: "valid",
        range_mean_m: 12.5,
        ck: '2',
        predecessor: None,
        moved: None,
        age_ms: 24 * hour_ms,
    };
    let moved = "{\"headline\": \"Footprints moved by at most 31 m\", \"sentences\": [\"31 m in profile 10001\"], \"beyond_limit\": false}";
    let second = RunRow {
        id: RUN,
        job: 2,
        verdict: "valid with remarks",
        range_mean_m: 14.25,
        ck: '3',
        predecessor: Some(BEFORE),
        moved: Some(moved),
        age_ms: hour_ms,
        ..first
    };
    let third = RunRow {
        id: "20260227_010000_j3_a1",
        site: "beta",
        job: 3,
        ..first
    };
    let refused = RunRow {
        id: "20260301_000000_j7_a3",
        site: "gamma",
        job: 7,
        valid: false,
        verdict: "INVALID",
        range_mean_m: 83.0,
        ..first
    };
    for row in [&first, &second, &third, &refused] {
        add_run(shared, &products, row);
    }
}
