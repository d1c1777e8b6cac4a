//! Jobs: requests, state transitions and causes.

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::{
    About, DatabaseError, Stored, append,
    causes::{CauseRow, add_cause, causes},
};
use crate::state::JobState;

/// Priority of queued jobs; a job rises by one class for every hour of waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[repr(i64)]
pub enum Priority {
    /// A new version of areograph: all sites, when no other job is queued.
    Backfill = 0,
    /// The nightly comparison.
    Scheduled = 1,
    /// An input changed.
    Changed = 2,
    /// A person requested it.
    #[serde(rename = "asked")]
    Requested = 3,
}

impl Priority {
    const fn from_number(number: i64) -> Self {
        match number {
            ..=0 => Self::Backfill,
            1 => Self::Scheduled,
            2 => Self::Changed,
            _ => Self::Requested,
        }
    }
}

/// A job.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Job {
    /// Its number.
    pub id: i64,
    /// The site that it brings up to date.
    pub site: String,
    /// Its state.
    pub state: JobState,
    /// Its class.
    pub priority: Priority,
    /// Number of its newest attempt, 0 before the first.
    pub attempt: i64,
    /// Attempts that failed and count.
    pub failures: i64,
    /// It waits until this time, milliseconds of UTC since 1970.
    pub not_before_ms: i64,
    /// Whether every stage runs, including stored ones.
    pub force: bool,
    /// Whether a person requested cancellation.
    pub cancel_asked: bool,
    /// Its night.
    pub night: Option<i64>,
    /// Who requested it.
    pub asked_by: Option<String>,
    /// When it was created, milliseconds of UTC since 1970.
    pub created_ms: i64,
    /// When its state last changed.
    pub changed_ms: i64,
    /// When it ended.
    pub ended_ms: Option<i64>,
    /// Its outcome, or the reason for waiting: a JSON object with `text` and more.
    pub outcome: Option<Value>,
}

/// A request for a job.
#[derive(Debug, Clone)]
pub struct JobRequest<'a> {
    /// The site.
    pub site: &'a str,
    /// Its class.
    pub priority: Priority,
    /// Whether every stage runs.
    pub force: bool,
    /// Its night.
    pub night: Option<i64>,
    /// Who requests it, if a person does.
    pub asked_by: Option<&'a str>,
    /// Whether its inputs are ready.
    pub ready: bool,
    /// The causes.
    pub causes: &'a [CauseRow],
}

/// The result of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Enqueued {
    /// The job.
    pub job: i64,
    /// Whether an existing pending job took over the causes.
    pub joined: bool,
}

/// An invalid transition of a job.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("job {job} is {from} and cannot become {to}")]
pub struct WrongTransition {
    /// The job.
    pub job: i64,
    /// Its state.
    pub from: JobState,
    /// The requested state.
    pub to: JobState,
}

/// Data recorded with a new state.
#[derive(Debug, Clone, Default)]
pub struct Moved {
    /// The outcome, or the reason for waiting.
    pub outcome: Option<Value>,
    /// The job waits until this time, milliseconds of UTC since 1970.
    pub not_before_ms: Option<i64>,
    /// Whether the attempt that ended counts as a failure.
    pub counts_as_failure: bool,
}

/// Creates a job, or adds the causes to the pending one of the site. A blocked or waiting job is queued again at the
/// request of a person or when an input changed.
///
/// # Errors
/// SQLite errors.
pub fn enqueue(
    transaction: &Transaction<'_>,
    now_ms: i64,
    request: &JobRequest<'_>,
) -> Stored<Enqueued> {
    let state = if request.ready {
        JobState::Queued
    } else {
        JobState::Held
    };
    let pending = pending_job(transaction, request.site)?;
    let job = if let Some(job) = &pending {
        join(transaction, now_ms, job, request, state)?;
        job.id
    } else {
        transaction.execute(
            "INSERT INTO job (site, state, priority, force, night, asked_by, created_ms, changed_ms)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?7)",
            params![
                request.site, state.name(), request.priority as i64, request.force, request.night, request.asked_by, now_ms
            ],
        )?;
        let id = transaction.last_insert_rowid();
        tell(transaction, now_ms, id, request.site, state, None)?;
        id
    };
    for cause in request.causes {
        add_cause(transaction, job, cause)?;
    }
    Ok(Enqueued {
        job,
        joined: pending.is_some(),
    })
}

fn join(
    transaction: &Transaction<'_>,
    now_ms: i64,
    job: &Job,
    request: &JobRequest<'_>,
    state: JobState,
) -> Stored<()> {
    transaction.execute(
        "UPDATE job SET priority = max(priority, ?2), force = max(force, ?3), night = coalesce(night, ?4),
         asked_by = coalesce(asked_by, ?5) WHERE id = ?1",
        params![job.id, request.priority as i64, request.force, request.night, request.asked_by],
    )?;
    let wakes = match job.state {
        JobState::Blocked | JobState::Waiting => request.priority >= Priority::Changed,
        JobState::Held => request.ready,
        _ => false,
    };
    if wakes && job.state != state {
        // The night that wakes a job waits for it, and counts its result.
        transaction.execute(
            "UPDATE job SET failures = 0, night = coalesce(?2, night) WHERE id = ?1",
            params![job.id, request.night],
        )?;
        let moved = Moved {
            not_before_ms: Some(0),
            ..Moved::default()
        };
        advance(transaction, now_ms, job.id, state, &moved)?;
    }
    Ok(())
}

/// Moves a job to another state and records the event.
///
/// # Errors
/// [`WrongTransition`] if the state table has no such transition; SQLite errors.
pub fn advance(
    transaction: &Transaction<'_>,
    now_ms: i64,
    id: i64,
    to: JobState,
    moved: &Moved,
) -> Stored<()> {
    let Job { state, site, .. } =
        job(transaction, id)?.ok_or(DatabaseError::Sqlite(rusqlite::Error::QueryReturnedNoRows))?;
    if !state.next().contains(&to) {
        return Err(WrongTransition {
            job: id,
            from: state,
            to,
        }
        .into());
    }
    transaction.execute(
        "UPDATE job SET state = ?2, changed_ms = ?3, ended_ms = ?4, outcome = coalesce(?5, outcome),
         not_before_ms = coalesce(?6, not_before_ms), failures = failures + ?7, attempt = attempt + ?8 WHERE id = ?1",
        params![
            id,
            to.name(),
            now_ms,
            to.is_final().then_some(now_ms),
            moved.outcome.as_ref().map(Value::to_string),
            moved.not_before_ms,
            moved.counts_as_failure,
            to == JobState::Starting,
        ],
    )?;
    tell(transaction, now_ms, id, &site, to, moved.outcome.as_ref())
}

/// Returns a job from a worker to the pending ones. A job of the same site that arrived meanwhile is merged into it,
/// with its causes and its request for an immediate run.
///
/// # Errors
/// As [`advance`].
pub fn give_back(
    transaction: &Transaction<'_>,
    now_ms: i64,
    id: i64,
    to: JobState,
    moved: &Moved,
) -> Stored<()> {
    let waiting = match job(transaction, id)? {
        Some(job) => pending_job(transaction, &job.site)?,
        None => None,
    };
    let Some(waiting) = waiting.filter(|_| !to.is_final() && !to.is_active()) else {
        return advance(transaction, now_ms, id, to, moved);
    };
    let taken_in = Moved {
        outcome: Some(json!({ "text": format!("merged into job {id}"), "job": id })),
        ..Moved::default()
    };
    advance(
        transaction,
        now_ms,
        waiting.id,
        JobState::Superseded,
        &taken_in,
    )?;
    for cause in causes(transaction, waiting.id)? {
        add_cause(transaction, id, &cause)?;
    }
    advance(transaction, now_ms, id, JobState::Queued, moved)?;
    transaction.execute(
        "UPDATE job SET priority = max(priority, ?2), force = max(force, ?3), night = coalesce(?4, night),
         asked_by = coalesce(?5, asked_by), failures = 0, not_before_ms = 0 WHERE id = ?1",
        params![id, waiting.priority as i64, waiting.force, waiting.night, waiting.asked_by],
    )?;
    Ok(())
}

fn tell(
    transaction: &Transaction<'_>,
    now_ms: i64,
    job: i64,
    site: &str,
    state: JobState,
    outcome: Option<&Value>,
) -> Stored<()> {
    let about = About {
        site: Some(site),
        job: Some(job),
        run: None,
    };
    let data = json!({ "state": state, "outcome": outcome });
    append(transaction, now_ms, "job", about, &data)?;
    Ok(())
}

/// Requests cancellation of a job: a pending one ends at once, an active one when its worker has ended. Returns its
/// state; `None` for an unknown job.
///
/// # Errors
/// SQLite errors.
pub fn request_cancel(
    transaction: &Transaction<'_>,
    now_ms: i64,
    id: i64,
) -> Stored<Option<JobState>> {
    let Some(found) = job(transaction, id)? else {
        return Ok(None);
    };
    let to = match found.state {
        state if state.is_final() || state == JobState::Cancelling => return Ok(Some(state)),
        state if state.is_active() => JobState::Cancelling,
        _ => JobState::Cancelled,
    };
    transaction.execute("UPDATE job SET cancel_asked = 1 WHERE id = ?1", [id])?;
    let moved = Moved {
        outcome: Some(json!({ "text": "cancelled" })),
        ..Moved::default()
    };
    advance(transaction, now_ms, id, to, &moved)?;
    Ok(Some(to))
}

/// The queued job to take next: by class, which rises with every hour of waiting, then by age.
///
/// # Errors
/// SQLite errors.
pub fn next_queued(connection: &Connection, now_ms: i64, backfill: bool) -> Stored<Option<Job>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM job WHERE state = 'queued' AND not_before_ms <= ?1 AND (priority > 0 OR ?2)
         AND site NOT IN (SELECT site FROM job WHERE state IN ('starting', 'running', 'cancelling'))
         ORDER BY priority + (?1 - created_ms) / 3600000 DESC, created_ms, id LIMIT 1",
    )?;
    Ok(query
        .query_row(params![now_ms, backfill], read)
        .optional()?)
}

/// A job by its number.
///
/// # Errors
/// SQLite errors.
pub fn job(connection: &Connection, id: i64) -> Stored<Option<Job>> {
    let mut query = connection.prepare_cached("SELECT * FROM job WHERE id = ?1")?;
    Ok(query.query_row([id], read).optional()?)
}

/// Jobs in one state, the oldest first.
///
/// # Errors
/// SQLite errors.
pub fn jobs_in(connection: &Connection, state: JobState) -> Stored<Vec<Job>> {
    let mut query = connection.prepare_cached("SELECT * FROM job WHERE state = ?1 ORDER BY id")?;
    let found = query.query_map([state.name()], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Waiting jobs that are due.
///
/// # Errors
/// SQLite errors.
pub fn due_waiting(connection: &Connection, now_ms: i64) -> Stored<Vec<Job>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM job WHERE state = 'waiting' AND not_before_ms <= ?1 ORDER BY id",
    )?;
    let found = query.query_map([now_ms], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// The job of a site that has, or may have, a worker.
///
/// # Errors
/// SQLite errors.
pub fn active_job(connection: &Connection, site: &str) -> Stored<Option<Job>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM job WHERE site = ?1 AND state IN ('starting', 'running', 'cancelling')",
    )?;
    Ok(query.query_row([site], read).optional()?)
}

/// The pending job of a site.
///
/// # Errors
/// SQLite errors.
pub fn pending_job(connection: &Connection, site: &str) -> Stored<Option<Job>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM job WHERE site = ?1 AND state IN ('held', 'queued', 'waiting', 'blocked')",
    )?;
    Ok(query.query_row([site], read).optional()?)
}

/// A filter of jobs.
#[derive(Debug, Clone, Default)]
pub struct JobFilter<'a> {
    /// Of this site.
    pub site: Option<&'a str>,
    /// In this state.
    pub state: Option<JobState>,
    /// With a number below this one.
    pub before: Option<i64>,
}

/// At most `limit` jobs, the newest first.
///
/// # Errors
/// SQLite errors.
pub fn jobs(connection: &Connection, filter: &JobFilter<'_>, limit: u32) -> Stored<Vec<Job>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM job WHERE (?1 IS NULL OR site = ?1) AND (?2 IS NULL OR state = ?2) AND (?3 IS NULL OR id < ?3)
         ORDER BY id DESC LIMIT ?4",
    )?;
    let state = filter.state.map(JobState::name);
    let found = query.query_map(params![filter.site, state, filter.before, limit], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

fn read(row: &Row<'_>) -> rusqlite::Result<Job> {
    let state: String = row.get("state")?;
    let state = state.parse().map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(0, rusqlite::types::Type::Text, Box::new(error))
    })?;
    let outcome: Option<String> = row.get("outcome")?;
    Ok(Job {
        id: row.get("id")?,
        site: row.get("site")?,
        state,
        priority: Priority::from_number(row.get("priority")?),
        attempt: row.get("attempt")?,
        failures: row.get("failures")?,
        not_before_ms: row.get("not_before_ms")?,
        force: row.get("force")?,
        cancel_asked: row.get("cancel_asked")?,
        night: row.get("night")?,
        asked_by: row.get("asked_by")?,
        created_ms: row.get("created_ms")?,
        changed_ms: row.get("changed_ms")?,
        ended_ms: row.get("ended_ms")?,
        outcome: outcome.and_then(|text| serde_json::from_str(&text).ok()),
    })
}
