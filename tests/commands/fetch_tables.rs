//! Tables of shots that a service makes: asked for by window, received whole or not at all, refused with the service's reason.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests work in temporary folders and may fail loudly"
)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::common::{
    self,
    archive_server::{ArchiveServer, Fault, Listing, write},
    json,
    mission::areograph,
};

const HEADING: &str = "long_East,lat_North,topography, MOLArange,  planet_rad, c,A,  Ephermis Time,            UTC,          Orbit\r\n";
/// Boxes of the windows of the site: west, east, south, north.
const GUSEV: [&str; 4] = ["175", "178.2", "-15.1", "-14.1"];
const TO_ZERO: [&str; 4] = ["359", "360", "0", "1"];
const FROM_ZERO: [&str; 4] = ["0", "1", "0", "1"];

/// Rows like the first ones of real tables, along a pass to the south.
fn table(longitude_deg: f64, latitude_deg: f64, count: u32) -> String {
    let heights = if latitude_deg < -10.0 {
        "   -1929.58, 379838.56,  3392380.98"
    } else {
        "   -1176.10, 384716.33,  3394456.04"
    };
    let rows = (0..count).map(|row| {
        let along = f64::from(row);
        format!(
            "{:09.5},{:9.5},{heights},1,0,{:17.5},1999-03-16T16:41:04.142, 10094\r\n",
            longitude_deg - along * 1e-6,
            latitude_deg - along * 1e-5,
            -25_125_471.672_53 + 0.1 * along
        )
    });
    HEADING.to_owned() + &rows.collect::<String>()
}

/// A service with its answers and tables, and a site of two windows, one of them over 0°.
struct Service {
    folder: tempfile::TempDir,
    server: ArchiveServer,
}

impl Service {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let server = ArchiveServer::of(&folder.path().join("archive"), Listing::Plain);
        let service = Self { folder, server };
        let hosts = format!(
            "[network]\nconnect_s = 2\nread_s = 1\nattempts = 3\npause_s = 0.01\npause_max_s = 1\n[shots]\nurl = '{}/livegds'\n\
             answer_s = 20\n",
            service.server.url()
        );
        write(&service.path("hosts.toml"), hosts.as_bytes());
        service.site("[\"shots/*.csv\"]");
        service
    }

    fn site(&self, files: &str) {
        let text = format!(
            "site = \"gusev\"\n[kernels]\nroot = \"kernels\"\n[[shots]]\nfiles = {files}\nlayout = \"ode_pedr\"\n[[windows]]\n\
             id = \"gusev\"\nlongitude_deg = [175.0, 178.2]\nlatitude_deg = [-15.1, -14.1]\n[[windows]]\nid = \"zero\"\n\
             longitude_deg = [-1, 1]\nlatitude_deg = [0, 1]\n"
        );
        write(&self.path("mars/gusev.toml"), text.as_bytes());
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    /// Path and query of a request.
    fn query(edges: [&str; 4]) -> String {
        let [west, east, south, north] = edges;
        format!(
            "/livegds?query=molapedr&results=v&output=J&minlat={south}&maxlat={north}&westernlon={west}&easternlon={east}"
        )
    }

    /// Prepares the answer to the query of a box.
    fn answers(&self, edges: [&str; 4], answer: &str) {
        let path = self.path("archive").join(&Self::query(edges)[1..]);
        write(&path, answer.as_bytes());
    }

    /// Prepares a table and the answer that names it; the path of the table.
    fn makes(&self, edges: [&str; 4], stamp: &str, table: &str, count: &str) -> String {
        let path = format!("/output/{stamp}/MolaPEDR_{stamp}_pts_csv.csv");
        write(&self.path("archive").join(&path[1..]), table.as_bytes());
        let topography = path.replace("_pts_", "_topo_");
        let [url, topography] = [&path, &topography]
            .map(|path| format!("{{\"URL\": \"{}{path}\"}}", self.server.url()));
        self.answers(
            edges,
            &format!(
                r#"{{"GDSResults": {{"Status": "Success", {count} "StateSummary": {{"State": "Finished", "StatusNote": "Finished"}},
                "ResultFiles": {{"ResultFile": [{topography}, {url}]}}}}}}"#
            ),
        );
        path
    }

    /// All tables of the site.
    fn makes_all(&self) {
        self.makes(
            GUSEV,
            "1",
            &table(176.0, -14.2, 3_000),
            "\"Count\": \"3000\",",
        );
        self.makes(TO_ZERO, "2", &table(359.5, 0.9, 10), "\"Count\": 10,");
        self.makes(FROM_ZERO, "3", &table(0.5, 0.9, 20), "");
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = areograph();
        command.arg("fetch").args(arguments);
        command.arg("--archives").arg(self.path("hosts.toml"));
        command
    }

    fn of_site(&self, more: &[&str]) -> Output {
        let site = self.path("mars/gusev.toml");
        let site = site.to_string_lossy();
        let arguments = [&[&*site, "--only", "shots"], more].concat();
        self.command(&arguments).output().unwrap()
    }

    /// Standard output for the site.
    fn fetched(&self, more: &[&str]) -> String {
        let output = self.of_site(more);
        let [out, err] = texts(&output);
        assert!(
            output.status.success(),
            "{more:?}: {}\n{out}{err}",
            output.status
        );
        out
    }

    /// A command for the box of Gusev alone.
    fn of_box(&self) -> Command {
        let into = self.path("mars");
        let edges = GUSEV.join(",");
        self.command(&["--into", &into.to_string_lossy(), "--box", &edges])
    }

    fn table_of_box(&self) -> PathBuf {
        self.path("mars/shots/box_175_178.2_-15.1_-14.1.csv")
    }

    /// The table of the box is refused, and nothing of it is left.
    fn refuses(&self, what: &str, code: i32, expected: &str) {
        let output = self.of_box().output().unwrap();
        let [_, err] = texts(&output);
        assert!(err.contains(expected), "{what}: {err}");
        assert!(err.contains("what to do: "), "{what}: {err}");
        assert_eq!(output.status.code(), Some(code), "{what}: {err}");
        assert!(!self.table_of_box().exists(), "{what}");
        assert!(self.left().is_empty(), "{what}: {:?}", self.left());
    }

    /// Parts and answers that are left.
    fn left(&self) -> Vec<String> {
        let entries = fs::read_dir(self.path("mars/.fetch/parts"))
            .into_iter()
            .flatten();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.collect()
    }
}

fn texts(output: &Output) -> [String; 2] {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8(text.clone()).unwrap())
}

#[test]
fn windows_become_tables() {
    let service = Service::new();
    let planned = service.fetched(&["--plan"]);
    for (edges, name) in [(GUSEV, "gusev"), (TO_ZERO, "zero_1"), (FROM_ZERO, "zero_2")] {
        let [west, east, south, north] = edges;
        let query = format!("{}{}", service.server.url(), Service::query(edges));
        let why = format!("{west} to {east} east, {south} to {north} north");
        for expected in [
            &query,
            &why,
            &format!("shots/{name}.csv: missing, size unknown"),
        ] {
            assert!(planned.contains(expected), "{expected} in {planned}");
        }
    }
    assert_eq!(service.server.request_count(), 0, "a plan asks no service");
    service.makes_all();
    let out = service.fetched(&[]);
    assert!(out.contains("fetched: 3; present: 0; failed: 0"), "{out}");
    let made = [("gusev", 1), ("zero_1", 2), ("zero_2", 3)].map(|(name, stamp)| {
        let made = format!("/output/{stamp}/MolaPEDR_{stamp}_pts_csv.csv");
        let original = fs::read(service.path("archive").join(&made[1..])).unwrap();
        let path = service.path(&format!("mars/shots/{name}.csv"));
        assert!(fs::read(&path).unwrap() == original, "{name}");
        (name, made)
    });
    assert!(service.left().is_empty(), "{:?}", service.left());
    let state = json(&service.path("mars/fetch.json"))["files"].clone();
    for (name, made) in made {
        let record = &state[format!("shots/{name}.csv")];
        assert_eq!(record["verified_by"], "rows");
        let address = service.server.url() + &made;
        assert_eq!(record["made_url"], address);
        assert!(
            record["url"]
                .as_str()
                .unwrap()
                .contains("/livegds?query=molapedr&")
        );
    }
    // A second time nothing is asked; plan, audit and verification know the tables.
    let before = service.server.request_count();
    assert!(
        service
            .fetched(&[])
            .contains("fetched: 0; present: 3; failed: 0")
    );
    assert!(service.fetched(&["--plan"]).ends_with("not present: 0\n"));
    let audit = service.fetched(&["--audit"]);
    assert!(
        audit.contains("missing: 0; differ: 0; not needed: 0; not fetched by areograph: 0"),
        "{audit}"
    );
    assert!(service.fetched(&["--verify"]).contains("fetched: 3"));
    assert_eq!(service.server.request_count(), before);
    // One that is missing again is asked for, although the glob finds others.
    fs::remove_file(service.path("mars/shots/zero_2.csv")).unwrap();
    assert!(
        service
            .fetched(&[])
            .contains("fetched: 1; present: 2; failed: 0")
    );
    // The site reads what was fetched.
    let mut info = areograph();
    info.args(["pedr", "info"])
        .arg(service.path("mars/shots/gusev.csv"));
    let info = info.output().unwrap();
    assert!(info.status.success(), "{}", texts(&info)[1]);
    assert!(texts(&info)[0].contains("3000"), "{}", texts(&info)[0]);
}

/// A part of a window may be empty, a window may not.
#[test]
fn an_empty_part_of_a_window_has_a_table_without_rows() {
    let service = Service::new();
    let none = r#"{"GDSResults": {"Status": "Success", "Count": "0"}}"#;
    service.makes_all();
    service.answers(FROM_ZERO, none);
    let out = service.fetched(&[]);
    assert!(out.contains("fetched: 3; present: 0; failed: 0"), "{out}");
    assert!(
        out.contains("zero_2.csv: written without rows: the service has no shot in this part"),
        "{out}"
    );
    let empty = service.path("mars/shots/zero_2.csv");
    let counted = areograph().args(["pedr", "info"]).arg(&empty).output();
    let [counted, _] = texts(&counted.unwrap());
    let is_zero = |line: &str| line.split_whitespace().eq(["rows", "0"]);
    assert!(counted.lines().any(is_zero), "{counted}");
    let before = service.server.request_count();
    assert!(
        service
            .fetched(&[])
            .contains("fetched: 0; present: 3; failed: 0")
    );
    assert_eq!(service.server.request_count(), before);
    // A window of another site with the same name is another window, and may not be empty.
    let site = fs::read_to_string(service.path("mars/gusev.toml")).unwrap();
    let (head, _) = site.split_once("[[windows]]").unwrap();
    let other = head
        .replace("site = \"gusev\"", "site = \"other\"")
        .replace("shots/", "others/")
        + "[[windows]]\nid = \"zero\"\nlongitude_deg = [0.0, 1.0]\nlatitude_deg = [0.0, 1.0]\n";
    assert_ne!(head, other);
    write(&service.path("mars/other.toml"), other.as_bytes());
    let both = ["gusev.toml", "other.toml"].map(|name| service.path("mars").join(name));
    let both = both.each_ref().map(|path| path.to_string_lossy());
    let mut command = service.command(&[&*both[0], &*both[1], "--only", "shots"]);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", texts(&output)[1]);
    assert!(!service.path("mars/others/zero.csv").exists());
    // Now both parts are empty.
    for name in ["zero_1.csv", "zero_2.csv"] {
        fs::remove_file(service.path("mars/shots").join(name)).unwrap();
    }
    service.answers(TO_ZERO, none);
    let output = service.of_site(&[]);
    assert_eq!(output.status.code(), Some(4), "{}", texts(&output)[1]);
    assert!(texts(&output)[1].contains("the service has no shot in this box"));
    assert!(!empty.exists());
}

#[test]
fn tables_of_a_user_are_not_asked_for() {
    let service = Service::new();
    service.makes_all();
    write(
        &service.path("mars/shots/own.csv"),
        table(176.0, -14.2, 5).as_bytes(),
    );
    assert!(
        service
            .fetched(&[])
            .contains("fetched: 0; present: 0; failed: 0")
    );
    service.site("[\"shots/gusev.csv\", \"shots/zero_1.csv\", \"shots/zero_2.csv\"]");
    let own = table(176.0, -14.2, 7);
    write(&service.path("mars/shots/gusev.csv"), own.as_bytes());
    assert!(
        service
            .fetched(&[])
            .contains("fetched: 2; present: 0; failed: 0")
    );
    assert_eq!(
        fs::read_to_string(service.path("mars/shots/gusev.csv")).unwrap(),
        own
    );
    // A name that suits no window.
    service.site("[\"shots/all.csv\"]");
    let output = service.of_site(&[]);
    let err = &texts(&output)[1];
    assert_eq!(output.status.code(), Some(2), "{err}");
    assert!(
        err.contains("shots/gusev.csv, ") && err.contains("what to do: write a glob"),
        "{err}"
    );
}

/// A query without a table: answers of the service, and addresses that are not fetched from.
#[test]
fn refusals_quote_the_service() {
    let service = Service::new();
    let status = |more: &str| format!(r#"{{"GDSResults": {{"Status": "Success", {more}}}}}"#);
    let result = |url: &str| {
        status(&format!(
            r#""ResultFiles": {{"ResultFile": {{"URL": "{url}"}}}}"#
        ))
    };
    for (answer, code, expected) in [
        (
            "<html><title>Down</title></html>".to_owned(),
            6,
            "a web page came: Down",
        ),
        (
            r#"{"GDSResults": {"Status": "ERROR", "Error": "Area too large"}}"#.to_owned(),
            6,
            "the service returned no table: ERROR: Area too large",
        ),
        (
            status(r#""JobId": "55117""#),
            6,
            "to job 55117; expected the table in the answer",
        ),
        (
            "Server too busy".to_owned(),
            6,
            "its answer is not JSON: Server too busy",
        ),
        (
            status(r#""Count": "0""#),
            4,
            "the service has no shot in this box",
        ),
        (
            result("file:///etc/passwd_pts_csv.csv"),
            6,
            "is not followed",
        ),
        (
            result("http://a.org/a_pts_csv.csv"),
            6,
            "is not followed: expected https",
        ),
    ] {
        service.answers(GUSEV, &answer);
        service.refuses(&answer, code, expected);
    }
    fs::remove_dir_all(service.path("archive")).unwrap();
    service.refuses("no answer", 6, "HTTP status 404");
}

/// Files that are not the table of the query, by their content.
#[test]
fn other_tables_are_refused() {
    let service = Service::new();
    let good = table(176.0, -14.2, 50);
    let makes = |table: &str| drop(service.makes(GUSEV, "9", table, "\"Count\": \"50\","));
    for (what, table, expected) in [
        (
            "short",
            table(176.0, -14.2, 49),
            "49 rows; expected 50, as the service states",
        ),
        (
            "cut off",
            good.trim_end_matches("10094\r\n").to_owned(),
            "the last row is malformed (line 51: ",
        ),
        (
            "another box",
            table(190.0, -14.2, 50),
            "none of its 50 shots is in the box",
        ),
        (
            "another heading",
            good.replace("planet_rad", "areoid_rad"),
            "column 5 is \"areoid_rad\"",
        ),
        ("heading alone", HEADING.to_owned(), "it has no rows"),
        (
            "page",
            "<!DOCTYPE html><html><title>Expired</title></html>".to_owned(),
            "a web page was received instead of the file: Expired",
        ),
    ] {
        makes(&table);
        service.refuses(what, 3, expected);
    }
    makes(&good);
    fs::remove_dir_all(service.path("archive/output")).unwrap();
    service.refuses("table is gone", 6, "HTTP status 404");
    makes(&good);
    assert!(service.of_box().output().unwrap().status.success());
    assert_eq!(fs::read_to_string(service.table_of_box()).unwrap(), good);
}

/// Real tables of the service, behind answers that state their rows: each arrives as it is, without a warning.
#[test]
fn real_tables_pass_as_served() {
    let Some(folder) = common::real_data("mola_ode", "real tables, fetched") else {
        return;
    };
    // The sixth extends over 0°, which are two queries.
    for (name, rows) in [
        ("spirit_topography", 10_247),
        ("opportunity_topography", 8_715),
        ("insight_topography", 8_410),
        ("perseverance_topography", 10_108),
        ("weak_negative_1", 11_241),
    ] {
        let service = Service::new();
        let table = fs::read_to_string(folder.join(format!("{name}.csv"))).unwrap();
        let column = |at: usize| {
            let rows = table.lines().skip(1);
            rows.map(move |row| {
                row.split(',')
                    .nth(at)
                    .unwrap()
                    .trim()
                    .parse::<f64>()
                    .unwrap()
            })
        };
        let edges = [0, 1].map(|at| {
            let (least, most) = (column(at).reduce(f64::min), column(at).reduce(f64::max));
            [least.unwrap().floor(), most.unwrap().ceil()].map(|edge| edge.to_string())
        });
        let [[west, east], [south, north]] = &edges;
        service.makes(
            [west, east, south, north],
            "1",
            &table,
            &format!("\"Count\": \"{rows}\","),
        );
        let into = service.path("mars");
        let edges = [west, east, south, north].map(String::as_str).join(",");
        let output = service
            .command(&["--into", &into.to_string_lossy(), "--box", &edges])
            .output()
            .unwrap();
        let [out, err] = texts(&output);
        assert!(
            output.status.success() && err.is_empty(),
            "{name}: {out}{err}"
        );
        let fetched = fs::read_dir(service.path("mars/shots")).unwrap().next();
        let fetched = fs::read_to_string(fetched.unwrap().unwrap().path()).unwrap();
        assert!(fetched == table, "{name}");
    }
}

/// A transfer that ends early continues with the same table; the service is not asked to make it again.
#[test]
fn interrupted_tables_are_resumed() {
    let service = Service::new();
    let whole = table(176.0, -14.2, 3_000);
    let (query, path) = (Service::query(GUSEV), service.makes(GUSEV, "1", &whole, ""));
    service
        .server
        .next(&path, [100_000, 0, 0].map(Fault::ResetAfter));
    // The first attempt makes progress, and three more do not.
    service.server.next(&query, [Fault::Status(503)]);
    service.server.always(&path, Fault::ResetAfter(0));
    let output = service.of_box().output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", texts(&output)[1]);
    assert_eq!(
        service.left().len(),
        3,
        "part, description and answer: {:?}",
        service.left()
    );
    assert_eq!(service.server.requests(&query).len(), 2);
    let planned = texts(&service.of_box().arg("--plan").output().unwrap())[0].clone();
    assert!(planned.contains("have arrived"), "{planned}");
    // Killed while it continues.
    let part = || {
        let parts = service
            .left()
            .into_iter()
            .filter(|name| Path::new(name).extension().is_some_and(|end| end == "part"));
        let sizes = parts.map(|name| {
            service
                .path("mars/.fetch/parts")
                .join(name)
                .metadata()
                .unwrap()
                .len()
        });
        sizes.sum::<u64>()
    };
    let begun = part();
    assert!(begun > 0);
    service.server.always(&path, Fault::Slow);
    let mut child = service
        .of_box()
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while part() <= begun && child.try_wait().unwrap().is_none() {
        thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!service.table_of_box().exists());
    let (out, before) = (service.of_box().output().unwrap(), part());
    let [out, err] = texts(&out);
    assert!(out.contains("had arrived earlier"), "{out}{err} {before}");
    assert_eq!(fs::read_to_string(service.table_of_box()).unwrap(), whole);
    assert_eq!(
        service.server.requests(&query).len(),
        2,
        "the query is not asked again"
    );
    assert!(service.server.requests(&path).last().unwrap().from() > begun);
    assert!(service.left().is_empty(), "{:?}", service.left());
}

/// A table whose transfer was interrupted, and which the service has removed since.
#[test]
fn an_expired_table_is_made_again() {
    let service = Service::new();
    let path = service.makes(GUSEV, "1", &table(176.0, -14.2, 3_000), "");
    service.server.always(&path, Fault::ResetAfter(50_000));
    service.server.next(&path, [Fault::ResetAfter(100_000)]);
    service.server.always(&path, Fault::ResetAfter(0));
    assert!(!service.of_box().output().unwrap().status.success());
    fs::remove_dir_all(service.path("archive/output")).unwrap();
    service.server.always(&path, Fault::Status(404));
    let new = table(176.0, -14.3, 2_000);
    service.makes(GUSEV, "2", &new, "");
    let output = service.of_box().output().unwrap();
    assert!(output.status.success(), "{}", texts(&output)[1]);
    assert_eq!(fs::read_to_string(service.table_of_box()).unwrap(), new);
    assert_eq!(service.server.requests(&Service::query(GUSEV)).len(), 2);
}

/// The answer comes when the table is made: the wait has a limit of its own, and a user can stop it.
#[test]
fn the_wait_for_an_answer_ends() {
    let service = Service::new();
    let query = Service::query(GUSEV);
    service.server.always(&query, Fault::Hangs);
    let start = Instant::now();
    let child = service
        .of_box()
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while service.server.requests(&query).is_empty() {
        thread::sleep(Duration::from_millis(5));
    }
    let interrupt = Command::new("kill")
        .arg("-INT")
        .arg(child.id().to_string())
        .status();
    assert!(interrupt.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", texts(&output)[1]);
    // Below the limit of the answer, 20 s, on a busy machine as well.
    assert!(
        start.elapsed() < Duration::from_secs(10),
        "{:?}",
        start.elapsed()
    );
    let hosts = fs::read_to_string(service.path("hosts.toml")).unwrap();
    write(
        &service.path("hosts.toml"),
        hosts
            .replace("answer_s = 20", "answer_s = 0.3")
            .replace("attempts = 3", "attempts = 2")
            .as_bytes(),
    );
    let output = service.of_box().output().unwrap();
    let err = &texts(&output)[1];
    assert_eq!(output.status.code(), Some(6), "{err}");
    assert!(
        err.contains("timeout") && err.contains("attempts: 2"),
        "{err}"
    );
}
