//! The interface for programs: documents of JSON below `/api/v1`, described by `/openapi.json`.

mod answer;
mod events;
mod files;
mod jobs;
mod kernels;
mod life;
mod logs;
mod measures;
mod new_jobs;
mod nights;
mod plans;
mod runs;
mod shots;
mod sites;
mod status;

use std::sync::{Arc, LazyLock};

use axum::{Json, Router, response::IntoResponse as _, routing::get};
use serde_json::Value;
use utoipa::{
    Modify, OpenApi,
    openapi::{
        OpenApi as Description,
        security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme},
    },
};
use utoipa_axum::{router::OpenApiRouter, routes};

use super::{app::App, problem::ProblemDocument};

#[derive(OpenApi)]
#[openapi(
    info(
        title = "areograph",
        description = "Sites, runs, jobs, kernels and shots of an areograph service. Errors are problem documents \
                       (RFC 9457). Lists are paged: pass `next` of a page as `after` for the following page. \
                       Instants are in RFC 3339 format, UTC.",
    ),
    components(schemas(ProblemDocument)),
    modifiers(&Tokens),
)]
struct Api;

/// Every operation accepts a token.
struct Tokens;

impl Modify for Tokens {
    fn modify(&self, api: &mut Description) {
        let bearer = HttpBuilder::new()
            .scheme(HttpAuthScheme::Bearer)
            .description(Some("A token created by `areograph service token add`."))
            .build();
        let components = api.components.get_or_insert_default();
        components.add_security_scheme("token", SecurityScheme::Http(bearer));
        api.security = Some(vec![SecurityRequirement::new("token", [""; 0])]);
    }
}

/// All routes for programs.
pub(super) fn routes() -> Router<Arc<App>> {
    described().split_for_parts().0.route(
        "/openapi.json",
        get(|_: super::caller::Reader| async move { Json(description()).into_response() }),
    )
}

/// The description of all routes for programs, as `OpenAPI`.
pub(super) fn description() -> &'static Value {
    static DESCRIPTION: LazyLock<Value> = LazyLock::new(|| {
        let (_, mut description) = described().split_for_parts();
        // The router's notation for a parameter that may contain `/`.
        let paths = std::mem::take(&mut description.paths.paths);
        let named = paths
            .into_iter()
            .map(|(path, item)| (path.replace("{*", "{"), item));
        description.paths.paths = named.collect();
        serde_json::to_value(description).unwrap_or_default()
    });
    &DESCRIPTION
}

fn described() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::with_openapi(Api::openapi())
        .routes(routes!(sites::list))
        .routes(routes!(sites::one))
        .routes(routes!(sites::current))
        .routes(routes!(runs::of_site))
        .routes(routes!(runs::one, runs::pin_one))
        .routes(routes!(files::of_run))
        .routes(routes!(files::difference))
        .routes(routes!(plans::begin))
        .routes(routes!(plans::one))
        .routes(routes!(shots::in_box, shots::in_polygon))
        .routes(routes!(jobs::list, new_jobs::create))
        .routes(routes!(jobs::one))
        .routes(routes!(jobs::cancel_one))
        .routes(routes!(jobs::retry_one))
        .routes(routes!(logs::of_job))
        .routes(routes!(events::follow))
        .routes(routes!(nights::list))
        .routes(routes!(nights::one))
        .routes(routes!(kernels::list))
        .routes(routes!(kernels::one))
        .routes(routes!(status::status))
        .routes(routes!(life::healthy))
        .routes(routes!(life::ready))
        .routes(routes!(measures::metrics))
}
