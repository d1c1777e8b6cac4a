//! The box at the top of the start page: what needs attention, each cause once.

use maud::{Markup, html};

use super::{
    data::attention,
    parts::{Times, lead, prose, tone},
};
use crate::{
    clock::minute_text,
    database::shown::{DataStatus, RootFolder, Site, Wait},
    instant::Instant,
    words::counted,
};

/// Faults of the service itself and of its inputs.
pub(super) struct Faults<'a> {
    pub(super) configuration: Option<String>,
    pub(super) recovering: bool,
    pub(super) data: &'a DataStatus,
    pub(super) roots: &'a [RootFolder],
    pub(super) waits: &'a [Wait],
}

/// Sites that cannot be run for the same reason, other than a file or folder for which they wait.
struct Refused<'a> {
    problem: &'a str,
    sites: Vec<&'a str>,
}

fn refused(sites: &[Site]) -> Vec<Refused<'_>> {
    let mut found: Vec<Refused<'_>> = Vec::new();
    for site in sites.iter().filter(|site| site.waits_for.is_none()) {
        let Some(problem) = site.problem.as_deref().filter(|_| site.enabled) else {
            continue;
        };
        match found.iter_mut().find(|known| known.problem == problem) {
            Some(known) => known.sites.push(&site.name),
            None => found.push(Refused {
                problem,
                sites: vec![&site.name],
            }),
        }
    }
    found
}

/// The box: the worst state, counts, and causes.
pub(super) fn standing(sites: &[Site], faults: &Faults<'_>, times: &Times) -> Markup {
    let count = |wanted: &str| {
        let of_tone = |site: &&Site| tone(site.verdict.as_deref()) == wanted;
        sites.iter().filter(of_tone).count()
    };
    let stale = sites.iter().filter(|site| site.stale_since_utc.is_some());
    let (stale, waiting) = (
        stale.count(),
        sites.iter().filter(|site| site.waits_for.is_some()).count(),
    );
    let is_away = |root: &&RootFolder| root.state == "unavailable";
    let away: Vec<&RootFolder> = faults.roots.iter().filter(is_away).collect();
    let wrong = refused(sites);
    let invalid = |site: &&Site| site.newest_valid == Some(false);
    let invalid = sites.iter().filter(invalid).count();
    let without_run = |site: &&Site| site.enabled && site.verdict.is_none();
    let without_run = sites.iter().filter(without_run).count();
    let problem = faults.configuration.as_deref();
    let worst = if !away.is_empty()
        || !faults.waits.is_empty()
        || problem.is_some()
        || !wrong.is_empty()
        || invalid > 0
        || count("invalid") > 0
        || faults.recovering
        || faults.data.products.runs_damaged > 0
    {
        "invalid"
    } else if stale > 0 || without_run > 0 {
        "remarks"
    } else {
        "valid"
    };
    let refused: usize = wrong.iter().map(|one| one.sites.len()).sum();
    let parts = [
        (stale, "stale"),
        (waiting, "waiting for an input"),
        (refused, "not run because of a failure"),
        (invalid, "with an invalid newest run"),
        (without_run, "without a run"),
    ];
    let headline = headline(sites.len(), &parts, worst);
    lead(
        worst,
        &headline,
        &html! {
            ul {
                @for root in &away { li { "The folder " code { (root.path) } " has been unavailable since "
                    (times.at(root.since_utc)) ": " (root.detail) ". Its sites wait; nothing is lost." } }
                @for wait in faults.waits { li { (cause(wait, sites)) } }
                @if let Some(problem) = problem { li { "The changed configuration was rejected; the previous \
                    configuration remains in force: " (problem) } }
                (attention(faults.data, faults.recovering))
                @for one in &wrong { li {
                    @for (k, site) in one.sites.iter().enumerate() { @if k > 0 { ", " } a href={ "/sites/" (site) } { (site) } }
                    ": " (prose(one.problem))
                } }
                @if invalid > 0 { li { "The newest run of " (counted(invalid, "site")) " is invalid; earlier products remain current." } }
                @if worst != "invalid" && count("remarks") > 0 { li { (counted(count("remarks"), "site")) " valid with remarks." } }
            }
        },
    )
}

/// All sites, and how many of them are not as they should be.
fn headline(sites: usize, parts: &[(usize, &str)], worst: &str) -> String {
    let parts = parts.iter().filter(|(sites, _)| *sites > 0);
    let parts: Vec<String> = parts
        .map(|(sites, what)| format!("{sites} {what}"))
        .collect();
    let all = counted(sites, "site");
    match (sites, parts.is_empty()) {
        (0, _) => "No sites yet: put site files into the site folder".to_owned(),
        (_, true) if worst == "invalid" => all,
        (_, true) => format!("{all}, all of them up to date"),
        (_, false) => format!("{all}: {}", parts.join(", ")),
    }
}

/// A lost or unusable file, the sites that wait for it, and the age of their products.
fn cause(wait: &Wait, sites: &[Site]) -> Markup {
    let products = |name: &String| {
        let site = sites.iter().find(|site| site.name == *name)?;
        site.current_run.as_ref().and(site.current_since_utc)
    };
    let since: Vec<Instant> = wait.sites.iter().filter_map(products).collect();
    let text = |at: i64| minute_text(at);
    let (first, last) = (
        since.iter().map(|at| at.0).min().map(text),
        since.iter().map(|at| at.0).max().map(text),
    );
    html! {
        (prose(&wait.text)) ". " (counted(wait.sites.len(), "site"))
        @if wait.sites.len() == 1 { " waits" } @else { " wait" }
        " for it: "
        @for (k, site) in wait.sites.iter().enumerate() { @if k > 0 { ", " } a href={ "/sites/" (site) } { (site) } }
        "."
        @match (first, last) {
            (Some(first), Some(last)) if first != last => { " The products of " (first) " to " (last) " remain current." }
            (Some(first), _) => { " The products of " (first) " remain current." }
            _ => {}
        }
    }
}
