//! Health of the service, and its metrics.

use std::sync::Arc;

use axum::{
    extract::State,
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use serde::Serialize;
use utoipa::ToSchema;

use super::answer::answer_with;
use crate::{
    database::shown::{
        DataStatus, count_sites, data_status, last_complete_night_ms, roots, totals,
    },
    engine::scrub::due_before_ms,
    http::{
        app::{App, blocking},
        caller::Reader,
        metrics::Gauge,
        problem::{Problem, ProblemDocument},
    },
    instant::Instant,
};

const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

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

/// Metrics for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "life", responses(
    (status = 200, body = String, content_type = "application/openmetrics-text"),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn metrics(_: Reader, State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let now_ms = app.now_ms();
    let before_ms = due_before_ms(&app.config(), now_ms);
    let (totals, sites, night_ms, roots, data) = app
        .read(move |connection| {
            Ok((
                totals(connection)?,
                count_sites(connection)?,
                last_complete_night_ms(connection)?,
                roots(connection)?,
                data_status(connection, before_ms)?,
            ))
        })
        .await?;
    let age_s =
        |then_ms: Option<i64>| then_ms.map_or(0.0, |then_ms| (now_ms - then_ms) as f64 / 1e3);
    let mut gauges: Vec<Gauge> = totals
        .jobs
        .iter()
        .map(|(state, count)| Gauge {
            name: "jobs",
            help: "Jobs by state",
            label: Some(("state", state.name())),
            value: *count as f64,
        })
        .collect();
    let unavailable = roots
        .iter()
        .filter(|root| root.state == "unavailable")
        .count();
    let plain = Gauge::plain;
    gauges.extend([
        plain(
            "oldest_queued_job_seconds",
            "Age of the oldest queued job, 0 without one",
            age_s(totals.oldest_queued_ms),
        ),
        plain(
            "runs_kept",
            "Runs whose products are available",
            totals.runs as f64,
        ),
        plain("sites", "Sites that are enabled", sites.0 as f64),
        plain(
            "sites_stale",
            "Sites whose inputs are newer than their products",
            sites.1 as f64,
        ),
        plain(
            "roots_unavailable",
            "Input folders that are not available",
            unavailable as f64,
        ),
        plain(
            "alerts_undelivered",
            "Alerts that no hook has accepted yet",
            totals.undelivered as f64,
        ),
        plain(
            "connections_open",
            "Connections",
            app.open_connections() as f64,
        ),
        plain(
            "event_streams_open",
            "Streams of events",
            app.open_streams() as f64,
        ),
    ]);
    gauges.extend(of_products(&data));
    if let Some(night_ms) = night_ms {
        let help = "End of the last complete night, seconds of UTC since 1970";
        gauges.push(plain(
            "last_complete_night_seconds",
            help,
            night_ms as f64 / 1e3,
        ));
    }
    let mut response = app.metrics.text(&gauges).into_response();
    let form = HeaderValue::from_static(OPEN_METRICS);
    response.headers_mut().insert(header::CONTENT_TYPE, form);
    Ok(response)
}

/// Checks of products, and their results.
fn of_products(data: &DataStatus) -> Vec<Gauge> {
    let products = &data.products;
    let plain = Gauge::plain;
    let mut gauges = vec![
        plain(
            "runs_damaged",
            "Runs with products that do not match the manifest",
            products.runs_damaged as f64,
        ),
        plain(
            "runs_scrub_due",
            "Runs whose products have not been read for longer than changes.scrub_days",
            products.runs_due as f64,
        ),
    ];
    if let Some(scrub) = &products.last_scrub {
        gauges.extend([
            plain(
                "last_scrub_seconds",
                "End of the last check of products after a night, seconds of UTC since 1970",
                scrub.ended_utc.0 as f64 / 1e3,
            ),
            plain(
                "last_scrub_runs",
                "Runs whose products were read in the last check after a night",
                scrub.runs as f64,
            ),
            plain(
                "last_scrub_bytes",
                "Bytes read in the last check after a night",
                scrub.bytes as f64,
            ),
            plain(
                "last_scrub_damaged_runs",
                "Runs with damaged products in the last check after a night",
                scrub.damaged_runs as f64,
            ),
        ]);
    }
    if let Some(loss) = &data.database_loss {
        gauges.push(plain(
            "database_lost_seconds",
            "Time at which a lost database was rebuilt from the products, seconds of UTC since 1970",
            loss.at_utc.0 as f64 / 1e3,
        ));
    }
    gauges
}
