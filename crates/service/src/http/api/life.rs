//! Health of the service.

use std::sync::Arc;

use axum::{extract::State, http::StatusCode, response::Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::answer::answer_with;
use crate::{
    database::shown::roots,
    http::{
        app::{App, blocking},
        problem::Problem,
    },
    instant::Instant,
};

/// Whether the service is alive, without access to disk or database.
#[utoipa::path(get, path = "/healthz", tag = "life", security(()), responses(
    (status = 200, body = String, content_type = "text/plain"),
))]
pub(super) async fn healthy() -> &'static str {
    "ok\n"
}

/// Whether the service is operational.
#[derive(Debug, Serialize, ToSchema)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is an entry of the document"
)]
struct Readiness {
    /// Whether all of the following hold.
    ready: bool,
    /// Whether the database answers.
    database: bool,
    /// Whether the disks of products and state have enough space.
    disk: bool,
    /// Whether all folders of inputs are available.
    roots: bool,
    /// Whether the configuration in force is that of the file.
    configuration: bool,
    /// Whether the runs on the disk are recorded; not while a lost database is rebuilt from the products.
    runs: bool,
    /// When this was determined.
    at_utc: Instant,
}

/// Whether the service is operational: database, disks, folders of inputs, configuration, records of runs.
#[utoipa::path(get, path = "/readyz", tag = "life", security(()), responses(
    (status = 200, body = Readiness),
    (status = 503, body = Readiness, description = "The service is not operational"),
))]
pub(super) async fn ready(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let found = app.read(roots).await;
    let config = app.config();
    let disk = blocking(move || {
        let outputs = &config.outputs;
        [&outputs.products, &outputs.state]
            .into_iter()
            .all(|folder| {
                let free = rustix::fs::statvfs(&**folder)
                    .map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize));
                free.is_ok_and(|bytes| bytes >> 20 >= u64::from(config.workers.min_free_mib))
            })
    })
    .await?;
    let mut state = Readiness {
        ready: false,
        database: found.is_ok(),
        disk,
        roots: found.is_ok_and(|roots| roots.iter().all(|root| root.state != "unavailable")),
        configuration: app.shared.problem().is_none(),
        runs: !app.shared.is_recovering(),
        at_utc: Instant(app.now_ms()),
    };
    state.ready = state.database && state.disk && state.roots && state.configuration && state.runs;
    let status = if state.ready {
        StatusCode::OK
    } else {
        StatusCode::SERVICE_UNAVAILABLE
    };
    answer_with(&app, status, &state)
}
