//! The page of an archive: the worst profiles first, then ranges over time, over off-nadir angle and on a map.

mod worst;

use self::worst::worst_profiles;
use super::{
    html::{
        Cell, Column, Markup, Section, Table, Tone, counted, html, list, page, paragraph, verdict,
    },
    plots::{Extent, GREY, Panel, Plot, Series, Style, figure, label, thinned},
};
use areograph_base::{
    error::Result,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY},
};
use areograph_products::WorstProfile;
use areograph_stages::{
    check_archive::{ArchiveProfile, ArchiveRanges, TRAJECTORY_TOLERANCE_M},
    judge::Verdict as Judgement,
};

/// Profiles that are drawn over time.
const PROFILES_DRAWN: usize = 3_000;
/// Places that are drawn on the map.
const PLACES_DRAWN: usize = 4_000;
/// Number of listed files with problems, and of failures.
const LISTED: usize = 30;
/// Corrections with larger uncertainty than this are not drawn, seconds.
const KNOWN_S: f64 = 0.05;

/// The page of an archive; paths of shots are relative to the folder of the products, one above the page.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn archive_page(
    ranges: &ArchiveRanges,
    worst: &[WorstProfile<'_>],
    judgement: &Judgement,
) -> Result<String> {
    let sections = [
        Section::new("Worst profiles", worst_profiles(ranges, worst)),
        Section::new("Over time", over_time(ranges)?),
        Section::new("Over off-nadir angle", over_off_nadir(ranges)?),
        Section::new("Map", map(ranges, worst)?),
        Section::new("Not checked", not_checked(ranges)),
        Section::new("How it was made", how(ranges)),
    ];
    let lead = lead(ranges, judgement);
    Ok(page("Ranges of the archive", &lead, &sections))
}

fn lead(ranges: &ArchiveRanges, judgement: &Judgement) -> Markup {
    let (tone, word) = Tone::of(judgement.valid, !judgement.remarks.is_empty());
    let beyond = ranges.profiles();
    let beyond = beyond
        .filter(|profile| !profile.invalid_because.is_empty())
        .count();
    let headline = format!(
        "{word}: {} in {}, {beyond} beyond the limits.",
        counted(ranges.profiles().count(), "profile"),
        counted(ranges.files.len(), "file"),
    );
    let words = format!(
        "{} shots were checked: measured range minus distance from the spacecraft (kernels) to the footprint, with time \
         tags corrected by {} s. A profile consists of the shots of one file in one revolution.",
        grouped(ranges.sum(|file| file.shots)),
        label(ranges.clock.correction_s(), 3),
    );
    let body = html! { p { (words) } (list(&judgement.reasons)) (list(&judgement.remarks)) };
    verdict(tone, &headline, &body)
}

/// A count with thin spaces between thousands.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut grouped = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// A figure of a profile.
type Figure = fn(&ArchiveProfile) -> f64;

fn over_time(ranges: &ArchiveRanges) -> Result<Markup> {
    let checked: Vec<&ArchiveProfile> = ranges
        .profiles()
        .filter(|profile| profile.is_judged())
        .collect();
    let Some(first) = checked.first() else {
        return Ok(paragraph("No profile was checked."));
    };
    let start_s = first.start_et_s;
    let drawn = |keep: &dyn Fn(&ArchiveProfile) -> bool, figure: Figure| -> Vec<(f64, f64)> {
        let kept = checked.iter().filter(|of| keep(of));
        let points: Vec<(f64, f64)> = kept
            .map(|of| ((of.start_et_s - start_s) / SECONDS_PER_DAY, figure(of)))
            .collect();
        thinned(&points, PROFILES_DRAWN)
    };
    let within = |of: &ArchiveProfile| of.invalid_because.is_empty();
    let beyond = |of: &ArchiveProfile| !of.invalid_because.is_empty();
    let panel = |y_label: &'static str, figure: Figure, limit: Option<f64>| {
        let series = vec![
            Series::dots("within the limits", 0, drawn(&within, figure)),
            Series {
                style: Style::Crosses,
                ..Series::dots("beyond a limit", 0, drawn(&beyond, figure))
            },
        ];
        Panel {
            limits: limit.map_or_else(Vec::new, |limit| vec![-limit, limit]),
            height: 300,
            ..Panel::of(y_label, series)
        }
    };
    let limits = &ranges.limits;
    let thinning = match checked.len().div_ceil(PROFILES_DRAWN) {
        0 | 1 => String::new(),
        every => format!(" 1 profile in {every} is drawn."),
    };
    let ranges_plot = Plot::of(
        "Ranges over time".to_owned(),
        "Mean (without outliers) and robust spread (NMAD) of range − distance for every profile. Dashed: limits."
            .to_owned()
            + &thinning,
        "days since the first profile",
        vec![
            panel("mean, m", |of| of.mean_without_outliers_m, Some(limits.mean_max_m)),
            panel("NMAD, m", |of| of.range_minus_distance_m.nmad, None),
        ],
    );
    let orbits_plot = Plot::of(
        "Orbits over time".to_owned(),
        "Mean difference of spacecraft positions, file minus kernels.".to_owned(),
        "days since the first profile",
        vec![
            panel("up, m", |of| of.spacecraft_m[0], Some(limits.orbit_max_m)),
            panel(
                "along, m",
                |of| of.spacecraft_m[1],
                Some(limits.orbit_max_m),
            ),
            panel(
                "across, m",
                |of| of.spacecraft_m[2],
                Some(limits.orbit_max_m),
            ),
        ],
    );
    let known = |of: &ArchiveProfile| of.correction_uncertainty_s.is_some_and(|s| s < KNOWN_S);
    let scan = drawn(&known, |of| of.best_correction_s.unwrap_or(f64::NAN));
    let used_s = ranges.clock.correction_s();
    let scan_plot = Plot::of(
        "Clock correction over time".to_owned(),
        format!(
            "Time-tag correction that minimises the spread of range − distance of a profile, with raw or \
             crossover-corrected radii; drawn where the uncertainty is below {KNOWN_S} s. The horizontal line is the \
             correction used, {} s.",
            label(used_s, 3)
        ),
        "days since the first profile",
        vec![Panel {
            limits: vec![used_s],
            ..Panel::of(
                "correction, s",
                vec![Series::dots("best correction", 2, scan)],
            )
        }],
    );
    Ok(html! {
        div.plots { (figure(&ranges_plot)?) (figure(&orbits_plot)?) (figure(&scan_plot)?) }
    })
}

fn over_off_nadir(ranges: &ArchiveRanges) -> Result<Markup> {
    let mut table = Table::new(
        "Range − distance by off-nadir angle: profiles within the limits, without outliers",
        &[
            Column::Text("off nadir"),
            Column::Number("shots"),
            Column::Number("mean, m"),
            Column::Number("std, m"),
        ],
    );
    for bin in ranges.off_nadir().iter().filter(|bin| bin.shots > 0) {
        let angles = if bin.to_deg.is_finite() {
            format!("{}° to {}°", bin.from_deg, bin.to_deg)
        } else {
            format!("{}° and more", bin.from_deg)
        };
        let figures = bin.mean_and_deviation_m();
        let figure = |place: usize| figures.map_or_else(String::new, |of| label(of[place], 3));
        let cells: [Cell; 4] = [
            angles.into(),
            grouped(bin.shots).into(),
            figure(0).into(),
            figure(1).into(),
        ];
        table.row(true, cells);
    }
    let points = |beyond: bool| -> Vec<(f64, f64)> {
        let checked = ranges.profiles().filter(|profile| profile.is_judged());
        let points: Vec<(f64, f64)> = checked
            .filter(|profile| profile.invalid_because.is_empty() != beyond)
            .map(|profile| {
                let off_nadir_deg = profile.off_nadir_rad[0] / RADIANS_PER_DEGREE;
                (off_nadir_deg, profile.mean_without_outliers_m)
            })
            .collect();
        thinned(&points, PROFILES_DRAWN)
    };
    let plot = Plot::of(
        "Profiles by off-nadir angle".to_owned(),
        "Mean of range − distance without outliers against the mean off-nadir angle of each profile.".to_owned(),
        "off nadir, degrees",
        vec![Panel::of(
            "mean, m",
            vec![
                Series::dots("within the limits", 0, points(false)),
                Series {
                    style: Style::Crosses,
                    ..Series::dots("beyond a limit", 0, points(true))
                },
            ],
        )],
    );
    Ok(html! { (table.finish()) div.plots { (figure(&plot)?) } })
}

fn map(ranges: &ArchiveRanges, worst: &[WorstProfile<'_>]) -> Result<Markup> {
    let places = |of: &ArchiveProfile| {
        of.places_deg
            .iter()
            .map(|[x, y]| (*x, *y))
            .collect::<Vec<_>>()
    };
    let all: Vec<(f64, f64)> = ranges.profiles().flat_map(places).collect();
    let bad: Vec<(f64, f64)> = worst
        .iter()
        .filter(|of| !of.profile.invalid_because.is_empty())
        .flat_map(|of| places(of.profile))
        .collect();
    let mut plot = Plot::of(
        "Locations of the profiles".to_owned(),
        "Some shots of every profile, IAU 2000, areocentric; crosses mark the worst profiles beyond a \
         limit.".to_owned(),
        "east longitude, degrees",
        vec![Panel::of(
            "latitude, degrees",
            vec![
                Series::dots("profiles", GREY, thinned(&all, PLACES_DRAWN)),
                Series {
                    style: Style::Crosses,
                    ..Series::dots("worst profiles", 0, bad)
                },
            ],
        )],
    );
    plot.x = Extent {
        low: 0.0,
        high: 360.0,
    };
    plot.panels[0].y = Extent {
        low: -90.0,
        high: 90.0,
    };
    Ok(html! { div.plots { (figure(&plot)?) } })
}

fn not_checked(ranges: &ArchiveRanges) -> Markup {
    let [without, partly] = ranges.not_covered();
    let coverage = if without + partly == 0 {
        "The kernels contain a position for every shot.".to_owned()
    } else {
        format!(
            "The kernels contain no position for {} shots: {without} profiles could not be checked, and {partly} only \
             in part. Column not_covered of profiles.parquet counts these shots.",
            grouped(ranges.sum(|file| file.not_covered))
        )
    };
    let complaints = ranges
        .files
        .iter()
        .map(|file| &file.found)
        .filter(|found| found.complaint_count > 0)
        .take(LISTED);
    let complaints: Vec<_> = complaints.collect();
    let mut rejected = std::collections::BTreeMap::new();
    for (reason, count) in ranges.files.iter().flat_map(|file| &file.found.rejected) {
        *rejected.entry(reason.to_string()).or_insert(0) += count;
    }
    let rejected: Vec<String> = rejected
        .iter()
        .map(|(reason, count)| format!("{reason}: {}", grouped(*count)))
        .collect();
    html! {
        p { (coverage) }
        @if !ranges.failures.is_empty() {
            p { "Files that could not be read, or read again (" (ranges.failures.len()) "):" }
            ul {
                @for failure in ranges.failures.iter().take(LISTED) { li { (failure.file) ": " (failure.why) } }
            }
        }
        @if !complaints.is_empty() {
            p { "Records that are inconsistent internally or with neighbours were rejected:" }
            ul {
                @for found in complaints {
                    li {
                        (found.complaint_count) " problems, the first: "
                        (found.complaints.first().map_or("", String::as_str))
                    }
                }
            }
        }
        @if !rejected.is_empty() { p { "Shots rejected by the filter: " (rejected.join(", ")) "." } }
    }
}

fn how(ranges: &ArchiveRanges) -> Markup {
    let positions = format!(
        "Positions are interpolated with Chebyshev polynomials to within {TRAJECTORY_TOLERANCE_M} m of CSPICE; the \
         largest difference at independent instants was {:.1e} m. States are geometric.",
        ranges.trajectory_error_m()
    );
    let clock = format!(
        "Time tags are corrected by {} s ({}).",
        label(ranges.clock.correction_s(), 3),
        ranges.clock.source
    );
    html! { p { (positions) } p { (clock) } p { "Kernels:" }
        ul {
            @for kernel in &ranges.kernels {
                li { (kernel.name) " (" (kernel.role) "), BLAKE3 " (short(&kernel.blake3)) "…" }
            }
        }
    }
}

fn short(hash: &str) -> &str {
    hash.get(..16).unwrap_or(hash)
}
