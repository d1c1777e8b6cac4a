//! Nights.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::{
    answer::{ByNumber, List, answer},
    jobs::JobLine,
};
use crate::{
    database::shown::{Night, Run, jobs_of_night, night, nights, runs_of_night},
    http::{
        app::App,
        caller::Reader,
        extract::{At, Parameters},
        problem::{Problem, ProblemDocument},
    },
};

/// Jobs and runs returned with a night.
const MOST: u32 = 1000;

/// Nights, the newest first.
#[utoipa::path(get, path = "/api/v1/nights", tag = "nights", params(ByNumber), responses(
    (status = 200, body = List<Night>),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn list(
    _: Reader,
    State(app): State<Arc<App>>,
    Parameters(piece): Parameters<ByNumber>,
) -> Result<Response, Problem> {
    let (limit, before) = (piece.limit()?, piece.after()?);
    let found = app
        .read(move |connection| nights(connection, before, limit + 1))
        .await?;
    answer(&app, &List::of(found, limit, |night| night.id.to_string()))
}

/// A night and its results.
#[derive(Debug, Serialize, ToSchema)]
struct NightDetail {
    /// The night.
    night: Night,
    /// Its jobs by site, at most 1000.
    jobs: Vec<JobLine>,
    /// The runs that they published, at most 1000.
    runs: Vec<Run>,
}

/// One night with its jobs and runs.
#[utoipa::path(get, path = "/api/v1/nights/{night}", tag = "nights", params(
    ("night" = i64, Path, description = "Number of the night", minimum = 0),
), responses(
    (status = 200, body = NightDetail),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn one(
    _: Reader,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| {
            let Some(night) = night(connection, id)? else {
                return Ok(None);
            };
            Ok(Some(NightDetail {
                night,
                jobs: jobs_of_night(connection, id, MOST)?
                    .into_iter()
                    .map(JobLine::of)
                    .collect(),
                runs: runs_of_night(connection, id, MOST)?,
            }))
        })
        .await?;
    answer(
        &app,
        &found.ok_or_else(|| Problem::not_found("This night does not exist."))?,
    )
}
