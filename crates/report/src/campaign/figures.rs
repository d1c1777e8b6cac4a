//! Figures of a campaign: misregistration over properties of the pairs, and the map of its sites.

use std::collections::BTreeMap;

use chrono::{Datelike as _, NaiveDate};

use crate::{
    html::{Markup, Tone, html, paragraph},
    numbers::whole,
    plots::{Extent, Panel, Plot, Series, figure, thinned},
    sites_map,
};
use areograph_base::{body::Body, error::Result};
use areograph_stages::pool_sites::{CampaignRows, PairRow, PairState, SiteRow, phase_or_unknown};

/// Points of a panel: drawn once and listed once, about 200 bytes each.
const POINTS_MAX: usize = 250;
/// Groups with a place of their own on an axis; the others share the last one.
const GROUPS_MAX: usize = 16;
/// Colours of before and after.
const BEFORE: usize = 1;
const AFTER: usize = 0;
/// Sites up to which each has its name on the map.
const NAMED_MAX: usize = 12;
/// Days of a year.
const YEAR_DAYS: f64 = 365.25;

/// An axis: its name in titles, its label, and the value of a pair.
type Axis<T> = (&'static str, &'static str, fn(&PairRow) -> T);

/// Along-track misregistration, image with the larger emission minus the other, metres; `None` for equal or unknown
/// emissions.
fn along_m(pair: &PairRow, state: Option<&PairState>) -> Option<f64> {
    Some(pair.sense()? * state?.misregistration?.along_m.value)
}

/// Misregistration of the pooled pairs over emission, latitude, date, phase, summing and kernel set.
pub(super) fn misregistration(rows: &CampaignRows) -> Result<Markup> {
    let pairs: Vec<&PairRow> = rows
        .pairs
        .iter()
        .filter(|pair| pair.is_valid && !pair.is_repeated)
        .filter(|pair| pair.before.misregistration.is_some())
        .collect();
    if pairs.is_empty() {
        return Ok(paragraph("No valid pair has footprints in both images."));
    }
    let over: [Axis<Option<f64>>; 3] = [
        ("emission", "larger emission of the pair, degrees", |pair| {
            let [first, second] = pair.emission_rad;
            Some(first?.max(second?).to_degrees())
        }),
        ("latitude", "areocentric latitude, degrees", |pair| {
            Some(pair.latitude_rad?.to_degrees())
        }),
        ("date", "year of the first image", |pair| {
            year(&pair.utc_start[0])
        }),
    ];
    let groups: [Axis<String>; 3] = [
        ("mission phase", "number of the phase", |pair| {
            phase_or_unknown(&pair.phases[0]).to_owned()
        }),
        ("summing", "number of the combination", |pair| {
            let [first, second] = pair.summing;
            format!("{first} and {second}")
        }),
        ("kernel set", "number of the kernel set", |pair| {
            pair.kernels.name.clone()
        }),
    ];
    Ok(html! {
        div.plots {
            @for (name, axis, of) in over { (figure(&plot_over(&pairs, name, axis, of))?) }
            @for (name, axis, of) in groups {
                @if let Some(plot) = plot_by(&pairs, name, axis, of) { (figure(&plot)?) }
            }
        }
        @for (name, _, of) in groups {
            @if let Some(only) = only_group(&pairs, of) { p { "All pairs have one " (name) ": " (only) "." } }
        }
    })
}

/// The group of all pairs, if there is one.
fn only_group(pairs: &[&PairRow], of: fn(&PairRow) -> String) -> Option<String> {
    let first = of(pairs.first()?);
    let same = pairs.iter().all(|pair| of(pair) == first);
    same.then(|| {
        if first.is_empty() {
            "none".to_owned()
        } else {
            first
        }
    })
}

/// The year of a text that begins with a calendar date or a day of the year, with its fraction.
fn year(utc: &str) -> Option<f64> {
    let calendar = utc
        .get(..10)
        .map(|text| NaiveDate::parse_from_str(text, "%Y-%m-%d"));
    let ordinal = utc
        .get(..8)
        .map(|text| NaiveDate::parse_from_str(text, "%Y-%j"));
    let date = [calendar, ordinal]
        .into_iter()
        .flatten()
        .find_map(std::result::Result::ok)?;
    Some(f64::from(date.year()) + f64::from(date.ordinal0()) / YEAR_DAYS)
}

/// How many points a figure of so many pairs shows, in words.
fn shown(pairs: usize) -> String {
    if pairs <= POINTS_MAX {
        return String::new();
    }
    format!(
        " Of {} pairs, 1 in {} is drawn; pairs.csv has all of them.",
        whole(pairs),
        pairs.div_ceil(POINTS_MAX)
    )
}

fn panels(pairs: &[&PairRow], at: &dyn Fn(usize, &PairRow) -> Option<f64>) -> Vec<Panel> {
    let series = |label: &str, colour: usize, of: fn(&PairRow) -> Option<&PairState>| {
        let points = pairs
            .iter()
            .enumerate()
            .filter_map(|(index, pair)| Some((at(index, pair)?, along_m(pair, of(pair))?)));
        let points: Vec<(f64, f64)> = points.collect();
        Series::dots(label, colour, thinned(&points, POINTS_MAX))
    };
    let before = series("before the adjustment", BEFORE, |pair| Some(&pair.before));
    let after = series("after the adjustment", AFTER, |pair| pair.after.as_ref());
    let panel = |series: Series| Panel {
        height: 300,
        limits: vec![0.0],
        ..Panel::of("along the track, m", vec![series])
    };
    let mut panels = vec![panel(before)];
    if !after.points.is_empty() {
        panels.push(panel(after));
    }
    panels
}

fn plot_over(
    pairs: &[&PairRow],
    name: &str,
    axis: &'static str,
    of: fn(&PairRow) -> Option<f64>,
) -> Plot {
    let words = format!(
        "Along-track misregistration of the footprints of each pair, image with the larger emission minus the other.{}",
        shown(pairs.len())
    );
    Plot::of(
        format!("Misregistration over {name}"),
        words,
        axis,
        panels(pairs, &|_, pair| of(pair)),
    )
}

/// `None` for pairs of one group.
fn plot_by(
    pairs: &[&PairRow],
    name: &str,
    axis: &'static str,
    of: fn(&PairRow) -> String,
) -> Option<Plot> {
    if only_group(pairs, of).is_some() {
        return None;
    }
    let names: Vec<String> = pairs.iter().map(|pair| of(pair)).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for name in &names {
        *counts.entry(name).or_default() += 1;
    }
    // The largest groups, in alphabetical order.
    let mut largest: Vec<(&str, usize)> = counts.into_iter().collect();
    largest.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let others = largest.len().saturating_sub(GROUPS_MAX);
    largest.truncate(GROUPS_MAX);
    largest.sort_unstable();
    let number = |name: &str| {
        let place = largest.iter().position(|(group, _)| *group == name);
        place.unwrap_or(GROUPS_MAX) as f64 + 1.0
    };
    let list = largest.iter().enumerate().map(|(place, (group, count))| {
        let group = if group.is_empty() { "none" } else { group };
        format!("{}: {group} ({})", place + 1, whole(*count))
    });
    let list: Vec<String> = list.collect();
    let mut words = format!(
        "Along-track misregistration as above, by {name}, with the numbers of pairs: {}.",
        list.join(", ")
    );
    if others > 0 {
        words += &format!(" {} others are at {}.", whole(others), GROUPS_MAX + 1);
    }
    words += &shown(pairs.len());
    let places = largest.len() + usize::from(others > 0);
    Some(Plot {
        x: Extent {
            low: 0.6,
            high: places as f64 + 0.4,
        },
        ..Plot::of(
            format!("Misregistration by {name}"),
            words,
            axis,
            panels(pairs, &|index, _| Some(number(&names[index]))),
        )
    })
}

/// The sites on their bodies, by verdict.
pub(super) fn map(rows: &CampaignRows) -> Result<Markup> {
    let mut maps = Markup::default();
    for (_, body) in Body::WORDS {
        let sites: Vec<&SiteRow> = rows.sites.iter().filter(|site| site.body == body).collect();
        let places: Vec<sites_map::Place<'_>> = sites
            .iter()
            .filter_map(|site| {
                let [longitude_rad, latitude_rad] = site.place_rad?;
                Some(sites_map::Place {
                    name: &site.site,
                    tone: tone(site),
                    place_deg: (
                        longitude_rad.to_degrees().rem_euclid(360.0),
                        latitude_rad.to_degrees(),
                    ),
                })
            })
            .collect();
        let map = if places.len() <= NAMED_MAX {
            sites_map::figure(body, &places, "Centres of the first images of the sites.")?
        } else {
            sites_map::figure_of_many(body, &places)?
        };
        maps = html! { (maps) (map) };
    }
    Ok(maps)
}

const fn tone(site: &SiteRow) -> Tone {
    match (site.is_valid, site.remarks.is_empty()) {
        (false, _) => Tone::Bad,
        (true, false) => Tone::Remarks,
        (true, true) => Tone::Good,
    }
}
