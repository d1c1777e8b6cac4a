//! Trends of a site's figures over its runs, with the changes of kernels.

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};
use serde_json::Value;

use super::parts::{Times, figure, figure_name, sentences, table, verdict};
use crate::{
    clock::utc_text,
    database::shown::Run,
    words::{counted, sentence},
};

const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 30.0;

/// Changes of kernels from one run to the next.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct KernelChange {
    pub(super) changed: Vec<String>,
    pub(super) added: Vec<String>,
    pub(super) removed: Vec<String>,
}

impl KernelChange {
    /// From the kernels of `before` to the kernels of `after`.
    pub(super) fn between(before: &Run, after: &Run) -> Self {
        let (before, after) = (kernels(before), kernels(after));
        let named = |set: &BTreeSet<&String>| set.iter().map(|name| (*name).clone()).collect();
        let (old, new): (BTreeSet<_>, BTreeSet<_>) =
            (before.keys().collect(), after.keys().collect());
        let both = old
            .intersection(&new)
            .filter(|name| before[**name] != after[**name]);
        Self {
            changed: both.map(|name| (*name).clone()).collect(),
            added: named(&new.difference(&old).copied().collect()),
            removed: named(&old.difference(&new).copied().collect()),
        }
    }

    /// As text; `None` without changes.
    pub(super) fn words(&self) -> Option<String> {
        let parts = [
            ("changed", &self.changed),
            ("added", &self.added),
            ("removed", &self.removed),
        ];
        let parts: Vec<String> = parts
            .iter()
            .filter(|(_, names)| !names.is_empty())
            .map(|(what, names)| format!("{} {what}", sentence(names)))
            .collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// Kernels of a run by name, with their hashes.
fn kernels(run: &Run) -> BTreeMap<String, String> {
    let text = |kernel: &Value, name: &str| Some(kernel.get(name)?.as_str()?.to_owned());
    let all = run
        .kernels
        .as_array()
        .map(Vec::as_slice)
        .unwrap_or_default();
    all.iter()
        .filter_map(|kernel| Some((text(kernel, "name")?, text(kernel, "blake3")?)))
        .collect()
}

/// Figures of a run by name.
pub(super) fn figures(run: &Run) -> BTreeMap<String, f64> {
    let all = run.figures.as_object().into_iter().flatten();
    all.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?)))
        .collect()
}

/// Plots of all figures of `runs`, the newest first, and a table of the steps.
pub(super) fn trends(runs: &[Run], times: &Times) -> Markup {
    let oldest_first: Vec<&Run> = runs.iter().rev().collect();
    let steps: Vec<Option<String>> = oldest_first
        .iter()
        .enumerate()
        .map(|(k, run)| {
            let before = k.checked_sub(1).map(|k| oldest_first[k])?;
            KernelChange::between(before, run).words()
        })
        .collect();
    let all: Vec<BTreeMap<String, f64>> = oldest_first.iter().map(|run| figures(run)).collect();
    let names: BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    html! {
        @if runs.len() < 2 { p { "Plots require at least two runs." } }
        @else {
            div class="plots" {
                @for name in names {
                    @let values: Vec<Option<f64>> = all.iter().map(|figures| figures.get(name).copied()).collect();
                    (plot(name, &oldest_first, &values, &steps))
                }
            }
        }
        (table("Changes of kernels and verdict", &["Run", "Published, UTC", "Verdict", "Kernels", "Moved"], &html! {
            @for (k, run) in oldest_first.iter().enumerate().rev() {
                @let other_verdict = k.checked_sub(1).is_some_and(|k| oldest_first[k].verdict != run.verdict);
                @if k == 0 || other_verdict || steps[k].is_some() {
                    tr {
                        th scope="row" { a href={ "/runs/" (run.id) } { (run.id) } }
                        td { (times.at(run.published_utc)) }
                        td { (verdict(Some(&run.verdict))) }
                        td class="long" { (steps[k].as_deref().unwrap_or(if k == 0 { "first run shown" } else { "as before" })) }
                        td class="long" { (headline(run)) }
                    }
                }
            }
        }))
    }
}

/// The changes, in one sentence.
pub(super) fn headline(run: &Run) -> String {
    let headline = run.moved.get("headline").and_then(Value::as_str);
    headline.map_or_else(|| sentences(&run.moved).join(" "), str::to_owned)
}

fn plot(name: &str, runs: &[&Run], values: &[Option<f64>], steps: &[Option<String>]) -> Markup {
    let known: Vec<f64> = values
        .iter()
        .flatten()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else {
        return html! {};
    };
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A constant figure is a line in the middle, and small changes of a figure look small.
    let margin = match (0.08 * (high - low)).max(0.05 * high.abs().max(low.abs())) {
        margin if margin > 0.0 => margin,
        // Of zeros.
        _ => 1.0,
    };
    // Sizes have no negative values.
    let floor = if low >= 0.0 {
        (low - margin).max(0.0)
    } else {
        low - margin
    };
    let ceiling = high + margin;
    let x = |k: usize| LEFT + (k as f64 + 0.5) / runs.len() as f64 * (WIDTH - LEFT - RIGHT);
    let y = |value: f64| TOP + (ceiling - value) / (ceiling - floor) * (HEIGHT - TOP - BOTTOM);
    let points: Vec<(usize, f64)> = values
        .iter()
        .enumerate()
        .filter_map(|(k, value)| Some((k, value.filter(|value| value.is_finite())?)))
        .collect();
    let path: Vec<String> = points
        .iter()
        .map(|(k, value)| format!("{:.1},{:.1}", x(*k), y(*value)))
        .collect();
    let title = figure_name(name);
    html! {
        figure {
            h3 { (title) }
            svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label={ (title) ", from " (figure(*first)) " to " (figure(*last)) } {
                rect x=(LEFT) y=(TOP) width=(WIDTH - LEFT - RIGHT) height=(HEIGHT - TOP - BOTTOM) fill="none" stroke="#E2E2E2" {}
                // The ends of the axis: they are always apart.
                @for (value, down) in [(ceiling, TOP + 12.0), (floor, HEIGHT - BOTTOM)] {
                    text x=(LEFT - 6.0) y=(down) text-anchor="end" font-size="15" fill="#222222" { (figure(value)) }
                }
                @for (k, step) in steps.iter().enumerate() {
                    @if let Some(words) = step {
                        line x1=(format!("{:.1}", x(k))) x2=(format!("{:.1}", x(k))) y1=(TOP) y2=(HEIGHT - BOTTOM) stroke="#FF610D" stroke-dasharray="4 3" {
                            title { (words) }
                        }
                    }
                }
                polyline points=(path.join(" ")) fill="none" stroke="#0E5A99" stroke-width="2" {}
                @for (k, value) in &points {
                    @let run = runs[*k];
                    @let (across, down) = (x(*k), y(*value));
                    @if run.valid {
                        circle cx=(format!("{across:.1}")) cy=(format!("{down:.1}")) r="3.5" fill="#0E5A99" { title { (run.id) ": " (figure(*value)) } }
                    } @else {
                        path d=(format!("M{:.1} {:.1}l10 10m0 -10l-10 10", across - 5.0, down - 5.0)) stroke="#C10019" stroke-width="2.5" {
                            title { (run.id) ": " (figure(*value)) ", invalid" }
                        }
                    }
                }
                @let [from, to] = ends(runs);
                text x=(LEFT) y=(HEIGHT - 8.0) font-size="15" fill="#222222" { (from) }
                text x=(WIDTH - RIGHT) y=(HEIGHT - 8.0) text-anchor="end" font-size="15" fill="#222222" { (to) }
            }
            figcaption {
                "From " (figure(*first)) " to " (figure(*last)) " over " (counted(points.len(), "run")) "."
                @if steps.iter().any(Option::is_some) { " Broken lines: kernels changed." }
                @if runs.iter().any(|run| !run.valid) { " Crosses: invalid." }
            }
        }
    }
}

/// Days of the first and of the last run; with minutes if both are of one day.
fn ends(runs: &[&Run]) -> [String; 2] {
    let texts = [runs.first(), runs.last()]
        .map(|run| run.map_or_else(String::new, |run| utc_text(run.published_utc.0)));
    let part = |text: &str, letters: usize| text.chars().take(letters).collect::<String>();
    let [from, to] = texts.each_ref().map(|text| part(text, 10));
    if from == to {
        texts.map(|text| part(&text, 16).replace('T', " "))
    } else {
        [from, to]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instant::Instant;

    fn run(published_ms: i64) -> Run {
        Run {
            published_utc: Instant(published_ms),
            ..Run::default()
        }
    }

    #[test]
    fn ends_of_an_axis_are_apart_and_runs_of_one_day_have_minutes() {
        let day_ms = 86_400_000;
        let runs = [run(60_000), run(3_600_000), run(2 * day_ms)];
        let all: Vec<&Run> = runs.iter().collect();
        assert_eq!(
            ends(&all[..2]),
            ["1970-01-01 00:01", "1970-01-01 01:00"].map(str::to_owned)
        );
        assert_eq!(ends(&all), ["1970-01-01", "1970-01-03"].map(str::to_owned));
        // A constant figure, and one that changes in the fourth digit.
        for values in [[0.6758, 0.6758], [1.63e-3, 1.6302e-3], [-6.0, -6.0]] {
            let plot = plot("range_mean_m", &all[..2], &values.map(Some), &[None, None]).0;
            let labels = plot.split("text-anchor=\"end\" font-size=\"15\" fill=\"#222222\">");
            let labels: Vec<&str> = labels
                .skip(1)
                .map(|part| part.split('<').next().unwrap())
                .collect();
            assert_ne!(labels[0], labels[1], "{labels:?}");
            // The line is in the middle of the figure: no small change fills it.
            let lines = plot.split("points=\"").nth(1).unwrap();
            for point in lines.split('"').next().unwrap().split(' ') {
                let down: f64 = point.split(',').nth(1).unwrap().parse().unwrap();
                let middle = f64::midpoint(TOP, HEIGHT - BOTTOM);
                assert!((down - middle).abs() < 0.05 * HEIGHT, "{down}");
            }
        }
    }
}
