//! Residuals along the profiles, figure 2 of Shan et al. 2005: of every profile, or of all together and the worst
//! separately.

use super::{
    super::{
        html::{Markup, counted, html},
        numbers::whole,
        plots::{Extent, Panel, Plot, Series, Style, figure, label, thinned},
    },
    metres,
};
use areograph_base::{error::Result, units::RADIANS_PER_DEGREE};
use areograph_products::SiteProducts;
use areograph_stages::check_ranges::ProfileRanges;

/// Largest number of points of all residual plots; each is drawn twice and listed once, about 300 bytes.
const RESIDUAL_POINTS: usize = 5_000;
/// Largest number of points of one profile, about one per pixel of the plot's width.
const PROFILE_POINTS: usize = 500;
/// Number of profiles up to which each has a plot.
const PROFILES_ALONE: usize = 12;
/// With more profiles, only this number have a plot: the ones with the largest means.
const WORST: usize = 6;

/// Whether a site has too many profiles for a plot and a row each.
pub(crate) fn many(site: &SiteProducts) -> bool {
    site.profiles.len() > PROFILES_ALONE
}

/// Profiles with separate plots, by index, in order.
pub(crate) fn plotted(site: &SiteProducts) -> Vec<usize> {
    let measured = |index: &usize| site.ranges.profiles[*index].measured() > 0;
    let mut indices: Vec<usize> = (0..site.profiles.len()).filter(measured).collect();
    if many(site) {
        let mean_m = |index: &usize| site.ranges.profiles[*index].mean_without_outliers_m.abs();
        indices.sort_by(|one, other| mean_m(other).total_cmp(&mean_m(one)));
        indices.truncate(WORST);
        indices.sort_unstable();
    }
    indices
}

/// The plots.
///
/// # Errors
/// A plot that cannot be drawn.
pub(super) fn figures(site: &SiteProducts) -> Result<Markup> {
    let plotted = plotted(site);
    let limit = (RESIDUAL_POINTS / plotted.len().max(1)).clamp(20, PROFILE_POINTS);
    Ok(html! {
        @if many(site) { (figure(&all_profiles(site))?) }
        @for index in plotted { (figure(&profile_plot(site, index, limit))?) }
    })
}

/// Mean and spread of every profile.
fn all_profiles(site: &SiteProducts) -> Plot {
    let profiles = || {
        let numbered = (1_u32..).zip(&site.ranges.profiles);
        numbered.filter(|(_, of)| of.measured() > 0)
    };
    let means = profiles().map(|(number, of)| (f64::from(number), of.mean_without_outliers_m));
    let spreads = profiles().flat_map(|(number, of)| {
        let (mean_m, spread_m) = (of.mean_without_outliers_m, of.range_minus_distance_m.nmad);
        [-1.0, 1.0].map(|side| (f64::from(number), mean_m + side * spread_m))
    });
    let series = vec![
        Series {
            style: Style::Bars,
            ..Series::line("mean ± NMAD", 0, spreads.collect())
        },
        Series::dots("mean without outliers", 0, means.collect()),
    ];
    let mean_max_m = site.config.range_check.mean_max_m;
    let panel = Panel {
        limits: vec![-mean_max_m, mean_max_m],
        ..Panel::of("range − distance, m", series)
    };
    let caption = format!(
        "{} profiles in the order of the tables, means from {} to {} m. The {WORST} with the largest absolute means \
         are shown separately.",
        whole(site.profiles.len()),
        metres(extreme(site, f64::min)),
        metres(extreme(site, f64::max))
    );
    let title = "Range − distance of all profiles".to_owned();
    Plot::of(title, caption, "profile", vec![panel])
}

/// The smallest or largest mean.
fn extreme(site: &SiteProducts, of: fn(f64, f64) -> f64) -> f64 {
    let profiles = site.ranges.profiles.iter();
    let measured = profiles.filter(|ranges| ranges.measured() > 0);
    let means = measured.map(|ranges| ranges.mean_without_outliers_m);
    means.reduce(of).unwrap_or_default()
}

/// Residuals along one profile, the off-nadir angle below.
fn profile_plot(site: &SiteProducts, index: usize, limit: usize) -> Plot {
    let ranges = &site.ranges.profiles[index];
    let title = format!("Range − distance along {}", ranges.profile);
    let before = site.ranges.profiles[..index].iter();
    let shots = Shots::of(site, index, before.map(ProfileRanges::measured).sum());
    let mut panel = Panel::of(
        "range − distance, m",
        vec![Series::dots("shots", 0, thinned(&shots.kept, limit))],
    );
    panel.histogram = true;
    let mean_max_m = site.config.range_check.mean_max_m;
    panel.limits = vec![-mean_max_m, mean_max_m];
    if !shots.trend.is_empty() {
        panel.series.push(Series::line("trend", 1, shots.trend));
    }
    if !shots.outliers.is_empty() {
        panel.series.push(Series {
            label: "outliers (beyond the axes: drawn at the edge)".to_owned(),
            style: Style::Crosses,
            colour: 0,
            points: thinned(&shots.outliers, limit),
        });
    }
    let limits_seen = panel
        .limits
        .iter()
        .any(|limit| panel.y.low < *limit && *limit < panel.y.high);
    let angles = Series::dots("shots", 0, thinned(&shots.off_nadir_deg, limit));
    let from_zero = Extent::of(angles.points.iter().map(|shot| shot.1).chain([0.0]));
    let angle_panel = Panel {
        height: 190,
        y: Extent {
            low: 0.0,
            high: from_zero.high.max(OFF_NADIR_LEAST_DEG),
        },
        least: NADIR_DEG,
        ..Panel::of("off nadir, °", vec![angles])
    };
    let mut caption = words(ranges);
    let within = ranges.mean_without_outliers_m.abs() <= mean_max_m;
    caption += &match (limits_seen, within) {
        (true, _) => format!(" Dashed: the limit of the mean, ±{mean_max_m} m."),
        (false, true) => format!(" The mean is within its limit, ±{mean_max_m} m."),
        (false, false) => format!(" The mean is beyond its limit, ±{mean_max_m} m."),
    };
    if shots.kept.len() > limit {
        caption += &format!(" 1 shot in {} is drawn.", shots.kept.len().div_ceil(limit));
    }
    let x = "seconds from the start of the profile";
    Plot::of(title, caption, x, vec![panel, angle_panel])
}

/// Profiles with smaller off-nadir angles than this have no axis of them.
const NADIR_DEG: f64 = 0.05;
/// Least upper end of the axis of off-nadir angles.
const OFF_NADIR_LEAST_DEG: f64 = 1.0;

/// Contents of the plot of one profile.
fn words(ranges: &ProfileRanges) -> String {
    let main = &ranges.range_minus_distance_m;
    let trend = ranges.trend_m_s.map_or_else(String::new, |trend| {
        format!(
            ", trend {} ± {} mm/s",
            label(1e3 * trend.slope, 2),
            label(1e3 * trend.uncertainty, 2)
        )
    });
    format!(
        "{}: mean {} m, σ {} m{trend}; {}.",
        counted(main.n as usize, "shot"),
        metres(main.mean),
        metres(main.standard_deviation),
        counted(ranges.outliers as usize, "outlier")
    )
}

/// Points of one profile over seconds from its start.
struct Shots {
    kept: Vec<(f64, f64)>,
    outliers: Vec<(f64, f64)>,
    off_nadir_deg: Vec<(f64, f64)>,
    /// Ends of the trend line.
    trend: Vec<(f64, f64)>,
}

impl Shots {
    /// The plot of profile `index`, whose shots begin at `first`.
    fn of(site: &SiteProducts, index: usize, first: usize) -> Self {
        let (profile, all) = (&site.profiles[index], &site.ranges.shots);
        let start_s = profile.interval.start.seconds();
        let mut shots = Self {
            kept: Vec::new(),
            outliers: Vec::new(),
            off_nadir_deg: Vec::new(),
            trend: Vec::new(),
        };
        for shot in first..first + site.ranges.profiles[index].measured() {
            let row = all.row.at(shot) as usize;
            let seconds = site.footprints.et_s.at(row) - start_s;
            let residual = (seconds, all.range_minus_distance_m.at(shot));
            if all.outlier.at(shot) {
                shots.outliers.push(residual);
            } else {
                shots.kept.push(residual);
            }
            let angle_deg = site.footprints.off_nadir_rad.at(row) / RADIANS_PER_DEGREE;
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
