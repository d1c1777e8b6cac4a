//! Timeline of kernel coverage of positions and attitude.

use chrono::{DateTime, SecondsFormat, TimeDelta, Utc};
use maud::{Markup, html};

use crate::{http::coverage::Span, words::counted};

const WIDTH: f64 = 520.0;
const LINE: f64 = 34.0;
const BAR: f64 = 9.0;
const FOOT: f64 = 26.0;
/// More bars than this cannot be distinguished.
const BARS: usize = 400;
/// J2000 as seconds of calendar time since 1970.
const J2000_S: i64 = 946_728_000;

/// A kernel on the timeline.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) name: String,
    pub(super) position: Vec<Span>,
    pub(super) attitude: Vec<Span>,
}

impl Row {
    pub(super) const fn is_empty(&self) -> bool {
        self.position.is_empty() && self.attitude.is_empty()
    }

    fn spans(&self) -> impl Iterator<Item = &Span> {
        self.position.iter().chain(&self.attitude)
    }
}

/// A line for each kernel.
pub(super) fn timeline(rows: &[Row]) -> Markup {
    let start = rows
        .iter()
        .flat_map(Row::spans)
        .map(|span| span.start_et_s)
        .fold(f64::INFINITY, f64::min);
    let stop = rows
        .iter()
        .flat_map(Row::spans)
        .map(|span| span.stop_et_s)
        .fold(f64::NEG_INFINITY, f64::max);
    if !(start < stop) {
        return html! { p { "The coverage of the kernels is not known yet." } };
    }
    let x = |et_s: f64| (et_s - start) / (stop - start) * WIDTH;
    let height = rows.len() as f64 * LINE + FOOT;
    html! {
        figure class="timeline" {
            svg viewBox={ "0 0 " (WIDTH) " " (height) } role="img" aria-label={ "Coverage of " (counted(rows.len(), "kernel")) " from " (day(start)) " to " (day(stop)) } {
                @for (k, row) in rows.iter().enumerate() {
                    @let y = k as f64 * LINE;
                    text x="0" y=(y + 12.0) font-size="13" fill="#222222" { (row.name) }
                    (bars(&row.position, &x, y + 16.0, "#0E5A99"))
                    (bars(&row.attitude, &x, y + 16.0 + if row.position.is_empty() { 0.0 } else { BAR }, "#FF610D"))
                }
                text x="0" y=(height - 6.0) font-size="13" fill="#222222" { (day(start)) }
                text x=(WIDTH) y=(height - 6.0) font-size="13" text-anchor="end" fill="#222222" { (day(stop)) }
            }
            ul class="keys" { li { i class="k0" {} "positions" } li { i class="k1" {} "attitude" } }
            figcaption {
                "Times are TDB, about a minute ahead of UTC. Empty intervals are gaps; gaps too narrow for the plot are listed in the "
                a href="/api/v1/kernels" { "interface for programs" } "."
            }
        }
        details {
            summary { "Coverage as text" }
            ul {
                @for row in rows {
                    li {
                        (row.name) ": "
                        @for (what, spans) in [("positions", &row.position), ("attitude", &row.attitude)] {
                            @if let (Some(first), Some(last)) = (spans.first(), spans.last()) {
                                (what) " from " (minute(first.start_et_s)) " to " (minute(last.stop_et_s)) " with " (counted(spans.len() - 1, "gap")) "; "
                            }
                        }
                    }
                }
            }
        }
    }
}

fn bars(spans: &[Span], x: &impl Fn(f64) -> f64, y: f64, colour: &str) -> Markup {
    // Adjacent intervals closer than a tenth of a unit are one bar.
    let mut bars: Vec<(f64, f64)> = Vec::new();
    for span in spans {
        let (from, to) = (x(span.start_et_s), x(span.stop_et_s));
        match bars.last_mut() {
            Some(last) if from - last.1 < WIDTH / BARS as f64 / 10.0 => last.1 = to,
            _ => bars.push((from, to)),
        }
    }
    html! {
        @for (from, to) in bars {
            rect x=(format!("{from:.2}")) y=(y) width=(format!("{:.2}", (to - from).max(0.6))) height=(BAR - 1.0) fill=(colour) {}
        }
    }
}

fn calendar(et_s: f64) -> String {
    let epoch = DateTime::<Utc>::from_timestamp(J2000_S, 0).unwrap_or_default();
    #[allow(
        clippy::cast_possible_truncation,
        reason = "whole seconds of a calendar"
    )]
    let since = TimeDelta::try_seconds(et_s as i64).unwrap_or_default();
    let instant = epoch.checked_add_signed(since).unwrap_or_default();
    instant.to_rfc3339_opts(SecondsFormat::Secs, true)
}

fn day(et_s: f64) -> String {
    calendar(et_s).chars().take(10).collect()
}

fn minute(et_s: f64) -> String {
    calendar(et_s)
        .chars()
        .take(16)
        .collect::<String>()
        .replace('T', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_ephemeris_time() {
        assert_eq!(day(0.0), "2000-01-01");
        assert_eq!(minute(0.0), "2000-01-01 12:00");
        assert_eq!(minute(86_400.0 * 366.0), "2001-01-01 12:00");
    }
}
