//! Alerts: state changes, and undelivered notifications to hooks.

use rusqlite::{Connection, OptionalExtension as _, Transaction, params};

use super::Stored;

/// Records the state of a subject, and returns the former one if it differs; `None` for a new subject.
///
/// # Errors
/// SQLite errors.
pub fn put_alert_state(
    transaction: &Transaction<'_>,
    now_ms: i64,
    subject: &str,
    state: &str,
) -> Stored<Edge> {
    let before: Option<String> = transaction
        .query_row(
            "SELECT state FROM alert_state WHERE subject = ?1",
            [subject],
            |row| row.get(0),
        )
        .optional()?;
    if before.as_deref() == Some(state) {
        return Ok(Edge::None);
    }
    transaction.execute(
        "INSERT OR REPLACE INTO alert_state (subject, state, since_ms) VALUES (?1, ?2, ?3)",
        params![subject, state, now_ms],
    )?;
    Ok(before.map_or(Edge::First, Edge::From))
}

/// The transition of a subject to its state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Edge {
    /// It was already in this state.
    None,
    /// It had no recorded state.
    First,
    /// It was in this other state.
    From(String),
}

/// A notification to a hook.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notification {
    /// Its number.
    pub id: i64,
    /// Place of the hook in the configuration.
    pub hook: i64,
    /// JSON.
    pub body: String,
    /// Number of delivery attempts.
    pub tries: i64,
}

/// Records a notification.
///
/// # Errors
/// SQLite errors.
pub fn put_notification(
    transaction: &Transaction<'_>,
    now_ms: i64,
    hook: usize,
    kind: &str,
    body: &str,
) -> Stored<()> {
    transaction.execute(
        "INSERT INTO outbox (hook, kind, body, not_before_ms, created_ms) VALUES (?1, ?2, ?3, ?4, ?4)",
        params![i64::try_from(hook).unwrap_or_default(), kind, body, now_ms],
    )?;
    Ok(())
}

/// Notifications that are due, oldest first.
///
/// # Errors
/// SQLite errors.
pub fn due_notifications(
    connection: &Connection,
    now_ms: i64,
    limit: u32,
) -> Stored<Vec<Notification>> {
    let mut query = connection.prepare_cached(
        "SELECT id, hook, body, tries FROM outbox WHERE delivered_ms IS NULL AND not_before_ms <= ?1 ORDER BY id LIMIT ?2",
    )?;
    let found = query.query_map(params![now_ms, limit], |row| {
        Ok(Notification {
            id: row.get(0)?,
            hook: row.get(1)?,
            body: row.get(2)?,
            tries: row.get(3)?,
        })
    })?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Records that a notification was delivered.
///
/// # Errors
/// SQLite errors.
pub fn put_delivered(transaction: &Transaction<'_>, id: i64, now_ms: i64) -> Stored<()> {
    transaction.execute(
        "UPDATE outbox SET tries = tries + 1, delivered_ms = ?2, error = NULL WHERE id = ?1",
        params![id, now_ms],
    )?;
    Ok(())
}

/// Records that a notification could not be delivered, and the time of the next attempt.
///
/// # Errors
/// SQLite errors.
pub fn put_undelivered(
    transaction: &Transaction<'_>,
    id: i64,
    error: &str,
    not_before_ms: i64,
) -> Stored<()> {
    transaction.execute(
        "UPDATE outbox SET tries = tries + 1, error = ?2, not_before_ms = ?3 WHERE id = ?1",
        params![id, error, not_before_ms],
    )?;
    Ok(())
}
