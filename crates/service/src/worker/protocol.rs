//! The lines between the service and a worker: one JSON object each, at most [`LINE_MAX`] bytes.
//!
//! The service writes one [`Task`], then [`Here`] at intervals if the worker has a lease, and perhaps one [`Cancel`]; the end of its output means that the service has
//! ended, and the worker stops. The worker writes [`Line`]s, `hello` first and `answer` or `failure` last; one that is
//! too long for a line is sent in pieces. Unknown fields are ignored.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use areograph_base::body::Body;
use areograph_store::files::Identity;

/// Version of these lines.
pub const PROTOCOL: u32 = 1;
/// Longest line, bytes.
pub const LINE_MAX: usize = 64 << 10;

/// Longest answer in pieces, bytes.
pub const ANSWER_MAX: usize = 64 << 20;

/// A task of a worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// [`PROTOCOL`].
    pub v: u32,
    /// The job, 0 for work that belongs to none.
    pub job: i64,
    /// Number of the attempt, from 1.
    pub attempt: i64,
    /// The work.
    pub what: What,
    /// Known hashes of input files, which the worker extends: the hash cache.
    pub hashes_file: PathBuf,
    /// Folders below which input files must be; empty for no restriction.
    pub roots: Vec<PathBuf>,
    /// Threads.
    pub threads: u16,
    /// Memory limit of the worker, mebibytes.
    pub memory_mib: u32,
}

/// The work of a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum What {
    /// Runs a site; products are written to `<working>`, and after publication hard-linked to `<runs>/<run>`.
    Run {
        /// The site file.
        site_file: PathBuf,
        /// BLAKE3 of its keys as seen by the service; a different one is a failure of input.
        config_blake3: String,
        /// Folder whose subfolder with the site's name is the site's working folder.
        out: PathBuf,
        /// Folder of the site's runs.
        runs: PathBuf,
        /// Identifier of this attempt's run.
        run: String,
        /// Whether every stage runs.
        force: bool,
    },
    /// Reports the plan of a run, and the files that the site reads.
    Plan {
        /// The site file.
        site_file: PathBuf,
        /// As for a run.
        out: PathBuf,
    },
    /// Compares two runs.
    Diff {
        /// Folder of the earlier run.
        before: PathBuf,
        /// Folder of the later run.
        after: PathBuf,
        /// Page to write, if any.
        page: Option<PathBuf>,
        /// Limit of movements, metres.
        limit_m: f64,
        /// Limit of camera rotations, arcseconds.
        limit_arcsec: f64,
    },
    /// Opens kernels with CSPICE and reports their coverage.
    Probe {
        /// The kernels.
        files: Vec<PathBuf>,
    },
    /// Lists the files below folders, in a process since an unresponsive mount may block it.
    List {
        /// The folders.
        roots: Vec<PathBuf>,
        /// File of the answer, one [`Listed`] per line: it is too long for a line of this protocol.
        into: PathBuf,
    },
    /// Reads files and reports their hashes.
    Hash {
        /// The files.
        files: Vec<PathBuf>,
        /// Whether they are read even if the hash cache knows them.
        rehash: bool,
    },
    /// Searches the shots of runs within a polygon.
    Shots {
        /// Folders of the current runs.
        runs: Vec<PathBuf>,
        /// Corners of the polygon: east longitude and areocentric latitude, degrees.
        polygon: Vec<[f64; 2]>,
        /// Maximum number of rows.
        rows_max: u64,
        /// `csv`, `geojson` or `parquet`.
        format: String,
        /// File of the answer.
        into: PathBuf,
    },
}

/// The reason to stop a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CancelWhy {
    /// A person requested it.
    User,
    /// The service ends.
    Shutdown,
    /// The time limit was exceeded.
    Deadline,
}

/// The line that asks a worker to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cancel {
    /// The reason.
    pub cancel: CancelWhy,
}

/// The line that renews the lease of a worker on another computer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Here {
    /// Whether the service is there.
    pub here: bool,
}

/// A message of a worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "line", rename_all = "snake_case")]
pub enum Line {
    /// First.
    Hello {
        /// [`PROTOCOL`].
        v: u32,
        /// Version of areograph.
        version: String,
        /// Process.
        pid: u32,
    },
    /// A stage begins, was kept, or is done.
    Stage {
        /// Label of the stage, for example `register/E02-00665`.
        stage: String,
        /// `running`, `kept` or `done`.
        state: String,
        /// Reason why it runs, or the statement that it does not.
        because: String,
        /// Seconds that it took; 0 before it is done.
        seconds: f64,
    },
    /// Heartbeat, every 2 s.
    Beat {
        /// Memory in use, kibibytes.
        rss_kib: u64,
    },
    /// A piece of a line that is too long for one: their texts, joined, are that line.
    Piece {
        /// The piece.
        text: String,
        /// Whether more of them follow.
        more: bool,
    },
    /// Last message of successful work; its content depends on the kind of work.
    Answer(Answer),
    /// Last message of failed work.
    Failure(Failure),
}

/// Result of work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "done", rename_all = "snake_case")]
pub enum Answer {
    /// Answer of a run.
    Run(RunAnswer),
    /// Answer of a plan.
    Plan(PlanAnswer),
    /// Answer of a comparison: the headline, sentences, whether a limit was exceeded, and the largest movements.
    Diff {
        /// One sentence.
        headline: String,
        /// Further sentences.
        sentences: Vec<String>,
        /// Whether a limit was exceeded.
        beyond_limit: bool,
    },
    /// Answer of a probe: kernels in the order of the task.
    Probe {
        /// The coverage of each, or the reason for which CSPICE rejects it.
        kernels: Vec<Probed>,
    },
    /// Answer of a list: the number of files.
    List {
        /// Files found.
        files: u64,
    },
    /// Answer of hashing: files in the order of the task.
    Hash {
        /// The result for each.
        files: Vec<Hashed>,
    },
    /// Answer of a search.
    Shots {
        /// Rows written.
        rows: u64,
        /// Whether the result is complete.
        complete: bool,
    },
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunAnswer {
    /// The run whose folder now contains the products; `None` if nothing had changed.
    pub run: Option<String>,
    /// BLAKE3 of the manifest.
    pub manifest_blake3: String,
    /// Whether the products are valid.
    pub valid: bool,
    /// The verdict in a word.
    pub verdict: String,
    /// Reasons why they are not valid.
    pub reasons: Vec<String>,
    /// Stages that ran, with their reasons.
    pub ran: Vec<PlannedStage>,
}

/// Plan of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanAnswer {
    /// BLAKE3 of the keys of the site file.
    pub config_blake3: String,
    /// Every stage.
    pub stages: Vec<PlannedStage>,
    /// Files that the site reads, with their hashes.
    pub files: Vec<PlannedFile>,
    /// Extent of the site's windows: west, south, east, north, degrees; `None` for a site without windows.
    pub bounds_deg: Option<[f64; 4]>,
    /// The body of the site.
    pub body: Body,
}

/// A stage with the reason why it runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedStage {
    /// Its label.
    pub stage: String,
    /// Whether it runs.
    pub runs: bool,
    /// Reason why it runs, or the statement that it does not.
    pub because: String,
}

/// A file that a site reads.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedFile {
    /// Its path.
    pub path: PathBuf,
    /// BLAKE3 of its content.
    pub blake3: String,
}

/// Entries of a list, in the order of the folders of its task and of names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "listed", rename_all = "snake_case")]
pub enum Listed {
    /// A regular file, links followed.
    File {
        /// Its path below the folder as the task names it.
        path: PathBuf,
        /// Its identity in the file system.
        identity: Identity,
    },
    /// A file or folder that cannot be examined.
    Unreadable {
        /// Its path.
        path: PathBuf,
        /// The system's reason.
        problem: String,
    },
    /// After the files of a folder of the task: all of it has been listed, or it does not exist.
    Root {
        /// The folder.
        path: PathBuf,
        /// Device of its file system.
        device: Option<u64>,
        /// Files found below it.
        files: u64,
        /// The reason for which it cannot be listed.
        problem: Option<String>,
    },
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hashed {
    /// Its path.
    pub path: PathBuf,
    /// BLAKE3 of its content; `None` for a file that cannot be read.
    pub blake3: Option<String>,
    /// The reason for which it cannot be read.
    pub problem: Option<String>,
}

/// A kernel that was opened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Probed {
    /// Its path.
    pub path: PathBuf,
    /// BLAKE3 of its content.
    pub blake3: String,
    /// The reason for which it cannot be used.
    pub problem: Option<String>,
    /// Its coverage of the spacecraft: `position`, relative to any body, and `attitude`, lists of intervals as in
    /// `areograph kernels coverage --json`; null for a kernel that is neither SPK nor CK, or whose times no clock
    /// kernel converts.
    pub coverage: Value,
}

/// A failure of work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Exit code of its kind: 1 bug, 2 configuration, 3 input, 4 coverage, 6 input or output, 130 stopped.
    pub code: u8,
    /// Whether another run held the site's lock: no attempt was made.
    pub busy: bool,
    /// The site.
    pub site: Option<String>,
    /// The stage.
    pub stage: Option<String>,
    /// The file.
    pub file: Option<PathBuf>,
    /// The complete message with its advice.
    pub text: String,
}
