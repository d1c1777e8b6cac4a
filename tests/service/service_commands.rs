//! Commands round the service: nights for a timer, copies, tokens, units of systemd.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly"
)]

use areograph::config::{Document as _, ServiceConfig};

use crate::common;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use common::{
    mission::{areograph, succeed},
    outside,
};

struct Keeper {
    folder: tempfile::TempDir,
}

impl Keeper {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        succeed(
            areograph()
                .args(["serve", "--init"])
                .arg(folder.path().join("demo")),
        );
        let keeper = Self { folder };
        let file = keeper.file("areograph.toml");
        let text = fs::read_to_string(&file).unwrap();
        let text = text.replace("quiet_period_s = 5.0", "quiet_period_s = 0.5");
        let text = text.replace("scan_interval_s = 2.0", "scan_interval_s = 0.3");
        fs::write(
            file,
            text.replace("min_free_mib = 1024", "min_free_mib = 1"),
        )
        .unwrap();
        // Two sites are as good as four.
        for other in ["gusev_context", "gusev_crater"] {
            fs::remove_file(keeper.file(&format!("sites/{other}.toml"))).unwrap();
        }
        keeper
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join("demo").join(name)
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
        command
            .arg("service")
            .args(arguments)
            .arg(self.file("areograph.toml"));
        command.args(more).output().unwrap()
    }
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8(text).unwrap()
}

#[test]
fn a_night_without_a_service_does_what_is_to_be_done() {
    let keeper = Keeper::new();
    let first = keeper.nightly();
    assert_eq!(said(&first), "2 sites compared, 2 runs, 0 failures\n");
    assert_eq!(first.status.code(), Some(0));
    let second = keeper.nightly();
    assert_eq!(said(&second), "2 sites compared, 0 runs, 0 failures\n");
    // A new database knows the runs.
    let copy = keeper.folder.path().join("copy.db");
    assert_eq!(
        said(&keeper.service(&["backup"], &[copy.to_str().unwrap()])),
        format!("copied to {}\n", copy.display())
    );
    let again = keeper.service(&["backup"], &[copy.to_str().unwrap()]);
    assert_eq!(again.status.code(), Some(2), "{}", said(&again));
    assert_eq!(
        said(&keeper.service(&["rebuild"], &[])),
        "2 sites, 2 runs\n"
    );
    assert_eq!(
        said(&keeper.nightly()),
        "2 sites compared, 0 runs, 0 failures\n"
    );
    // A site that cannot be run: the night is done, and says so by its exit code.
    let site = keeper.file("sites/isidis.toml");
    let text = fs::read_to_string(&site).unwrap();
    fs::write(&site, format!("{text}\n[nonsense]\n")).unwrap();
    let failed = keeper.nightly();
    assert_eq!(said(&failed), "2 sites compared, 0 runs, 1 failure\n");
    assert_eq!(failed.status.code(), Some(2));
    assert!(
        keeper
            .file("products/isidis/current/report/index.html")
            .is_file()
    );
    // Half a database is told as such, and where the copies are.
    let database = keeper.file("state/areograph.db");
    let bytes = fs::read(&database).unwrap();
    fs::write(
        &database,
        [&bytes[..100], &vec![0xff; bytes.len() - 100]].concat(),
    )
    .unwrap();
    for ending in ["-wal", "-shm"] {
        let _ = fs::remove_file(keeper.file(&format!("state/areograph.db{ending}")));
    }
    let damaged = keeper.nightly();
    assert_eq!(damaged.status.code(), Some(3), "{}", said(&damaged));
    assert!(
        said(&damaged).contains("areograph service rebuild"),
        "{}",
        said(&damaged)
    );
}

#[test]
fn a_token_is_shown_once_listed_and_revoked() {
    let keeper = Keeper::new();
    let made = said(&keeper.service(
        &["token", "add"],
        &["--role", "operate", "--note", "night shift", "--days", "3"],
    ));
    let token = made.trim();
    assert!(token.starts_with("areo_") && token.len() == 78, "{made}");
    let id = &token[5..13];
    let list = said(&keeper.service(&["token", "list"], &[]));
    assert!(
        list.starts_with(&format!("{id}  operate  until 20"))
            && list.ends_with("never used  night shift\n"),
        "{list}"
    );
    assert!(!list.contains(&token[14..]));
    let revoked = keeper.service(&["token", "revoke"], &[id]);
    assert_eq!(said(&revoked), format!("{id} is revoked\n"));
    assert!(said(&keeper.service(&["token", "list"], &[])).contains("revoked 20"));
    let unknown = keeper.service(&["token", "revoke"], &["00000000"]);
    assert_eq!(unknown.status.code(), Some(2));
}

#[test]
fn a_configuration_stands_and_an_address_is_refused() {
    let keeper = Keeper::new();
    let again = areograph()
        .args(["serve", "--init"])
        .arg(keeper.folder.path().join("demo"))
        .output()
        .unwrap();
    assert_eq!(again.status.code(), Some(2));
    assert!(said(&again).contains("a configuration already exists"));
    let mut serve = areograph();
    serve.arg("serve").arg(keeper.file("areograph.toml"));
    let public = serve.args(["--listen", "0.0.0.0:0"]).output().unwrap();
    assert_eq!(public.status.code(), Some(2));
    assert!(
        said(&public).contains("behind_tls_proxy"),
        "{}",
        said(&public)
    );
}

#[test]
fn a_folder_that_was_never_seen_must_be_there() {
    let keeper = Keeper::new();
    fs::rename(keeper.file("kernels"), keeper.file("elsewhere")).unwrap();
    let night = keeper.nightly();
    assert_eq!(night.status.code(), Some(2));
    for part in [
        "areograph.toml",
        "inputs.kernels",
        "never available",
        "mount",
    ] {
        assert!(said(&night).contains(part), "{}", said(&night));
    }
}

#[test]
fn units_of_systemd_are_sound() {
    let test = "units_of_systemd_are_sound";
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/systemd");
    if Command::new("systemd-analyze")
        .arg("--version")
        .output()
        .is_err()
    {
        outside::skipped(test, "no systemd-analyze");
        return;
    }
    outside::found(test);
    // The program that the units name is where a package puts it; here any will do.
    let copy = tempfile::tempdir().unwrap();
    let mut units = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let unit = copy.path().join(path.file_name().unwrap());
        fs::write(&unit, text.replace("/usr/local/bin/areograph", "/bin/true")).unwrap();
        units.push(unit);
    }
    assert_eq!(units.len(), 3);
    let verified = Command::new("systemd-analyze")
        .arg("verify")
        .args(["--man=no", "--recursive-errors=no"])
        .args(&units)
        .output()
        .unwrap();
    assert!(verified.status.success(), "{}", said(&verified));
    let service = copy.path().join("areograph.service");
    let exposed = Command::new("systemd-analyze")
        .args(["security", "--offline=yes", "--threshold=40"])
        .arg(service)
        .output()
        .unwrap();
    // 4.0 of 10: what is left is the network, for the pages.
    assert!(exposed.status.success(), "{}", said(&exposed));
}

/// The value of a setting of a unit.
fn setting<'a>(unit: &'a str, name: &str) -> Option<&'a str> {
    let start = format!("{name}=");
    unit.lines().find_map(|line| line.strip_prefix(&start))
}

/// The text between two marks.
fn between<'a>(text: &'a str, before: &str, after: &str) -> &'a str {
    let (_, rest) = text.split_once(before).unwrap();
    rest.split_once(after).unwrap().0
}

#[test]
fn the_packaged_configuration_names_folders_that_the_units_let_it_write() {
    let checkout = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |name: &str| fs::read_to_string(checkout.join(name)).unwrap();
    let (script, example) = (read("scripts/deb"), read("config/areograph.toml"));
    // The configuration as the script of the package makes it.
    let state = between(&script, "\nstate=", "\n");
    let edit = between(&script, "\nsed -E \"", "\" config/areograph.toml").replace("$state", state);
    let made = Command::new("sed")
        .args(["-E", &edit])
        .arg(checkout.join("config/areograph.toml"))
        .output()
        .unwrap();
    let packaged = String::from_utf8(made.stdout).unwrap();
    assert_ne!(packaged, example);
    let file = Path::new("/etc/areograph/areograph.toml");
    let config = ServiceConfig::parse(&packaged, file).unwrap().config;
    let inputs = [
        &config.inputs.sites,
        &config.inputs.kernels,
        &config.inputs.data,
    ];
    let inputs: Vec<&PathBuf> = inputs.into_iter().flatten().collect();
    let written = [
        &config.outputs.products,
        &config.outputs.state,
        &config.fetch.folder,
    ];
    for unit in ["areograph.service", "areograph-nightly.service"] {
        let unit = read(&format!("config/systemd/{unit}"));
        let writable = setting(&unit, "ReadWritePaths").unwrap();
        assert_eq!(
            writable,
            format!("/var/lib/{}", setting(&unit, "StateDirectory").unwrap())
        );
        assert_eq!(writable, state);
        for folder in inputs.iter().chain(&written) {
            assert!(folder.starts_with(writable), "{}", folder.display());
        }
        assert!(
            setting(&unit, "ExecStart")
                .unwrap()
                .ends_with(file.to_str().unwrap()),
            "{unit}"
        );
        assert_eq!(setting(&unit, "User"), Some("areograph"));
        // Hooks of the package need no home and no device.
        assert_eq!(setting(&unit, "ProtectSystem"), Some("strict"));
    }
    // The package makes every folder before the first start, which requires those of the inputs.
    let made = between(&script, "for folder in ''", "; do");
    for folder in inputs {
        let name = folder.strip_prefix(state).unwrap().display();
        assert!(made.contains(&format!(" /{name} ")), "{name} of{made}");
    }
    assert!(script.contains("u areograph - "));
}
