//! Metrics of the service.

use std::sync::Arc;

use axum::{
    extract::State,
    http::{HeaderValue, header},
    response::{IntoResponse as _, Response},
};

use crate::{
    database::shown::{
        DataStatus, Standing, Totals, Wait, count_sites, data_status, last_complete_night_ms,
        roots, standing, totals, waits,
    },
    engine::{disk::free_mib, schedule::next_night_ms, scrub::due_before_ms},
    http::{
        app::{App, blocking},
        caller::Reader,
        groups::Group,
        metrics::Gauge,
        problem::{Problem, ProblemDocument},
    },
    state::JobState,
};

const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Metrics for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "life", responses(
    (status = 200, body = String, content_type = "application/openmetrics-text"),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn metrics(_: Reader, State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let (config, now_ms) = (app.config(), app.now_ms());
    let before_ms = due_before_ms(&config, now_ms);
    let (totals, sites, night_ms, roots, data, standing, waits) = app
        .read(move |connection| {
            Ok((
                totals(connection)?,
                count_sites(connection)?,
                last_complete_night_ms(connection)?,
                roots(connection)?,
                data_status(connection, before_ms)?,
                standing(connection)?,
                waits(connection)?,
            ))
        })
        .await?;
    let mut gauges = of_jobs(&totals, now_ms);
    let unavailable = roots.iter().filter(|root| root.state == "unavailable");
    let plain = Gauge::plain;
    gauges.extend([
        plain("sites", "Enabled sites", sites.0 as f64),
        plain(
            "sites_stale",
            "Sites whose inputs are newer than their products",
            sites.1 as f64,
        ),
        plain(
            "roots_unavailable",
            "Input folders that are unavailable",
            unavailable.count() as f64,
        ),
        plain(
            "connections_open",
            "Connections",
            app.open_connections() as f64,
        ),
        plain(
            "event_streams_open",
            "Open event streams",
            app.open_streams() as f64,
        ),
    ]);
    gauges.extend(of_sites(&standing, &waits));
    gauges.extend(of_products(&data));
    let outputs = config.outputs.clone();
    let free = blocking(move || [free_mib(&outputs.products), free_mib(&outputs.state)]).await?;
    for (folder, free_mib) in ["products", "state"].into_iter().zip(free) {
        gauges.extend(free_mib.map(|free_mib| Gauge {
            name: "disk_free_bytes",
            help: "Free space of the folder",
            label: Some(("folder", folder)),
            value: free_mib as f64 * 1_048_576.0,
        }));
    }
    let next_ms = next_night_ms(&config.schedule, now_ms);
    gauges.extend(next_ms.map(|next_ms| {
        let help = "Start of the next night, seconds of UTC since 1970";
        plain("next_night_seconds", help, next_ms as f64 / 1e3)
    }));
    gauges.extend(night_ms.map(|night_ms| {
        let help = "End of the last complete night, seconds of UTC since 1970";
        plain("last_complete_night_seconds", help, night_ms as f64 / 1e3)
    }));
    let mut response = app.metrics.text(&gauges).into_response();
    let form = HeaderValue::from_static(OPEN_METRICS);
    response.headers_mut().insert(header::CONTENT_TYPE, form);
    Ok(response)
}

/// Jobs, runs and alerts.
fn of_jobs(totals: &Totals, now_ms: i64) -> Vec<Gauge> {
    let oldest = totals.oldest_queued_ms;
    let age_s = oldest.map_or(0.0, |then_ms| (now_ms - then_ms) as f64 / 1e3);
    let of_state = |(state, count): &(JobState, i64)| Gauge {
        name: "jobs",
        help: "Jobs by state",
        label: Some(("state", state.name())),
        value: *count as f64,
    };
    let mut gauges: Vec<Gauge> = totals.jobs.iter().map(of_state).collect();
    gauges.extend([
        Gauge::plain(
            "oldest_queued_job_seconds",
            "Age of the oldest queued job; 0 if no job is queued",
            age_s,
        ),
        Gauge::plain(
            "runs_kept",
            "Runs whose products are available",
            totals.runs as f64,
        ),
        Gauge::plain(
            "alerts_undelivered",
            "Alerts that no hook has accepted yet",
            totals.undelivered as f64,
        ),
    ]);
    gauges
}

/// Version, verdicts, waiting sites, kernels.
fn of_sites(standing: &Standing, waits: &[Wait]) -> Vec<Gauge> {
    let mut gauges = vec![Gauge {
        name: "build_info",
        help: "Version of areograph",
        label: Some(("version", env!("CARGO_PKG_VERSION"))),
        value: 1.0,
    }];
    for group in Group::ALL {
        let of_group =
            |(verdict, _): &&(Option<String>, i64)| Group::of(verdict.as_deref()) == group;
        let count: i64 = standing
            .verdicts
            .iter()
            .filter(of_group)
            .map(|(_, n)| n)
            .sum();
        gauges.push(Gauge {
            name: "sites_by_verdict",
            help: "Enabled sites by the verdict of their current run",
            label: Some(("verdict", group.name())),
            value: count as f64,
        });
    }
    let mut waiting: Vec<&String> = waits.iter().flat_map(|wait| &wait.sites).collect();
    waiting.sort();
    waiting.dedup();
    gauges.extend([
        Gauge::plain(
            "sites_waiting",
            "Sites that wait for a file",
            waiting.len() as f64,
        ),
        Gauge::plain(
            "inputs_lost",
            "Missing files for which sites wait",
            waits.len() as f64,
        ),
    ]);
    gauges.extend(standing.newest_kernels.iter().map(|(kind, at_ms)| Gauge {
        name: "newest_kernel_seconds",
        help: "Last change of a kernel of this kind, seconds of UTC since 1970",
        label: Some(("kind", kind)),
        value: *at_ms as f64 / 1e3,
    }));
    gauges
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
