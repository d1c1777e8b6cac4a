//! A job that has to wait again gives way to one of its site that waits already.

use rusqlite::{Transaction, params};
use serde_json::json;

use super::{Job, Moved, Stored, add_cause, advance, causes, pending_job};
use crate::service::state::JobState;

/// Moves a job from a worker back among those that wait. A site has one of these: where changes came meanwhile and made it, that one
/// takes over the causes and the standing of this job, which ends.
///
/// # Errors
/// As [`advance`].
pub fn wait_again(
    transaction: &Transaction<'_>,
    now_ms: i64,
    job: &Job,
    to: JobState,
    moved: &Moved,
) -> Stored<()> {
    let waits = pending_job(transaction, &job.site)?.filter(|waits| waits.id != job.id);
    let Some(waits) = waits else {
        return advance(transaction, now_ms, job.id, to, moved);
    };
    for cause in causes(transaction, job.id)? {
        add_cause(transaction, waits.id, &cause)?;
    }
    let failures = job.failures + i64::from(moved.counts_as_failure);
    transaction.execute(
        "UPDATE job SET priority = max(priority, ?2), force = max(force, ?3), night = coalesce(night, ?4),
         asked_by = coalesce(asked_by, ?5), failures = max(failures, ?6) WHERE id = ?1",
        params![
            waits.id,
            job.priority as i64,
            job.force,
            job.night,
            job.asked_by,
            failures
        ],
    )?;
    let why = moved
        .outcome
        .as_ref()
        .and_then(|outcome| outcome["text"].as_str());
    let text = format!(
        "job {} goes on with it: {}",
        waits.id,
        why.unwrap_or("its inputs changed")
    );
    let ended = Moved {
        outcome: Some(json!({ "text": text, "job": waits.id })),
        ..Moved::default()
    };
    advance(transaction, now_ms, job.id, JobState::Superseded, &ended)
}
