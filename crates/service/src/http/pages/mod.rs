//! Pages for people: complete without the script, which only keeps them up to date.

mod data;
mod docs;
mod events;
mod jobs;
mod kernels;
pub(super) mod layout;
mod log;
mod login;
mod map;
mod nights;
mod parts;
mod runs;
mod sites;
mod standing;
mod timeline;
mod trend;

use std::sync::Arc;

use areograph_base::body::Body;
use axum::{
    Router,
    http::{HeaderName, header},
    routing::{get, post},
};

use super::app::App;

/// A file of this version never changes.
const KEPT: (HeaderName, &str) = (header::CACHE_CONTROL, "public, max-age=31536000, immutable");

/// All pages, their style and their script.
pub(super) fn routes() -> Router<Arc<App>> {
    let style = [(header::CONTENT_TYPE, "text/css; charset=utf-8"), KEPT];
    let script = [
        (header::CONTENT_TYPE, "text/javascript; charset=utf-8"),
        KEPT,
    ];
    let relief = [(header::CONTENT_TYPE, "image/png"), KEPT];
    Router::new()
        .route("/", get(sites::home))
        .route("/sites/{site}", get(sites::one))
        .route("/sites/{site}/run", post(sites::run_now))
        .route("/runs/{run}", get(runs::one))
        .route("/runs/{run}/pin", post(runs::pin_one))
        .route("/jobs", get(jobs::list))
        .route("/jobs/{job}", get(jobs::one))
        .route("/jobs/{job}/cancel", post(jobs::cancel_one))
        .route("/jobs/{job}/retry", post(jobs::retry_one))
        .route("/kernels", get(kernels::list))
        .route("/events", get(events::list))
        .route("/docs", get(docs::docs))
        .route("/nights", get(nights::list))
        .route("/nights/{night}", get(nights::one))
        .route("/login", get(login::form).post(login::enter))
        .route("/logout", post(login::leave))
        .route(
            layout::STYLE_PATH,
            get(move || async move { (style, layout::style()) }),
        )
        .route(
            layout::SCRIPT_PATH,
            get(move || async move { (script, layout::SCRIPT) }),
        )
        .route(
            layout::RELIEF_PATH,
            get(move || async move { (relief, Body::Mars.relief().unwrap_or_default()) }),
        )
}
