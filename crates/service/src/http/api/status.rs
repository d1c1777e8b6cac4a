//! Status of the service: its database and its products.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::answer::answer;
use crate::{
    database::shown::{DataStatus, Wait, data_status, waits},
    engine::{schedule::next_night_ms, scrub::due_before_ms},
    http::{
        app::App,
        caller::Reader,
        problem::{Problem, ProblemDocument},
    },
    instant::Instant,
};

/// Status of the service.
#[derive(Debug, Serialize, ToSchema)]
struct Status {
    /// Its name.
    name: String,
    /// Version of areograph.
    version: &'static str,
    /// Whether a lost database is being rebuilt from the products.
    recovering: bool,
    /// Why the configuration of the file is not in force.
    configuration_problem: Option<String>,
    /// When the next night is due.
    next_night_utc: Option<Instant>,
    /// Files for which sites wait.
    waits: Vec<Wait>,
    /// Its database and its products.
    #[serde(flatten)]
    data: DataStatus,
    /// When this was determined.
    at_utc: Instant,
}

/// Status of the data: a lost database, products that do not match their manifests, the last check of them.
#[utoipa::path(get, path = "/api/v1/status", tag = "life", responses(
    (status = 200, body = Status),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn status(_: Reader, State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let (config, now_ms) = (app.config(), app.now_ms());
    let before_ms = due_before_ms(&config, now_ms);
    let (data, waits) = app
        .read(move |connection| Ok((data_status(connection, before_ms)?, waits(connection)?)))
        .await?;
    let status = Status {
        name: config.name.clone(),
        version: env!("CARGO_PKG_VERSION"),
        recovering: app.shared.is_recovering(),
        configuration_problem: app.shared.problem(),
        next_night_utc: next_night_ms(&config.schedule, now_ms).map(Instant),
        waits,
        data,
        at_utc: Instant(now_ms),
    };
    answer(&app, &status)
}
