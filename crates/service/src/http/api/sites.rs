//! Sites.

use std::sync::Arc;

use axum::{
    extract::State,
    response::{IntoResponse as _, Redirect, Response},
};

use super::answer::{ByName, List, answer};
use crate::{
    database::shown::{Site, site, sites},
    http::{
        app::App,
        caller::Reader,
        extract::{At, Parameters, name},
        problem::{Problem, ProblemDocument},
    },
};

/// All sites, by name.
#[utoipa::path(get, path = "/api/v1/sites", tag = "sites", params(ByName), responses(
    (status = 200, body = List<Site>),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn list(
    _: Reader,
    State(app): State<Arc<App>>,
    Parameters(piece): Parameters<ByName>,
) -> Result<Response, Problem> {
    let limit = piece.limit()?;
    let after = piece.after()?.unwrap_or_default();
    let found = app
        .read(move |connection| sites(connection, &after, limit + 1))
        .await?;
    answer(&app, &List::of(found, limit, |site| site.name.clone()))
}

/// One site.
#[utoipa::path(get, path = "/api/v1/sites/{site}", tag = "sites", params(
    ("site" = String, Path, description = "Name of the site", pattern = "^[A-Za-z0-9_-]{1,64}$"),
), responses(
    (status = 200, body = Site),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn one(
    _: Reader,
    State(app): State<Arc<App>>,
    At(site): At<String>,
) -> Result<Response, Problem> {
    answer(&app, &find(&app, &site).await?)
}

/// A product of the current run: redirects to that of the run.
#[utoipa::path(get, path = "/api/v1/sites/{site}/current/{*path}", tag = "sites", params(
    ("site" = String, Path, description = "Name of the site", pattern = "^[A-Za-z0-9_-]{1,64}$"),
    ("path" = String, Path, description = "Path of a product as listed in the manifest; may contain /"),
), responses(
    (status = 307, description = "The Location header contains the address"),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn current(
    _: Reader,
    State(app): State<Arc<App>>,
    At((site, path)): At<(String, String)>,
) -> Result<Response, Problem> {
    let found = find(&app, &site).await?;
    let run = found
        .current_run
        .ok_or_else(|| app.unknown("This site has no valid run yet."))?;
    if !path
        .bytes()
        .all(|byte| byte.is_ascii_graphic() && !b"%?#\\".contains(&byte))
        || path.contains("..")
    {
        return Err(Problem::not_found("No manifest lists this product."));
    }
    Ok(Redirect::temporary(&format!("/api/v1/runs/{run}/files/{path}")).into_response())
}

/// An existing site.
pub(super) async fn find(app: &App, site_name: &str) -> Result<Site, Problem> {
    let wanted = name(site_name)?.to_owned();
    let found = app
        .read(move |connection| site(connection, &wanted))
        .await?;
    found.ok_or_else(|| app.unknown("This site does not exist."))
}
