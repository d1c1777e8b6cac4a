//! Jobs.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::answer::{List, answer, limit, number};
use crate::{
    database::{
        Job, JobFilter, Priority, causes, job, jobs,
        shown::{Attempt, Run, attempts, runs_of_job},
    },
    http::{
        app::App,
        caller::{Operator, Reader},
        changes::{cancel, retry},
        extract::{At, Parameters, name},
        problem::{Problem, ProblemDocument},
    },
    instant::Instant,
    state::JobState,
};

/// Attempts returned with a job.
const ATTEMPTS: u32 = 100;

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobLine {
    /// Its number.
    id: i64,
    /// The site that it brings up to date.
    site: String,
    /// Its state.
    state: JobState,
    /// Its class.
    priority: Priority,
    /// Number of its newest attempt, 0 before the first.
    attempt: i64,
    /// Number of failed attempts that count towards the limit.
    failures: i64,
    /// Time until which it waits.
    not_before_utc: Option<Instant>,
    /// Whether every stage runs, including stored ones.
    force: bool,
    /// Whether cancellation was requested.
    cancel_asked: bool,
    /// Its night.
    night: Option<i64>,
    /// The token of the requester.
    asked_by: Option<String>,
    /// When it was created.
    created_utc: Instant,
    /// When its state last changed.
    changed_utc: Instant,
    /// When it ended.
    ended_utc: Option<Instant>,
    /// Its outcome, or the reason for waiting: an object with `text` and more.
    outcome: Option<Value>,
}

impl JobLine {
    pub(super) fn of(job: Job) -> Self {
        Self {
            id: job.id,
            site: job.site,
            state: job.state,
            priority: job.priority,
            attempt: job.attempt,
            failures: job.failures,
            not_before_utc: (job.not_before_ms > 0).then_some(Instant(job.not_before_ms)),
            force: job.force,
            cancel_asked: job.cancel_asked,
            night: job.night,
            asked_by: job.asked_by,
            created_utc: Instant(job.created_ms),
            changed_utc: Instant(job.changed_ms),
            ended_utc: job.ended_ms.map(Instant),
            outcome: job.outcome,
        }
    }
}

/// A filter of jobs.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct JobsWanted {
    /// `next` of the preceding page.
    #[param(minimum = 0)]
    after: Option<i64>,
    /// Maximum number of items, by default 50.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
    /// Only jobs of this site.
    #[param(pattern = "^[A-Za-z0-9_-]{1,64}$")]
    site: Option<String>,
    /// Only jobs in this state.
    #[param(inline)]
    state: Option<JobState>,
}

/// Jobs, the newest first.
#[utoipa::path(get, path = "/api/v1/jobs", tag = "jobs", params(JobsWanted), responses(
    (status = 200, body = List<JobLine>),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn list(
    _: Reader,
    State(app): State<Arc<App>>,
    Parameters(wanted): Parameters<JobsWanted>,
) -> Result<Response, Problem> {
    let limit = limit(wanted.limit)?;
    let before = number(wanted.after)?;
    if let Some(site) = &wanted.site {
        name(site).map_err(|_| Problem::bad_request("site is not a valid site name."))?;
    }
    let found = app
        .read(move |connection| {
            let filter = JobFilter {
                site: wanted.site.as_deref(),
                state: wanted.state,
                before,
            };
            jobs(connection, &filter, limit + 1)
        })
        .await?;
    let lines = found.into_iter().map(JobLine::of).collect();
    answer(&app, &List::of(lines, limit, |job| job.id.to_string()))
}

/// A cause of a job.
#[derive(Debug, Serialize, ToSchema)]
struct JobCause {
    /// Its kind, as in `kernel_changed`.
    kind: String,
    /// The file that changed.
    file: Option<String>,
    /// BLAKE3 of its content before.
    old_blake3: Option<String>,
    /// BLAKE3 of its content now.
    new_blake3: Option<String>,
    /// Its description.
    detail: String,
    /// Its time.
    at_utc: Instant,
}

/// A job with its causes, attempts and runs.
#[derive(Debug, Serialize, ToSchema)]
struct JobDetail {
    /// The job.
    job: JobLine,
    /// Its causes.
    causes: Vec<JobCause>,
    /// Its attempts, the newest first, at most 100.
    attempts: Vec<Attempt>,
    /// Runs that its attempts published.
    runs: Vec<Run>,
}

/// One job with its causes, attempts and runs.
#[utoipa::path(get, path = "/api/v1/jobs/{job}", tag = "jobs", params(
    ("job" = i64, Path, description = "Number of the job", minimum = 0),
), responses(
    (status = 200, body = JobDetail),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn one(
    _: Reader,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| {
            let Some(job) = job(connection, id)? else {
                return Ok(None);
            };
            let causes = causes(connection, id)?.into_iter().map(|cause| JobCause {
                kind: cause.kind,
                file: cause.path,
                old_blake3: cause.old_blake3,
                new_blake3: cause.new_blake3,
                detail: cause.detail,
                at_utc: Instant(cause.at_ms),
            });
            Ok(Some(JobDetail {
                job: JobLine::of(job),
                causes: causes.collect(),
                attempts: attempts(connection, id, ATTEMPTS)?,
                runs: runs_of_job(connection, id, ATTEMPTS)?,
            }))
        })
        .await?;
    answer(&app, &found.ok_or_else(no_job)?)
}

/// Requests cancellation of a job; repeated requests have no effect.
#[utoipa::path(post, path = "/api/v1/jobs/{job}/cancel", tag = "jobs", params(
    ("job" = i64, Path, description = "Number of the job", minimum = 0),
), responses(
    (status = 200, body = JobLine),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn cancel_one(
    Operator(caller): Operator,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
) -> Result<Response, Problem> {
    answer(&app, &JobLine::of(cancel(&app, caller, id).await?))
}

/// Retries a job: a waiting or blocked one at once, one that ended without valid products as a new job.
#[utoipa::path(post, path = "/api/v1/jobs/{job}/retry", tag = "jobs", params(
    ("job" = i64, Path, description = "Number of the job", minimum = 0),
), responses(
    (status = 200, body = JobLine),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn retry_one(
    Operator(caller): Operator,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
) -> Result<Response, Problem> {
    answer(&app, &JobLine::of(retry(&app, caller, id).await?))
}

fn no_job() -> Problem {
    Problem::not_found("This job does not exist.")
}
