//! The configuration of the service: `areograph serve` and `areograph nightly`.

mod fetch;
mod folders;

use std::{
    collections::BTreeMap,
    net::{IpAddr, SocketAddr},
    path::PathBuf,
};

use serde::Serialize;

use super::{
    declare::{Declare as _, Keys, Many, declare_table, key, of_the_file, table, tables},
    document::Document,
    forms::{any_text, from_to, list, list_or_none, matching, text, whole_from_to, words},
    paths::MIRROR,
};

pub use fetch::FetchConfig;

/// People read the output of hooks; more programs than this are a mistake.
const HOOKS: Many = Many {
    count: Some((1, 16)),
    purpose: " programs that receive events",
    ..Many::ANY
};

declare_table! {
    /// Everything that the service needs to know: every value checked.
    pub struct ServiceConfig {
        /// Name of the service in pages and alerts.
        name: String = key(text()).or("areograph".to_owned()),
        /// The file it was read from.
        file: PathBuf = of_the_file(),
        /// BLAKE3, hexadecimal, of the keys and values as written.
        blake3: String = of_the_file(),
        /// The same keys and values one by one.
        keys: BTreeMap<String, String> = of_the_file(),
        /// Folders that are read.
        inputs: ServiceInputs = table(),
        /// Folders that are written.
        outputs: ServiceOutputs = table(),
        /// When every site is checked.
        schedule: ScheduleConfig = table(),
        /// Files of archives.
        fetch: FetchConfig = table(),
        /// Detection of changes.
        changes: ChangesConfig = table(),
        /// The processes that run sites.
        workers: WorkersConfig = table(),
        /// Retention of runs, events, logs and copies.
        retention: RetentionConfig = table(),
        /// Limits beyond which a site counts as stale.
        freshness: FreshnessConfig = table(),
        /// Largest movement of a site between two runs without an alert.
        moved: MovedConfig = table(),
        /// The HTTP service.
        http: HttpConfig = table(),
        /// Programs that receive events.
        hooks: Vec<HookConfig> = tables(HOOKS),
    }
    check across_tables
}

impl Document for ServiceConfig {
    const EXAMPLE: &'static str = "config/areograph.toml";
    const HEADER: &'static str = "\
# The service of areograph, `areograph serve` and `areograph nightly`: every key with its unit, range and default.
#
# Only the folders of [inputs] are required; a key that is left out has the default given here. Relative paths
# are relative to the folder of this file. Schema: schema/service.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Service configuration of areograph",
        "The TOML file of the service as JSON. areograph checks more than a schema can: agreement between keys, and existence of folders.",
    ];

    fn with_file(self, file: PathBuf, blake3: String, keys: BTreeMap<String, String>) -> Self {
        Self {
            file,
            blake3,
            keys,
            ..self
        }
    }
}

declare_table! {
    /// Folders that are read. Site files may name files below these folders only. A folder must exist when the
    /// service first reads it; later it may be temporarily absent, and its sites are held.
    pub struct ServiceInputs {
        /// Folders of site files (`*.toml`, without subfolders). The next poll detects files that appear or change.
        sites: Vec<PathBuf> = key(list(MIRROR).each_once("each folder once")).required().example(r#"["sites"]"#),
        /// Folders of kernels, with their subfolders.
        kernels: Vec<PathBuf> = key(list(MIRROR).each_once("each folder once")).required().example(r#"["kernels"]"#),
        /// Folders of PEDR files, labels and tie points, with their subfolders.
        data: Vec<PathBuf> = key(list(MIRROR).each_once("each folder once"))
            .required()
            .example(r#"["pedr", "labels", "ties"]"#),
    }
}

declare_table! {
    /// Folders that are written; they are created if missing.
    pub struct ServiceOutputs {
        /// Products: `<products>/<site>/current` leads to the products of the newest valid run.
        products: PathBuf = key(text()).or("products".to_owned()).then(|path, keys: &mut Keys<'_, '_>| keys.review().resolve(&path)),
        /// Database, logs and copies of the database; on a local disk, for one service only.
        state: PathBuf = key(text()).or("state".to_owned()).then(|path, keys: &mut Keys<'_, '_>| keys.review().resolve(&path)),
    }
}

declare_table! {
    /// When every site is checked, whether or not a change was detected.
    pub struct ScheduleConfig {
        /// Five fields: minute, hour, day of the month, month, day of the week.
        cron: String = key(matching(
            "five fields as in `30 2 * * *`",
            r"^\S+( +\S+){4}$",
            |text| text.split_ascii_whitespace().count() == 5,
        )).or("30 2 * * *".to_owned()),
        /// IANA time zone of these fields. A time that daylight saving skips is moved to the end of the gap; of a
        /// repeated time the first counts.
        zone: String = key(matching(
            "a time zone as in Europe/Berlin or UTC",
            r"^[A-Za-z0-9_+/-]+$",
            |text| text.parse::<chrono_tz::Tz>().is_ok(),
        )).or("UTC".to_owned()),
        /// A night that was missed because the service did not run is made up for if it is not older than this; of
        /// several nights only the newest.
        catch_up_h: f64 = key(from_to(0.0, 8784.0)).or(36.0),
    }
}

declare_table! {
    /// Detection of changes: files are listed, not watched, since network file systems do not report changes.
    pub struct ChangesConfig {
        /// Time between two polls of all folders.
        scan_interval_s: f64 = key(from_to(0.05, 86_400.0)).or(60.0),
        /// A folder is used when nothing below it has changed for this time: mirrors copy slowly.
        quiet_period_s: f64 = key(from_to(0.0, 86_400.0)).or(600.0),
        /// A folder that has lost a larger share of its files is treated as unavailable, and its sites are held.
        max_loss: f64 = key(from_to(0.0, 1.0)).or(0.2),
        /// Longest time that listing a folder may take; a dead mount does not answer.
        sweep_limit_s: f64 = key(from_to(0.1, 3600.0)).or(30.0),
        /// Interval at which all files are read again, even if the file system reports no change, days; 0 never.
        scrub_days: f64 = key(from_to(0.0, 3660.0)).or(7.0),
        /// Rate at which published products are read again, mebibytes per second: after a night, while no site runs.
        scrub_mib_per_s: f64 = key(from_to(0.1, 100_000.0)).or(32.0),
    }
}

declare_table! {
    /// The processes that run sites, one site each.
    pub struct WorkersConfig {
        /// Number of processes that run at the same time.
        count: u16 = key(whole_from_to(1, 256)).or(2),
        /// Threads of each process.
        threads: u16 = key(whole_from_to(1, 1024)).or(2),
        /// Memory that each process may take, mebibytes. A worker takes about 106 before it reads a site.
        memory_mib: u32 = key(whole_from_to(512, 1 << 24)).or(8192),
        /// Longest time for a site.
        deadline_s: f64 = key(from_to(1.0, 2_592_000.0)).or(21_600.0),
        /// A worker without a heartbeat for this time is ended.
        silence_s: f64 = key(from_to(1.0, 86_400.0)).or(30.0),
        /// Longest log of an attempt, kibibytes; its middle is left out.
        log_max_kib: u32 = key(whole_from_to(16, 1 << 20)).or(4096),
        /// No site is started while the disk of products or state has less space, mebibytes.
        min_free_mib: u32 = key(whole_from_to(0, 1 << 24)).or(1024),
        /// Delay of the first attempt after a failure of input or output; each further one doubles it, up to 15 minutes.
        retry_s: f64 = key(from_to(0.0, 900.0)).or(30.0),
    }
}

declare_table! {
    /// Retention. The current run, its predecessor and pinned runs are always kept.
    pub struct RetentionConfig {
        /// Newest runs of each site.
        runs: u32 = key(whole_from_to(1, 100_000)).or(14),
        /// Number of weeks for which one run a week is kept.
        weeks: u32 = key(whole_from_to(0, 1040)).or(52),
        /// Newest events.
        events: u32 = key(whole_from_to(1000, 100_000_000)).or(100_000),
        /// Logs of attempts whose runs were removed, days.
        logs_days: f64 = key(from_to(0.0, 36_600.0)).or(90.0),
        /// Figures of removed runs, which the trends of a site show, days.
        history_days: f64 = key(from_to(0.0, 36_600.0)).or(1830.0),
        /// Nightly copies of the database.
        copies: u32 = key(whole_from_to(0, 1000)).or(7),
    }
}

declare_table! {
    /// Limits beyond which a site counts as stale. A site whose inputs did not change is fresh, however old its run.
    pub struct FreshnessConfig {
        /// Longest time from a change of its inputs to a run with them.
        stale_after_h: f64 = key(from_to(0.0, 87_840.0)).or(48.0),
        /// Longest time without a complete comparison of its inputs.
        unchecked_after_h: f64 = key(from_to(0.0, 87_840.0)).or(26.0),
    }
}

declare_table! {
    /// Largest movement of a site between two runs without an alert, as for `areograph report diff`.
    pub struct MovedConfig {
        /// Largest movement of a footprint, a camera or a boresight on the ground.
        limit_m: f64 = key(from_to(0.0, 1e7)).or(50.0),
        /// Largest rotation of a camera.
        limit_arcsec: f64 = key(from_to(0.0, 1_296_000.0)).or(60.0),
    }
}

declare_table! {
    /// The HTTP service: pages, and an interface for programs.
    pub struct HttpConfig {
        /// Address and port. An address that other machines can reach requires `behind_tls_proxy`.
        listen: SocketAddr = key(matching(
            "an address with its port, as in 127.0.0.1:8470",
            r"^[0-9a-fA-F.:\[\]]+:[0-9]{1,5}$",
            |text| text.parse::<SocketAddr>().is_ok(),
        )).or("127.0.0.1:8470".to_owned()).then(|text, _: &mut Keys<'_, '_>| socket_address(&text)),
        /// The address under which a proxy shows the service, as in `https://mars.example.org`; requests for another host are
        /// refused.
        public_url: String = key(matching(
            "a host with https:// before it, without a path",
            r"^(https://[A-Za-z0-9.-]+(:[0-9]{1,5})?)?$",
            |text| text.is_empty() || is_public_url(text),
        )).or(String::new()).unused(r#""https://mars.example.org""#),
        /// A proxy in front of the service encrypts the connections.
        behind_tls_proxy: bool = key(words([("no", false, ""), ("yes", true, "")])).or(false),
        /// Addresses of proxies whose `X-Forwarded-For` is trusted.
        trusted_proxies: Vec<IpAddr> = key(list_or_none(matching(
            "addresses as in 10.0.0.1",
            r"^[0-9a-fA-F.:]+$",
            |text| text.parse::<IpAddr>().is_ok(),
        ))).or(Vec::new()).unused(r#"["127.0.0.1"]"#).then(|texts, _: &mut Keys<'_, '_>| addresses(&texts)),
        /// Readers on a loopback address: all users of this machine, or holders of a token. Other addresses, and all
        /// changes, always require a token.
        open_reading: bool = key(words([
            ("yes", true, "reading from this machine needs no token"),
            ("no", false, "reading needs a token"),
        ])).or(true),
    }
}

/// The text has been checked; an address that cannot be had is the one that the system chooses.
fn socket_address(text: &str) -> SocketAddr {
    text.parse()
        .unwrap_or_else(|_| SocketAddr::from(([127, 0, 0, 1], 0)))
}

fn addresses(texts: &[String]) -> Vec<IpAddr> {
    texts.iter().filter_map(|text| text.parse().ok()).collect()
}

fn is_public_url(text: &str) -> bool {
    text.strip_prefix("https://")
        .is_some_and(|host| !host.is_empty() && !host.contains(['/', '?', '#', '@', ' ']))
}

declare_table! {
    /// Programs that receive events, as JSON on their standard input: run without a shell, ended after 30 s, run
    /// again when they fail.
    pub struct HookConfig {
        /// Program and arguments; a relative path of the program is relative to the folder of this file.
        command: Vec<String> = key(list(any_text()))
            .required()
            .unused(r#"["/usr/local/bin/tell-us", "--mars"]"#)
            .then(program_below_the_file),
        /// Events that it receives; all events when empty.
        events: Vec<AlertKind> = key(list_or_none(words(AlertKind::WORDS))).or(Vec::new()).unused(r#"["failed", "night_complete"]"#),
    }
}

/// A program without a folder is looked for in the search path.
fn program_below_the_file(mut command: Vec<String>, keys: &mut Keys<'_, '_>) -> Vec<String> {
    if let Some(program) = command.first_mut().filter(|program| program.contains('/')) {
        *program = keys
            .review()
            .resolve(program)
            .to_string_lossy()
            .into_owned();
    }
    command
}

/// Events of which people are notified.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum AlertKind {
    /// First failure of a site after a success.
    Failed,
    /// First success after a failure.
    Recovered,
    /// A run made products that are not valid.
    Invalid,
    /// A site moved beyond a limit.
    Moved,
    /// A site is stale, or was not checked for too long.
    Stale,
    /// A folder of inputs is not available.
    RootUnavailable,
    /// A folder of inputs is back.
    RootBack,
    /// Archive files could not be fetched.
    FetchFailed,
    /// The disk is nearly full.
    DiskLow,
    /// A published product does not match its manifest.
    ProductDamaged,
    /// The database was lost and rebuilt from the products.
    DatabaseLost,
    /// A night is over.
    NightComplete,
}

impl AlertKind {
    const WORDS: [(&'static str, Self, &'static str); 12] = [
        (
            "failed",
            Self::Failed,
            "first failure of a site after a success",
        ),
        (
            "recovered",
            Self::Recovered,
            "first success after a failure",
        ),
        ("invalid", Self::Invalid, "products that are not valid"),
        ("moved", Self::Moved, "a site moved beyond a limit"),
        (
            "stale",
            Self::Stale,
            "a site is stale, or was not checked for too long",
        ),
        (
            "root_unavailable",
            Self::RootUnavailable,
            "a folder of inputs is not available",
        ),
        ("root_back", Self::RootBack, "a folder of inputs is back"),
        (
            "fetch_failed",
            Self::FetchFailed,
            "archive files could not be fetched",
        ),
        ("disk_low", Self::DiskLow, "the disk is nearly full"),
        (
            "product_damaged",
            Self::ProductDamaged,
            "a published product does not match its manifest",
        ),
        (
            "database_lost",
            Self::DatabaseLost,
            "the database was lost and rebuilt from the products",
        ),
        (
            "night_complete",
            Self::NightComplete,
            "once a night: its summary",
        ),
    ];
}

fn across_tables(service: &ServiceConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| serde_json::json!({"required": ["inputs"]}));
    if keys.span_of("inputs").is_none() {
        keys.missing(
            "inputs",
            "a table [inputs] with the folders sites, kernels and data",
        );
    }
    let http = &service.http;
    if !http.listen.ip().is_loopback() && !http.behind_tls_proxy {
        keys.refuse_below(
            "http",
            "listen",
            "a loopback address as in 127.0.0.1:8470, or behind_tls_proxy = \"yes\" for a service behind a proxy that encrypts",
        );
    }
    let (products, state) = (&service.outputs.products, &service.outputs.state);
    if products == state {
        keys.refuse_below(
            "outputs",
            "state",
            "another folder than that of the products",
        );
    }
    folders::outputs_apart(service, keys);
}
