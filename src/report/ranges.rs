//! The range check: Table 3 and figure 2 of Shan et al. 2005, and the residuals beside them.

use super::{
    html::{Cell, Column, Table, heading, list, paragraph},
    plots::{Extent, Panel, Plot, Series, Style, figure, label, thinned},
    section::Section,
};
use crate::{
    error::Result, products::SiteProducts, stages::check_ranges::ProfileRanges,
    units::RADIANS_PER_DEGREE,
};

/// Points of all residual plots together; each is drawn twice and listed once, about 300 bytes.
const RESIDUAL_POINTS: usize = 5_000;
/// Most points of one profile, about one per pixel of the plot's width.
const PROFILE_POINTS: usize = 500;
/// Up to so many profiles have a plot each; more share plots in groups of so many.
pub(super) const PROFILES_APART: usize = 12;

pub(super) const SECTION: Section = Section {
    title: "Range check",
    anchor: "range-check",
    appears: |site| !site.config.pedr.files.is_empty(),
    write,
};

fn write(site: &SiteProducts) -> Result<String> {
    if site.profiles.is_empty() {
        return Ok(paragraph("No profile."));
    }
    let figures = figures(site)?;
    Ok([
        statistics(site),
        three_ways(site),
        heading("Along the profiles"),
        format!("<div class=\"plots\">\n{figures}</div>\n"),
    ]
    .concat())
}

/// Millimetres are enough for ranges that come in centimetres.
pub(super) fn metres(value: f64) -> String {
    label(value, 3)
}

fn statistics(site: &SiteProducts) -> String {
    let limits = &site.config.range_check;
    let mut table = Table::new(
        "Range − distance per profile (Table 3 of Shan et al. 2005), metres",
        &[
            Column::Text("profile"),
            Column::Number("n"),
            Column::Number("mean"),
            Column::Number("std"),
            Column::Number("median"),
            Column::Number("NMAD"),
            Column::Number("min"),
            Column::Number("max"),
            Column::Number("outliers"),
            Column::Number("trend, mm/s"),
            Column::Text("simultaneous images"),
            Column::Text("verdict"),
        ],
    );
    for (profile, ranges) in site.profiles.iter().zip(&site.ranges.profiles) {
        let main = &ranges.range_minus_distance_m;
        let shots_share = f64::from(limits.shots_min) / f64::from(main.n.max(1));
        let outlier_share = f64::from(ranges.outliers) / f64::from(main.n.max(1));
        let images: Vec<String> = profile
            .simultaneous
            .iter()
            .filter_map(|of| {
                let image = site.images.get(of.image)?;
                Some(format!("{} ({} shots)", image.times.id, of.shots))
            })
            .collect();
        let valid = ranges.invalid_because.is_empty();
        table.row(
            valid,
            [
                (&profile.id).into(),
                Cell::Limited(main.n.to_string(), shots_share),
                Cell::Limited(metres(main.mean), main.mean.abs() / limits.mean_max_m),
                metres(main.standard_deviation).into(),
                metres(main.median).into(),
                metres(main.nmad).into(),
                metres(main.min).into(),
                metres(main.max).into(),
                Cell::Limited(
                    ranges.outliers.to_string(),
                    used_share(outlier_share, limits.outlier_share_max),
                ),
                trend(ranges).into(),
                dash_for_none(images.join(", ")).into(),
                if valid { "valid" } else { "invalid" }.into(),
            ],
        );
    }
    let words = format!(
        "Valid: at least {} shots, mean within ±{} m, at most {} % outliers (beyond {} robust standard deviations of \
         the median). The bar below a figure shows how much of its limit it uses.",
        limits.shots_min,
        limits.mean_max_m,
        100.0 * limits.outlier_share_max,
        limits.outlier_sigma
    );
    table.finish() + &paragraph(&words)
}

/// Share of a limit that may be 0: then nothing of it is used by 0, and all is beyond otherwise.
fn used_share(value: f64, limit: f64) -> f64 {
    if value <= 0.0 { 0.0 } else { value / limit }
}

fn dash_for_none(text: String) -> String {
    if text.is_empty() {
        "–".to_owned()
    } else {
        text
    }
}

fn trend(ranges: &ProfileRanges) -> String {
    ranges.trend_m_s.map_or_else(
        || "–".to_owned(),
        |trend| format!("{:.2} ± {:.2}", 1e3 * trend.slope, 1e3 * trend.uncertainty),
    )
}

fn three_ways(site: &SiteProducts) -> String {
    let limits = &site.config.range_check;
    let mut table = Table::new(
        "The three ways to check a range, means in metres",
        &[
            Column::Text("profile"),
            Column::Number("range − distance, kernels"),
            Column::Number("without outliers"),
            Column::Number("with crossover radius"),
            Column::Number("range − distance, PEDR's own orbit"),
            Column::Number("without outliers"),
            Column::Number("PEDR − kernels, radial"),
            Column::Number("along"),
            Column::Number("cross"),
        ],
    );
    for ranges in &site.ranges.profiles {
        let mean_m = ranges.mean_without_outliers_m;
        let decoding_m = ranges.decoding_without_outliers_m;
        let [radial, along, cross] =
            [0, 1, 2].map(|axis| metres(ranges.spacecraft_m[axis].mean).into());
        table.row(
            true,
            [
                (&ranges.profile).into(),
                metres(ranges.range_minus_distance_m.mean).into(),
                Cell::Limited(metres(mean_m), mean_m.abs() / limits.mean_max_m),
                metres(ranges.range_minus_distance_crossover_m.mean).into(),
                metres(ranges.decoding_m.mean).into(),
                Cell::Limited(metres(decoding_m), decoding_m.abs() / limits.decoding_max_m),
                radial,
                along,
                cross,
            ],
        );
    }
    let words = [
        "Without outliers: a single wrong record does not decide the verdict on all others; limits hold for these means."
            .to_owned(),
        "Range − distance with the kernels' spacecraft: what remains between laser, footprint and trajectory; the \
         paper's figure."
            .to_owned(),
        "With the crossover radius: the same after the MOLA team's crossover adjustment, which moves the footprint and \
         not the range."
            .to_owned(),
        format!(
            "Range − distance with the spacecraft of the PEDR file: no kernel is involved, so anything beyond ±{} m \
             means that the file was read wrongly.",
            limits.decoding_max_m
        ),
        format!(
            "PEDR − kernels: the file's spacecraft minus the kernels', radial, along the flight and across it: what \
             the choice of orbit changes. Beyond {} m in all they are not of one orbit, clock and datum. The tabulated \
             trajectory is within {:.1e} m of the kernels.",
            limits.orbit_max_m, site.ranges.trajectory_error_m
        ),
    ];
    table.finish() + &list(&words)
}

/// Profiles by index, one per plot or, when there are many, several.
pub(super) fn groups(site: &SiteProducts) -> Vec<std::ops::Range<usize>> {
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

/// How a plot of these profiles is called.
pub(super) fn group_title(site: &SiteProducts, group: &std::ops::Range<usize>) -> String {
    let first = &site.profiles[group.start].id;
    if group.len() == 1 {
        return first.clone();
    }
    format!("{first} to {}", site.profiles[group.end - 1].id)
}

fn figures(site: &SiteProducts) -> Result<String> {
    let limit = (RESIDUAL_POINTS / site.profiles.len()).clamp(20, PROFILE_POINTS);
    let plots = groups(site)
        .into_iter()
        .map(|group| figure(&profile_plot(site, group, limit)));
    plots.collect()
}

/// Figure 2 of the paper: residuals along the profile, the off-nadir angle below.
fn profile_plot(site: &SiteProducts, group: std::ops::Range<usize>, limit: usize) -> Plot {
    let title = format!("Range − distance along {}", group_title(site, &group));
    let mut first: usize = site.profiles[..group.start]
        .iter()
        .map(|profile| profile.rows.len())
        .sum();
    let (mut residuals, mut angles, mut outliers, mut trends) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut thinned_out = false;
    let apart = group.len() == 1;
    for (colour, index) in group.clone().enumerate() {
        let shots = Shots::of(site, index, first);
        first += site.profiles[index].rows.len();
        thinned_out |= shots.kept.len() > limit;
        let label = if apart { "shots" } else { &*shots.id };
        residuals.push(dots(label, colour, thinned(&shots.kept, limit)));
        angles.push(dots(label, colour, thinned(&shots.off_nadir_deg, limit)));
        outliers.extend(shots.outliers);
        trends.extend(shots.trend);
    }
    let mut panel = Panel::of("range − distance, m", residuals);
    panel.histogram = true;
    let mean_max_m = site.config.range_check.mean_max_m;
    panel.limits = vec![-mean_max_m, mean_max_m];
    if apart && !trends.is_empty() {
        panel.series.push(Series::line("trend", 1, trends));
    }
    if !outliers.is_empty() {
        panel.series.push(Series {
            label: "outliers, at the edge when beyond it".to_owned(),
            style: Style::Crosses,
            colour: 0,
            points: thinned(&outliers, limit),
        });
    }
    let limits_seen = panel
        .limits
        .iter()
        .any(|limit| panel.y.low < *limit && *limit < panel.y.high);
    let mut angle_panel = Panel::of("off nadir, deg", angles);
    angle_panel.height = 190;
    angle_panel.y = Extent {
        low: angle_panel.y.low.max(0.0),
        ..angle_panel.y
    };
    let mut caption = if apart {
        words(&site.ranges.profiles[group.start])
    } else {
        together(&site.ranges.profiles[group])
    };
    caption += " Bars: how many shots lie at each height.";
    caption += &if limits_seen {
        format!(" Dashed: the limit of the mean, ±{mean_max_m} m.")
    } else {
        format!(" The limit of the mean, ±{mean_max_m} m, is outside the plot.")
    };
    if thinned_out {
        caption += &format!(" At most {limit} shots of a profile are drawn, equally spaced.");
    }
    let x = "seconds from the start of the profile";
    Plot::of(title, caption, x, vec![panel, angle_panel])
}

fn dots(label: &str, colour: usize, points: Vec<(f64, f64)>) -> Series {
    Series {
        label: label.to_owned(),
        style: Style::Dots,
        colour,
        points,
    }
}

/// What the plot of one profile shows.
fn words(ranges: &ProfileRanges) -> String {
    let main = &ranges.range_minus_distance_m;
    let trend = ranges.trend_m_s.map_or_else(String::new, |trend| {
        format!(
            ", trend {:.2} ± {:.2} mm/s",
            1e3 * trend.slope,
            1e3 * trend.uncertainty
        )
    });
    format!(
        "{} shots: mean {} m, standard deviation {} m{trend}; {} outliers.",
        main.n,
        metres(main.mean),
        metres(main.standard_deviation),
        ranges.outliers
    )
}

/// What a plot of several profiles shows.
fn together(profiles: &[ProfileRanges]) -> String {
    let summaries = || profiles.iter().map(|ranges| &ranges.range_minus_distance_m);
    let lowest = summaries()
        .map(|main| main.mean)
        .fold(f64::INFINITY, f64::min);
    let highest = summaries()
        .map(|main| main.mean)
        .fold(f64::NEG_INFINITY, f64::max);
    let spread = summaries()
        .map(|main| main.standard_deviation)
        .fold(0.0, f64::max);
    let outliers: u32 = profiles.iter().map(|ranges| ranges.outliers).sum();
    format!(
        "{} profiles: means from {} to {} m, standard deviations up to {} m; {outliers} outliers.",
        profiles.len(),
        metres(lowest),
        metres(highest),
        metres(spread)
    )
}

/// Points of one profile over seconds from its start.
struct Shots {
    id: String,
    kept: Vec<(f64, f64)>,
    outliers: Vec<(f64, f64)>,
    off_nadir_deg: Vec<(f64, f64)>,
    /// Ends of the trend line.
    trend: Vec<(f64, f64)>,
}

impl Shots {
    /// Of profile `index`, whose shots begin at `first`.
    fn of(site: &SiteProducts, index: usize, first: usize) -> Self {
        let (profile, all) = (&site.profiles[index], &site.ranges.shots);
        let start_s = profile.interval.start.seconds();
        let mut shots = Self {
            id: profile.id.clone(),
            kept: Vec::new(),
            outliers: Vec::new(),
            off_nadir_deg: Vec::new(),
            trend: Vec::new(),
        };
        for shot in first..first + profile.rows.len() {
            let row = all.row[shot] as usize;
            let seconds = site.footprints.et_s[row] - start_s;
            let residual = (seconds, all.range_minus_distance_m[shot]);
            if all.outlier[shot] {
                shots.outliers.push(residual);
            } else {
                shots.kept.push(residual);
            }
            let angle_deg = site.footprints.off_nadir_rad[row] / RADIANS_PER_DEGREE;
            shots.off_nadir_deg.push((seconds, angle_deg));
        }
        let ranges = &site.ranges.profiles[index];
        if let (Some(trend), Some(first), Some(last)) = (
            ranges.trend_m_s,
            shots.off_nadir_deg.first(),
            shots.off_nadir_deg.last(),
        ) {
            let mean_s = shots.off_nadir_deg.iter().map(|shot| shot.0).sum::<f64>()
                / shots.off_nadir_deg.len() as f64;
            let at = |seconds: f64| {
                let mean_m = ranges.range_minus_distance_m.mean;
                (seconds, mean_m + trend.slope * (seconds - mean_s))
            };
            shots.trend = vec![at(first.0), at(last.0)];
        }
        shots
    }
}
