//! Pieces of pages: times, verdicts, tables.

use chrono::{DateTime, Utc};
use chrono_tz::Tz;
use maud::{Markup, PreEscaped, html};
use serde::Deserialize;
use serde_json::Value;

use crate::{
    clock::utc_text,
    http::{app::App, groups::Group},
    instant::Instant,
    state::JobState,
};

const MINUTE_MS: i64 = 60_000;
const HOUR_MS: i64 = 60 * MINUTE_MS;
const DAY_MS: i64 = 24 * HOUR_MS;

/// Formats of times.
#[derive(Debug, Clone, Copy)]
pub(super) struct Times {
    pub(super) zone: Tz,
    pub(super) now_ms: i64,
}

/// The service's time and zone.
pub(super) fn times(app: &App) -> Times {
    Times {
        zone: app.config().schedule.zone.parse().unwrap_or(Tz::UTC),
        now_ms: app.now_ms(),
    }
}

impl Times {
    /// An instant in UTC and in the zone of the schedule.
    pub(super) fn at(&self, instant: Instant) -> Markup {
        let utc = DateTime::<Utc>::from_timestamp_millis(instant.0).unwrap_or_default();
        html! {
            time datetime=(utc_text(instant.0)) { (utc.format("%Y-%m-%d %H:%M")) }
            @if self.zone != Tz::UTC {
                @let local = utc.with_timezone(&self.zone);
                " " small { (local.format("%H:%M %Z")) }
            }
        }
    }

    /// The instant, or a dash.
    pub(super) fn maybe(&self, instant: Option<Instant>) -> Markup {
        html! { @match instant { Some(instant) => (self.at(instant)), None => "–" } }
    }

    /// Age of an instant.
    pub(super) fn age(&self, instant: Instant) -> String {
        let ms = self.now_ms - instant.0;
        let count = |unit_ms: i64, unit: &str| format!("{} {unit}", ms.abs() / unit_ms);
        let length = match ms.abs() {
            ..MINUTE_MS => count(1000, "s"),
            MINUTE_MS..HOUR_MS => count(MINUTE_MS, "min"),
            HOUR_MS..DAY_MS => count(HOUR_MS, "h"),
            _ => count(DAY_MS, "d"),
        };
        if ms < 0 {
            format!("in {length}")
        } else {
            format!("{length} ago")
        }
    }
}

/// CSS class of a verdict's colour.
pub(super) fn tone(verdict: Option<&str>) -> &'static str {
    match Group::of(verdict) {
        Group::Valid => "valid",
        Group::Remarks => "remarks",
        Group::Invalid => "invalid",
        Group::NoRun => "none",
    }
}

/// A verdict as a coloured word.
pub(super) fn verdict(verdict: Option<&str>) -> Markup {
    html! { span class={ "word " (tone(verdict)) } { (verdict.unwrap_or("no run yet")) } }
}

/// A state as a coloured word.
pub(super) fn state(state: JobState) -> Markup {
    let tone = match state {
        JobState::Succeeded | JobState::Unchanged => "valid",
        JobState::Invalid | JobState::Failed | JobState::Blocked => "invalid",
        JobState::Held | JobState::Waiting | JobState::Cancelling => "remarks",
        _ => "none",
    };
    html! { span class={ "word " (tone) } { (state) } }
}

/// A box with the most important statement.
pub(super) fn lead(tone: &str, headline: &str, body: &Markup) -> Markup {
    html! { div class={ "verdict " (tone) } { p { strong { (headline) } } (body) } }
}

/// A table that can be scrolled by keyboard. On a phone, each row is a card whose cells state their heads.
pub(super) fn table(caption: &str, heads: &[&str], rows: &Markup) -> Markup {
    table_of("wide cards", caption, heads, &labelled(&rows.0, heads))
}

/// A table of many short rows, which remain rows on a phone.
pub(super) fn log_rows(caption: &str, heads: &[&str], rows: &Markup) -> Markup {
    table_of("wide log", caption, heads, rows)
}

fn table_of(class: &str, caption: &str, heads: &[&str], rows: &Markup) -> Markup {
    html! {
        div class=(class) tabindex="0" role="region" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for head in heads { th scope="col" { (head) } } } }
                tbody { (rows) }
            }
        }
    }
}

/// Rows whose cells carry the head of their column.
fn labelled(rows: &str, heads: &[&str]) -> Markup {
    let mut text = String::with_capacity(rows.len() * 2);
    let mut column = 0;
    for part in rows.split_inclusive('<') {
        let name = part.get(..2).unwrap_or_default();
        let (tag, rest) = part.split_at(if matches!(name, "td" | "th") { 2 } else { 0 });
        text.push_str(tag);
        if name == "tr" {
            column = 0;
        } else if !tag.is_empty() {
            let head = heads.get(column).unwrap_or(&"");
            text.push_str(&html! { (PreEscaped(" data-head=\"")) (head) (PreEscaped("\"")) }.0);
            column += 1;
        }
        text.push_str(rest);
    }
    PreEscaped(text)
}

/// Sentences of a JSON column: a list of texts, or one.
pub(super) fn sentences(value: &Value) -> Vec<String> {
    let text = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Object(fields) => {
            let named = ["detail", "because", "text"]
                .iter()
                .find_map(|name| fields.get(*name));
            named.and_then(Value::as_str).map(str::to_owned)
        }
        _ => None,
    };
    match value {
        Value::Array(values) => values.iter().filter_map(text).collect(),
        Value::Null => Vec::new(),
        value => text(value)
            .into_iter()
            .filter(|text| !text.is_empty())
            .collect(),
    }
}

/// A sentence with file names between backticks.
pub(super) fn prose(text: &str) -> Markup {
    html! {
        @for (place, part) in text.split('`').enumerate() {
            @if place % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}

/// A list of sentences; a single one is a paragraph.
pub(super) fn said(sentences: &[String]) -> Markup {
    html! {
        @match sentences {
            [] => {}
            [one] => p { (prose(one)) }
            several => ul { @for sentence in several { li { (prose(sentence)) } } }
        }
    }
}

/// Start of the next page of a list.
#[derive(Debug, Deserialize)]
pub(super) struct From {
    pub(super) after: Option<i64>,
}

/// The link to the next page of a list.
pub(super) fn more(address: Option<String>) -> Markup {
    html! { @if let Some(address) = address { p { a href=(address) rel="next" { "Older" } } } }
}

/// Bytes in a readable unit.
pub(super) fn size(bytes: u64) -> String {
    match bytes {
        ..10_000 => format!("{bytes} B"),
        10_000..10_000_000 => format!("{:.0} kB", bytes as f64 / 1e3),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}

/// A number with a readable number of digits.
pub(super) fn figure(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        "0".to_owned()
    } else if (0.01..1e6).contains(&magnitude) {
        let decimals = if magnitude < 1.0 {
            4
        } else if magnitude < 100.0 {
            2
        } else {
            1
        };
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    }
}

/// Displayed name of a figure: `range_mean_m` is `range mean, m`.
pub(super) fn figure_name(name: &str) -> String {
    const UNITS: [(&str, &str); 7] = [
        ("_m", "m"),
        ("_rad", "rad"),
        ("_px", "pixels"),
        ("_s", "s"),
        ("_deg", "°"),
        ("_arcsec", "″"),
        ("_km", "km"),
    ];
    let unit = UNITS
        .iter()
        .find_map(|(end, unit)| Some((name.strip_suffix(end)?, unit)));
    let words = |name: &str| name.replace('_', " ").replace("rmse", "RMSE");
    match unit {
        Some((name, unit)) => format!("{}, {unit}", words(name)),
        None => words(name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_figures_and_names_read_well() {
        let times = Times {
            zone: "Europe/Berlin".parse().unwrap(),
            now_ms: 1_772_332_200_000,
        };
        let told = times.at(Instant(1_772_328_600_000)).into_string();
        assert!(
            told.contains("2026-03-01 01:30") && told.contains("02:30 CET"),
            "{told}"
        );
        for (ago_ms, expected) in [
            (5_000, "5 s ago"),
            (3_600_000, "1 h ago"),
            (3 * DAY_MS, "3 d ago"),
            (-120_000, "in 2 min"),
        ] {
            assert_eq!(times.age(Instant(times.now_ms - ago_ms)), expected);
        }
        let row = html! { tr { th scope="row" { "a" } td { "1" } } tr { th { time { "b" } } } };
        assert_eq!(
            labelled(&row.0, &["A", "B<"]).0,
            "<tr><th data-head=\"A\" scope=\"row\">a</th><td data-head=\"B&lt;\">1</td></tr>\
             <tr><th data-head=\"A\"><time>b</time></th></tr>"
        );
        assert_eq!(figure_name("range_mean_m"), "range mean, m");
        assert_eq!(figure(0.012_345), "0.0123");
        assert_eq!(figure(1.5e-6), "1.50e-6");
        assert_eq!(
            sentences(&serde_json::json!(["a", { "detail": "b" }])),
            ["a", "b"]
        );
    }
}
