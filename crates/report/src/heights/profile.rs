//! Heights from south to north: the MOLA surface with its uncertainty, and tie points before and after.

use super::super::{
    many,
    numbers::above_words,
    plots::{Extent, Panel, Plot, Series, Style, label, thinned},
};
use areograph_base::units::METRES_PER_KM;
use areograph_geom::{
    ellipsoid::{Spherical, local_axes},
    reference_surface::ReferenceSurface,
    statistics::Summary,
};
use areograph_products::{GeometricProducts, SiteProducts};
use areograph_stages::check_heights::{HeightCheck, TieHeight};

/// Number of tie points drawn, and number for a site of many images.
const POINTS_SHOWN: usize = 400;
const POINTS_OF_MANY: usize = 200;
/// One value in this many may be beyond each end of the axis of differences.
const OUTERMOST: usize = 60;
/// Largest number of shots that determine the areoid: it has six terms.
const SHOTS_OF_AREOID: usize = 20_000;
/// Colours of the surface, of points before and after.
const SURFACE: usize = super::super::plots::GREY;
const BEFORE: usize = 1;
const AFTER: usize = 0;

/// Heights above the areoid, or above the ellipsoid where the body has none, and below them above the surface.
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
    let reference = reference(site, geometric.heights);
    let height_m = |tie: &TieHeight| {
        reference.as_ref().map_or(tie.height_m, |surface| {
            let place = Spherical::from_xyz_m(&tie.ground.xyz_m);
            place.radius_m - surface.radius_m([place.longitude_rad, place.latitude.0])
        })
    };
    let surface_m = |tie: &TieHeight| height_m(tie) - tie.above_m();
    let points = |check: &HeightCheck, value: &dyn Fn(&TieHeight) -> f64| -> Vec<(f64, f64)> {
        let ties = thinned(&check.ties, points_shown);
        ties.iter().map(|tie| (north_km(tie), value(tie))).collect()
    };
    let states = || {
        let before = ("before the adjustment", BEFORE, geometric.heights);
        let after = after.map(|check| ("after the adjustment", AFTER, check));
        [before].into_iter().chain(after)
    };
    let dots = |value: &dyn Fn(&TieHeight) -> f64| -> Vec<Series> {
        let each = states().map(|(label, colour, check)| Series {
            style: Style::Dots,
            ..Series::line(label, colour, points(check, value))
        });
        each.collect()
    };
    let bars = |ends: [&dyn Fn(&TieHeight) -> f64; 2]| Series {
        style: Style::Bars,
        ..Series::line(format!("{altimeter} surface ± 1 σ"), SURFACE, {
            let [low, high] = ends.map(|value| points(latest, value));
            low.into_iter().zip(high).flat_map(<[_; 2]>::from).collect()
        })
    };
    let mut heights = vec![bars([
        &|tie| surface_m(tie) - tie.surface_sigma_m,
        &|tie| surface_m(tie) + tie.surface_sigma_m,
    ])];
    heights.extend(dots(&height_m));
    let mut differences = vec![bars([&|tie| -tie.surface_sigma_m, &|tie| {
        tie.surface_sigma_m
    }])];
    differences.extend(dots(&TieHeight::above_m));
    let terms = site.config.terms();
    let panels = vec![
        Panel::of(
            above_words(terms.has_areoid && reference.is_some()),
            heights,
        ),
        Panel {
            height: 300,
            y: without_extremes(&differences),
            ..Panel::of("above the surface, m", differences)
        },
    ];
    let title = format!("Heights of tie points and of the {altimeter} surface");
    Plot::of(
        title,
        words(geometric, altimeter, terms.areoid(), points_shown),
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

fn words(
    geometric: &GeometricProducts,
    altimeter: &str,
    areoid: &str,
    points_shown: usize,
) -> String {
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
        "Top: heights of tie points above the {areoid}, south to north. Bottom: heights above the {altimeter} surface, \
         {medians}. Grey: surface ± 1 σ (median {} m).{thinned}",
        label(Summary::of(&sigmas).median, 1)
    )
}

/// The surface from which heights of figures are counted, over the tie points.
fn reference(site: &SiteProducts, check: &HeightCheck) -> Option<ReferenceSurface> {
    let footprints = site.footprints;
    let step = footprints.len().div_ceil(SHOTS_OF_AREOID).max(1);
    let shots = (0..footprints.len()).step_by(step).map(|row| {
        let place_rad = [&footprints.longitude_rad, &footprints.latitude_rad].map(|of| of.at(row));
        (place_rad, footprints.areoid_radius_m.at(row))
    });
    let places = check.ties.iter().map(|tie| {
        let place = Spherical::from_xyz_m(&tie.ground.xyz_m);
        [place.longitude_rad, place.latitude.0]
    });
    let places: Vec<[f64; 2]> = places.collect();
    ReferenceSurface::fitted(site.config.body, &places, shots)
}

/// East, north and up in the middle of the tie points.
fn middle_axes(check: &HeightCheck) -> nalgebra::Matrix3<f64> {
    let places = check.ties.iter().map(|tie| tie.ground.xyz_m);
    let middle_m = places.fold(nalgebra::Vector3::zeros(), |sum, place| sum + place);
    local_axes(&middle_m)
}
