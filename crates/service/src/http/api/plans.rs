//! Plans: what a run of a site would do.

use std::sync::Arc;

use axum::{
    extract::State,
    http::{HeaderValue, StatusCode, header},
    response::Response,
};

use super::{
    answer::{answer, answer_with},
    sites::find,
};
use crate::{
    database::shown::site_file,
    http::{
        app::App,
        caller::Reader,
        extract::At,
        plans::{Input, Plan, Step},
        problem::{Problem, ProblemDocument},
        work::{ask, place},
    },
    worker::protocol::{Answer, What},
};

/// Longest time for a plan, seconds: the first one may have to read all inputs.
const DEADLINE_S: f64 = 1800.0;

/// Begins a plan: what a run of the site would do, and why. The header Location contains the address of the answer.
#[utoipa::path(post, path = "/api/v1/sites/{site}/plan", tag = "sites", params(
    ("site" = String, Path, description = "Name of the site", pattern = "^[A-Za-z0-9_-]{1,64}$"),
), responses(
    (status = 202, body = Plan),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn begin(
    _: Reader,
    State(app): State<Arc<App>>,
    At(site): At<String>,
) -> Result<Response, Problem> {
    let site = find(&app, &site).await?.name;
    let wanted = site.clone();
    let file = app
        .read(move |connection| site_file(connection, &wanted))
        .await?;
    let file = file.ok_or_else(|| Problem::not_found("This site does not exist."))?;
    let place = place(&app)?;
    let plan = app.plans.begin(&site, app.now_ms());
    let out = app.config().outputs.products.join(&site).join("working");
    let what = What::Plan {
        site_file: file.into(),
        out,
    };
    let (app_then, begun) = (Arc::clone(&app), plan.clone());
    tokio::spawn(async move {
        let found = ask(&app_then, what, DEADLINE_S).await;
        app_then.plans.end(ended(begun, found));
        drop(place);
    });
    let mut response = answer_with(&app, StatusCode::ACCEPTED, &plan)?;
    let address = HeaderValue::from_str(&format!("/api/v1/plans/{}", plan.id));
    let address = address.map_err(Problem::internal)?;
    response.headers_mut().insert(header::LOCATION, address);
    Ok(response)
}

fn ended(
    plan: Plan,
    found: Result<Result<Answer, crate::worker::protocol::Failure>, Problem>,
) -> Plan {
    let problem = match found {
        Ok(Ok(Answer::Plan(answer))) => {
            let stages = answer.stages.into_iter().map(|stage| Step {
                stage: stage.stage,
                runs: stage.runs,
                because: stage.because,
            });
            let files = answer.files.into_iter().map(|file| Input {
                file: file.path.display().to_string(),
                blake3: file.blake3,
            });
            return Plan {
                state: "done",
                stages: stages.collect(),
                files: files.collect(),
                ..plan
            };
        }
        Ok(Ok(_)) => "The worker sent an unexpected answer.".to_owned(),
        Ok(Err(failure)) => failure.text,
        Err(problem) => {
            tracing::error!("a plan: {}", problem.cause.unwrap_or_default());
            problem.detail.into_owned()
        }
    };
    Plan {
        state: "failed",
        problem: Some(problem),
        ..plan
    }
}

/// A requested plan; the newest 64 are kept.
#[utoipa::path(get, path = "/api/v1/plans/{plan}", tag = "sites", params(
    ("plan" = u64, Path, description = "Number of the plan", minimum = 0),
), responses(
    (status = 200, body = Plan),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn one(
    _: Reader,
    State(app): State<Arc<App>>,
    At(id): At<u64>,
) -> Result<Response, Problem> {
    let plan = app.plans.get(id);
    answer(
        &app,
        &plan.ok_or_else(|| Problem::not_found("This plan does not exist."))?,
    )
}
