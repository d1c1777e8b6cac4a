//! Logs of attempts.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::answer::answer;
use crate::{
    database::shown::attempts,
    http::{
        app::{App, blocking},
        caller::Reader,
        extract::{At, Parameters},
        logs::{PIECE, log_piece},
        problem::{Problem, ProblemDocument},
    },
};

/// Selection of a log and its page.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct LogWanted {
    /// The attempt, by default the newest.
    #[param(minimum = 1)]
    attempt: Option<u32>,
    /// `next` of the preceding page; by default the start.
    #[param(minimum = 0)]
    after: Option<u64>,
}

/// A page of a log.
#[derive(Debug, Serialize, ToSchema)]
struct LogText {
    /// The attempt.
    attempt: i64,
    /// Lines, most of them JSON.
    text: String,
    /// `after` of the next page.
    next: u64,
    /// Whether the attempt has ended and this is the end of its log.
    complete: bool,
}

/// Attempts that are searched.
const ATTEMPTS: u32 = 1000;

/// The log of an attempt, at most 256 KiB of it.
#[utoipa::path(get, path = "/api/v1/jobs/{job}/log", tag = "jobs", params(
    ("job" = i64, Path, description = "Number of the job", minimum = 0), LogWanted,
), responses(
    (status = 200, body = LogText),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn of_job(
    _: Reader,
    State(app): State<Arc<App>>,
    At(job): At<i64>,
    Parameters(wanted): Parameters<LogWanted>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| attempts(connection, job, ATTEMPTS))
        .await?;
    let which = |n: i64| wanted.attempt.is_none_or(|attempt| i64::from(attempt) == n);
    let attempt = found
        .into_iter()
        .find(|attempt| which(attempt.n))
        .ok_or_else(|| Problem::not_found("This attempt does not exist."))?;
    let config = app.config();
    let (log, after) = (attempt.log, wanted.after.unwrap_or(0));
    let piece =
        blocking(move || log_piece(&config.outputs.state, &log, Some(after), PIECE)).await??;
    let log = LogText {
        attempt: attempt.n,
        complete: attempt.ended_utc.is_some() && piece.next == piece.bytes,
        text: piece.text,
        next: piece.next,
    };
    answer(&app, &log)
}
