//! Jobs of a night, and totals.

use rusqlite::{Connection, OptionalExtension as _, params};

use crate::{
    database::{Job, Stored, job},
    state::JobState,
};

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

/// Endings of binary and text kernels, and the kinds that they name.
const KINDS: [(&str, &str); 7] = [
    ("bsp", "spk"),
    ("bc", "ck"),
    ("tls", "lsk"),
    ("tsc", "sclk"),
    ("tpc", "pck"),
    ("tf", "fk"),
    ("ti", "ik"),
];

/// Sites by the word of their verdict, and the last change of a usable kernel by kind.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Standing {
    /// Verdicts of the current runs of enabled sites, and their number; `None` without a run.
    pub verdicts: Vec<(Option<String>, i64)>,
    /// Kinds of kernels that exist, and the last change, milliseconds of UTC since 1970.
    pub newest_kernels: Vec<(&'static str, i64)>,
}

/// Counts verdicts, and finds the newest kernel of each kind.
///
/// # Errors
/// SQLite errors.
pub fn standing(connection: &Connection) -> Stored<Standing> {
    let mut query = connection.prepare_cached(
        "SELECT r.verdict, count(*) FROM site s LEFT JOIN run r ON r.id = s.current_run WHERE s.enabled GROUP BY 1",
    )?;
    let verdicts = query.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    let mut newest_kernels = Vec::new();
    let mut query = connection.prepare_cached(
        "SELECT max(f.changed_ms) FROM root r JOIN file_version f ON f.path > r.path || '/' AND f.path < r.path || '0'
         WHERE r.kind = 'kernels' AND f.state = 'ready' AND f.path LIKE ?1",
    )?;
    let verdicts = verdicts.collect::<Result<_, _>>()?;
    for (ending, kind) in KINDS {
        let newest: Option<i64> = query.query_row([format!("%.{ending}")], |row| row.get(0))?;
        newest_kernels.extend(newest.map(|at_ms| (kind, at_ms)));
    }
    Ok(Standing {
        verdicts,
        newest_kernels,
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
