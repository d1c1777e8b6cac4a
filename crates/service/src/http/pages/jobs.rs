//! Jobs, and the page of a job.

use std::sync::Arc;

use axum::{
    extract::State,
    response::{IntoResponse as _, Redirect, Response},
};
use maud::{Markup, html};
use serde::Deserialize;

use super::{
    layout::{Page, form_token, operator},
    log::log_table,
    parts::{Times, lead, more, prose, state, table, times, verdict},
    trend::headline,
};
use crate::{
    database::{
        CauseRow, Job, JobFilter, causes, job, jobs,
        shown::{Attempt, Run, attempts, runs_of_job},
    },
    http::{
        app::{App, blocking},
        caller::{Caller, Reader},
        changes::{cancel, outcome_text, retry},
        extract::{At, Filled, Parameters, name},
        logs::{LogPiece, log_piece},
        problem::Problem,
    },
    instant::Instant,
    state::JobState,
};

/// Jobs on one page.
const JOBS: u32 = 100;
/// Attempts on the page of a job.
const ATTEMPTS: u32 = 50;
/// Bytes of the end of a log on the page of a job.
const TAIL: u64 = 64 << 10;

/// A filter of jobs.
#[derive(Debug, Deserialize)]
pub(super) struct JobsWanted {
    after: Option<i64>,
    site: Option<String>,
    state: Option<JobState>,
}

/// Jobs, the newest first.
pub(super) async fn list(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    Parameters(wanted): Parameters<JobsWanted>,
) -> Result<Response, Problem> {
    if let Some(site) = &wanted.site {
        name(site)?;
    }
    let (site, chosen) = (wanted.site.clone(), wanted.state);
    let found = app
        .read(move |connection| {
            let filter = JobFilter {
                site: wanted.site.as_deref(),
                state: wanted.state,
                before: wanted.after,
            };
            jobs(connection, &filter, JOBS + 1)
        })
        .await?;
    let shown = &found[..found.len().min(JOBS as usize)];
    let of_site = site
        .as_ref()
        .map(|site| format!("&site={site}"))
        .unwrap_or_default();
    let of_state = chosen
        .map(|state| format!("&state={state}"))
        .unwrap_or_default();
    let next = shown.last().filter(|_| found.len() > shown.len());
    let next = next.map(|job| format!("/jobs?after={}{of_site}{of_state}", job.id));
    let body = html! {
        nav aria-label="States" {
            ul {
                li { a href={ "/jobs?" (of_site) } aria-current=[chosen.is_none().then_some("true")] { "all" } }
                @for state in JobState::ALL {
                    li { a href={ "/jobs?state=" (state) (of_site) } aria-current=[(chosen == Some(state)).then_some("true")] { (state) } }
                }
            }
        }
        @if let Some(site) = &site { p { "Jobs of the site " a href={ "/sites/" (site) } { (site) } "." } }
        div id="jobs" data-live="" { (job_table("Jobs, the newest first", shown, &times(&app))) }
        (more(next))
    };
    Ok(Page {
        title: "Jobs",
        place: "/jobs",
    }
    .answer(&app, &caller, &body))
}

/// Jobs as a table.
pub(super) fn job_table(caption: &str, jobs: &[Job], times: &Times) -> Markup {
    html! {
        @if jobs.is_empty() { p { "None." } } @else {
            (table(caption, &["Job", "Site", "State", "Attempt", "Since", "Requested by", "Outcome"], &html! {
                @for job in jobs {
                    tr {
                        th scope="row" { a href={ "/jobs/" (job.id) } { (job.id) } }
                        td { a href={ "/sites/" (job.site) } { (job.site) } }
                        td { (state(job.state)) }
                        td { (job.attempt) }
                        td { (times.age(Instant(job.changed_ms))) }
                        td { (asker(job)) }
                        td class="long" { (prose(outcome_text(job).unwrap_or_default())) }
                    }
                }
            }))
        }
    }
}

fn asker(job: &Job) -> Markup {
    html! {
        @match (&job.asked_by, job.night) {
            (Some(token), _) => { "token " (token) }
            (None, Some(night)) => a href={ "/nights/" (night) } { "night " (night) },
            (None, None) => "the service",
        }
    }
}

/// One job: its causes, its attempts, the end of its log.
pub(super) async fn one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| {
            let Some(job) = job(connection, id)? else {
                return Ok(None);
            };
            let causes = causes(connection, id)?;
            let attempts = attempts(connection, id, ATTEMPTS)?;
            Ok(Some((
                job,
                causes,
                attempts,
                runs_of_job(connection, id, ATTEMPTS)?,
            )))
        })
        .await?;
    let (job, causes, attempts, runs) =
        found.ok_or_else(|| Problem::not_found("This job does not exist."))?;
    let log = match attempts.first() {
        Some(newest) => {
            let (config, path) = (app.config(), newest.log.clone());
            blocking(move || log_piece(&config.outputs.state, &path, None, TAIL)).await??
        }
        None => LogPiece::default(),
    };
    let times = times(&app);
    let body = html! {
        div id="job" data-live="" {
            (job_lead(&job, attempts.first(), &times))
            (buttons(&job, &caller))
        }
        section { h2 { "Why" } (why(&causes, &times)) }
        section { h2 { "Attempts" } div id="attempts" data-live="" { (attempt_table(&attempts, &times)) (run_list(&runs)) } }
        @if let Some(newest) = attempts.first() {
            section {
                h2 { "Log" }
                div id="log" data-live="" {
                    p {
                        "Attempt " (newest.n)
                        @if log.bytes > TAIL { ", its end" }
                        ". " a href={ "/api/v1/jobs/" (job.id) "/log?attempt=" (newest.n) } { "Whole log" }
                    }
                    (log_table(&log.text, log.bytes <= TAIL, newest.ended_utc.is_some()))
                }
            }
        }
    };
    let title = format!("Job {} of {}", job.id, job.site);
    Ok(Page {
        title: &title,
        place: "/jobs",
    }
    .answer(&app, &caller, &body))
}

fn job_lead(job: &Job, newest: Option<&Attempt>, times: &Times) -> Markup {
    let tone = match job.state {
        JobState::Succeeded | JobState::Unchanged => "valid",
        JobState::Failed | JobState::Invalid | JobState::Blocked => "invalid",
        _ => "remarks",
    };
    let progress = newest.filter(|_| job.state.is_active());
    lead(
        tone,
        job.state.name(),
        &html! {
            p {
                "Site " a href={ "/sites/" (job.site) } { (job.site) } ". "
                "Made " (times.at(Instant(job.created_ms))) " by " (asker(job)) "; "
                (job.state) " since " (times.at(Instant(job.changed_ms))) "."
                @if job.force { " Every stage runs." }
                @if job.cancel_asked && !job.state.is_final() { " Cancellation was requested." }
                @if job.state == JobState::Waiting { " Next attempt " (times.age(Instant(job.not_before_ms))) "." }
            }
            @if let Some(text) = outcome_text(job) { p { (prose(text)) } }
            @if let Some(attempt) = progress {
                p {
                    "Attempt " (attempt.n) ", stage " (attempt.stage.as_deref().unwrap_or("not yet known"))
                    @if let Some(rss_kib) = attempt.rss_kib { ", " (rss_kib / 1024) " MiB" }
                    ", last heartbeat " (times.age(attempt.beat_utc)) "."
                }
                @if let (Some(done), Some(of)) = (attempt.done, attempt.of) {
                    p { label { "Stages " progress max=(of) value=(done) {} " " (done) " of " (of) " " (attempt.unit.as_deref().unwrap_or_default()) } }
                }
            }
        },
    )
}

fn buttons(job: &Job, caller: &Caller) -> Markup {
    let again = matches!(
        job.state,
        JobState::Waiting
            | JobState::Blocked
            | JobState::Failed
            | JobState::Invalid
            | JobState::Cancelled
    );
    let stops = !job.state.is_final() && job.state != JobState::Cancelling;
    html! {
        @if let Some(session) = &caller.session && caller.operates() && (again || stops) {
            div class="actions" {
                @if stops {
                    form method="post" action={ "/jobs/" (job.id) "/cancel" } {
                        (form_token(&session.form_token)) button id="cancel" type="submit" { "Cancel" }
                    }
                }
                @if again {
                    form method="post" action={ "/jobs/" (job.id) "/retry" } {
                        (form_token(&session.form_token)) button id="retry" type="submit" { "Try again" }
                    }
                }
            }
        }
    }
}

fn why(causes: &[CauseRow], times: &Times) -> Markup {
    html! {
        @if causes.is_empty() { p { "No reason is recorded." } }
        ul {
            @for cause in causes {
                li {
                    (times.at(Instant(cause.at_ms))) " " (cause.kind.replace('_', " "))
                    @if let Some(path) = &cause.path { ": " code { (path) } }
                    @if !cause.detail.is_empty() { ": " (prose(&cause.detail)) }
                    @if let (Some(old), Some(new)) = (&cause.old_blake3, &cause.new_blake3) {
                        " (" code { (short(old)) } " → " code { (short(new)) } ")"
                    }
                }
            }
        }
    }
}

/// The start of a hash, sufficient for comparison by eye.
pub(super) fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}

fn attempt_table(attempts: &[Attempt], times: &Times) -> Markup {
    html! {
        @if attempts.is_empty() { p { "Not begun." } } @else {
            (table("Attempts, the newest first", &["Attempt", "Began", "Ended", "Last stage", "How it ended", "Exit"], &html! {
                @for attempt in attempts {
                    tr {
                        th scope="row" { (attempt.n) }
                        td { (times.at(attempt.started_utc)) }
                        td { (times.maybe(attempt.ended_utc)) }
                        td { (attempt.stage.as_deref().unwrap_or("–")) }
                        td class="long" { (attempt.how.as_deref().unwrap_or("–")) }
                        td {
                            @match (attempt.exit, attempt.signal) {
                                (_, Some(signal)) => { "signal " (signal) }
                                (Some(exit), None) => (exit),
                                (None, None) => "–",
                            }
                        }
                    }
                }
            }))
        }
    }
}

fn run_list(runs: &[Run]) -> Markup {
    html! {
        @for run in runs {
            p { "Published: " a href={ "/runs/" (run.id) } { (run.id) } " " (verdict(Some(&run.verdict))) " " (headline(run)) }
        }
    }
}

/// Form data of the buttons of a job.
#[derive(Debug, Deserialize)]
pub(super) struct JobForm {
    form_token: String,
}

/// Requests cancellation of a job.
pub(super) async fn cancel_one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
    Filled(form): Filled<JobForm>,
) -> Result<Response, Problem> {
    let caller = operator(caller, &form.form_token)?;
    let job = cancel(&app, caller, id).await?;
    Ok(Redirect::to(&format!("/jobs/{}", job.id)).into_response())
}

/// Retries a job.
pub(super) async fn retry_one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
    Filled(form): Filled<JobForm>,
) -> Result<Response, Problem> {
    let caller = operator(caller, &form.form_token)?;
    let job = retry(&app, caller, id).await?;
    Ok(Redirect::to(&format!("/jobs/{}", job.id)).into_response())
}
