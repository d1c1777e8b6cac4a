//! The page of a run.

use std::{collections::BTreeSet, sync::Arc};

use axum::{
    extract::State,
    response::{IntoResponse as _, Redirect, Response},
};
use maud::{Markup, html};
use serde::Deserialize;
use serde_json::Value;

use super::{
    jobs::short,
    layout::{Page, form_token, operator},
    parts::{
        Times, figure, figure_name, lead, log_rows, prose, said, sentences, size, table, times,
        tone,
    },
    trend::{KernelChange, figures, headline},
};
use crate::{
    database::{
        CauseRow, causes,
        shown::{Run, run},
    },
    http::{
        app::{App, blocking},
        caller::{Caller, Reader},
        changes::pin,
        extract::{At, Filled, name},
        files::manifest,
        problem::Problem,
    },
};
use areograph_store::{manifest::Manifest, publish::MANIFEST};

/// The first page of a site's products.
const REPORT: &str = "report/index.html";

/// One run: its causes, changes, figures, kernels, stages and files.
pub(super) async fn one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(id): At<String>,
) -> Result<Response, Problem> {
    let id = name(&id)?.to_owned();
    let found = app
        .read(move |connection| {
            let Some(this) = run(connection, &id)? else {
                return Ok(None);
            };
            let before = match &this.predecessor {
                Some(before) => run(connection, before)?,
                None => None,
            };
            let causes = causes(connection, this.job)?;
            Ok(Some((this, before, causes)))
        })
        .await?;
    let (run, before, causes) =
        found.ok_or_else(|| Problem::not_found("This run does not exist."))?;
    let (config, wanted) = (app.config(), run.clone());
    let manifest = blocking(move || manifest(&config.outputs.products, &wanted)).await?;
    let times = times(&app);
    let body = html! {
        (run_lead(&run, &causes, manifest.as_ref().ok(), &times))
        (pin_button(&run, &caller))
        section { h2 { "What moved" } (moved(&run)) }
        section { h2 { "Figures" } (figure_table(&run, before.as_ref())) }
        section { h2 { "Kernels" } (kernel_table(&run, before.as_ref())) }
        section { h2 { "Stages" } (stage_table(&run)) }
        section {
            h2 { "Files" }
            @match &manifest {
                Ok(manifest) => (file_table(&run, manifest)),
                Err(problem) => p { (problem.detail) },
            }
        }
    };
    let title = format!("Run {} of {}", run.id, run.site);
    Ok(Page {
        title: &title,
        place: "/",
    }
    .answer(&app, &caller, &body))
}

fn run_lead(run: &Run, causes: &[CauseRow], manifest: Option<&Manifest>, times: &Times) -> Markup {
    let named = |path: &str| {
        manifest
            .is_some_and(|manifest| manifest.products.iter().any(|product| product.path == path))
    };
    lead(
        tone(Some(&run.verdict)),
        &run.verdict,
        &html! {
            p {
                "Site " a href={ "/sites/" (run.site) } { (run.site) } ", published " (times.at(run.published_utc))
                " by " a href={ "/jobs/" (run.job) } { "job " (run.job) } ", attempt " (run.attempt) ", areograph " (run.version) "."
                @if let Some(before) = &run.predecessor { " Previous run: " a href={ "/runs/" (before) } { (before) } "." }
                @if let Some(removed) = run.removed_utc { " Its products were removed " (times.at(removed)) "." }
                @else if let Some(checked) = run.checked_utc { " Its products were last read " (times.age(checked)) "." }
            }
            @if run.damaged > 0 { p { "Products withheld because they do not match the manifest: " (run.damaged) "." } }
            (said(&sentences(&run.reasons)))
            @let because = sentences(&run.because);
            @for because in &because { p { "Because: " (prose(because)) } }
            @for cause in causes.iter().filter(|cause| !cause.detail.is_empty() && !because.contains(&cause.detail)) {
                p { "Because: " (prose(&cause.detail)) }
            }
            @if named(REPORT) { p { a href={ "/api/v1/runs/" (run.id) "/files/" (REPORT) } { "Report" } } }
        },
    )
}

fn pin_button(run: &Run, caller: &Caller) -> Markup {
    html! {
        @if let Some(session) = &caller.session && caller.operates() && run.removed_utc.is_none() {
            form method="post" action={ "/runs/" (run.id) "/pin" } class="actions" {
                (form_token(&session.form_token))
                button type="submit" name="pinned" value=(!run.pinned) {
                    @if run.pinned { "Do not keep permanently" } @else { "Keep permanently" }
                }
            }
        } @else if run.pinned { p { "Kept permanently." } }
    }
}

fn moved(run: &Run) -> Markup {
    let more: Vec<String> = run
        .moved
        .get("sentences")
        .map(sentences)
        .unwrap_or_default();
    html! {
        @if run.moved.is_null() {
            @if run.predecessor.is_none() { p { "This is the first run." } } @else { p { "No comparison with its predecessor." } }
        } @else {
            p { strong { (headline(run)) } }
            @if run.moved.get("beyond_limit").and_then(Value::as_bool) == Some(true) { p class="word invalid" { "Beyond a limit." } }
            (said(&more))
            @if run.moved.get("page").and_then(Value::as_bool) == Some(true) {
                p { a href={ "/api/v1/runs/" (run.id) "/difference" } { "Difference from the previous run" } }
            }
            @if let Some(problem) = run.moved.get("problem").and_then(Value::as_str) { p { "The comparison failed: " (problem) } }
        }
    }
}

fn figure_table(run: &Run, before: Option<&Run>) -> Markup {
    let (now, then) = (figures(run), before.map(figures).unwrap_or_default());
    let names: BTreeSet<&String> = now.keys().chain(then.keys()).collect();
    html! {
        @if names.is_empty() { p { "None." } } @else {
            (table("Figures of this run and the previous run", &["Figure", "This run", "Before", "Difference"], &html! {
                @for name in names {
                    @let (new, old) = (now.get(name), then.get(name));
                    tr {
                        th scope="row" { (figure_name(name)) }
                        td class="number" { (shown(new)) }
                        td class="number" { (shown(old)) }
                        td class="number" { @if let (Some(new), Some(old)) = (new, old) { (figure(new - old)) } @else { "–" } }
                    }
                }
            }))
        }
    }
}

fn shown(value: Option<&f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| figure(*value))
}

fn kernel_table(run: &Run, before: Option<&Run>) -> Markup {
    let change = before.map(|before| KernelChange::between(before, run));
    let kernels = run
        .kernels
        .as_array()
        .map(Vec::as_slice)
        .unwrap_or_default();
    let text = |kernel: &Value, field: &str| {
        kernel
            .get(field)
            .and_then(Value::as_str)
            .unwrap_or_default()
            .to_owned()
    };
    let told = |name: &String| match &change {
        Some(change) if change.changed.contains(name) => "changed",
        Some(change) if change.added.contains(name) => "new",
        _ => "",
    };
    html! {
        @if let Some(words) = change.as_ref().and_then(KernelChange::words) { p { "Since the previous run: " (words) "." } }
        (log_rows("Kernels in load order", &["Kernel", "Role", "BLAKE3", "Since the previous run"], &html! {
            @for kernel in kernels {
                @let name = text(kernel, "name");
                tr {
                    th scope="row" { (name) }
                    td { (text(kernel, "role")) }
                    td class="hash" { (short(&text(kernel, "blake3"))) }
                    td { (told(&name)) }
                }
            }
        }))
    }
}

fn stage_table(run: &Run) -> Markup {
    let stages = run.stages.as_array().map(Vec::as_slice).unwrap_or_default();
    let text = |stage: &Value, field: &str| {
        stage
            .get(field)
            .and_then(Value::as_str)
            .unwrap_or_default()
            .to_owned()
    };
    html! {
        (log_rows("Stages", &["Stage", "Ran", "Why"], &html! {
            @for stage in stages {
                tr {
                    th scope="row" { (text(stage, "stage")) }
                    td { @if stage.get("runs").and_then(Value::as_bool) == Some(true) { "yes" } @else { "kept" } }
                    td class="long" { (text(stage, "because")) }
                }
            }
        }))
    }
}

fn file_table(run: &Run, manifest: &Manifest) -> Markup {
    html! {
        p { a href={ "/api/v1/runs/" (run.id) "/files/" (MANIFEST) } { (MANIFEST) } ": all inputs of these products." }
        (log_rows("Products", &["File", "Size", "Rows", "BLAKE3"], &html! {
            @for product in &manifest.products {
                tr {
                    th scope="row" { a href={ "/api/v1/runs/" (run.id) "/files/" (product.path) } { (product.path) } }
                    td class="number" { (size(product.bytes)) }
                    td class="number" { (product.rows) }
                    td class="hash" { (short(&product.blake3)) }
                }
            }
        }))
    }
}

/// Form data of the button of a run.
#[derive(Debug, Deserialize)]
pub(super) struct PinForm {
    form_token: String,
    pinned: bool,
}

/// Keeps a run permanently, or releases it.
pub(super) async fn pin_one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(id): At<String>,
    Filled(form): Filled<PinForm>,
) -> Result<Response, Problem> {
    let caller = operator(caller, &form.form_token)?;
    let run = pin(&app, caller, name(&id)?.to_owned(), form.pinned).await?;
    Ok(Redirect::to(&format!("/runs/{}", run.id)).into_response())
}
