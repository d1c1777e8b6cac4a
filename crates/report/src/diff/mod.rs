//! The page of a comparison: movements first, then their possible causes.

mod checks;
mod inputs;
mod map;
mod movement;

use std::cmp::Reverse;

pub(super) use map::sheet;

use super::html::{self, Markup, Section, Tone, html, list};
use crate::difference::{Outcome, RunDifference};
use areograph_base::error::Result;

/// The differences of one or several sites as one HTML page; `not_compared` gives the reasons for omitted sites.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn difference_page(sites: &[&RunDifference], not_compared: &[String]) -> Result<String> {
    let title = match sites {
        [one] => format!("{}: difference of two runs", one.site),
        _ => "Difference of two runs".to_owned(),
    };
    let mut sites = sites.to_vec();
    sites.sort_by_key(|site| Reverse(site.severity()));
    let sites = &*sites;
    let lead = html! { (lead(sites)) (list(not_compared)) };
    let sections = [
        of_each("Checks", sites, |site| Ok(checks::changed(site)))?,
        of_each("Movement", sites, |site| {
            let moved = matches!(site.outcome, Outcome::Moved | Outcome::BeyondLimit);
            Ok(html! { @if moved { (movement::tables(site)) (map::figure_of(site)?) } })
        })?,
        of_each("Movement along the images", sites, movement::plots)?,
        of_each("Range residuals", sites, |site| Ok(inputs::profiles(site)))?,
        of_each("Values", sites, |site| Ok(inputs::values(site)))?,
        of_each("Kernels, stages and products", sites, |site| {
            Ok(inputs::items(site))
        })?,
        of_each("Notes and problems", sites, |site| Ok(inputs::texts(site)))?,
    ];
    Ok(html::page(&title, &lead, &sections))
}

/// A section with the part of every site that has one, under the site's name if there are several.
fn of_each(
    name: &'static str,
    sites: &[&RunDifference],
    part: impl Fn(&RunDifference) -> Result<Markup>,
) -> Result<Section> {
    let parts = sites.iter().map(|site| Ok((&site.site, part(site)?)));
    let parts: Vec<(&String, Markup)> = parts.collect::<Result<_>>()?;
    let body = html! {
        @for (name, part) in parts {
            @if !part.0.is_empty() && sites.len() > 1 { h3 { (name) } }
            (part)
        }
    };
    Ok(Section::new(name, body))
}

/// Changed verdicts first, on their own; then movements; of several sites the unchanged ones in one line.
fn lead(sites: &[&RunDifference]) -> Markup {
    let (unchanged, changed): (Vec<&RunDifference>, Vec<&RunDifference>) = sites
        .iter()
        .partition(|site| sites.len() > 1 && site.is_unchanged());
    let names: Vec<&str> = unchanged.iter().map(|site| &*site.site).collect();
    html! {
        @for site in sites { (changed_verdict(site)) }
        @for site in changed { (moved(site)) }
        @if !names.is_empty() { p { "Unchanged: " (names.join(", ")) "." } }
    }
}

fn changed_verdict(site: &RunDifference) -> Markup {
    let (a, b) = (&site.a.verdict, &site.b.verdict);
    if a.word() == b.word() {
        return Markup::default();
    }
    let tone = match (b.valid, b.remarks.is_empty()) {
        (false, _) => Tone::Bad,
        (true, false) => Tone::Remarks,
        (true, true) => Tone::Good,
    };
    let headline = format!("{}: {} → {}", site.site, a.word(), b.word());
    html::verdict(
        tone,
        &headline,
        &html! { (list(&b.reasons)) (list(&b.remarks)) },
    )
}

fn moved(site: &RunDifference) -> Markup {
    let tone = match site.outcome {
        _ if !site.b.verdict.valid => Tone::Bad,
        Outcome::NothingChanged | Outcome::NothingMoved => Tone::Good,
        Outcome::Moved => Tone::Remarks,
        Outcome::BeyondLimit => Tone::Bad,
    };
    let headline = format!("{}: {}.", site.site, site.headline());
    let runs = format!(
        "A was published at {}, B at {}; a movement is B − A.",
        site.a.finished_utc, site.b.finished_utc
    );
    let body = html! { (list(&site.first_sentences())) p { (limits(site)) } p { (runs) } };
    html::verdict(tone, &headline, &body)
}

fn limits(site: &RunDifference) -> String {
    let metres = site.limits.movement_m.map(|limit| format!("{limit} m"));
    let arcseconds = site.limits.pointing_arcsec;
    let arcseconds = arcseconds.map(|limit| format!("{limit} arcsec"));
    let limits: Vec<String> = metres.into_iter().chain(arcseconds).collect();
    if limits.is_empty() {
        return "No limits were set.".to_owned();
    }
    format!("Limits: {}.", limits.join(", "))
}
