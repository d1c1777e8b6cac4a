//! Tables and plots of the range check.

use super::{
    html::{Table, paragraph, section},
    plots::{Extent, Plot, Series, Style, figure, thinned},
};
use crate::{error::Result, products::SiteProducts, stages::check_ranges::BiasScan};

/// Points of all residual plots together; about 90 bytes each.
const RESIDUAL_POINTS: usize = 20_000;
/// Most points of one profile, about one per unit of the plot's width.
const PROFILE_POINTS: usize = 1_000;
/// Up to so many profiles have a plot each; more share plots in groups of so many.
pub(super) const PROFILES_APART: usize = 12;

/// Statistics per profile: Table 3 of Shan et al. 2005.
pub(super) fn profiles(site: &SiteProducts) -> String {
    if site.profiles.is_empty() {
        return section("Range check", &paragraph("No profile."));
    }
    let mut body = statistics(site);
    body += &paragraph(
        "Metres. Range residual: measured range minus distance between the spacecraft in the kernels and the footprint \
         with its raw radius (Table 3 of Shan et al. 2005).",
    );
    body += &comparison(site);
    body += &paragraph(&format!(
        "Means in metres. Crossover: range residual with the crossover-corrected radius. Decoding: range residual with \
         the spacecraft of the PEDR file. Radial, along, cross: the file's spacecraft minus the kernels'. The tabulated \
         trajectory is within {:.1e} m of the kernels.",
        site.ranges.trajectory_error_m
    ));
    section("Range check", &body)
}

fn metres(value: f64) -> String {
    format!("{value:.3}")
}

fn statistics(site: &SiteProducts) -> String {
    let heads = [
        "profile",
        "n",
        "mean",
        "std",
        "median",
        "NMAD",
        "min",
        "max",
        "outliers",
        "trend, mm/s",
        "simultaneous images",
        "verdict",
    ];
    let numbers: &'static [bool] = &[
        false, true, true, true, true, true, true, true, true, true, false, false,
    ];
    let mut table = Table::new(&heads, numbers);
    for (profile, ranges) in site.profiles.iter().zip(&site.ranges.profiles) {
        let main = &ranges.range_minus_distance_m;
        let mut cells = vec![profile.id.clone(), main.n.to_string()];
        cells.extend(
            [
                main.mean,
                main.standard_deviation,
                main.median,
                main.nmad,
                main.min,
                main.max,
            ]
            .map(metres),
        );
        cells.push(ranges.outliers.to_string());
        cells.push(ranges.trend_m_s.map_or_else(
            || "–".to_owned(),
            |trend| format!("{:.2} ± {:.2}", 1e3 * trend.slope, 1e3 * trend.uncertainty),
        ));
        let images: Vec<String> = profile
            .simultaneous
            .iter()
            .map(|image| format!("{} ({} shots)", image.image, image.shots))
            .collect();
        cells.push(if images.is_empty() {
            "–".to_owned()
        } else {
            images.join(", ")
        });
        let valid = ranges.invalid_because.is_empty();
        cells.push(if valid {
            "valid".to_owned()
        } else {
            ranges.invalid_because.join("; ")
        });
        table.row(valid, &cells);
    }
    table.finish()
}

fn comparison(site: &SiteProducts) -> String {
    let heads = [
        "profile",
        "range residual",
        "crossover",
        "decoding",
        "radial",
        "along",
        "cross",
    ];
    let mut table = Table::new(&heads, &[false, true, true, true, true, true, true]);
    for ranges in &site.ranges.profiles {
        let [radial, along, cross] = &ranges.spacecraft_m;
        let residuals = [
            &ranges.range_minus_distance_m,
            &ranges.range_minus_distance_crossover_m,
            &ranges.decoding_m,
            radial,
            along,
            cross,
        ];
        let mut cells = vec![ranges.profile.clone()];
        cells.extend(residuals.map(|summary| metres(summary.mean)));
        table.row(true, &cells);
    }
    table.finish()
}

/// Range residuals against time, outliers marked.
pub(super) fn residual_plots(site: &SiteProducts) -> Result<String> {
    if site.profiles.is_empty() {
        return Ok(String::new());
    }
    let limit = (RESIDUAL_POINTS / site.profiles.len()).clamp(20, PROFILE_POINTS);
    let mut figures = String::new();
    for group in groups(site) {
        figures += &figure(&residual_plot(site, group, limit))?;
    }
    Ok(section("Range residuals", &figures))
}

/// Profiles by index, one per plot or, when there are many, several.
fn groups(site: &SiteProducts) -> Vec<std::ops::Range<usize>> {
    let count = site.profiles.len();
    let size = if count > PROFILES_APART {
        PROFILES_APART
    } else {
        1
    };
    (0..count)
        .step_by(size)
        .map(|first| first..(first + size).min(count))
        .collect()
}

fn residual_plot(site: &SiteProducts, group: std::ops::Range<usize>, limit: usize) -> Plot {
    let shots = &site.ranges.shots;
    let mut series = Vec::new();
    let mut first: usize = site.profiles[..group.start]
        .iter()
        .map(|profile| profile.rows.len())
        .sum();
    let mut thinned_out = false;
    let mut outliers: Vec<(f64, f64)> = Vec::new();
    for (index, profile) in site.profiles[group.clone()].iter().enumerate() {
        let start_s = profile.interval.start.seconds();
        let rows = first..first + profile.rows.len();
        first = rows.end;
        let point = |shot: usize| {
            let et_s = site.footprints.et_s[shots.row[shot] as usize];
            (et_s - start_s, shots.range_minus_distance_m[shot])
        };
        let kept: Vec<(f64, f64)> = rows
            .clone()
            .filter(|shot| !shots.outlier[*shot])
            .map(point)
            .collect();
        outliers.extend(rows.filter(|shot| shots.outlier[*shot]).map(point));
        thinned_out |= kept.len() > limit;
        series.push(Series {
            label: profile.id.clone(),
            style: Style::Dots,
            colour: index,
            points: thinned(&kept, limit),
        });
    }
    let inliers = || {
        series
            .iter()
            .flat_map(|series: &Series| series.points.iter())
    };
    let y = Extent::of(inliers().map(|point| point.1));
    let x = Extent::of(inliers().chain(&outliers).map(|point| point.0));
    if !outliers.is_empty() {
        series.push(Series {
            label: "outliers, at the edge when beyond it".to_owned(),
            style: Style::Crosses,
            colour: 0,
            points: thinned(&outliers, limit),
        });
    }
    Plot {
        x_label: "seconds from the start of the profile",
        y_label: "range − distance, m",
        x,
        y,
        x_turns: false,
        height: 300,
        series,
        marks: Vec::new(),
        caption: if thinned_out {
            "Every so many shots are drawn.".to_owned()
        } else {
            String::new()
        },
    }
}

/// Spread of the residuals against the assumed clock correction.
pub(super) fn scan_plots(site: &SiteProducts) -> Result<String> {
    let configured_s = site.config.mola_clock.correction_s();
    let mut figures = String::new();
    for group in groups(site) {
        let scans: Vec<(&str, &BiasScan)> = site.ranges.profiles[group]
            .iter()
            .filter_map(|profile| Some((profile.profile.as_str(), profile.scan.as_ref()?)))
            .collect();
        if !scans.is_empty() {
            figures += &figure(&scan_plot(&scans, configured_s))?;
        }
    }
    if figures.is_empty() {
        return Ok(String::new());
    }
    let words = paragraph(
        "The correction added to the time tags at which the residuals of a profile spread least. Profiles at nadir \
         hardly tell: look at the uncertainty. The upright line is the configured correction.",
    );
    Ok(section("Clock bias scan", &(words + &figures)))
}

fn scan_plot(scans: &[(&str, &BiasScan)], configured_s: f64) -> Plot {
    let series: Vec<Series> = scans
        .iter()
        .enumerate()
        .map(|(colour, (id, scan))| Series {
            label: format!("{id}: {}", best(scan)),
            style: Style::Line,
            colour,
            points: scan
                .correction_s
                .iter()
                .copied()
                .zip(scan.spread_m.iter().copied())
                .collect(),
        })
        .collect();
    let points = || series.iter().flat_map(|series| series.points.iter());
    Plot {
        x_label: "assumed correction of the tags, s",
        y_label: "standard deviation, m",
        x: Extent::of(points().map(|point| point.0).chain([configured_s])),
        y: Extent::of(points().map(|point| point.1)),
        x_turns: false,
        height: 280,
        marks: vec![configured_s],
        caption: format!("Configured {configured_s:+.3} s."),
        series,
    }
}

fn best(scan: &BiasScan) -> String {
    match (scan.best_s, scan.uncertainty_s) {
        (Some(best_s), Some(uncertainty_s)) => format!("best {best_s:+.4} ± {uncertainty_s:.4} s"),
        (Some(best_s), None) => format!("best {best_s:+.4} s"),
        _ => "no minimum inside the scan".to_owned(),
    }
}
