//! Changes requested through pages and by programs, each recorded with its caller.

use std::sync::Arc;

use axum::http::StatusCode;
use serde_json::Value;

use super::{app::App, caller::Caller, problem::Problem};
use crate::{
    audit::{Change, note_change},
    database::{
        CauseKind, CauseRow, Enqueued, Job, JobRequest, Priority, enqueue, job, request_cancel,
        shown::{pin_run, run, site},
    },
    state::JobState,
};

/// Requested jobs.
#[derive(Debug, Clone)]
pub(super) struct Wanted {
    pub(super) sites: Vec<String>,
    pub(super) force: bool,
    pub(super) reason: String,
}

/// Requests jobs of existing sites.
pub(super) fn ask_for(
    transaction: &rusqlite::Transaction<'_>,
    now_ms: i64,
    wanted: &Wanted,
    caller: &Caller,
) -> crate::database::Stored<Vec<(String, Enqueued)>> {
    let who = caller.name();
    let cause = CauseRow::plain(CauseKind::Requested, &wanted.reason, now_ms);
    let mut jobs = Vec::new();
    for site in &wanted.sites {
        let request = JobRequest {
            site,
            priority: Priority::Requested,
            force: wanted.force,
            night: None,
            asked_by: Some(&who),
            ready: true,
            causes: std::slice::from_ref(&cause),
        };
        let enqueued = enqueue(transaction, now_ms, &request)?;
        let change = Change {
            who: &who,
            action: if wanted.force { "run by force" } else { "run" },
            target: &format!("site {site}, job {}", enqueued.job),
            remote: &caller.remote.to_string(),
        };
        note_change(transaction, now_ms, change)?;
        jobs.push((site.clone(), enqueued));
    }
    Ok(jobs)
}

/// Requests a job of one site.
pub(super) async fn run_site(
    app: &Arc<App>,
    caller: Caller,
    wanted: Wanted,
) -> Result<Option<i64>, Problem> {
    let now_ms = app.now_ms();
    let enqueued = app
        .write(move |transaction| {
            for name in &wanted.sites {
                if site(transaction, name)?.is_none() {
                    return Ok(Vec::new());
                }
            }
            ask_for(transaction, now_ms, &wanted, &caller)
        })
        .await?;
    app.shared.wake.notify_one();
    Ok(enqueued.first().map(|(_, enqueued)| enqueued.job))
}

/// Requests cancellation of a job.
pub(super) async fn cancel(app: &Arc<App>, caller: Caller, id: i64) -> Result<Job, Problem> {
    let now_ms = app.now_ms();
    let done = app
        .write(move |transaction| {
            let Some(found) = job(transaction, id)? else {
                return Ok(None);
            };
            let stopped = matches!(found.state, JobState::Cancelled | JobState::Cancelling);
            if found.state.is_final() || stopped {
                return Ok(Some((found, stopped)));
            }
            request_cancel(transaction, now_ms, id)?;
            note(transaction, now_ms, &caller, "cancel", &format!("job {id}"))?;
            Ok(job(transaction, id)?.map(|job| (job, true)))
        })
        .await?;
    app.shared.wake.notify_one();
    match done {
        None => Err(no_job()),
        Some((job, true)) => Ok(job),
        Some((job, false)) => Err(Problem::conflict(format!(
            "Job {id} has ended with the state {}.",
            job.state
        ))),
    }
}

/// Retries a job: a waiting or blocked one at once, one that ended without valid products as a new job.
pub(super) async fn retry(app: &Arc<App>, caller: Caller, id: i64) -> Result<Job, Problem> {
    let now_ms = app.now_ms();
    let done = app
        .write(move |transaction| {
            let Some(found) = job(transaction, id)? else {
                return Ok(Err(no_job()));
            };
            let kind = match found.state {
                JobState::Held | JobState::Queued => return Ok(Ok(found)),
                JobState::Waiting | JobState::Blocked => CauseKind::Requested,
                JobState::Failed | JobState::Invalid | JobState::Cancelled => CauseKind::RetryOf,
                state => {
                    let text = format!("Job {id} is {state} and cannot be retried.");
                    return Ok(Err(Problem::conflict(text)));
                }
            };
            let who = caller.name();
            let detail = format!("job {id} is retried");
            let request = JobRequest {
                site: &found.site,
                priority: Priority::Requested,
                force: found.force,
                night: None,
                asked_by: Some(&who),
                ready: true,
                causes: &[CauseRow::plain(kind, &detail, now_ms)],
            };
            let enqueued = enqueue(transaction, now_ms, &request)?;
            note(transaction, now_ms, &caller, "retry", &format!("job {id}"))?;
            let again = job(transaction, enqueued.job)?;
            Ok(again.ok_or_else(no_job))
        })
        .await?;
    app.shared.wake.notify_one();
    done
}

/// Keeps a run permanently, or releases it.
pub(super) async fn pin(
    app: &Arc<App>,
    caller: Caller,
    id: String,
    pinned: bool,
) -> Result<crate::database::shown::Run, Problem> {
    let now_ms = app.now_ms();
    app.write(move |transaction| {
        let Some(mut found) = run(transaction, &id)? else {
            return Ok(Err(Problem::not_found("This run does not exist.")));
        };
        if pinned && found.removed_utc.is_some() {
            let text = "The products of this run were removed and cannot be kept.";
            return Ok(Err(Problem::conflict(text)));
        }
        if found.pinned != pinned {
            pin_run(transaction, &id, pinned)?;
            let action = if pinned { "pin" } else { "unpin" };
            note(transaction, now_ms, &caller, action, &format!("run {id}"))?;
            found.pinned = pinned;
        }
        Ok(Ok(found))
    })
    .await?
}

fn note(
    transaction: &rusqlite::Transaction<'_>,
    now_ms: i64,
    caller: &Caller,
    action: &str,
    target: &str,
) -> crate::database::Stored<()> {
    let change = Change {
        who: &caller.name(),
        action,
        target,
        remote: &caller.remote.to_string(),
    };
    note_change(transaction, now_ms, change)
}

fn no_job() -> Problem {
    Problem::new(StatusCode::NOT_FOUND, "This job does not exist.")
}

/// The text of an outcome.
pub(super) fn outcome_text(job: &Job) -> Option<&str> {
    job.outcome.as_ref()?.get("text").and_then(Value::as_str)
}
