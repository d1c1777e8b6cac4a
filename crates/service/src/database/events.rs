//! Events, in order.

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::Stored;

/// An event.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Event {
    /// Its number; later events have larger ones.
    pub seq: i64,
    /// When, milliseconds of UTC since 1970.
    pub at_ms: i64,
    /// What kind of event: `job`, `stage`, `progress`, `run`, `root`, `night`, `alert`, `config`.
    pub kind: String,
    /// The site that it concerns.
    pub site: Option<String>,
    /// The job that it concerns.
    pub job: Option<i64>,
    /// The run that it concerns.
    pub run: Option<String>,
    /// Further data, by its kind.
    pub data: Value,
}

/// Subject of an event.
#[derive(Debug, Clone, Copy, Default)]
pub struct About<'a> {
    /// The site.
    pub site: Option<&'a str>,
    /// The job.
    pub job: Option<i64>,
    /// The run.
    pub run: Option<&'a str>,
}

/// Records an event and returns its number.
///
/// # Errors
/// SQLite errors.
pub fn append(
    transaction: &Transaction<'_>,
    now_ms: i64,
    kind: &str,
    about: About<'_>,
    data: &Value,
) -> Stored<i64> {
    transaction.execute(
        "INSERT INTO event (at_ms, kind, site, job, run, data) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
        params![
            now_ms,
            kind,
            about.site,
            about.job,
            about.run,
            data.to_string()
        ],
    )?;
    Ok(transaction.last_insert_rowid())
}

/// At most `limit` events after number `after`, oldest first.
///
/// # Errors
/// SQLite errors.
pub fn events_after(connection: &Connection, after: i64, limit: u32) -> Stored<Vec<Event>> {
    let mut query =
        connection.prepare_cached("SELECT * FROM event WHERE seq > ?1 ORDER BY seq LIMIT ?2")?;
    let found = query.query_map(params![after, limit], event)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// A filter of events.
#[derive(Debug, Clone, Copy, Default)]
pub struct EventFilter<'a> {
    /// This kind; without it all but `stage` and `progress`.
    pub kind: Option<&'a str>,
    /// The site that they concern.
    pub site: Option<&'a str>,
    /// Numbers below this one.
    pub before: Option<i64>,
}

/// At most `limit` events, newest first.
///
/// # Errors
/// SQLite errors.
pub fn events_before(
    connection: &Connection,
    filter: &EventFilter<'_>,
    limit: u32,
) -> Stored<Vec<Event>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM event WHERE seq < ?1 AND (?2 IS NULL OR site = ?2)
         AND CASE WHEN ?3 IS NULL THEN kind NOT IN ('stage', 'progress') ELSE kind = ?3 END ORDER BY seq DESC LIMIT ?4",
    )?;
    let before = filter.before.unwrap_or(i64::MAX);
    let found = query.query_map(params![before, filter.site, filter.kind, limit], event)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// The number of the newest event, 0 before the first.
///
/// # Errors
/// SQLite errors.
pub fn newest_event(connection: &Connection) -> Stored<i64> {
    let newest = connection
        .query_row("SELECT max(seq) FROM event", [], |row| row.get(0))
        .optional()?
        .flatten();
    Ok(newest.unwrap_or(0))
}

fn event(row: &Row<'_>) -> rusqlite::Result<Event> {
    let data: String = row.get("data")?;
    Ok(Event {
        seq: row.get("seq")?,
        at_ms: row.get("at_ms")?,
        kind: row.get("kind")?,
        site: row.get("site")?,
        job: row.get("job")?,
        run: row.get("run")?,
        data: serde_json::from_str(&data).unwrap_or_default(),
    })
}
