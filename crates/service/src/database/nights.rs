//! Nights: intended instants of the comparison of all sites, and their results.

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde::Serialize;
use utoipa::ToSchema;

use super::Stored;
use crate::{instant::Instant, words::counted};

/// Origin of a night.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NightHow {
    /// It was due.
    Due,
    /// It was due while the service did not run.
    CaughtUp,
    /// A person, or an external timer, requested it.
    Requested,
    /// It was due too long ago and was skipped.
    Missed,
}

impl NightHow {
    /// Its name in the database.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Due => "due",
            Self::CaughtUp => "caught_up",
            Self::Requested => "asked",
            Self::Missed => "missed",
        }
    }
}

/// A night.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Night {
    /// Its number.
    pub id: i64,
    /// When it was due.
    pub due_utc: Instant,
    /// Time zone of the schedule.
    pub zone: String,
    /// When it began.
    pub started_utc: Option<Instant>,
    /// When its last job ended.
    pub ended_utc: Option<Instant>,
    /// `due`, `caught_up`, `asked` or `missed`.
    pub how: String,
    /// Sites whose inputs were compared.
    pub sites_checked: i64,
    /// Runs that were published.
    pub runs: i64,
    /// Jobs that failed, were blocked or produced invalid products.
    pub failures: i64,
}

impl Night {
    /// Its results as text.
    #[must_use]
    pub fn words(&self) -> String {
        let checked = counted(self.sites_checked, "site");
        let (runs, failures) = (counted(self.runs, "run"), counted(self.failures, "failure"));
        format!("{checked} compared, {runs}, {failures}")
    }
}

/// Records a night; of two with the same instant the first is kept, and `None` is returned.
///
/// # Errors
/// SQLite errors.
pub fn put_night(
    transaction: &Transaction<'_>,
    due_ms: i64,
    zone: &str,
    how: NightHow,
    started_ms: Option<i64>,
) -> Stored<Option<i64>> {
    let made = transaction.execute(
        "INSERT OR IGNORE INTO night (due_ms, zone, started_ms, how) VALUES (?1, ?2, ?3, ?4)",
        params![due_ms, zone, started_ms, how.name()],
    )?;
    Ok((made > 0).then(|| transaction.last_insert_rowid()))
}

/// The current night, begun and not ended.
///
/// # Errors
/// SQLite errors.
pub fn open_night(connection: &Connection) -> Stored<Option<Night>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM night WHERE started_ms IS NOT NULL AND ended_ms IS NULL ORDER BY id DESC LIMIT 1",
    )?;
    Ok(query.query_row([], night_row).optional()?)
}

/// A night by its number.
///
/// # Errors
/// SQLite errors.
pub fn night(connection: &Connection, id: i64) -> Stored<Option<Night>> {
    let mut query = connection.prepare_cached("SELECT * FROM night WHERE id = ?1")?;
    Ok(query.query_row([id], night_row).optional()?)
}

/// Records the number of sites compared in a night.
///
/// # Errors
/// SQLite errors.
pub fn put_night_checked(transaction: &Transaction<'_>, id: i64, sites: usize) -> Stored<()> {
    transaction.execute(
        "UPDATE night SET sites_checked = ?2 WHERE id = ?1",
        params![id, i64::try_from(sites).unwrap_or(i64::MAX)],
    )?;
    Ok(())
}

/// Whether jobs of a night are unfinished.
///
/// # Errors
/// SQLite errors.
pub fn night_at_work(connection: &Connection, id: i64) -> Stored<bool> {
    let mut query = connection.prepare_cached(
        "SELECT 1 FROM job WHERE night = ?1 AND state IN ('queued', 'starting', 'running', 'cancelling', 'waiting')",
    )?;
    Ok(query.exists([id])?)
}

/// Ends a night and counts its results.
///
/// # Errors
/// SQLite errors.
pub fn end_night(transaction: &Transaction<'_>, id: i64, now_ms: i64) -> Stored<Option<Night>> {
    transaction.execute(
        "UPDATE night SET ended_ms = ?2,
         runs = (SELECT count(*) FROM run JOIN job ON job.id = run.job WHERE job.night = ?1),
         failures = (SELECT count(*) FROM job WHERE night = ?1 AND (state IN ('failed', 'invalid', 'blocked')
           OR state = 'held' AND site IN (SELECT name FROM site WHERE problem IS NOT NULL)))
         WHERE id = ?1 AND ended_ms IS NULL",
        params![id, now_ms],
    )?;
    night(transaction, id)
}

pub(super) fn night_row(row: &Row<'_>) -> rusqlite::Result<Night> {
    Ok(Night {
        id: row.get("id")?,
        due_utc: row.get("due_ms")?,
        zone: row.get("zone")?,
        started_utc: row.get("started_ms")?,
        ended_utc: row.get("ended_ms")?,
        how: row.get("how")?,
        sites_checked: row.get("sites_checked")?,
        runs: row.get("runs")?,
        failures: row.get("failures")?,
    })
}
