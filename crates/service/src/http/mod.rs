//! The service over HTTP: an interface for programs, pages for people, metrics for monitors.
//!
//! Handlers read the tables of the database (`database/shown`) and send requests to the engine by rows and a wake-up.
//! Workers start only for plans and searches of shots. A request passes, from the outside:
//!
//! | layer | task |
//! |---|---|
//! | `accept` | connections, times, sizes |
//! | `frame` | identifier, headers, the form of a refusal |
//! | `guard` | host, no token in the address, identity of the caller, rate |
//! | forged forms | refused |
//! | handler | a document, or a `Problem` |
//!
//! `Redactor` removes the folders of the machine from every answer. Files are opened below the folder where they belong,
//! by names that a manifest holds (`files`). `docs/http.md` describes the use.

mod accept;
mod api;
mod app;
mod caller;
mod changes;
mod coverage;
mod extract;
mod files;
mod frame;
mod groups;
mod guard;
mod logs;
mod metrics;
mod pages;
mod plans;
mod problem;
mod rate;
mod redactor;
mod stall;
mod work;

use std::sync::Arc;

use axum::{Router, middleware::from_fn_with_state};
use tokio::net::TcpListener;
use tower_http::{catch_panic::CatchPanicLayer, csrf::CsrfLayer};

use super::shared::Shared;
use app::App;
use areograph_base::error::{Error, IoError, Result};

/// Answers requests until the service ends; then streams of events end first, and current requests within 10 s.
///
/// # Errors
/// The listener has no address.
pub async fn serve(listener: TcpListener, shared: Arc<Shared>) -> Result<()> {
    let local = listener.local_addr();
    let local = local.map_err(|error| Error::new(IoError::on("ask for the address")(error)))?;
    let app = Arc::new(App::new(shared, local));
    accept::run(listener, router(&app), &app).await;
    Ok(())
}

/// All routes, and around them, from the outside: frame, panics, guard, forged forms.
fn router(app: &Arc<App>) -> Router {
    Router::new()
        .merge(api::routes())
        .merge(pages::routes())
        .fallback(|| async { problem::Problem::not_found("This address does not exist.") })
        .layer(CsrfLayer::new())
        .layer(from_fn_with_state(Arc::clone(app), guard::guard))
        .layer(CatchPanicLayer::custom(frame::panicked))
        .layer(from_fn_with_state(Arc::clone(app), frame::frame))
        .with_state(Arc::clone(app))
}
