//! The first screen of a site's page: verdict, key numbers, downloads, images with footprints, the map, checks.

use std::borrow::Cow;

use super::{
    checks,
    heights::{WITHHELD_BECAUSE, is_open, place_by},
    html::{Markup, Tone, counted, folded_unless, html, link, list, verdict},
    image_strips, map,
    misregistration::{BeforeAfter, by_footprints},
    numbers::{number, signed, whole},
    section::Section,
    source::traced,
};
use areograph_base::{error::Result, footprints::AdjustmentModel};
use areograph_products::{Listed, SiteProducts};
use areograph_stages::{
    compare_pairs::PairComparison,
    judge::{Check, CheckKind, NO_BEAM},
};

/// The page with the same data to explore.
const EXPLORE: &str = "report/explore.html";
/// Number of reasons, and of remarks, listed; the rest are counted.
const REASONS_SHOWN: usize = 4;

/// Verdict with reasons, accuracy with its basis, and location: the first lines of the page.
///
/// # Errors
/// A map that cannot be drawn.
pub(super) fn lead(site: &SiteProducts, sections: &[&Section]) -> Result<Markup> {
    let (reasons, remarks) = (&site.verdict.reasons, &site.verdict.remarks);
    let tone = match (reasons.len(), remarks.len()) {
        (0, 0) => Tone::Good,
        (0, _) => Tone::Remarks,
        _ => Tone::Bad,
    };
    let listed = first_of(remarks);
    let found = html! {
        (verdict(tone, &headline(site), &first_of(reasons)))
        (numbers(site))
        (downloads(site))
        div.first {
            div {
                (image_strips::figures(site)?)
                (checks::of_site(site, sections))
                (checks::untested(&site.verdict.untested))
            }
            div { (map::first(site)?) }
        }
        (folded_unless(reasons.is_empty(), &counted(remarks.len(), "remark"), &listed))
    };
    // The user's text is not changed.
    Ok(html! { (about(site)) (found) })
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

/// Subject of the page: description, dates of the data, counts.
fn about(site: &SiteProducts) -> Markup {
    let days = |first: Option<String>, last: Option<String>| {
        let day = |utc: String| utc.get(..10).map(str::to_owned);
        match (first.and_then(day), last.and_then(day)) {
            (Some(first), Some(last)) if first == last => format!(" of {first}"),
            (Some(first), Some(last)) => format!(" of {first} to {last}"),
            _ => String::new(),
        }
    };
    let starts = || {
        let starts = site.images.iter().map(|image| &image.times.utc_start);
        starts.filter(|utc| !utc.is_empty()).cloned()
    };
    let taken = days(starts().min(), starts().max());
    let images = counted(site.images.len(), "image");
    let instants = site.utc.iter();
    let shot = days(
        instants.clone().min().map(|utc| utc.to_string()),
        instants.max().map(|utc| utc.to_string()),
    );
    let footprints = counted(site.footprints.len(), "footprint");
    let profiles = counted(site.profiles.len(), "profile");
    let description = site.config.description.trim_end_matches('.');
    html! {
        p.about {
            @if !description.is_empty() { (description) ". " }
            @if !site.images.is_empty() { (traced(&images, "manifest.json#/counts/images")) (taken) "; " }
            (traced(&footprints, "manifest.json#/counts/footprints"))
            " in " (traced(&profiles, "manifest.json#/counts/profiles")) (shot) "."
            @if site.listed.iter().any(|of| of.path == EXPLORE) {
                " " (link("explore.html", "Explore map, images and profiles")) "."
            }
        }
    }
}

/// Names of the products that most users take: paths, and file names of products of images.
pub const DOWNLOADS: [&str; 10] = [
    "footprints.parquet",
    "registered_footprints.parquet",
    "registered_footprints.csv",
    "exchange/registered_footprints.gpkg",
    "exchange/site.qgz",
    "surface_above_areoid.tif",
    "surface_above_sphere.tif",
    "orthoimage.tif",
    "mosaic.tif",
    "adjusted_isd.json",
];
/// Offered in place of the last one if there is no adjustment.
pub const UNADJUSTED: &str = "isd.json";

/// Links to these products.
fn downloads(site: &SiteProducts) -> Markup {
    let (shown, is_adjusted) = (site.shown_images(), site.adjustment().is_some());
    let is_offered = |of: &&Listed| match of.image {
        None => DOWNLOADS.contains(&&*of.path),
        Some(image) => {
            let name = of.path.rsplit('/').next().unwrap_or_default();
            let is_named = DOWNLOADS.contains(&name) || !is_adjusted && name == UNADJUSTED;
            is_named && shown.binary_search(&image).is_ok()
        }
    };
    let offered: Vec<&Listed> = site.listed.iter().filter(is_offered).collect();
    html! {
        @if !offered.is_empty() {
            ul.downloads {
                @for of in offered { li { (link(&format!("../{}", of.path), &of.path)) } }
                li { (link("#provenance", "all products")) }
            }
        }
    }
}

/// A key number: its name, its value, and a note.
struct KeyNumber {
    what: Cow<'static, str>,
    value: Markup,
    note: Markup,
}

/// The accuracy of the products: by MOLA, between the images, absolutely; without tie points by
/// the ranges.
fn numbers(site: &SiteProducts) -> Markup {
    let numbers: Vec<KeyNumber> = [
        by_altimeter(site),
        between_images(site),
        in_place(site),
        by_ranges(site),
    ]
    .into_iter()
    .flatten()
    .collect();
    html! {
        @if !numbers.is_empty() {
            dl.numbers {
                @for KeyNumber { what, value, note } in numbers {
                    div { dt { (what) } dd { b { (value) } " " (note) } }
                }
            }
        }
    }
}

/// A check with its number, if it has one, and the place of that in the products.
fn checked<'a>(site: &SiteProducts<'a>, kind: CheckKind) -> Option<(&'a Check, f64, String)> {
    let mut checks = site.verdict.checks.iter().enumerate();
    let (index, check) = checks.find(|(_, check)| check.kind == kind)?;
    Some((
        check,
        check.value?,
        format!("{}/value", checks::place(index)),
    ))
}

fn by_altimeter(site: &SiteProducts) -> Option<KeyNumber> {
    let (_, after_m, after_place) = checked(site, CheckKind::HeightAfter)?;
    let (_, before_m, before_place) = checked(site, CheckKind::HeightBefore)?;
    let (geometric, adjustment) = site.adjustment()?;
    let of = |state| format!("adjustment.json#/{state}/heights/above_surface_m/n");
    let ties = counted(adjustment.heights.above_m.n as usize, "tie point");
    let ties = traced(&ties, &of("after"));
    let all = traced(&whole(geometric.heights.above_m.n), &of("before"));
    let before_m = traced(&signed(before_m, 1), &before_place);
    let altimeter = site.config.terms().altimeter;
    Some(KeyNumber {
        what: format!("Heights against {altimeter}").into(),
        value: traced(&format!("{} m", signed(after_m, 1)), &after_place),
        // Data that control a result cannot test it: then only the number before does.
        note: match site.config.adjustment.model {
            AdjustmentModel::MolaSurface => html! {
                "median of " (ties) ", controlled by " (altimeter) "; before the adjustment "
                (before_m) " m, median of " (all) ", independent of it"
            },
            AdjustmentModel::Published => html! {
                "median of " (ties) "; before the adjustment " (before_m) " m, median of " (all)
            },
        },
    })
}

fn between_images(site: &SiteProducts) -> Option<KeyNumber> {
    let (after, after_m, place) = checked(site, CheckKind::ParallaxAfter)?;
    let (geometric, _) = site.adjustment()?;
    let pairs = BeforeAfter::all(&geometric);
    let pair = pairs.iter().find(|pair| pair.name() == after.subject)?;
    let before_m = pair.before.along_track_parallax_m.abs();
    let before_place = format!("|{}/along_track_parallax_m", pair.place("before"));
    Some(KeyNumber {
        what: "Between images, along track".into(),
        value: traced(
            &format!(
                "{} m",
                number(after_m.abs(), if after_m.abs() < 1.0 { 2 } else { 1 })
            ),
            &format!("|{place}"),
        ),
        note: html! {
            "at the tie points of " (after.subject) ", which the adjustment fits; "
            (traced(&number(before_m, 0), &before_place)) " m before" (at_footprints(pair))
        },
    })
}

/// Disagreement of the same images on footprints, which are not fitted, and its precision by the tie points.
fn at_footprints(pair: &BeforeAfter) -> Markup {
    let of = |state: &str, pair_of: &PairComparison| {
        let [apart_m, sigma_m] = by_footprints(pair_of)?;
        let place = format!("{}/footprints", pair.place(state));
        let traced = |value: f64, name: &str| traced(&number(value, 0), &format!("{place}/{name}"));
        Some([traced(apart_m, "apart_m"), traced(sigma_m, "apart_sigma_m")])
    };
    let [before, after] = [("before", Some(pair.before)), ("after", pair.after)]
        .map(|(state, found)| of(state, found?));
    let (Some([before_m, before_sigma_m]), Some([after_m, sigma_m])) = (before, after) else {
        return Markup::default();
    };
    html! {
        ". Footprints, not fitted: " (after_m) " m (σ " (sigma_m) " m), before "
        (before_m) " m (σ " (before_sigma_m) " m)"
    }
}

/// Place of heights in the products.
const HEIGHTS: &str = "adjustment.json#/adjustment/heights";

/// Absolute accuracy of position and height.
fn in_place(site: &SiteProducts) -> Option<KeyNumber> {
    let (geometric, adjustment) = site.adjustment()?;
    let heights = adjustment.adjusted.heights.as_ref()?;
    if site.accuracy_withheld().is_some() {
        return Some(KeyNumber {
            what: "Absolute accuracy, 1 σ".into(),
            value: html! { "withheld" },
            note: html! { (WITHHELD_BECAUSE) "; see the remarks" },
        });
    }
    let [east_m, north_m, up_m] = heights.mean_sigma_m;
    let by = place_by(&geometric, &adjustment);
    Some(KeyNumber {
        what: "Absolute accuracy, 1 σ".into(),
        value: traced(
            &format!(
                "±{} m east, ±{} m north, ±{} m height",
                number(east_m, 0),
                number(north_m, 0),
                number(up_m, 1)
            ),
            &format!("{HEIGHTS}/mean_sigma_m/0 {HEIGHTS}/mean_sigma_m/1 {HEIGHTS}/mean_sigma_m/2"),
        ),
        note: html! {
            @if is_open(&geometric, &adjustment) {
                "from " (by) "; open points: see Accuracy"
            } @else {
                "position from " (by) ", height from " (site.config.terms().altimeter)
            }
            (untested_attitude(site))
        },
    })
}

/// A clause where nothing tests an attitude error that all images share.
fn untested_attitude(site: &SiteProducts) -> String {
    let mut checks = site.verdict.checks.iter();
    if checks.any(|check| check.kind == CheckKind::BeamAcross) {
        String::new()
    } else {
        format!("; {NO_BEAM}")
    }
}

/// Ranges, if there are profiles.
fn by_ranges(site: &SiteProducts) -> Option<KeyNumber> {
    let (check, mean_m, place) = checked(site, CheckKind::RangeMean)?;
    let profile = &check.subject;
    Some(KeyNumber {
        what: "Range − distance".into(),
        value: traced(&format!("{} m", signed(mean_m, 2)), &place),
        note: match site.profiles.len() {
            1 => html! { "mean of profile " (profile) },
            count => {
                let profiles = counted(count, "profile");
                let profiles = traced(&profiles, "manifest.json#/counts/profiles");
                html! { "largest mean of " (profiles) ", " (profile) }
            }
        },
    })
}

/// As many sentences as keep the verdict on one screen; the manifest has all.
fn first_of(sentences: &[String]) -> Markup {
    let shown = &sentences[..sentences.len().min(REASONS_SHOWN)];
    let more = sentences.len() - shown.len();
    html! {
        (list(shown))
        @if more > 0 { p { "And " (more) " more; ../manifest.json lists all." } }
    }
}
