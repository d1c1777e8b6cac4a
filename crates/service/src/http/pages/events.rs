//! Events, the newest first, by kind and site.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use maud::{Markup, html};
use serde::Deserialize;
use serde_json::Value;

use super::{
    layout::Page,
    parts::{Times, more, prose, table, times},
};
use crate::{
    database::{Event, EventFilter, events_before},
    http::{
        app::App,
        caller::Reader,
        extract::{Parameters, name},
        problem::Problem,
    },
    instant::Instant,
    words::counted,
};

/// Events on one page.
const EVENTS: u32 = 100;
/// Kinds of events, and their names on the page.
const KINDS: [(&str, &str); 9] = [
    ("alert", "alerts"),
    ("job", "jobs"),
    ("run", "runs"),
    ("checked", "comparisons"),
    ("file", "files"),
    ("root", "folders"),
    ("night", "nights"),
    ("fetch", "retrieval"),
    ("stage", "stages"),
];

/// A filter of events.
#[derive(Debug, Deserialize)]
pub(super) struct EventsWanted {
    before: Option<i64>,
    kind: Option<String>,
    site: Option<String>,
}

/// Events, the newest first.
pub(super) async fn list(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    Parameters(wanted): Parameters<EventsWanted>,
) -> Result<Response, Problem> {
    let site = wanted.site.filter(|site| !site.is_empty());
    if let Some(site) = &site {
        name(site)?;
    }
    let kind = wanted.kind.filter(|kind| !kind.is_empty());
    let is_known = |kind: &String| KINDS.iter().any(|(known, _)| known == kind);
    if kind.as_ref().is_some_and(|kind| !is_known(kind)) {
        return Err(Problem::bad_request("kind is not a valid kind of event."));
    }
    let (of_kind, of_site) = (kind.clone(), site.clone());
    let found = app
        .read(move |connection| {
            let filter = EventFilter {
                kind: of_kind.as_deref(),
                site: of_site.as_deref(),
                before: wanted.before,
            };
            events_before(connection, &filter, EVENTS + 1)
        })
        .await?;
    let shown = &found[..found.len().min(EVENTS as usize)];
    let address = |kind: Option<&str>, before: Option<i64>| {
        let mut parts = Vec::new();
        parts.extend(kind.map(|kind| format!("kind={kind}")));
        parts.extend(site.as_ref().map(|site| format!("site={site}")));
        parts.extend(before.map(|before| format!("before={before}")));
        format!("/events?{}", parts.join("&"))
    };
    let next = shown.last().filter(|_| found.len() > shown.len());
    let body = html! {
        nav aria-label="Kinds" {
            ul {
                li { a href=(address(None, None)) aria-current=[kind.is_none().then_some("true")] { "all but stages" } }
                @for (one, text) in KINDS {
                    li { a href=(address(Some(one), None)) aria-current=[(kind.as_deref() == Some(one)).then_some("true")] { (text) } }
                }
            }
        }
        form method="get" action="/events" class="actions" {
            @if let Some(kind) = &kind { input type="hidden" name="kind" value=(kind); }
            label for="site" { "Site" }
            input id="site" name="site" maxlength="64" value=(site.as_deref().unwrap_or_default());
            button type="submit" { "Show" }
        }
        div id="events" data-live="" { (event_table(shown, &times(&app))) }
        (more(next.map(|event| address(kind.as_deref(), Some(event.seq)))))
    };
    Ok(Page {
        title: "Events",
        place: "/events",
    }
    .answer(&app, &caller, &body))
}

fn event_table(events: &[Event], times: &Times) -> Markup {
    html! {
        @if events.is_empty() { p { "None." } } @else {
            (table("Events, the newest first", &["When, UTC", "Kind", "Site", "Job or run", "Event"], &html! {
                @for event in events {
                    tr {
                        th scope="row" { (times.at(Instant(event.at_ms))) }
                        td { (event.kind) }
                        td { @if let Some(site) = &event.site { a href={ "/sites/" (site) } { (site) } } }
                        td {
                            @match (&event.run, event.job) {
                                (Some(run), _) => a href={ "/runs/" (run) } { (run) },
                                (None, Some(job)) => a href={ "/jobs/" (job) } { "job " (job) },
                                (None, None) => {}
                            }
                        }
                        td class="long lines" { (prose(&event_text(&event.kind, &event.data))) }
                    }
                }
            }))
        }
    }
}

/// An event in words.
fn event_text(kind: &str, data: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let state = text(&data["state"]);
    let with = |state: String, detail: String| match (state.is_empty(), detail.is_empty()) {
        (false, false) => format!("{state}: {detail}"),
        _ => state + &detail,
    };
    match kind {
        "job" => with(state, text(&data["outcome"]["text"])),
        "stage" => {
            let because = match data["seconds"].as_f64() {
                Some(seconds) if state == "done" => format!("{seconds:.2} s"),
                _ => text(&data["because"]),
            };
            with(format!("{} {state}", text(&data["stage"])), because)
        }
        "run" if data["moved"].is_object() => text(&data["moved"]["headline"]),
        "run" => text(&data["verdict"]),
        "root" => with(
            format!("`{}` is {state}", text(&data["path"])),
            text(&data["text"]),
        ),
        "night" if data["sites_checked"].is_number() => format!(
            "complete: {} checked, {}, {}",
            counted(&data["sites_checked"], "site"),
            counted(&data["runs"], "run"),
            counted(&data["failures"], "failure")
        ),
        "night" => "begins".to_owned(),
        "alert" => with(text(&data["alert"]).replace('_', " "), text(&data["text"])),
        "config" if data["taken"] == true => "the configuration is in force".to_owned(),
        "fetch" => {
            let failures = data["failures"].as_array().map_or(0, Vec::len);
            format!("archive files retrieved, {}", counted(failures, "failure"))
        }
        _ => text(&data["text"]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn events_read_as_sentences() {
        for (kind, data, expected) in [
            (
                "job",
                json!({ "state": "held", "outcome": { "text": "`a` left" } }),
                "held: `a` left",
            ),
            (
                "job",
                json!({ "state": "running", "outcome": null }),
                "running",
            ),
            (
                "stage",
                json!({ "stage": "adjust", "state": "done", "seconds": 1.234 }),
                "adjust done: 1.23 s",
            ),
            (
                "alert",
                json!({ "alert": "input_lost", "text": "2 sites wait" }),
                "input lost: 2 sites wait",
            ),
            ("run", json!({ "verdict": "valid" }), "valid"),
            (
                "night",
                json!({ "sites_checked": 4, "runs": 1, "failures": 0 }),
                "complete: 4 sites checked, 1 run, 0 failures",
            ),
            (
                "fetch",
                json!({ "sites": 1, "failures": ["indexes"] }),
                "archive files retrieved, 1 failure",
            ),
            (
                "file",
                json!({ "text": "`a` has new content" }),
                "`a` has new content",
            ),
        ] {
            assert_eq!(event_text(kind, &data), expected);
        }
    }
}
