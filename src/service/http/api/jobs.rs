//! Jobs.

use std::sync::Arc;

use axum::{
    extract::State,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::Response,
};
use rusqlite::{OptionalExtension as _, Transaction, params};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::answer::{List, answer, answer_with, limit, number};
use crate::service::{
    database::{
        Job, JobFilter, Priority, Stored, causes, job, jobs,
        shown::{Attempt, Run, attempts, runs_of_job, site, sites},
    },
    http::{
        app::App,
        caller::{Caller, Operator, Reader},
        changes::{Wanted, ask_for, cancel, retry},
        extract::{Asked, At, Document, name},
        problem::{Problem, ProblemDocument},
    },
    instant::Instant,
    state::JobState,
};

/// Attempts that are given with a job.
const ATTEMPTS: u32 = 100;
/// Sites of one request.
const SITES: usize = 1000;
/// Longest reason, characters.
const REASON: usize = 500;
/// An answer is given again for so long.
const REMEMBERED_MS: i64 = 24 * 3_600_000;

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobLine {
    /// Its number.
    id: i64,
    /// The site that it brings up to date.
    site: String,
    /// Where it stands.
    state: JobState,
    /// Its class.
    priority: Priority,
    /// Number of its newest attempt, 0 before the first.
    attempt: i64,
    /// Attempts that failed and count.
    failures: i64,
    /// It waits until then.
    not_before_utc: Option<Instant>,
    /// Whether every stage runs, whatever is stored.
    force: bool,
    /// Whether somebody asked it to stop.
    cancel_asked: bool,
    /// The night that it belongs to.
    night: Option<i64>,
    /// The token of who asked for it.
    asked_by: Option<String>,
    /// When it was made.
    created_utc: Instant,
    /// When its state last changed.
    changed_utc: Instant,
    /// When it ended.
    ended_utc: Option<Instant>,
    /// How it ended, or why it waits: an object with `text` and more.
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

/// Which jobs are wanted.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct JobsWanted {
    /// `next` of the piece before.
    #[param(max_length = 64)]
    after: Option<String>,
    /// Most items, 50 unless told.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
    /// Of this site.
    #[param(pattern = "^[A-Za-z0-9_-]{1,64}$")]
    site: Option<String>,
    /// In this state.
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
    Asked(wanted): Asked<JobsWanted>,
) -> Result<Response, Problem> {
    let limit = limit(wanted.limit)?;
    let before = number(wanted.after.as_deref())?;
    if let Some(site) = &wanted.site {
        name(site).map_err(|_| Problem::bad_request("site is no name of a site."))?;
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
    /// In words.
    detail: String,
    /// When.
    at_utc: Instant,
}

/// A job with its causes, attempts and runs.
#[derive(Debug, Serialize, ToSchema)]
struct JobDetail {
    /// The job.
    job: JobLine,
    /// Why it is there.
    causes: Vec<JobCause>,
    /// Its attempts, the newest first, at most 100.
    attempts: Vec<Attempt>,
    /// What they published.
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

/// Jobs that are asked for: of `sites`, or of `all`.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct JobsAsked {
    /// Names of sites.
    #[serde(default)]
    #[schema(max_items = 1000, example = json!(["alpha"]))]
    sites: Vec<String>,
    /// Whether all sites are meant.
    #[serde(default)]
    all: bool,
    /// Whether every stage runs, whatever is stored.
    #[serde(default)]
    force: bool,
    /// Why.
    #[serde(default)]
    #[schema(max_length = 500)]
    reason: String,
}

/// A job that was asked for.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
struct JobAsked {
    /// The site.
    site: String,
    /// Its job.
    job: i64,
    /// Whether a job that was pending took it in.
    joined: bool,
}

/// The jobs that were asked for.
#[derive(Debug, Serialize, ToSchema)]
struct JobsMade {
    /// A job for each site.
    jobs: Vec<JobAsked>,
}

/// Asks for jobs. With an `Idempotency-Key`, asking again within 24 h gives the same jobs and makes no others.
#[utoipa::path(post, path = "/api/v1/jobs", tag = "jobs", params(
    ("Idempotency-Key" = Option<String>, Header, description = "1 to 100 letters, digits, `_` and `-`, chosen by the client",
     pattern = "^[A-Za-z0-9_-]{1,100}$"),
), request_body = JobsAsked, responses(
    (status = 202, body = JobsMade, description = "Jobs were made"),
    (status = 200, body = JobsMade, description = "The jobs were there already"),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn create(
    Operator(caller): Operator,
    State(app): State<Arc<App>>,
    headers: HeaderMap,
    Document(asked): Document<JobsAsked>,
) -> Result<Response, Problem> {
    let key = idempotency_key(&headers)?;
    check(&asked)?;
    let now_ms = app.now_ms();
    let made = app
        .write(move |transaction| make(transaction, now_ms, &caller, key.as_deref(), asked))
        .await??;
    app.shared.wake.notify_one();
    let known = made.jobs.iter().all(|job| job.joined);
    let status = if known {
        StatusCode::OK
    } else {
        StatusCode::ACCEPTED
    };
    let mut response = answer_with(&app, status, &made)?;
    let place = match &made.jobs[..] {
        [one] => format!("/api/v1/jobs/{}", one.job),
        _ => "/api/v1/jobs".to_owned(),
    };
    if let Ok(place) = HeaderValue::from_str(&place) {
        response.headers_mut().insert(header::LOCATION, place);
    }
    Ok(response)
}

fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(key) = headers.get("idempotency-key") else {
        return Ok(None);
    };
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
    let key = key.to_str().unwrap_or_default();
    if (1..=100).contains(&key.len()) && key.bytes().all(plain) {
        return Ok(Some(key.to_owned()));
    }
    Err(Problem::bad_request(
        "Idempotency-Key is 1 to 100 letters, digits, _ and -.",
    ))
}

fn check(asked: &JobsAsked) -> Result<(), Problem> {
    if asked.all == !asked.sites.is_empty() {
        return Err(Problem::bad_request(
            "Name sites, or say all: one of the two.",
        ));
    }
    if asked.sites.len() > SITES {
        return Err(Problem::bad_request(format!(
            "At most {SITES} sites at once."
        )));
    }
    if asked.reason.chars().count() > REASON || asked.reason.contains(char::is_control) {
        return Err(Problem::bad_request(format!(
            "reason has at most {REASON} characters, on one line."
        )));
    }
    Ok(())
}

fn make(
    transaction: &Transaction<'_>,
    now_ms: i64,
    caller: &Caller,
    key: Option<&str>,
    mut asked: JobsAsked,
) -> Stored<Result<JobsMade, Problem>> {
    let request = serde_json::to_vec(&asked).unwrap_or_default();
    let request = blake3::hash(&request).to_hex().to_string();
    // Keys of different clients are different keys.
    let key = key.map(|key| format!("{}:{key}", caller.name()));
    if let Some(key) = &key {
        let old = "DELETE FROM idempotency WHERE at_ms < ?1";
        transaction.execute(old, [now_ms - REMEMBERED_MS])?;
        let known = "SELECT request_blake3, jobs FROM idempotency WHERE key = ?1";
        let known = transaction.query_row(known, [key], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?))
        });
        if let Some((earlier, jobs)) = known.optional()? {
            if earlier != request {
                let text = "This Idempotency-Key was used for another request.";
                return Ok(Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, text)));
            }
            let mut jobs: Vec<JobAsked> = serde_json::from_str(&jobs).unwrap_or_default();
            jobs.iter_mut().for_each(|job| job.joined = true);
            return Ok(Ok(JobsMade { jobs }));
        }
    }
    if asked.all {
        let all = sites(transaction, "", u32::MAX)?;
        asked.sites = all
            .into_iter()
            .filter(|site| site.enabled)
            .map(|site| site.name)
            .collect();
    }
    for name in &asked.sites {
        if site(transaction, name)?.is_none_or(|site| !site.enabled) {
            let text = format!("There is no site {name:?} that can be run.");
            return Ok(Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, text)));
        }
    }
    let wanted = Wanted {
        sites: asked.sites,
        force: asked.force,
        reason: asked.reason,
    };
    let jobs: Vec<JobAsked> = ask_for(transaction, now_ms, &wanted, caller)?
        .into_iter()
        .map(|(site, asked)| JobAsked {
            site,
            job: asked.job,
            joined: asked.joined,
        })
        .collect();
    if let Some(key) = &key {
        let text = serde_json::to_string(&jobs).unwrap_or_default();
        transaction.execute(
            "INSERT INTO idempotency (key, token, request_blake3, jobs, at_ms) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![key, caller.name(), request, text, now_ms],
        )?;
    }
    Ok(Ok(JobsMade { jobs }))
}

/// Asks a job to stop; asking again changes nothing.
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

/// Tries a job again: one that waits or is blocked at once, one that ended without valid products as a new job.
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
    Problem::not_found("There is no such job.")
}
