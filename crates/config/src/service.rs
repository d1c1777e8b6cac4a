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
    campaign::ExecutorKind,
    declare::{Declare as _, Keys, Many, declare_table, key, of_the_file, table, tables},
    document::{Document, with_file},
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
        /// Where these processes run.
        executor: ServiceExecutorConfig = table(),
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
# Service of areograph (`areograph serve` and `areograph nightly`): every key with its unit, range and default.
#
# Only the folders of [inputs] are required; an omitted key has the default given here. Relative paths
# are relative to the folder of this file. Schema: schema/service.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Service configuration of areograph",
        "The TOML file of the service as JSON. areograph checks more than a schema can: the agreement \
         between keys, and the existence of folders.",
    ];

    with_file!();
}

declare_table! {
    /// Input folders. Site files may refer only to files below these folders. A folder must exist when the service
    /// first reads it; if it is temporarily absent later, the sites that use it wait.
    pub struct ServiceInputs {
        /// Folders of site files (`*.toml`, without subfolders). The next poll detects new and changed files.
        sites: Vec<PathBuf> = key(list(MIRROR).each_once("each folder once")).required().example(r#"["sites"]"#),
        /// Kernel folders, including subfolders.
        kernels: Vec<PathBuf> = key(list(MIRROR).each_once("each folder once")).required().example(r#"["kernels"]"#),
        /// Folders of PEDR files, labels and tie points, including subfolders.
        data: Vec<PathBuf> = key(list(MIRROR).each_once("each folder once"))
            .required()
            .example(r#"["pedr", "labels", "ties"]"#),
    }
}

declare_table! {
    /// Output folders; created if missing.
    pub struct ServiceOutputs {
        /// Folder of the products: `<products>/<site>/current` refers to the products of the newest valid run.
        products: PathBuf = key(text()).or("products".to_owned()).then(|path, keys: &mut Keys<'_, '_>| keys.review().resolve(&path)),
        /// Folder of the database, its copies and the logs; on a local disk, for one service only.
        state: PathBuf = key(text()).or("state".to_owned()).then(|path, keys: &mut Keys<'_, '_>| keys.review().resolve(&path)),
    }
}

declare_table! {
    /// Times at which every site is checked, whether or not a change was detected.
    pub struct ScheduleConfig {
        /// Time of the check in five fields: minute, hour, day of the month, month, day of the week.
        cron: String = key(matching(
            "five fields such as `30 2 * * *`",
            r"^\S+( +\S+){4}$",
            |text| text.split_ascii_whitespace().count() == 5,
        )).or("30 2 * * *".to_owned()),
        /// IANA time zone of `cron`. A time that daylight saving skips is moved to the end of the gap; a repeated time
        /// applies at its first occurrence.
        zone: String = key(matching(
            "a time zone such as Europe/Berlin or UTC",
            r"^[A-Za-z0-9_+/-]+$",
            |text| text.parse::<chrono_tz::Tz>().is_ok(),
        )).or("UTC".to_owned()),
        /// Largest age of a missed night that the service makes up for after a restart; of several missed nights, only
        /// the last is made up for.
        catch_up_h: f64 = key(from_to(0.0, 8784.0)).or(36.0),
    }
}

declare_table! {
    /// Detection of changes: files are listed, not watched, since network file systems do not report changes.
    pub struct ChangesConfig {
        /// Time between two polls of all folders.
        scan_interval_s: f64 = key(from_to(0.05, 86_400.0)).or(60.0),
        /// Time without changes in a folder of kernels or data after which the folder is used, since mirrors copy files in
        /// pieces. Where files appear whole, by renaming, 0 suffices: a file is then used when two polls find it unchanged.
        quiet_period_s: f64 = key(from_to(0.0, 86_400.0)).or(600.0),
        /// Largest share of files that may disappear from a folder; above this limit, the folder is treated as
        /// unavailable, and the sites that use it wait.
        max_loss: f64 = key(from_to(0.0, 1.0)).or(0.2),
        /// Longest time for listing a folder; an unavailable mount may not respond.
        sweep_limit_s: f64 = key(from_to(0.1, 3600.0)).or(30.0),
        /// Interval at which all files are reread, even if the file system reports no change, days; 0 disables
        /// rereading.
        scrub_days: f64 = key(from_to(0.0, 3660.0)).or(7.0),
        /// Rate at which published products are reread after a night, while no site runs, mebibytes per second.
        scrub_mib_per_s: f64 = key(from_to(0.1, 100_000.0)).or(32.0),
    }
}

declare_table! {
    /// Worker processes, which run one site each.
    pub struct WorkersConfig {
        /// Number of simultaneous worker processes.
        count: u16 = key(whole_from_to(1, 256)).or(2),
        /// Number of threads of each process.
        threads: u16 = key(whole_from_to(1, 1024)).or(2),
        /// Memory limit of each process, mebibytes. A worker uses about 106 MiB before it reads a site.
        memory_mib: u32 = key(whole_from_to(512, 1 << 24)).or(8192),
        /// Longest run time of a site.
        deadline_s: f64 = key(from_to(1.0, 2_592_000.0)).or(21_600.0),
        /// Time without a heartbeat after which a worker is terminated.
        silence_s: f64 = key(from_to(1.0, 86_400.0)).or(30.0),
        /// Largest size of the log of an attempt, kibibytes; the middle of a larger log is omitted.
        log_max_kib: u32 = key(whole_from_to(16, 1 << 20)).or(4096),
        /// Free space on the disks of products and state below which no site is started, mebibytes.
        min_free_mib: u32 = key(whole_from_to(0, 1 << 24)).or(1024),
        /// Delay before the first retry after an input or output failure; each further retry doubles the delay, up to
        /// 15 minutes.
        retry_s: f64 = key(from_to(0.0, 900.0)).or(30.0),
    }
}

declare_table! {
    /// Where sites run. Plans, hashes and other short work remain on this machine. The nodes of a cluster share the folders of
    /// inputs and products and the program, under the same paths. Slurm receives `workers.threads`, `workers.memory_mib` and
    /// `workers.deadline_s`; `workers.count` remains the number of simultaneous runs, waiting in the queue of the cluster or running.
    pub struct ServiceExecutorConfig {
        /// Kind of executor.
        kind: ExecutorKind = key(words([
            ("local", ExecutorKind::Local, "on this machine"),
            ("slurm", ExecutorKind::Slurm, "as jobs of a Slurm cluster, started with srun"),
        ])).or(ExecutorKind::Local),
        /// Further options of srun.
        options: Vec<String> = key(list_or_none(text())).or(Vec::new()).unused(r#"["--partition=planetary"]"#),
    }
}

declare_table! {
    /// Retention. The current run, its predecessor and pinned runs are always kept.
    pub struct RetentionConfig {
        /// Number of the newest runs kept for each site.
        runs: u32 = key(whole_from_to(1, 100_000)).or(14),
        /// Number of weeks for which one run per week is kept.
        weeks: u32 = key(whole_from_to(0, 1040)).or(52),
        /// Number of the newest events kept.
        events: u32 = key(whole_from_to(1000, 100_000_000)).or(100_000),
        /// Retention of the logs of attempts whose runs were removed, days.
        logs_days: f64 = key(from_to(0.0, 36_600.0)).or(90.0),
        /// Retention of the figures of removed runs for site trends, days.
        history_days: f64 = key(from_to(0.0, 36_600.0)).or(1830.0),
        /// Number of nightly database copies kept.
        copies: u32 = key(whole_from_to(0, 1000)).or(7),
    }
}

declare_table! {
    /// Limits beyond which a site counts as stale. A site with unchanged inputs is fresh, regardless of the age of its
    /// run.
    pub struct FreshnessConfig {
        /// Longest time from a change of site inputs to a run with the new inputs.
        stale_after_h: f64 = key(from_to(0.0, 87_840.0)).or(48.0),
        /// Longest time without a complete comparison of site inputs.
        unchecked_after_h: f64 = key(from_to(0.0, 87_840.0)).or(26.0),
    }
}

declare_table! {
    /// Largest movement of a site between two runs that causes no alert, as in `areograph report diff`.
    pub struct MovedConfig {
        /// Largest movement of a footprint, of a camera, or of the point at which a boresight meets the ground.
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
            "an address with port, such as 127.0.0.1:8470",
            r"^[0-9a-fA-F.:\[\]]+:[0-9]{1,5}$",
            |text| text.parse::<SocketAddr>().is_ok(),
        )).or("127.0.0.1:8470".to_owned()).then(|text, _: &mut Keys<'_, '_>| socket_address(&text)),
        /// Public address of the service behind a proxy, such as `https://mars.example.org`; requests for a different
        /// host are refused.
        public_url: String = key(matching(
            "https:// and a host, without a path",
            r"^(https://[A-Za-z0-9.-]+(:[0-9]{1,5})?)?$",
            |text| text.is_empty() || is_public_url(text),
        )).or(String::new()).unused(r#""https://mars.example.org""#),
        /// Whether a proxy in front of the service encrypts the connections.
        behind_tls_proxy: bool = key(words([("no", false, ""), ("yes", true, "")])).or(false),
        /// Addresses of proxies whose `X-Forwarded-For` is trusted.
        trusted_proxies: Vec<IpAddr> = key(list_or_none(matching(
            "addresses such as 10.0.0.1",
            r"^[0-9a-fA-F.:]+$",
            |text| text.parse::<IpAddr>().is_ok(),
        ))).or(Vec::new()).unused(r#"["127.0.0.1"]"#).then(|texts, _: &mut Keys<'_, '_>| addresses(&texts)),
        /// Whether all users of this machine may read on a loopback address without a token. Other addresses, and all
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
    /// Programs that receive events as JSON on standard input. They run without a shell, are terminated after 30 s, and
    /// are rerun after a failure.
    pub struct HookConfig {
        /// Program and arguments; a relative path of the program is relative to the folder of this file.
        command: Vec<String> = key(list(any_text()))
            .required()
            .unused(r#"["/usr/local/bin/tell-us", "--mars"]"#)
            .then(program_below_the_file),
        /// Events that the program receives; all events if empty.
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
    /// A file that sites read is no longer in its folder, or cannot be used.
    InputLost,
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
    const WORDS: [(&'static str, Self, &'static str); 13] = [
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
        ("invalid", Self::Invalid, "a run with invalid products"),
        ("moved", Self::Moved, "a site moved beyond a limit"),
        (
            "stale",
            Self::Stale,
            "a site is stale, or has not been checked for too long",
        ),
        (
            "root_unavailable",
            Self::RootUnavailable,
            "an input folder is unavailable",
        ),
        (
            "root_back",
            Self::RootBack,
            "an input folder is available again",
        ),
        (
            "input_lost",
            Self::InputLost,
            "sites wait for a file that is no longer in its folder or cannot be used",
        ),
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
        ("night_complete", Self::NightComplete, "summary of a night"),
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
            "a loopback address such as 127.0.0.1:8470, or behind_tls_proxy = \"yes\" for a service behind an encrypting proxy",
        );
    }
    let (products, state) = (&service.outputs.products, &service.outputs.state);
    if products == state {
        keys.refuse_below(
            "outputs",
            "state",
            "a folder other than the products folder",
        );
    }
    folders::outputs_apart(service, keys);
}
