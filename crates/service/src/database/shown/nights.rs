//! Nights: the scheduled comparisons of all sites.

use rusqlite::{Connection, OptionalExtension as _, Row, params};
use serde::Serialize;
use utoipa::ToSchema;

use crate::{database::Stored, instant::Instant};

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
    /// Jobs that failed.
    pub failures: i64,
}

/// A night by its number.
///
/// # Errors
/// SQLite errors.
pub fn night(connection: &Connection, id: i64) -> Stored<Option<Night>> {
    let mut query = connection.prepare_cached("SELECT * FROM night WHERE id = ?1")?;
    Ok(query.query_row([id], read).optional()?)
}

/// At most `limit` nights, the newest first, with numbers below `before`.
///
/// # Errors
/// SQLite errors.
pub fn nights(connection: &Connection, before: Option<i64>, limit: u32) -> Stored<Vec<Night>> {
    let mut query =
        connection.prepare_cached("SELECT * FROM night WHERE id < ?1 ORDER BY id DESC LIMIT ?2")?;
    let found = query.query_map(params![before.unwrap_or(i64::MAX), limit], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

fn read(row: &Row<'_>) -> rusqlite::Result<Night> {
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
