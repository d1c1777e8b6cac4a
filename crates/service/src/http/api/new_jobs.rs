//! Jobs requested by programs.

use std::sync::Arc;

use axum::{
    extract::State,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::Response,
};
use rusqlite::{OptionalExtension as _, Transaction, params};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::answer::answer_with;
use crate::{
    database::{
        Stored,
        shown::{site, sites},
    },
    http::{
        app::App,
        caller::{Caller, Operator},
        changes::{Wanted, ask_for},
        extract::Document,
        problem::{Problem, ProblemDocument},
    },
};

/// Sites of one request.
const SITES: usize = 1000;
/// Longest reason, characters.
const REASON: usize = 500;
/// Time for which an answer is repeated.
const REMEMBERED_MS: i64 = 24 * 3_600_000;

/// Sites of the requested jobs.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(
    untagged,
    expecting = "sites is invalid; expected a list of names, or the word all"
)]
pub(super) enum SitesAsked {
    /// These sites.
    Named(SiteNames),
    /// All sites.
    All(AllSites),
}

/// Names of sites.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(transparent)]
#[schema(min_items = 1, max_items = 1000, example = json!(["alpha"]))]
pub(super) struct SiteNames(Vec<String>);

/// The word for all sites.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum AllSites {
    /// All of them.
    All,
}

/// Requested jobs.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct JobsAsked {
    /// Names of sites, or `all`.
    sites: SitesAsked,
    /// Whether every stage runs, including stored ones.
    #[serde(default)]
    force: bool,
    /// The reason.
    #[serde(default)]
    #[schema(max_length = 500)]
    reason: String,
}

/// A requested job.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
struct JobAsked {
    /// The site.
    site: String,
    /// Its job.
    job: i64,
    /// Whether a pending job took over the request.
    joined: bool,
}

/// The requested jobs.
#[derive(Debug, Serialize, ToSchema)]
struct JobsMade {
    /// A job for each site.
    jobs: Vec<JobAsked>,
}

/// Requests jobs. With an `Idempotency-Key`, a repetition within 24 h returns the same jobs and creates no others.
#[utoipa::path(post, path = "/api/v1/jobs", tag = "jobs", params(
    ("Idempotency-Key" = Option<String>, Header, description = "1 to 100 letters, digits, `_` and `-`, chosen by the client",
     pattern = "^[A-Za-z0-9_-]{1,100}$"),
), request_body = JobsAsked, responses(
    (status = 202, body = JobsMade, description = "Jobs were created"),
    (status = 200, body = JobsMade, description = "The jobs already existed"),
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
        "Idempotency-Key is invalid; expected 1 to 100 letters, digits, _ and -.",
    ))
}

fn check(asked: &JobsAsked) -> Result<(), Problem> {
    if let SitesAsked::Named(SiteNames(names)) = &asked.sites
        && !(1..=SITES).contains(&names.len())
    {
        return Err(Problem::bad_request(format!(
            "sites contains {} names; expected 1 to {SITES}.",
            names.len()
        )));
    }
    if asked.reason.chars().count() > REASON || asked.reason.contains(char::is_control) {
        return Err(Problem::bad_request(format!(
            "reason is invalid; expected at most {REASON} characters on one line."
        )));
    }
    Ok(())
}

fn make(
    transaction: &Transaction<'_>,
    now_ms: i64,
    caller: &Caller,
    key: Option<&str>,
    asked: JobsAsked,
) -> Stored<Result<JobsMade, Problem>> {
    let request = serde_json::to_vec(&asked).unwrap_or_default();
    let request = blake3::hash(&request).to_hex().to_string();
    // Keys of different clients are distinct.
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
                let text = "This Idempotency-Key was used for a different request.";
                return Ok(Err(Problem::conflict(text)));
            }
            let mut jobs: Vec<JobAsked> = serde_json::from_str(&jobs).unwrap_or_default();
            for job in &mut jobs {
                job.joined = true;
            }
            return Ok(Ok(JobsMade { jobs }));
        }
    }
    let names = match asked.sites {
        SitesAsked::Named(SiteNames(names)) => names,
        SitesAsked::All(AllSites::All) => sites(transaction, "", u32::MAX)?
            .into_iter()
            .filter(|site| site.enabled)
            .map(|site| site.name)
            .collect(),
    };
    for name in &names {
        if site(transaction, name)?.is_none_or(|site| !site.enabled) {
            let text = format!("Site {name:?} does not exist or is disabled.");
            return Ok(Err(Problem::not_found(text)));
        }
    }
    let wanted = Wanted {
        sites: names,
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
