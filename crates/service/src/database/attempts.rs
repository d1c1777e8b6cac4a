//! Attempts: the worker processes of a job, one after the other.

use rusqlite::{Connection, Row, Transaction, params};
use serde::Serialize;
use utoipa::ToSchema;

use super::Stored;
use crate::{instant::Instant, worker::process::ProcessIdentity};

/// An attempt: one worker process.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Attempt {
    /// Its number, from 1.
    pub n: i64,
    /// When it began.
    pub started_utc: Instant,
    /// Its last heartbeat.
    pub beat_utc: Instant,
    /// Memory in use, kibibytes.
    pub rss_kib: Option<i64>,
    /// Last reported stage.
    pub stage: Option<String>,
    /// Progress in that stage.
    pub done: Option<i64>,
    /// Total of that progress.
    pub of: Option<i64>,
    /// Unit of the progress.
    pub unit: Option<String>,
    /// When it ended.
    pub ended_utc: Option<Instant>,
    /// How it ended.
    pub how: Option<String>,
    /// Exit code.
    pub exit: Option<i64>,
    /// Signal that ended it.
    pub signal: Option<i64>,
    /// Path of its log.
    #[serde(skip)]
    pub log: String,
    /// Its process, once started.
    #[serde(skip)]
    pub process: Option<ProcessIdentity>,
    /// Whether Slurm runs it; unknown for attempts of earlier versions.
    #[serde(skip)]
    pub is_on_cluster: Option<bool>,
}

/// Records the start of an attempt.
///
/// * `is_on_cluster` – whether Slurm runs it
/// * `log` – a path below the state folder
///
/// # Errors
/// SQLite errors.
pub fn begin_attempt(
    transaction: &Transaction<'_>,
    now_ms: i64,
    (job, n): (i64, i64),
    is_on_cluster: bool,
    log: &str,
) -> Stored<()> {
    transaction.execute(
        "INSERT INTO attempt (job, n, started_ms, beat_ms, on_cluster, log) VALUES (?1, ?2, ?3, ?3, ?4, ?5)",
        params![job, n, now_ms, is_on_cluster, log],
    )?;
    Ok(())
}

/// Records the process of an attempt.
///
/// # Errors
/// SQLite errors.
pub fn put_process(
    transaction: &Transaction<'_>,
    (job, n): (i64, i64),
    process: &ProcessIdentity,
) -> Stored<()> {
    let start = i64::try_from(process.start).unwrap_or(i64::MAX);
    transaction.execute(
        "UPDATE attempt SET pid = ?3, pid_start = ?4, boot_id = ?5 WHERE job = ?1 AND n = ?2",
        params![job, n, process.pid, start, process.boot_id],
    )?;
    Ok(())
}

/// Records a heartbeat.
///
/// # Errors
/// SQLite errors.
pub fn put_beat(
    transaction: &Transaction<'_>,
    now_ms: i64,
    (job, n): (i64, i64),
    rss_kib: Option<u64>,
    stage: Option<&str>,
) -> Stored<()> {
    let rss_kib = rss_kib.and_then(|kib| i64::try_from(kib).ok());
    transaction.execute(
        "UPDATE attempt SET beat_ms = ?3, rss_kib = coalesce(?4, rss_kib), stage = coalesce(?5, stage) WHERE job = ?1 AND n = ?2",
        params![job, n, now_ms, rss_kib, stage],
    )?;
    Ok(())
}

/// End of an attempt.
#[derive(Debug, Clone, Copy, Default)]
pub struct AttemptEnd<'a> {
    /// As text.
    pub how: &'a str,
    /// Exit code.
    pub exit: Option<i32>,
    /// Signal.
    pub signal: Option<i32>,
}

/// Records how an attempt ended; the first record stays. Returns whether this is the first.
///
/// # Errors
/// SQLite errors.
pub fn end_attempt(
    transaction: &Transaction<'_>,
    now_ms: i64,
    (job, n): (i64, i64),
    end: AttemptEnd<'_>,
) -> Stored<bool> {
    let noted = transaction.execute(
        "UPDATE attempt SET ended_ms = ?3, how = ?4, exit = ?5, signal = ?6 WHERE job = ?1 AND n = ?2 AND ended_ms IS NULL",
        params![job, n, now_ms, end.how, end.exit, end.signal],
    )?;
    Ok(noted > 0)
}

/// The attempts of a job, at most the newest `limit`, the newest first.
///
/// # Errors
/// SQLite errors.
pub fn attempts(connection: &Connection, job: i64, limit: u32) -> Stored<Vec<Attempt>> {
    let mut query = connection
        .prepare_cached("SELECT * FROM attempt WHERE job = ?1 ORDER BY n DESC LIMIT ?2")?;
    let found = query.query_map(params![job, limit], attempt_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

fn attempt_row(row: &Row<'_>) -> rusqlite::Result<Attempt> {
    let (pid, start, boot_id): (Option<u32>, Option<i64>, Option<String>) =
        (row.get("pid")?, row.get("pid_start")?, row.get("boot_id")?);
    let process = pid.zip(start).zip(boot_id);
    Ok(Attempt {
        n: row.get("n")?,
        started_utc: row.get("started_ms")?,
        beat_utc: row.get("beat_ms")?,
        rss_kib: row.get("rss_kib")?,
        stage: row.get("stage")?,
        done: row.get("done")?,
        of: row.get("of")?,
        unit: row.get("unit")?,
        ended_utc: row.get("ended_ms")?,
        how: row.get("how")?,
        exit: row.get("exit")?,
        signal: row.get("signal")?,
        log: row.get("log")?,
        process: process.map(|((pid, start), boot_id)| ProcessIdentity {
            pid,
            start: start.unsigned_abs(),
            boot_id,
        }),
        is_on_cluster: row.get("on_cluster")?,
    })
}
