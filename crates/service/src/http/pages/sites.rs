//! The start page, and the page of a site.

use std::sync::Arc;

use axum::{
    extract::State,
    http::StatusCode,
    response::{IntoResponse as _, Redirect, Response},
};
use maud::{Markup, html};
use serde::Deserialize;

use super::{
    data::last_scrub,
    layout::{Page, form_token, operator},
    map::maps,
    parts::{
        Times, figure, figure_name, lead, more, prose, said, state, table, times, tone, verdict,
    },
    standing::{Faults, standing},
    trend::{figures, headline, trends},
};
use crate::{
    database::{
        JobFilter, jobs,
        shown::{Night, Run, Site, data_status, nights, roots, runs_of_site, site, sites, waits},
    },
    engine::{schedule::next_night_ms, scrub::due_before_ms},
    http::{
        app::App,
        caller::{Caller, Reader},
        changes::{Wanted, run_site},
        extract::{At, Filled, Parameters, name},
        problem::Problem,
    },
    instant::Instant,
    state::JobState,
    words::counted,
};

/// Sites on one page.
const SITES: u32 = 500;
/// Runs whose figures are plotted.
const TREND: u32 = 120;
/// Runs in the table.
const RUNS: usize = 30;

/// Start of the next page of a list.
#[derive(Debug, Deserialize)]
pub(super) struct From {
    after: Option<String>,
}

/// All sites: map, table, last night, work.
pub(super) async fn home(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    Parameters(from): Parameters<From>,
) -> Result<Response, Problem> {
    let after = from.after.unwrap_or_default();
    let before_ms = due_before_ms(&app.config(), app.now_ms());
    let (found, roots, waits, nights, work, data) = app
        .read(move |connection| {
            let mut work = Vec::new();
            for state in [
                JobState::Running,
                JobState::Starting,
                JobState::Cancelling,
                JobState::Queued,
            ] {
                let filter = JobFilter {
                    state: Some(state),
                    ..JobFilter::default()
                };
                work.extend(jobs(connection, &filter, 20)?);
            }
            Ok((
                sites(connection, &after, SITES + 1)?,
                roots(connection)?,
                waits(connection)?,
                nights(connection, None, 1)?,
                work,
                data_status(connection, before_ms)?,
            ))
        })
        .await?;
    let times = times(&app);
    let shown = &found[..found.len().min(SITES as usize)];
    let next = (found.len() > shown.len())
        .then(|| shown.last().map(|site| format!("/?after={}", site.name)));
    let faults = Faults {
        configuration: app.shared.problem(),
        recovering: app.shared.is_recovering(),
        data: &data,
        roots: &roots,
        waits: &waits,
    };
    let next_ms = next_night_ms(&app.config().schedule, app.now_ms());
    let body = html! {
        div id="state" data-live="" { (standing(shown, &faults, &times)) }
        section {
            h2 { "Map" }
            div id="map" data-live="" { (maps(shown)) }
        }
        section {
            h2 { "Sites" }
            div id="sites" data-live="" { (site_table(shown, &times)) }
            @if let Some(Some(next)) = next { p { a href=(next) rel="next" { "More sites" } } }
        }
        section {
            h2 { "Nights" }
            div id="night" data-live="" { (last_night(nights.first(), &times)) (next_night(next_ms, &times)) (last_scrub(&data.products, &times)) }
        }
        section {
            h2 { "Work" }
            div id="work" data-live="" { (super::jobs::job_table("Running and queued jobs", &work, &times)) }
        }
    };
    Ok(Page {
        title: "Sites",
        place: "/",
    }
    .answer(&app, &caller, &body))
}

fn site_table(sites: &[Site], times: &Times) -> Markup {
    let heads = [
        "Site",
        "Verdict",
        "Current since, UTC",
        "Checked",
        "State",
        "Job",
    ];
    table(
        "All sites",
        &heads,
        &html! {
            @for site in sites {
                tr {
                    th scope="row" { a href={ "/sites/" (site.name) } { (site.name) } }
                    td { (verdict(site.verdict.as_deref())) @if site.newest_valid == Some(false) { " " small { "newest run invalid" } } }
                    td { (times.maybe(site.current_since_utc)) }
                    td { @match site.checked_utc { Some(at) => (times.age(at)), None => "never" } }
                    td class="long" { (brief(site, times)) }
                    td { @if let (Some(job), Some(at)) = (site.job, site.job_state) { a href={ "/jobs/" (job) } { (job) } " " (state(at)) } }
                }
            }
        },
    )
}

/// State of a site in the table of all sites, whose reason is in the box above if several sites may share it.
fn brief(site: &Site, times: &Times) -> Markup {
    html! {
        @match (&site.waits_for, &site.problem) {
            (Some(what), _) if site.enabled => { span class="word remarks" { "waits" } " for " code { (what) } }
            (None, Some(_)) if site.enabled => { span class="word invalid" { "not run" } "; see above" }
            _ => (freshness(site, times)),
        }
    }
}

/// Fresh, or since when and why stale.
fn freshness(site: &Site, times: &Times) -> Markup {
    html! {
        @if !site.enabled { "Not run: the site file was removed, or disables the site." }
        @else if site.waits_for.is_some() && let Some(why) = &site.stale_because {
            "Waits: " (prose(why)) "."
            @if let Some(since) = site.stale_since_utc { " Stale since " (times.at(since)) "." }
        }
        @else if let Some(problem) = &site.problem { "Not run: " (problem) }
        @else if let Some(since) = site.stale_since_utc {
            "Stale since " (times.at(since)) ": " (prose(site.stale_because.as_deref().unwrap_or("its inputs changed")))
        }
        @else if site.current_run.is_some() { "Up to date." @if let Some(note) = &site.note { " Last decision: " (prose(note)) "." } }
        @else { (prose(site.note.as_deref().unwrap_or("No run yet."))) }
    }
}

/// Summary of the last night.
fn last_night(night: Option<&Night>, times: &Times) -> Markup {
    html! {
        @match night {
            None => p { "No night yet." }
            Some(night) => p {
                a href={ "/nights/" (night.id) } { "Night of " (times.at(night.due_utc)) }
                ": " (counted(night.sites_checked, "site")) " checked, "
                (counted(night.runs, "run")) ", " (counted(night.failures, "failure")) ". "
                @match (night.started_utc, night.ended_utc) {
                    (_, Some(at)) => { "Complete " (times.age(at)) "." }
                    (Some(_), None) => "Under way.",
                    (None, None) => "Not begun.",
                }
            }
        }
    }
}

/// The instant of the next night.
fn next_night(next_ms: Option<i64>, times: &Times) -> Markup {
    html! {
        @if let Some(next) = next_ms.map(Instant) { p { "Next night: " (times.at(next)) ", " (times.age(next)) "." } }
    }
}

/// One site: its state, its trends, its runs.
pub(super) async fn one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(wanted): At<String>,
    Parameters(from): Parameters<From>,
) -> Result<Response, Problem> {
    let wanted = name(&wanted)?.to_owned();
    let after = from.after;
    let found = app
        .read(move |connection| {
            let Some(site) = site(connection, &wanted)? else {
                return Ok(None);
            };
            let filter = JobFilter {
                site: Some(&wanted),
                ..JobFilter::default()
            };
            let jobs = jobs(connection, &filter, 10)?;
            let runs = runs_of_site(connection, &wanted, after.as_deref(), TREND)?;
            Ok(Some((site, runs, jobs)))
        })
        .await?;
    let (site, runs, jobs) =
        found.ok_or_else(|| Problem::not_found("This site does not exist."))?;
    let times = times(&app);
    let oldest =
        (runs.len() > RUNS).then(|| format!("/sites/{}?after={}", site.name, runs[RUNS - 1].id));
    let body = html! {
        div id="state" data-live="" { (site_lead(&site, runs.first(), &times)) }
        (run_buttons(&site, &caller))
        section {
            h2 { "Jobs" }
            div id="jobs" data-live="" { (super::jobs::job_table("Newest jobs of this site", &jobs, &times)) }
        }
        section {
            h2 { "Trends" }
            div id="trends" data-live="" {
                @if runs.is_empty() { p { "No run yet." } } @else { (trends(&runs, &times)) }
            }
        }
        section {
            h2 { "Runs" }
            div id="runs" data-live="" { (run_table(&site, &runs[..runs.len().min(RUNS)], &times)) }
            (more(oldest))
        }
    };
    Ok(Page {
        title: &site.name,
        place: "/",
    }
    .answer(&app, &caller, &body))
}

fn site_lead(site: &Site, newest: Option<&Run>, times: &Times) -> Markup {
    let verdict = site.verdict.as_deref().unwrap_or("no run yet");
    let (tone, headline) = match &site.waits_for {
        Some(what) => ("remarks", format!("{verdict}; waits for {what}")),
        None => (tone(site.verdict.as_deref()), verdict.to_owned()),
    };
    lead(
        tone,
        &headline,
        &html! {
            p { (freshness(site, times)) }
            @if let Some(run) = &site.current_run {
                p {
                    "The current run is " a href={ "/runs/" (run) } { (run) } " of " (times.maybe(site.current_since_utc)) ". "
                    a href={ "/api/v1/sites/" (site.name) "/current/report/index.html" } { "Report" }
                }
            }
            @if let Some(run) = newest.filter(|run| !run.valid) {
                p { "The newest run, " a href={ "/runs/" (run.id) } { (run.id) } ", is invalid and did not become current:" }
                (said(&super::parts::sentences(&run.reasons)))
            }
            p { "Inputs last compared: " (times.maybe(site.checked_utc)) "." }
        },
    )
}

fn run_buttons(site: &Site, caller: &Caller) -> Markup {
    html! {
        @if let Some(session) = &caller.session && caller.operates() {
            form method="post" action={ "/sites/" (site.name) "/run" } class="actions" {
                (form_token(&session.form_token))
                label for="reason" { "Reason" }
                input id="reason" name="reason" maxlength="200" autocomplete="off";
                button type="submit" name="force" value="false" { "Bring up to date" }
                button type="submit" name="force" value="true" { "Run every stage" }
            }
        }
    }
}

fn run_table(site: &Site, runs: &[Run], times: &Times) -> Markup {
    html! {
        (table("Runs, the newest first", &["Run", "Published, UTC", "Verdict", "Moved", "Figures"], &html! {
            @for run in runs {
                tr {
                    th scope="row" {
                        a href={ "/runs/" (run.id) } { (run.id) }
                        @if site.current_run.as_ref() == Some(&run.id) { " " small { "current" } }
                        @if run.pinned { " " small { "pinned" } }
                    }
                    td { (times.at(run.published_utc)) }
                    td { (verdict(Some(&run.verdict))) }
                    td class="long" { (headline(run)) }
                    td class="long" {
                        @for (k, (name, value)) in figures(run).iter().enumerate() { @if k > 0 { "; " } (figure_name(name)) ": " (figure(*value)) }
                    }
                }
            }
        }))
    }
}

/// Form data of the buttons of a site.
#[derive(Debug, Deserialize)]
pub(super) struct RunForm {
    form_token: String,
    #[serde(default)]
    reason: String,
    force: bool,
}

/// Requests a job of a site.
pub(super) async fn run_now(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(site): At<String>,
    Filled(form): Filled<RunForm>,
) -> Result<Response, Problem> {
    let caller = operator(caller, &form.form_token)?;
    let reason: String = form
        .reason
        .chars()
        .filter(|c| !c.is_control())
        .take(200)
        .collect();
    let wanted = Wanted {
        sites: vec![name(&site)?.to_owned()],
        force: form.force,
        reason: if reason.is_empty() {
            "requested on its page".to_owned()
        } else {
            reason
        },
    };
    match run_site(&app, caller, wanted).await? {
        Some(job) => Ok(Redirect::to(&format!("/jobs/{job}")).into_response()),
        None => Err(Problem::new(
            StatusCode::NOT_FOUND,
            "This site does not exist.",
        )),
    }
}
