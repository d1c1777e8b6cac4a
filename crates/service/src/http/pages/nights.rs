//! Nights, and the page of a night.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use maud::{Markup, html};

use super::{
    jobs::job_table,
    layout::Page,
    parts::{From, Times, lead, more, table, times, verdict},
    trend::headline,
};
use crate::{
    database::shown::{Night, Run, jobs_of_night, night, nights, runs_of_night},
    http::{
        app::App,
        caller::Reader,
        extract::{At, Parameters},
        problem::Problem,
    },
};

/// Nights on one page.
const NIGHTS: u32 = 60;
/// Jobs and runs on the page of a night.
const MOST: u32 = 500;

/// Nights, the newest first.
pub(super) async fn list(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    Parameters(from): Parameters<From>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| nights(connection, from.after, NIGHTS + 1))
        .await?;
    let times = times(&app);
    let shown = &found[..found.len().min(NIGHTS as usize)];
    let next = shown.last().filter(|_| found.len() > shown.len());
    let schedule = &app.config().schedule;
    let body = html! {
        p { "Every site is compared with its inputs on the schedule " code { (schedule.cron) } " in " (schedule.zone) ", whether \
            or not a change was detected." }
        div id="nights" data-live="" { (night_table(shown, &times)) }
        (more(next.map(|night| format!("/nights?after={}", night.id))))
    };
    Ok(Page {
        title: "Nights",
        place: "/nights",
    }
    .answer(&app, &caller, &body))
}

fn night_table(nights: &[Night], times: &Times) -> Markup {
    html! {
        @if nights.is_empty() { p { "No night yet." } } @else {
            (table("Nights, the newest first", &["Due, UTC", "How", "Began", "Ended", "Sites checked", "Runs", "Failures"], &html! {
                @for night in nights {
                    tr {
                        th scope="row" { a href={ "/nights/" (night.id) } { (times.at(night.due_utc)) } }
                        td { (night.how.replace('_', " ")) }
                        td { (times.maybe(night.started_utc)) }
                        td { (times.maybe(night.ended_utc)) }
                        td class="number" { (night.sites_checked) }
                        td class="number" { (night.runs) }
                        td class="number" { (night.failures) }
                    }
                }
            }))
        }
    }
}

/// One night: its comparisons and results.
pub(super) async fn one(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    At(id): At<i64>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| {
            let Some(night) = night(connection, id)? else {
                return Ok(None);
            };
            let runs = runs_of_night(connection, id, MOST)?;
            Ok(Some((night, jobs_of_night(connection, id, MOST)?, runs)))
        })
        .await?;
    let (night, jobs, runs) =
        found.ok_or_else(|| Problem::not_found("This night does not exist."))?;
    let times = times(&app);
    let body = html! {
        div id="night" data-live="" {
            (night_lead(&night, &times))
            section { h2 { "Runs" } (run_table(&runs)) }
            section { h2 { "Jobs" } (job_table("Jobs of this night", &jobs, &times)) }
        }
    };
    let day = crate::clock::utc_text(night.due_utc.0);
    let title = format!("Night of {}", day.get(..10).unwrap_or_default());
    Ok(Page {
        title: &title,
        place: "/nights",
    }
    .answer(&app, &caller, &body))
}

fn night_lead(night: &Night, times: &Times) -> Markup {
    let (tone, headline) = match (night.how.as_str(), night.ended_utc, night.failures) {
        ("missed", _, _) => ("remarks", "Missed: the service did not run"),
        (_, None, _) => ("remarks", "Under way"),
        (_, Some(_), 0) => ("valid", "Complete"),
        (_, Some(_), _) => ("invalid", "Complete, with failures"),
    };
    lead(
        tone,
        headline,
        &html! {
            p {
                "Due " (times.at(night.due_utc)) ", " (night.how.replace('_', " ")) "; began " (times.maybe(night.started_utc))
                ", ended " (times.maybe(night.ended_utc)) ". "
                (night.sites_checked) " sites checked, " (night.runs) " runs, " (night.failures) " failures."
            }
            @if night.runs == 0 && night.ended_utc.is_some() { p { "All sites were checked; no run was necessary." } }
        },
    )
}

fn run_table(runs: &[Run]) -> Markup {
    html! {
        @if runs.is_empty() { p { "None." } } @else {
            (table("Runs of this night", &["Site", "Run", "Verdict", "Moved"], &html! {
                @for run in runs {
                    tr {
                        th scope="row" { a href={ "/sites/" (run.site) } { (run.site) } }
                        td { a href={ "/runs/" (run.id) } { (run.id) } }
                        td { (verdict(Some(&run.verdict))) }
                        td class="long" { (headline(run)) }
                    }
                }
            }))
        }
    }
}
