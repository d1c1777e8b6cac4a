//! Attempts of jobs, and totals.

use rusqlite::{Connection, OptionalExtension as _, params};
use serde::Serialize;
use utoipa::ToSchema;

use crate::{
    database::{Job, Stored, job},
    instant::Instant,
    state::JobState,
};

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
}

/// The attempts of a job, at most the newest `limit`, the newest first.
///
/// # Errors
/// SQLite errors.
pub fn attempts(connection: &Connection, job: i64, limit: u32) -> Stored<Vec<Attempt>> {
    let mut query = connection
        .prepare_cached("SELECT * FROM attempt WHERE job = ?1 ORDER BY n DESC LIMIT ?2")?;
    let found = query.query_map(params![job, limit], |row| {
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
        })
    })?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// At most `limit` jobs of a night.
///
/// # Errors
/// SQLite errors.
pub fn jobs_of_night(connection: &Connection, night: i64, limit: u32) -> Stored<Vec<Job>> {
    let mut query = connection
        .prepare_cached("SELECT id FROM job WHERE night = ?1 ORDER BY site, id LIMIT ?2")?;
    let found = query.query_map(params![night, limit], |row| row.get(0))?;
    let numbers: Vec<i64> = found.collect::<Result<_, _>>()?;
    let jobs = numbers.into_iter().map(|id| job(connection, id));
    jobs.filter_map(Stored::transpose).collect()
}

/// Totals for metrics.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Totals {
    /// Jobs by state.
    pub jobs: Vec<(JobState, i64)>,
    /// Runs that are kept.
    pub runs: i64,
    /// When the oldest queued job was created.
    pub oldest_queued_ms: Option<i64>,
    /// Alerts that no hook has accepted yet.
    pub undelivered: i64,
}

/// Counts jobs, runs and alerts.
///
/// # Errors
/// SQLite errors.
pub fn totals(connection: &Connection) -> Stored<Totals> {
    let mut query = connection.prepare_cached("SELECT state, count(*) FROM job GROUP BY state")?;
    let found = query.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get(1)?)))?;
    let counted: Vec<(String, i64)> = found.collect::<Result<_, _>>()?;
    let of = |state: JobState| counted.iter().find(|(name, _)| *name == state.name());
    let number = |sql: &str| connection.query_row(sql, [], |row| row.get::<_, Option<i64>>(0));
    Ok(Totals {
        jobs: JobState::ALL
            .into_iter()
            .map(|state| (state, of(state).map_or(0, |(_, count)| *count)))
            .collect(),
        runs: number("SELECT count(*) FROM run WHERE removed_ms IS NULL")?.unwrap_or(0),
        oldest_queued_ms: number("SELECT min(created_ms) FROM job WHERE state = 'queued'")?,
        undelivered: number("SELECT count(*) FROM outbox WHERE delivered_ms IS NULL")?.unwrap_or(0),
    })
}

/// When the last night that was not missed ended.
///
/// # Errors
/// SQLite errors.
pub fn last_complete_night_ms(connection: &Connection) -> Stored<Option<i64>> {
    let newest = "SELECT ended_ms FROM night WHERE ended_ms IS NOT NULL AND how != 'missed' ORDER BY id DESC LIMIT 1";
    Ok(connection
        .query_row(newest, [], |row| row.get(0))
        .optional()?)
}
