//! The lines between the service and a worker: one JSON object each, at most [`LINE_MAX`] bytes.
//!
//! The service writes one [`Task`], later perhaps one [`Cancel`]; the end of its output means that it is gone, and the worker
//! stops. The worker writes [`Line`]s, `hello` first and `answer` or `failure` last; one that is too long for a line goes in
//! pieces. Unknown fields are ignored.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use areograph_store::files::Identity;

/// Version of these lines.
pub const PROTOCOL: u32 = 1;
/// Longest line, bytes.
pub const LINE_MAX: usize = 64 << 10;

/// Longest answer in pieces, bytes.
pub const ANSWER_MAX: usize = 64 << 20;

/// What a worker is to do.
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
    /// Folders below which input files must lie; empty for no such rule.
    pub roots: Vec<PathBuf>,
    /// Threads.
    pub threads: u16,
    /// Memory that the worker may take, mebibytes.
    pub memory_mib: u32,
}

/// The work of a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum What {
    /// Runs a site; products go to `<working>`, and when they were published, hard links of them to `<runs>/<run>`.
    Run {
        /// The site file.
        site_file: PathBuf,
        /// BLAKE3 of its keys that the service has seen; another one is a failure of input.
        config_blake3: String,
        /// Folder whose subfolder of the site's name is the site's working folder.
        out: PathBuf,
        /// Folder of the site's runs.
        runs: PathBuf,
        /// Identifier of the run that this attempt makes.
        run: String,
        /// Whether every stage runs.
        force: bool,
    },
    /// Says what a run would do, and which files the site reads.
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
        /// How far anything may move, metres.
        limit_m: f64,
        /// How far a camera may turn, arcseconds.
        limit_arcsec: f64,
    },
    /// Opens kernels with CSPICE and tells what they cover.
    Probe {
        /// The kernels.
        files: Vec<PathBuf>,
    },
    /// Lists the files below folders, in a process since a dead mount does not answer.
    List {
        /// The folders.
        roots: Vec<PathBuf>,
        /// Where the answer goes, one [`Listed`] a line: it is too long for a line of this protocol.
        into: PathBuf,
    },
    /// Reads files and tells their hashes.
    Hash {
        /// The files.
        files: Vec<PathBuf>,
        /// Whether they are read even where the hash cache knows them.
        rehash: bool,
    },
    /// Searches the shots of runs within a polygon.
    Shots {
        /// Folders of the current runs.
        runs: Vec<PathBuf>,
        /// Corners of the polygon: east longitude and areocentric latitude, degrees.
        polygon: Vec<[f64; 2]>,
        /// Most rows.
        rows_max: u64,
        /// `csv`, `geojson` or `parquet`.
        format: String,
        /// Where the answer goes.
        into: PathBuf,
    },
}

/// Why a worker is asked to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CancelWhy {
    /// A person asked.
    User,
    /// The service ends.
    Shutdown,
    /// It took too long.
    Deadline,
}

/// The line that asks a worker to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cancel {
    /// Why.
    pub cancel: CancelWhy,
}

/// What a worker says.
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
        /// Why it runs, or that it does not.
        because: String,
        /// Seconds that it took; 0 before it is done.
        seconds: f64,
    },
    /// Sign of life, every 2 s.
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
    /// Last, of work that was done; its content by the kind of work.
    Answer(Answer),
    /// Last, of work that failed.
    Failure(Failure),
}

/// What came of work that was done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "done", rename_all = "snake_case")]
pub enum Answer {
    /// Of a run.
    Run(RunAnswer),
    /// Of a plan.
    Plan(PlanAnswer),
    /// Of a comparison: the headline, sentences, whether something moved beyond a limit, and the largest movements.
    Diff {
        /// In one sentence.
        headline: String,
        /// More of them.
        sentences: Vec<String>,
        /// Whether a limit was passed.
        beyond_limit: bool,
    },
    /// Of a probe: kernels in the order of the task.
    Probe {
        /// What each covers, or why CSPICE refuses it.
        kernels: Vec<Probed>,
    },
    /// Of a list: how many files there are.
    List {
        /// Files found.
        files: u64,
    },
    /// Of hashing: files in the order of the task.
    Hash {
        /// What was found of each.
        files: Vec<Hashed>,
    },
    /// Of a search.
    Shots {
        /// Rows written.
        rows: u64,
        /// Whether there are no more.
        complete: bool,
    },
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunAnswer {
    /// The run whose folder now holds the products; none when nothing had changed.
    pub run: Option<String>,
    /// BLAKE3 of the manifest.
    pub manifest_blake3: String,
    /// Whether the products are valid.
    pub valid: bool,
    /// The verdict in a word.
    pub verdict: String,
    /// Why they are not valid.
    pub reasons: Vec<String>,
    /// Stages that ran, with their reasons.
    pub ran: Vec<PlannedStage>,
}

/// What a run would do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanAnswer {
    /// BLAKE3 of the keys of the site file.
    pub config_blake3: String,
    /// Every stage.
    pub stages: Vec<PlannedStage>,
    /// Files that the site reads, with their hashes.
    pub files: Vec<PlannedFile>,
    /// What the site's windows span: west, south, east, north, degrees; none of a site without windows.
    pub bounds_deg: Option<[f64; 4]>,
}

/// A stage with the reason why it runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedStage {
    /// Its label.
    pub stage: String,
    /// Whether it runs.
    pub runs: bool,
    /// Why, or that it does not.
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

/// What a list tells, in the order of the folders of its task and of names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "listed", rename_all = "snake_case")]
pub enum Listed {
    /// A regular file, links followed.
    File {
        /// Its path below the folder as the task names it.
        path: PathBuf,
        /// What the file system says of it.
        identity: Identity,
    },
    /// A file or folder that cannot be looked at.
    Unreadable {
        /// Its path.
        path: PathBuf,
        /// The system's reason.
        problem: String,
    },
    /// Behind the files of a folder of the task: all of it has been listed, or it is not there.
    Root {
        /// The folder.
        path: PathBuf,
        /// Device of its file system.
        device: Option<u64>,
        /// Files found below it.
        files: u64,
        /// Why it cannot be listed.
        problem: Option<String>,
    },
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hashed {
    /// Its path.
    pub path: PathBuf,
    /// BLAKE3 of its content; none of a file that cannot be read.
    pub blake3: Option<String>,
    /// Why it cannot be read.
    pub problem: Option<String>,
}

/// A kernel that was opened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Probed {
    /// Its path.
    pub path: PathBuf,
    /// BLAKE3 of its content.
    pub blake3: String,
    /// Why it cannot be used.
    pub problem: Option<String>,
    /// What it holds of the spacecraft: `position`, relative to whatever body, and `attitude`, lists of intervals as those of
    /// `areograph kernels coverage --json`; null of a kernel that is neither SPK nor CK, or whose times no clock tells.
    pub coverage: Value,
}

/// Why work failed.
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
    /// The whole message with its advice.
    pub text: String,
}
