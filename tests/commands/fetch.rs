//! `areograph fetch` against a server of this computer: a folder filled in one command, every fault, killed and simultaneous
//! processes.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests work in temporary folders and may fail loudly"
)]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::common::{
    self,
    archive_server::{ArchiveServer, Fault, Listing, md5_of, write, write_kernels},
    json,
    mission::areograph,
    object_store::ObjectStore,
};

/// Bytes without a pattern that a wrong piece could repeat.
fn noise(seed: u32, count: usize) -> Vec<u8> {
    let mut state = seed.wrapping_mul(2_654_435_761).max(1);
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state.to_le_bytes()[1]
        })
        .collect()
}

/// An archive of invented files with the layout of the real ones, and a server of it.
struct Archive {
    folder: tempfile::TempDir,
    server: ArchiveServer,
}

/// Kernels: type, name, coverage.
const KERNELS: [(&str, &str, [&str; 2]); 8] = [
    ("LSK", "naif0009.tls", ["", ""]),
    ("LSK", "naif0010.tls", ["", ""]),
    ("SCLK", "mgs_sclkscet_00061.tsc", ["", ""]),
    (
        "SPK",
        "mgs_ext1.bsp",
        ["2001-02-01T00:00:00.000", "2001-04-01T00:00:00.000"],
    ),
    (
        "SPK",
        "mgs_ext2.bsp",
        ["2001-04-01T00:00:00.000", "2001-06-01T00:00:00.000"],
    ),
    (
        "SPK",
        "de405s.bsp",
        ["1997-01-01T00:00:00.000", "2010-01-01T00:00:00.000"],
    ),
    (
        "CK",
        "mgs_sc_ext1.bc",
        ["2001-02-01T00:00:00.000", "2001-04-01T00:00:00.000"],
    ),
    (
        "CK",
        "mgs_sa_ext1.bc",
        ["2001-02-01T00:00:00.000", "2001-04-01T00:00:00.000"],
    ),
];
/// Files of the laser; the second one has the orbits of early March 2001.
const PEDR: [&str; 3] = ["ap18920l.b", "ap18933l.b", "ap18946l.b"];
/// Generic kernels: versions of the leap seconds, and files beside them.
const GENERIC: [(&str, &[u8]); 4] = [
    ("naif0009.tls", b"until 2008"),
    ("naif0012.tls", b"until 2016"),
    ("naif0012.tls.pc", b"until 2016\r\n"),
    ("latest_leapseconds.tls", b"until 2016"),
];
const PEDR_BYTES: usize = 776 * 300;
const KERNEL_PATH: &str = "/naif/mgsp_1000/data/spk/mgs_ext1.bsp";
const PEDR_PATH: &str = "/pedr/ap18xxx/ap18933l.b";

impl Archive {
    fn new(listing: Listing) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("archive");
        let kernels = (1..).zip(KERNELS).map(|(number, (kind, name, span))| {
            (kind, name, span, noise(number, 100_000 + number as usize))
        });
        write_kernels(&root.join("naif"), &kernels.collect::<Vec<_>>());
        for (number, name) in (100..).zip(PEDR) {
            write(
                &root.join("pedr/ap18xxx").join(name),
                &noise(number, PEDR_BYTES),
            );
        }
        for (name, text) in GENERIC {
            write(&root.join("generic/lsk").join(name), text);
        }
        let server = ArchiveServer::of(&root, listing);
        let archive = Self { folder, server };
        archive.hosts("");
        archive
    }

    /// Writes the table of hosts.
    fn hosts(&self, more: &str) {
        let url = self.server.url();
        let text = format!(
            "contact = 'tester@example.org'\n[network]\nconnect_s = 2\nread_s = 1\nattempts = 3\npause_s = 0.01\npause_max_s = 2\n\
             [kernels]\nurl = '{url}/naif/'\n[generic]\nurl = '{url}/generic/'\n[pedr]\nurl = '{url}/pedr/'\nfolders = ['ap18xxx']\n[images]\nurl = '{url}/moc/'\n{more}"
        );
        fs::write(self.folder.path().join("hosts.toml"), text).unwrap();
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    /// The file of the archive behind a path of the server.
    fn original(&self, path: &str) -> Vec<u8> {
        fs::read(
            self.folder
                .path()
                .join("archive")
                .join(path.trim_start_matches('/')),
        )
        .unwrap()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = areograph();
        command.arg("fetch").args(arguments);
        command.arg("--archives").arg(self.path("hosts.toml"));
        command.arg("--into").arg(self.path("mars"));
        command
    }

    /// Standard output of a command that succeeds.
    fn fetched(&self, arguments: &[&str]) -> String {
        let output = self.command(arguments).output().unwrap();
        let [out, err] = texts(&output);
        assert!(
            output.status.success(),
            "{arguments:?}: {}\n{out}{err}",
            output.status
        );
        out
    }

    /// Code and standard error of a command that fails.
    fn refused(&self, arguments: &[&str]) -> (i32, String) {
        let output = self.command(arguments).output().unwrap();
        let [out, err] = texts(&output);
        assert!(!output.status.success(), "{arguments:?}\n{out}");
        (output.status.code().unwrap(), err)
    }

    fn state(&self) -> serde_json::Value {
        json(&self.path("mars/fetch.json"))["files"].clone()
    }
}

fn texts(output: &Output) -> [String; 2] {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8(text.clone()).unwrap())
}

/// Files below a folder, with their sizes; not those that areograph keeps for itself.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && name != ".fetch" {
            found.extend(
                files(&path)
                    .into_iter()
                    .map(|file| format!("{name}/{file}")),
            );
        } else if path.is_file() {
            found.push(name);
        }
    }
    found.sort();
    found
}

/// Names of files that a killed process was writing.
const INCOMPLETE: &str = ".partial-areograph-";

/// Everything for the orbits of a few days.
const DAYS: [&str; 2] = ["--dates", "2001-03-07,2001-03-08"];
/// One file of the laser.
const ORBIT: [&str; 4] = ["--orbits", "18940,18940", "--only", "pedr"];

#[test]
fn a_folder_is_filled_in_one_command_and_stays() {
    for listing in [Listing::Plain, Listing::Table] {
        let archive = Archive::new(listing);
        let told = archive.fetched(&DAYS);
        assert!(told.contains("failed: 0"), "{told}");
        let kernels = [
            "de405s.bsp",
            "mgs_ext1.bsp",
            "mgs_sc_ext1.bc",
            "mgs_sclkscet_00061.tsc",
            "naif0010.tls",
        ];
        let expected: Vec<String> = ["fetch.json".to_owned()]
            .into_iter()
            .chain(kernels.map(|name| format!("kernels/{name}")))
            .chain(
                PEDR.map(|name| format!("pedr/{name}"))
                    .into_iter()
                    .skip(1)
                    .take(1),
            )
            .collect();
        let found = files(&archive.path("mars"));
        for name in &expected {
            assert!(found.contains(name), "{name} of {found:?}");
        }
        let kernel = fs::read(archive.path("mars/kernels/mgs_ext1.bsp")).unwrap();
        assert!(kernel == archive.original(KERNEL_PATH));
        let state = archive.state();
        assert_eq!(state["kernels/mgs_ext1.bsp"]["verified_by"], "md5");
        assert_eq!(state["kernels/mgs_ext1.bsp"]["md5"], md5_of(&kernel));
        assert_eq!(state["pedr/ap18933l.b"]["verified_by"], "size");
        // A second time: only indexes are asked for, and they have not changed.
        let before = archive.server.request_count();
        archive.fetched(&DAYS);
        assert_eq!(archive.server.request_count() - before, 4);
        let plan = archive.fetched(&[&DAYS[..], &["--plan"]].concat());
        assert!(plan.ends_with("not present: 0\n"), "{plan}");
        assert_eq!(
            archive.server.request_count() - before,
            4,
            "a plan asks no archive"
        );
        let agent = &archive.server.requests(KERNEL_PATH)[0].headers["user-agent"];
        assert!(
            agent.starts_with("areograph/") && agent.ends_with("(tester@example.org)"),
            "{agent}"
        );
        assert!(
            archive.server.open_max() <= 2,
            "{} connections",
            archive.server.open_max()
        );
        assert!(
            archive
                .fetched(&["--verify"])
                .starts_with("files unchanged since they were fetched: ")
        );
    }
}

#[test]
fn a_plan_states_files_sizes_and_reasons() {
    let archive = Archive::new(Listing::Plain);
    let (code, told) = archive.refused(&[&DAYS[..], &["--plan"]].concat());
    assert_eq!(code, 3);
    assert!(
        told.contains("this folder contains no copy of kernels.tab")
            && told.contains("areograph fetch --index"),
        "{told}"
    );
    archive.fetched(&[&DAYS[..], &["--index"]].concat());
    let plan = archive.fetched(&[&DAYS[..], &["--plan"]].concat());
    for expected in [
        "kernels/mgs_ext1.bsp: missing, size unknown",
        "orbit, solution nav: 2001-02-01T00:00:00.000 to 2001-04-01T00:00:00.000, for --dates",
        "LSK, latest of 2",
        "pedr/ap18933l.b: missing, 232800 B",
        "from orbit 18933 on: orbits 189",
    ] {
        assert!(plan.contains(expected), "{expected} in {plan}");
    }
    assert!(
        !plan.contains("mgs_sa_ext1.bc") && !plan.contains("mgs_ext2.bsp"),
        "{plan}"
    );
    assert_eq!(files(&archive.path("mars")), [""; 0]);
    // What no archive has is named, and ends a fetch with the code of coverage.
    let late = ["--dates", "2001-03-31,2001-05-01", "--only", "kernels"];
    let (code, told) = archive.refused(&late);
    assert_eq!(code, 4, "{told}");
    let plan = archive.fetched(&[&late[..], &["--plan"]].concat());
    assert!(
        plan.contains(
            "in_no_index attitude: no kernel of the archive covers 2001-04-01T00:00:00.000 to "
        ),
        "{plan}"
    );
}

#[test]
fn generic_kernels_are_the_latest_of_their_listing() {
    for listing in [Listing::Plain, Listing::Table] {
        let archive = Archive::new(listing);
        let arguments = ["--generic-kernels", "generic"];
        let fetch = || {
            let mut command = archive.command(&arguments);
            command.current_dir(archive.folder.path()).output().unwrap()
        };
        let first = fetch();
        assert!(first.status.success(), "{:?}", texts(&first));
        assert_eq!(files(&archive.path("generic")), ["naif0012.tls"]);
        let before = archive.server.requests("/generic/lsk/naif0012.tls").len();
        assert!(fetch().status.success());
        let after = archive.server.requests("/generic/lsk/naif0012.tls").len();
        assert_eq!(before, after, "a file that is here is not asked for");
        // A new version lies beside the former one.
        write(
            &archive.path("archive/generic/lsk/naif0013.tls"),
            b"until 2035",
        );
        assert!(fetch().status.success());
        let found = ["naif0012.tls", "naif0013.tls"];
        assert_eq!(files(&archive.path("generic")), found);
        // No listing is no kernel.
        archive.server.always("/generic/lsk/", Fault::Status(404));
        let [_, told] = texts(&fetch());
        assert!(told.contains("HTTP status 404"), "{told}");
        assert_eq!(files(&archive.path("generic")), found);
    }
}

/// Faults after which the right file is there, whole.
#[test]
fn passing_faults_end_in_the_whole_file() {
    let archive = Archive::new(Listing::Plain);
    archive.fetched(&[&ORBIT[..], &["--index"]].concat());
    let whole = archive.original(PEDR_PATH);
    let cases: [(&str, Vec<Fault>, u64); 12] = [
        (
            "503 and 500",
            vec![Fault::Status(503), Fault::Status(500)],
            0,
        ),
        ("429 with a wait", vec![Fault::RetryAfter(429, 1)], 0),
        ("503 with a wait", vec![Fault::RetryAfter(503, 1)], 0),
        ("reset inside", vec![Fault::ResetAfter(100_000)], 100_000),
        ("reset at once", vec![Fault::ResetAfter(0)], 0),
        (
            "short",
            vec![Fault::ShortBy(10_000), Fault::ShortBy(1)],
            PEDR_BYTES as u64 - 10_000,
        ),
        (
            "longer than announced",
            vec![Fault::Longer {
                is_announced: false,
            }],
            0,
        ),
        (
            "range ignored",
            vec![Fault::ResetAfter(100_000), Fault::IgnoresRange],
            0,
        ),
        (
            "another range",
            vec![Fault::ResetAfter(100_000), Fault::WrongRange],
            0,
        ),
        (
            "moved on the host",
            vec![Fault::Redirect("/pedr/ap18xxx/ap18933l.b".to_owned())],
            0,
        ),
        ("hangs once", vec![Fault::Hangs], 0),
        (
            "three resets with progress",
            vec![
                Fault::ResetAfter(50_000),
                Fault::ResetAfter(50_000),
                Fault::ResetAfter(50_000),
                Fault::ResetAfter(50_000),
            ],
            200_000,
        ),
    ];
    let (mut asked, mut sent) = (0, 0);
    for (what, faults, _) in cases {
        let _ = fs::remove_file(archive.path("mars/pedr/ap18933l.b"));
        let waits = faults
            .iter()
            .any(|fault| matches!(fault, Fault::RetryAfter(..)));
        let is_resumed = matches!(faults[0], Fault::ResetAfter(1..) | Fault::ShortBy(_))
            && !faults.contains(&Fault::IgnoresRange)
            && !faults.contains(&Fault::WrongRange);
        archive.server.next(PEDR_PATH, faults);
        let start = Instant::now();
        archive.fetched(&[&ORBIT[..], &["--offline-index"]].concat());
        assert!(
            fs::read(archive.path("mars/pedr/ap18933l.b")).unwrap() == whole,
            "{what}"
        );
        assert!(
            !waits || start.elapsed() >= Duration::from_secs(1),
            "{what}: did not wait"
        );
        let requests = archive.server.requests(PEDR_PATH);
        let now = archive.server.sent(PEDR_PATH);
        if is_resumed {
            let last = requests.last().unwrap();
            assert!(
                last.from() > 0 && last.headers.contains_key("if-range"),
                "{what}"
            );
            // What had arrived is not sent again; a reset may lose what was under way.
            assert!(
                now - sent <= whole.len() as u64 + 50_000,
                "{what}: {} bytes",
                now - sent
            );
        }
        assert!(requests.len() > asked, "{what}");
        (asked, sent) = (requests.len(), now);
    }
    assert!(parts(&archive).is_empty(), "{:?}", parts(&archive));
}

/// Parts of files that are left.
fn parts(archive: &Archive) -> Vec<String> {
    files(&archive.path("mars/.fetch/parts"))
}

/// Faults that end in an error, with nothing under the file's name.
#[test]
fn lasting_faults_are_named_and_leave_no_file() {
    let archive = Archive::new(Listing::Plain);
    archive.fetched(&[&ORBIT[..], &["--index"]].concat());
    let own = format!(
        "https://127.0.0.1:{}/pedr/ap18xxx/ap18933l.b",
        archive.server.port
    );
    for (fault, code, expected) in [
        (Fault::Status(404), 6, "HTTP status 404"),
        (Fault::Status(403), 6, "HTTP status 403"),
        (Fault::Status(503), 6, "HTTP status 503; attempts: 3"),
        (Fault::ResetAfter(0), 6, "attempts: 3"),
        (Fault::Hangs, 6, "timeout"),
        (
            Fault::Longer { is_announced: true },
            3,
            "232900 bytes; expected 232800 according to the index",
        ),
        (
            Fault::Page,
            3,
            "57 bytes; expected 232800 according to the index",
        ),
        (
            Fault::Redirect("http://archive.example.org/x".to_owned()),
            6,
            "is not followed: expected https, or the same host",
        ),
        (
            Fault::Redirect("file:///etc/passwd".to_owned()),
            6,
            "is not followed",
        ),
        (
            Fault::Redirect(PEDR_PATH.to_owned()),
            6,
            "there are too many redirections",
        ),
        // From http to https: followed, and this server does not speak it.
        (Fault::Redirect(own), 6, "attempts: "),
    ] {
        archive.server.always(PEDR_PATH, fault.clone());
        let (found, told) = archive.refused(&[&ORBIT[..], &["--offline-index"]].concat());
        assert!(told.contains(expected), "{fault:?}: {told}");
        assert_eq!(found, code, "{fault:?}: {told}");
        assert!(told.contains("what to do: "), "{told}");
        assert!(!archive.path("mars/pedr/ap18933l.b").exists(), "{fault:?}");
    }
}

/// A connection that is accepted, and whose encryption never begins.
#[test]
fn a_hung_handshake_ends() {
    let archive = Archive::new(Listing::Plain);
    archive.fetched(&[&ORBIT[..], &["--index"]].concat());
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = silent.local_addr().unwrap().port();
    let hosts = fs::read_to_string(archive.path("hosts.toml")).unwrap();
    let plain = format!("{}/pedr/", archive.server.url());
    let hosts = hosts.replace(&plain, &format!("https://127.0.0.1:{port}/pedr/"));
    let hosts = hosts
        .replace("connect_s = 2", "connect_s = 0.3")
        .replace("attempts = 3", "attempts = 2");
    fs::write(archive.path("hosts.toml"), hosts).unwrap();
    let start = Instant::now();
    let (code, told) = archive.refused(&[&ORBIT[..], &["--offline-index"]].concat());
    assert_eq!(code, 6);
    assert!(
        told.contains("timeout") && told.contains("attempts: 2"),
        "{told}"
    );
    assert!(
        start.elapsed() < Duration::from_secs(10),
        "{:?}",
        start.elapsed()
    );
    drop(silent);
}

/// With checksums of the archive, wrong bytes of the right length are found.
#[test]
fn wrong_bytes_are_found_by_their_checksum() {
    let archive = Archive::new(Listing::Plain);
    let kernels = [&DAYS[..], &["--only", "kernels"]].concat();
    archive.server.always(KERNEL_PATH, Fault::WrongBytes);
    let (code, told) = archive.refused(&kernels);
    let expected = format!("expected {}", md5_of(&archive.original(KERNEL_PATH)));
    assert!(
        told.contains("MD5 of 100004 bytes is ") && told.contains(&expected),
        "{told}"
    );
    assert_eq!(code, 3);
    assert!(!archive.path("mars/kernels/mgs_ext1.bsp").exists());
    assert!(
        archive.path("mars/kernels/mgs_sc_ext1.bc").exists(),
        "other files go on"
    );
    for fault in [
        // Part of the file, then another file under its name.
        vec![Fault::ResetAfter(50_000), Fault::WrongBytes],
        vec![Fault::Longer { is_announced: true }],
        // Neither length nor chunks: the checksum decides.
        vec![Fault::NoLength],
    ] {
        let archive = Archive::new(Listing::Plain);
        archive.server.next(KERNEL_PATH, fault);
        archive.fetched(&kernels);
        let found = fs::read(archive.path("mars/kernels/mgs_ext1.bsp")).unwrap();
        assert!(found == archive.original(KERNEL_PATH));
    }
    let archive = Archive::new(Listing::Table);
    archive.server.always(KERNEL_PATH, Fault::Page);
    assert!(
        archive
            .refused(&kernels)
            .1
            .contains("a web page was received instead of the file")
    );
    // Without a checksum, and with a rounded size, an end that marks nothing proves nothing.
    archive.server.always(PEDR_PATH, Fault::NoLength);
    let told = archive.refused(&ORBIT).1;
    assert!(
        told.contains("the file cannot be verified as complete"),
        "{told}"
    );
}

#[test]
fn an_index_that_is_older_than_the_files_is_named() {
    let archive = Archive::new(Listing::Plain);
    let kernels = [&DAYS[..], &["--only", "kernels"]].concat();
    archive.fetched(&[&kernels[..], &["--index"]].concat());
    // A new version of a kernel; the copy of the index does not know it.
    let path = archive
        .path("archive")
        .join(KERNEL_PATH.trim_start_matches('/'));
    fs::write(&path, noise(77, 90_000)).unwrap();
    let told = archive
        .refused(&[&kernels[..], &["--offline-index"]].concat())
        .1;
    assert!(
        told.contains("MD5 of 90000 bytes is ")
            && told.contains("the index may be older than the file"),
        "{told}"
    );
    fs::remove_file(&path).unwrap();
    let told = archive
        .refused(&[&kernels[..], &["--offline-index"]].concat())
        .1;
    assert!(
        told.contains("HTTP status 404") && told.contains("the index may be older"),
        "{told}"
    );
}

#[test]
fn a_path_that_leads_out_of_the_archive_is_refused() {
    let archive = Archive::new(Listing::Plain);
    let index = archive.path("archive/naif/dsindex.tab");
    let good = fs::read_to_string(&index).unwrap();
    fs::write(
        &index,
        good.replace(
            "\"data/spk/mgs_ext1.lbl                   \"",
            "\"../../../../../../etc/mgs_ext1.lbl      \"",
        ),
    )
    .unwrap();
    let (code, told) = archive.refused(&DAYS);
    assert_eq!(code, 3);
    assert!(
        told.contains(
            "line 4: \"../../../../../../etc/mgs_ext1.bsp\" is not a path below the volume"
        ),
        "{told}"
    );
    fs::write(&index, good).unwrap();
    let sums = archive.path("archive/naif/mgsp_1000/index/checksum.tab");
    let text = fs::read_to_string(&sums).unwrap();
    fs::write(
        &sums,
        text.replace("data/lsk/naif0010.tls", "../../lsk/naif0010.tl"),
    )
    .unwrap();
    assert!(
        archive
            .refused(&DAYS)
            .1
            .contains("is not a path below the volume")
    );
    assert_eq!(files(&archive.path("mars")), [""; 0]);
}

#[test]
fn files_of_others_are_never_replaced_unasked() {
    let archive = Archive::new(Listing::Plain);
    let kernels = [&DAYS[..], &["--only", "kernels"]].concat();
    let path = archive.path("mars/kernels/mgs_ext1.bsp");
    // The right file, from elsewhere: it is recognised by its content.
    write(&path, &archive.original(KERNEL_PATH));
    let told = archive.fetched(&kernels);
    assert!(
        told.contains("mgs_ext1.bsp: was present and matches the file of the archive"),
        "{told}"
    );
    assert_eq!(archive.server.sent(KERNEL_PATH), 0);
    // Another file of the same name and size.
    let mine = noise(99, archive.original(KERNEL_PATH).len());
    fs::write(&path, &mine).unwrap();
    fs::remove_file(archive.path("mars/fetch.json")).unwrap();
    let (code, told) = archive.refused(&kernels);
    assert_eq!(code, 3);
    assert!(
        told.contains("exists with different content: MD5 is ") && told.contains("--replace"),
        "{told}"
    );
    assert!(fs::read(&path).unwrap() == mine);
    archive.fetched(&[&kernels[..], &["--replace"]].concat());
    assert!(fs::read(&path).unwrap() == archive.original(KERNEL_PATH));
    // Damage on the disk: found by reading, mended with --replace.
    fs::write(&path, &mine).unwrap();
    let (code, told) = archive.refused(&["--verify"]);
    assert_eq!(code, 3);
    assert!(
        told.contains("1 of 5 recorded files have changed since they were fetched, or are missing"),
        "{told}"
    );
    archive.fetched(&[&kernels[..], &["--replace"]].concat());
    archive.fetched(&["--verify"]);
    // An incomplete state is no state.
    fs::write(archive.path("mars/fetch.json"), "{\"format\": 1, \"fi").unwrap();
    assert!(
        archive
            .refused(&["--verify"])
            .1
            .contains("is not a state file of areograph fetch")
    );
}

#[test]
fn an_audit_compares_folder_and_archive() {
    let archive = Archive::new(Listing::Plain);
    archive.fetched(&DAYS);
    fs::remove_file(archive.path("mars/kernels/mgs_sc_ext1.bc")).unwrap();
    write(&archive.path("mars/kernels/own.bsp"), b"own");
    // The archive has a new version of an ephemeris.
    let path = archive
        .path("archive")
        .join(KERNEL_PATH.trim_start_matches('/'));
    let old = md5_of(&fs::read(&path).unwrap());
    fs::write(&path, noise(77, 90_000)).unwrap();
    let sums = archive.path("archive/naif/mgsp_1000/index/checksum.tab");
    let text = fs::read_to_string(&sums).unwrap();
    fs::write(&sums, text.replace(&old, &md5_of(&noise(77, 90_000)))).unwrap();
    archive.fetched(&[&DAYS[..], &["--index"]].concat());
    let told = archive.fetched(&[&DAYS[..], &["--only", "kernels", "--audit"]].concat());
    for expected in [
        "missing kernels/mgs_sc_ext1.bc: attitude: ",
        "differs kernels/mgs_ext1.bsp: fetched with MD5 ",
        "not_needed pedr/ap18933l.b: fetched as from orbit 18933 on",
        "not_fetched kernels/own.bsp",
        "missing: 1; differ: 1; not needed: ",
    ] {
        assert!(told.contains(expected), "{expected} in {told}");
    }
    // The new version replaces the fetched one only when asked.
    assert!(archive.refused(&DAYS).1.contains("the archive now has "));
    archive.fetched(&[&DAYS[..], &["--replace"]].concat());
    assert!(fs::read(archive.path("mars/kernels/mgs_ext1.bsp")).unwrap() == noise(77, 90_000));
}

/// A file that cannot grow: the part is kept, and nothing has the file's name.
#[test]
fn a_full_disk_keeps_what_has_arrived() {
    let archive = Archive::new(Listing::Plain);
    archive.fetched(&[&ORBIT[..], &["--index"]].concat());
    let fetch = archive.command(&[&ORBIT[..], &["--offline-index"]].concat());
    let mut limited = Command::new("sh");
    // Blocks of 512 bytes; a write beyond them fails as one on a full disk does.
    limited.args(["-c", "trap '' XFSZ; ulimit -f 200; exec \"$0\" \"$@\""]);
    limited.arg(fetch.get_program()).args(fetch.get_args());
    let output = limited.output().unwrap();
    let [_, told] = texts(&output);
    assert_eq!(output.status.code(), Some(6), "{told}");
    assert!(told.contains("cannot write: File too large"), "{told}");
    assert_eq!(files(&archive.path("mars")), [""; 0]);
    let before = archive.server.requests(PEDR_PATH).len();
    let told = archive.fetched(&[&ORBIT[..], &["--offline-index"]].concat());
    assert!(
        told.contains("of which 102400 B had arrived earlier"),
        "{told}"
    );
    assert_eq!(archive.server.requests(PEDR_PATH)[before].from(), 102_400);
    assert!(fs::read(archive.path("mars/pedr/ap18933l.b")).unwrap() == archive.original(PEDR_PATH));
}

fn started(mut command: Command) -> Child {
    command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Bytes of the parts that are left.
fn part_sizes(archive: &Archive) -> Vec<u64> {
    let folder = archive.path("mars/.fetch/parts");
    let parts = parts(archive).into_iter().map(|name| folder.join(name));
    let parts = parts.filter(|path| path.extension().is_some_and(|end| end == "part"));
    parts.map(|path| path.metadata().unwrap().len()).collect()
}

/// SIGKILL at many moments: no file is ever half there, and what has arrived is not sent again.
#[test]
fn killed_processes_leave_whole_files_and_resume() {
    let kills: u32 = if common::long() { 200 } else { 12 };
    let archive = Archive::new(Listing::Plain);
    let all = [
        "--orbits",
        "18920,18950",
        "--dates",
        "2001-03-07,2001-03-08",
        "--offline-index",
    ];
    archive.fetched(&[&all[..4], &["--index"]].concat());
    let paths = PEDR.map(|name| format!("/pedr/ap18xxx/{name}"));
    for path in &paths {
        archive.server.always(path, Fault::Slow);
    }
    archive.server.always(KERNEL_PATH, Fault::Slow);
    let (mut killed, mut rounds, mut whole_files) = (0, 0_u64, 0_u64);
    // Sizes of parts that killed processes left.
    let mut lengths = BTreeSet::new();
    while killed < kills {
        let mut child = started(archive.command(&all));
        // From before the first request to after the last file.
        let until = Duration::from_millis(5 + (rounds * 37) % 260);
        rounds += 1;
        thread::sleep(until);
        if child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            killed += 1;
        }
        child.wait().unwrap();
        lengths.extend(part_sizes(&archive));
        for name in files(&archive.path("mars")) {
            if name == "fetch.json" {
                json(&archive.path("mars/fetch.json"));
                continue;
            }
            // A state that was under way: under no final name, and removed by the next writer.
            if name.starts_with(INCOMPLETE) {
                continue;
            }
            let found = fs::read(archive.path("mars").join(&name)).unwrap();
            let original = match name.split_once('/').unwrap() {
                ("pedr", file) => archive.original(&format!("/pedr/ap18xxx/{file}")),
                (_, file) => {
                    let (kind, ..) = KERNELS.iter().find(|kernel| kernel.1 == file).unwrap();
                    archive.original(&format!(
                        "/naif/mgsp_1000/data/{}/{file}",
                        kind.to_lowercase()
                    ))
                }
            };
            assert!(found == original, "{name} after {killed} kills");
        }
        // Complete: begin anew, so that every round has something to kill.
        if PEDR
            .iter()
            .all(|name| archive.path("mars/pedr").join(name).exists())
        {
            whole_files += 1;
            let _ = fs::remove_dir_all(archive.path("mars/pedr"));
            let _ = fs::remove_dir_all(archive.path("mars/kernels"));
            let _ = fs::remove_file(archive.path("mars/fetch.json"));
        }
    }
    archive.fetched(&all);
    archive.fetched(&["--verify"]);
    let left = files(&archive.path("mars"));
    assert!(
        !left.iter().any(|name| name.contains(INCOMPLETE)),
        "{left:?}"
    );
    let needed = (whole_files + 1) * PEDR_BYTES as u64;
    for path in &paths {
        let sent = archive.server.sent(path);
        // Bytes that were under way, in the buffers of both ends, when a process was killed.
        let lost = u64::from(kills) * 100_000;
        println!("{path}: {sent} bytes sent for {needed}; {killed} kills in {rounds} rounds");
        assert!(
            sent >= needed.saturating_sub(PEDR_BYTES as u64) && sent <= needed + lost,
            "{path}: {sent}"
        );
    }
    let requests = paths.iter().flat_map(|path| archive.server.requests(path));
    let resumed: Vec<u64> = requests
        .map(|request| request.from())
        .filter(|from| *from > 0)
        .collect();
    println!(
        "{} transfers were resumed, up to byte {:?}",
        resumed.len(),
        resumed.iter().max()
    );
    assert!(
        resumed.len() as u64 >= u64::from(kills) / 6,
        "{} resumed",
        resumed.len()
    );
    // Each goes on exactly where the part ended.
    for from in resumed {
        assert!(
            lengths.contains(&from),
            "resumed at {from}, where no part ended"
        );
    }
}

#[test]
fn two_processes_do_not_fill_one_folder() {
    let archive = Archive::new(Listing::Plain);
    archive.fetched(&[&ORBIT[..], &["--index"]].concat());
    archive.server.always(PEDR_PATH, Fault::Slow);
    let arguments = [&ORBIT[..], &["--offline-index"]].concat();
    let first = started(archive.command(&arguments));
    while archive.server.requests(PEDR_PATH).is_empty() {
        thread::sleep(Duration::from_millis(2));
    }
    let (code, told) = archive.refused(&arguments);
    assert_eq!(code, 6);
    assert!(
        told.contains("another areograph fetch is filling this folder"),
        "{told}"
    );
    assert!(first.wait_with_output().unwrap().status.success());
    assert!(fs::read(archive.path("mars/pedr/ap18933l.b")).unwrap() == archive.original(PEDR_PATH));
    assert_eq!(archive.server.requests(PEDR_PATH).len(), 1);
}

#[test]
fn a_mirror_on_a_disk_serves_as_an_archive_does() {
    let archive = Archive::new(Listing::Plain);
    let hosts = fs::read_to_string(archive.path("hosts.toml")).unwrap();
    let mirror = format!("file://{}", archive.path("archive").display());
    fs::write(
        archive.path("hosts.toml"),
        hosts.replace(&archive.server.url(), &mirror),
    )
    .unwrap();
    archive.fetched(&DAYS);
    assert!(
        fs::read(archive.path("mars/kernels/mgs_ext1.bsp")).unwrap()
            == archive.original(KERNEL_PATH)
    );
    assert_eq!(archive.server.request_count(), 0);
    archive.hosts("[planets]\nurl = 'x'\n");
    let (code, told) = archive.refused(&DAYS);
    assert_eq!(code, 2);
    assert!(
        told.contains("hosts.toml: ") && told.contains("unknown field"),
        "{told}"
    );
    let (code, told) = archive.refused(&["--only", "pedr"]);
    assert!(code == 2 && told.contains("unknown field"), "{told}");
}

#[test]
fn a_mirror_in_an_object_store_serves_as_an_archive_does() {
    let archive = Archive::new(Listing::Plain);
    let store = ObjectStore::of(&archive.path("archive"));
    let hosts = fs::read_to_string(archive.path("hosts.toml")).unwrap();
    let hosts = hosts.replace(&archive.server.url(), "s3://mola");
    fs::write(archive.path("hosts.toml"), hosts).unwrap();
    for arguments in [&DAYS[..], &["--generic-kernels", "generic"]] {
        let mut command = store.named_by(archive.command(arguments), "KEY");
        let output = command.current_dir(archive.folder.path()).output().unwrap();
        assert!(output.status.success(), "{:?}", texts(&output));
    }
    let kernel = fs::read(archive.path("mars/kernels/mgs_ext1.bsp")).unwrap();
    assert!(kernel == archive.original(KERNEL_PATH));
    assert_eq!(files(&archive.path("generic")), ["naif0012.tls"]);
    assert_eq!(archive.server.request_count(), 0);
}

/// A row of the index: an image 3 km wide and 10 km high around a place, west longitude as the index has it.
fn index_row(product: &str, utc: &str, [west_deg, latitude_deg]: [f64; 2], orbit: u32) -> String {
    let volume_file = product.replace('/', "");
    let corner = |west: f64, north: f64| {
        format!(
            "{:.3},{:.3}",
            west_deg + west * 0.0254,
            latitude_deg + north * 0.0846
        )
    };
    format!(
        "\"MGSC_1240\",\"{}/{volume_file}.IMQ\",\"{product}   \",\"{utc}\",\"MOC-NA\",\"N/A \",672,2240,3,3,4.5,1.0,10.0,40.0,\
         40.0,{west_deg},{latitude_deg},{},{},{},{},\"MAPPING\",\"MARS\",\"653298871:2\",245.0,0.4821,\"6A\",\"30\",0,\
         \"MOC-PRED-X-5\",3.0,10.0,,,,\"\",,,,,,,,,,,\"Gale\",\"OK\",{orbit}\r\n",
        &volume_file[..6],
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
        corner(1.0, -1.0),
        corner(-1.0, -1.0),
    )
}

#[test]
fn a_place_becomes_a_site_that_can_be_filled() {
    let archive = Archive::new(Listing::Plain);
    let rows = [
        index_row("E02/01000", "2001-03-07T10:00:00.00", [222.2, -5.4], 9000),
        index_row("E02/01001", "2001-03-07T20:00:00.00", [222.21, -5.41], 9005),
        index_row("E02/01002", "2001-03-08T10:00:00.00", [10.0, 40.0], 9012),
    ];
    write(
        &archive.path("archive/moc/mgsc_1578/index/cumindex.tab"),
        rows.concat().as_bytes(),
    );
    let image = noise(7, 5_000);
    for file in ["e0201000", "e0201001"] {
        write(
            &archive.path(&format!("archive/moc/mgsc_1240/e02010/{file}.imq")),
            &image,
        );
    }
    let init = |more: &[&str]| {
        let mut command = areograph();
        command
            .arg("init")
            .arg(archive.path("mars"))
            .args(["--site", "gale"])
            .args(more);
        command.output().unwrap()
    };
    let output = init(&["--place", "gale"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(
        texts(&output)[1].contains("no copy of the image index"),
        "{}",
        texts(&output)[1]
    );
    archive.fetched(&["--index"]);
    let output = init(&["--place", "utopia"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        texts(&output)[1].contains("unknown place \"utopia\"; expected becquerel, "),
        "{}",
        texts(&output)[1]
    );
    let output = init(&["--place", "gale"]);
    let [out, err] = texts(&output);
    assert!(output.status.success(), "{err}");
    assert!(
        out.contains("image E02-01000: pair with E02/01001: overlap "),
        "{out}"
    );
    assert!(!out.contains("E02-01002"), "{out}");
    let site = archive.path("mars/gale.toml");
    let site = site.to_string_lossy();
    let told = archive.fetched(&[&site]);
    assert!(told.contains("failed: 0"), "{told}");
    let found = files(&archive.path("mars"));
    for name in [
        "images/e0201000.imq",
        "images/e0201001.imq",
        "kernels/mgs_ext1.bsp",
        "pedr/ap18933l.b",
    ] {
        assert!(found.iter().any(|file| file == name), "{name} of {found:?}");
    }
    assert!(fs::read(archive.path("mars/images/e0201000.imq")).unwrap() == image);
    // The same place with tables of shots in place of PEDR files: the query of its window is planned.
    let tables = archive.path("mars/shots/*.csv");
    let tables = [
        "--place",
        "gale",
        "--site",
        "tables",
        "--shots",
        &tables.to_string_lossy(),
    ];
    let mut command = areograph();
    command.arg("init").arg(archive.path("mars")).args(tables);
    let [_, err] = texts(&command.output().unwrap());
    let written = archive.path("mars/tables.toml");
    let text = fs::read_to_string(&written).unwrap_or_else(|_| panic!("{err}"));
    assert!(
        text.contains("files = [\"shots/*.csv\"]\n") && !text.contains("\n[pedr]\n"),
        "{text}"
    );
    let plan = archive.fetched(&[&written.to_string_lossy(), "--plan"]);
    assert!(plan.contains("mars/shots/tables.csv: missing"), "{plan}");
}
