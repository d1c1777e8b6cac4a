//! Runs.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use serde::Deserialize;
use utoipa::ToSchema;

use super::{
    answer::{ByName, List, answer},
    sites::find as find_site,
};
use crate::{
    database::shown::{Run, run, runs_of_site},
    http::{
        app::App,
        caller::{Operator, Reader},
        changes::pin,
        extract::{At, Document, Parameters, name},
        problem::{Problem, ProblemDocument},
    },
};

/// Runs of a site, the newest first.
#[utoipa::path(get, path = "/api/v1/sites/{site}/runs", tag = "runs", params(
    ("site" = String, Path, description = "Name of the site", pattern = "^[A-Za-z0-9_-]{1,64}$"), ByName,
), responses(
    (status = 200, body = List<Run>),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn of_site(
    _: Reader,
    State(app): State<Arc<App>>,
    At(site): At<String>,
    Parameters(piece): Parameters<ByName>,
) -> Result<Response, Problem> {
    let limit = piece.limit()?;
    let site = find_site(&app, &site).await?.name;
    let after = piece.after()?;
    let found = app
        .read(move |connection| runs_of_site(connection, &site, after.as_deref(), limit + 1))
        .await?;
    answer(&app, &List::of(found, limit, |run| run.id.clone()))
}

/// One run: its causes, kernels, figures and changes.
#[utoipa::path(get, path = "/api/v1/runs/{run}", tag = "runs", params(
    ("run" = String, Path, description = "Identifier of the run", pattern = "^[A-Za-z0-9_-]{1,64}$"),
), responses(
    (status = 200, body = Run),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn one(
    _: Reader,
    State(app): State<Arc<App>>,
    At(id): At<String>,
) -> Result<Response, Problem> {
    answer(&app, &find(&app, &id).await?)
}

/// Properties of a run that can be changed.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RunChange {
    /// Whether it is kept permanently.
    pinned: bool,
}

/// Keeps a run permanently, or releases it.
#[utoipa::path(patch, path = "/api/v1/runs/{run}", tag = "runs", params(
    ("run" = String, Path, description = "Identifier of the run", pattern = "^[A-Za-z0-9_-]{1,64}$"),
), request_body = RunChange, responses(
    (status = 200, body = Run),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn pin_one(
    Operator(caller): Operator,
    State(app): State<Arc<App>>,
    At(id): At<String>,
    Document(change): Document<RunChange>,
) -> Result<Response, Problem> {
    let id = name(&id)?.to_owned();
    answer(&app, &pin(&app, caller, id, change.pinned).await?)
}

/// An existing run.
pub(super) async fn find(app: &App, id: &str) -> Result<Run, Problem> {
    let wanted = name(id)?.to_owned();
    let found = app.read(move |connection| run(connection, &wanted)).await?;
    found.ok_or_else(|| app.unknown("This run does not exist."))
}
