//! The first screen of a site's page: verdict, the numbers that matter, every check, the map.

use super::{
    checks,
    heights::{absolute, place_by},
    html::{Tone, counted, escape, list, paragraph, verdict},
    map,
    numbers::{number, signed, whole},
};
use crate::{
    error::Result,
    footprints::AdjustmentModel,
    products::SiteProducts,
    stages::judge::{Check, CheckKind},
};

/// Reasons, and remarks, that are listed; the rest is counted.
const REASONS_SHOWN: usize = 4;

/// Valid or not and why, how good by whose judgement, and where: the first lines of the page.
///
/// # Errors
/// A map that cannot be drawn.
pub(super) fn lead(site: &SiteProducts) -> Result<String> {
    let (reasons, remarks) = (&site.verdict.reasons, &site.verdict.remarks);
    let tone = match (reasons.len(), remarks.len()) {
        (0, 0) => Tone::Good,
        (0, _) => Tone::Remarks,
        _ => Tone::Bad,
    };
    let remarks = if remarks.is_empty() {
        String::new()
    } else {
        format!(
            "<details class=\"more\"{}><summary>{}</summary>\n{}</details>\n",
            if reasons.is_empty() { " open" } else { "" },
            counted(remarks.len(), "remark"),
            first_of(remarks)
        )
    };
    Ok(format!(
        "{}{}{}<div class=\"first\">\n<div>{}</div>\n<div>{}</div>\n</div>\n{remarks}",
        about(site),
        verdict(tone, &headline(site), &first_of(reasons)),
        numbers(site),
        checks::table(site),
        map::first(site)?,
    ))
}

fn headline(site: &SiteProducts) -> String {
    match (site.verdict.reasons.len(), site.verdict.remarks.len()) {
        (0, 0) => "Valid: every check is within its limit.".to_owned(),
        (0, 1) => "Valid, with one remark.".to_owned(),
        (0, count) => format!("Valid, with {count} remarks."),
        (1, _) => "Invalid, for one reason:".to_owned(),
        (count, _) => format!("Invalid, for {count} reasons:"),
    }
}

/// What the page is about: description, dates of the data, how much there is.
fn about(site: &SiteProducts) -> String {
    let mut parts = Vec::new();
    let days = |dates: &mut dyn Iterator<Item = &str>| {
        let mut days: Vec<String> = dates
            .filter_map(|utc| Some(utc.get(..10)?.to_owned()))
            .collect();
        days.sort_unstable();
        match (days.first(), days.last()) {
            (Some(first), Some(last)) if first == last => format!(" of {first}"),
            (Some(first), Some(last)) => format!(" of {first} to {last}"),
            _ => String::new(),
        }
    };
    if !site.images.is_empty() {
        let taken = days(&mut site.images.iter().map(|image| &*image.times.utc_start));
        parts.push(counted(site.images.len(), "image") + &taken);
    }
    let shot = days(&mut site.utc.iter().map(String::as_str));
    parts.push(format!(
        "{} in {}{shot}",
        counted(site.footprints.len(), "footprint"),
        counted(site.profiles.len(), "profile")
    ));
    let mut words = escape(site.config.description.trim_end_matches('.'));
    if !words.is_empty() {
        words += ". ";
    }
    words += &escape(&(parts.join("; ") + "."));
    format!("<p class=\"about\">{words}</p>\n")
}

/// A number that matters: what it is, its value, and what to know of it.
struct KeyNumber {
    what: &'static str,
    value: String,
    note: String,
}

/// The numbers that say how good the products are: by MOLA, between the images, absolutely; without tie points by
/// the ranges.
fn numbers(site: &SiteProducts) -> String {
    let numbers: Vec<KeyNumber> = [
        by_mola(site),
        between_images(site),
        in_place(site),
        by_ranges(site),
    ]
    .into_iter()
    .flatten()
    .collect();
    if numbers.is_empty() {
        return String::new();
    }
    let items: String = numbers
        .iter()
        .map(|number| {
            format!(
                "<div><dt>{}</dt><dd><b>{}</b> {}</dd></div>\n",
                escape(number.what),
                escape(&number.value),
                escape(&number.note)
            )
        })
        .collect();
    format!("<dl class=\"numbers\">\n{items}</dl>\n")
}

/// The number of a check, if it has one.
fn checked<'a>(site: &SiteProducts<'a>, kind: CheckKind) -> Option<(&'a Check, f64)> {
    let check = site
        .verdict
        .checks
        .iter()
        .find(|check| check.kind == kind)?;
    Some((check, check.value?))
}

fn by_mola(site: &SiteProducts) -> Option<KeyNumber> {
    let (_, after_m) = checked(site, CheckKind::HeightAfter)?;
    let (_, before_m) = checked(site, CheckKind::HeightBefore)?;
    let (geometric, adjustment) = site.adjustment()?;
    let ties = counted(adjustment.heights.above_m.n as usize, "tie point");
    let all = whole(geometric.heights.above_m.n);
    let before_m = signed(before_m, 1);
    Some(KeyNumber {
        what: "Heights against MOLA",
        value: format!("{} m", signed(after_m, 1)),
        // What controls a result cannot judge it: then only the number before does.
        note: match site.config.adjustment.model {
            AdjustmentModel::MolaSurface => format!(
                "median of {ties}, controlled by MOLA; {before_m} m of {all} before, independent of it"
            ),
            AdjustmentModel::Published => {
                format!("median of {ties}; {before_m} m of {all} before the adjustment")
            }
        },
    })
}

fn between_images(site: &SiteProducts) -> Option<KeyNumber> {
    let (after, after_m) = checked(site, CheckKind::ParallaxAfter)?;
    let (geometric, _) = site.adjustment()?;
    let mut pairs = geometric.pairs.iter();
    let before = pairs.find(|pair| pair.images.join(" and ") == after.subject)?;
    Some(KeyNumber {
        what: "Between images, along track",
        value: format!(
            "{} m",
            number(after_m.abs(), if after_m.abs() < 1.0 { 2 } else { 1 })
        ),
        note: format!(
            "at the tie points of {}; {} m before",
            after.subject,
            number(before.along_track_parallax_m.abs(), 0)
        ),
    })
}

/// What is known of the absolute place and height.
fn in_place(site: &SiteProducts) -> Option<KeyNumber> {
    let (geometric, adjustment) = site.adjustment()?;
    let heights = adjustment.adjusted.heights.as_ref()?;
    let [east_m, north_m, up_m] = heights.mean_sigma_m;
    let [_, place] = absolute(&geometric, &adjustment);
    Some(KeyNumber {
        what: "Absolute accuracy, 1 σ",
        value: format!(
            "±{} m plan, ±{} m height",
            number(east_m.max(north_m), 0),
            number(up_m, 1)
        ),
        note: if place.contains(';') {
            format!(
                "by {}; see accuracy for what is open",
                place_by(&geometric, &adjustment)
            )
        } else {
            format!(
                "plan by {}, height by MOLA",
                place_by(&geometric, &adjustment)
            )
        },
    })
}

/// Ranges, where there are profiles.
fn by_ranges(site: &SiteProducts) -> Option<KeyNumber> {
    let (check, mean_m) = checked(site, CheckKind::RangeMean)?;
    Some(KeyNumber {
        what: "Range − distance",
        value: format!("{} m", signed(mean_m, 2)),
        note: match site.profiles.len() {
            1 => format!("mean of profile {}", check.subject),
            count => format!("largest mean of {count} profiles, {}", check.subject),
        },
    })
}

/// As many sentences as leave the verdict on one screen; the manifest has all.
fn first_of(sentences: &[String]) -> String {
    let shown = &sentences[..sentences.len().min(REASONS_SHOWN)];
    let mut html = list(shown);
    if shown.len() < sentences.len() {
        let more = sentences.len() - shown.len();
        html += &paragraph(&format!(
            "And {more} more, all of them in ../manifest.json."
        ));
    }
    html
}
