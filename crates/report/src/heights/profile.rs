//! Heights from south to north: the MOLA surface with its uncertainty, and tie points before and after.

use super::super::many;
use super::super::plots::{Extent, Panel, Plot, Series, Style, label, thinned};
use areograph_base::units::METRES_PER_KM;
use areograph_geom::{ellipsoid::local_axes, statistics::Summary};
use areograph_products::{GeometricProducts, SiteProducts};
use areograph_stages::check_heights::{HeightCheck, TieHeight};

/// Number of tie points drawn, and number for a site of many images.
const POINTS_SHOWN: usize = 400;
const POINTS_OF_MANY: usize = 200;
/// One value in this many may be beyond each end of the axis of differences.
const OUTERMOST: usize = 60;
/// Colours of the surface, of points before and after.
const SURFACE: usize = super::super::plots::GREY;
const BEFORE: usize = 1;
const AFTER: usize = 0;

/// Heights above the ellipsoid, and below them above the surface.
pub(super) fn plot(site: &SiteProducts, geometric: &GeometricProducts) -> Plot {
    let points_shown = if many::are_many(site) {
        POINTS_OF_MANY
    } else {
        POINTS_SHOWN
    };
    let altimeter = site.config.terms().altimeter;
    let after = geometric.adjustment.map(|adjustment| adjustment.heights);
    // The surface is drawn below the points that it controls.
    let latest = after.unwrap_or(geometric.heights);
    let axes = middle_axes(geometric.heights);
    let north_km = |tie: &TieHeight| axes.row(1).transpose().dot(&tie.ground.xyz_m) / METRES_PER_KM;
    let points = |check: &HeightCheck, value: fn(&TieHeight) -> f64| -> Vec<(f64, f64)> {
        let ties = thinned(&check.ties, points_shown);
        ties.iter().map(|tie| (north_km(tie), value(tie))).collect()
    };
    let states = || {
        let before = ("before the adjustment", BEFORE, geometric.heights);
        let after = after.map(|check| ("after the adjustment", AFTER, check));
        [before].into_iter().chain(after)
    };
    let dots = |value: fn(&TieHeight) -> f64| -> Vec<Series> {
        let each = states().map(|(label, colour, check)| Series {
            style: Style::Dots,
            ..Series::line(label, colour, points(check, value))
        });
        each.collect()
    };
    let bars = |ends: [fn(&TieHeight) -> f64; 2]| Series {
        style: Style::Bars,
        ..Series::line(format!("{altimeter} surface ± 1 σ"), SURFACE, {
            let [low, high] = ends.map(|value| points(latest, value));
            low.into_iter().zip(high).flat_map(<[_; 2]>::from).collect()
        })
    };
    let mut heights = vec![bars([
        |tie| tie.surface_m - tie.surface_sigma_m,
        |tie| tie.surface_m + tie.surface_sigma_m,
    ])];
    heights.extend(dots(|tie| tie.height_m));
    let mut differences = vec![bars([
        |tie| -tie.surface_sigma_m,
        |tie| tie.surface_sigma_m,
    ])];
    differences.extend(dots(TieHeight::above_m));
    let panels = vec![
        Panel::of("above the ellipsoid, m", heights),
        Panel {
            height: 300,
            y: without_extremes(&differences),
            ..Panel::of("above the surface, m", differences)
        },
    ];
    let title = format!("Heights of tie points and of the {altimeter} surface");
    Plot::of(
        title,
        words(geometric, altimeter, points_shown),
        "north of the middle, km",
        panels,
    )
}

/// An axis for all except the outermost values, which are drawn at its edge.
fn without_extremes(series: &[Series]) -> Extent {
    let mut values: Vec<f64> = series
        .iter()
        .flat_map(|line| line.points.iter().map(|point| point.1))
        .collect();
    values.sort_unstable_by(f64::total_cmp);
    let outermost = values.len() / OUTERMOST;
    Extent::of(values[outermost..values.len() - outermost].iter().copied())
}

fn words(geometric: &GeometricProducts, altimeter: &str, points_shown: usize) -> String {
    let after = geometric.adjustment.map(|adjustment| adjustment.heights);
    let median = |check: &HeightCheck| label(check.above_m.median, 1);
    let sigmas: Vec<f64> = geometric
        .heights
        .ties
        .iter()
        .map(|tie| tie.surface_sigma_m)
        .collect();
    let medians = after.map_or_else(
        || format!("median {} m", median(geometric.heights)),
        |after| {
            format!(
                "median {} m before, {} m after",
                median(geometric.heights),
                median(after)
            )
        },
    );
    let all = geometric.heights.ties.len();
    let thinned = if all > points_shown {
        format!(" 1 in {} is drawn.", all.div_ceil(points_shown))
    } else {
        String::new()
    };
    format!(
        "Top: heights of tie points above the ellipsoid, south to north. Bottom: heights above the {altimeter} surface, \
         {medians}. Grey: surface ± 1 σ (median {} m).{thinned}",
        label(Summary::of(&sigmas).median, 1)
    )
}

/// East, north and up in the middle of the tie points.
fn middle_axes(check: &HeightCheck) -> nalgebra::Matrix3<f64> {
    let places = check.ties.iter().map(|tie| tie.ground.xyz_m);
    let middle_m = places.fold(nalgebra::Vector3::zeros(), |sum, place| sum + place);
    local_axes(&middle_m)
}
