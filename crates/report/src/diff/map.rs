//! A map of movements on the ground: footprints, tie points and boresights, each from A to B.

use nalgebra::Vector3;

use crate::{
    difference::{Moved, RunDifference},
    html::Markup,
    numbers::whole,
    plots::{Arrow, Arrows, Extent, Panel, Plot, Series, WIDTH, figure, magnification},
};
use areograph_base::{error::Result, units::METRES_PER_KM};
use areograph_geom::ellipsoid::local_axes;

/// Smallest movement that is drawn, metres: less than the error of any kernel.
const DRAWN_FROM_M: f64 = 1e-3;
/// Share of the map's side that the longest vector takes.
const LONGEST: f64 = 0.12;
/// Part of a plot's width beside its panel, and the range of heights of a map, in the plot's own units.
const BESIDE: u32 = 190;
const HEIGHTS: [f64; 2] = [300.0, 1_000.0];

/// The map; empty if nothing moved on the ground.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub(super) fn figure_of(site: &RunDifference) -> Result<Markup> {
    let kinds = kinds(site);
    let moved = |[from, to]: &Moved| (to - from).norm() > DRAWN_FROM_M;
    if !kinds.iter().any(|(_, places)| places.iter().any(moved)) {
        return Ok(Markup::default());
    }
    let all = || kinds.iter().flat_map(|(_, places)| places);
    let middle = all().fold(Vector3::zeros(), |sum, [from, _]| sum + from);
    let axes = local_axes(&middle);
    let kilometres = |of: &Vector3<f64>| {
        let local = axes * of / METRES_PER_KM;
        (local.x, local.y)
    };
    let groups: Vec<(&str, Vec<Arrow>)> = kinds
        .iter()
        .filter(|(_, places)| !places.is_empty())
        .map(|(name, places)| {
            let arrows = places.iter().map(|[from, to]| Arrow {
                from: kilometres(from),
                by: kilometres(&(to - from)),
            });
            (*name, arrows.collect())
        })
        .collect();
    let starts = || {
        let all = groups.iter().flat_map(|(_, arrows)| arrows);
        all.map(|arrow| arrow.from)
    };
    let (x, y, _) = sheet(starts());
    let room = (LONGEST * (x.high - x.low), LONGEST * (y.high - y.low));
    let longest: Vec<Arrow> = groups
        .iter()
        .flat_map(|(_, arrows)| arrows.clone())
        .collect();
    let times = magnification(&longest, room);
    let tip = |arrow: &Arrow| {
        (
            arrow.from.0 + times * arrow.by.0,
            arrow.from.1 + times * arrow.by.1,
        )
    };
    // With room for the vectors themselves.
    let (x, y, height) = sheet(starts().chain(longest.iter().map(tip)));
    let mut panel = Panel {
        y,
        height,
        ..Panel::of("north, km", Vec::new())
    };
    let mut parts = Vec::new();
    for (colour, (name, arrows)) in groups.into_iter().enumerate() {
        parts.push(format!("{} {name}", whole(arrows.len())));
        let places = arrows.iter().map(|arrow| arrow.from).collect();
        panel.series.push(Series::dots(name, colour, places));
        let drawn = |arrow: &Arrow| METRES_PER_KM * arrow.by.0.hypot(arrow.by.1) > DRAWN_FROM_M;
        if arrows.iter().any(drawn) {
            panel.arrows.push(Arrows {
                label: format!("{name}, B − A"),
                colour,
                magnification: times,
                each: arrows,
            });
        }
    }
    let words = format!(
        "Positions in A and movements to B, magnified {times} ×: {}. Axes: kilometres east and north of the mean position.",
        parts.join(", ")
    );
    let title = format!("{}: movements on the ground", site.site);
    figure(&Plot {
        x,
        ..Plot::of(title, words, "east, km", vec![panel])
    })
}

/// Items in both runs, by kind.
fn kinds(site: &RunDifference) -> [(&'static str, Vec<Moved>); 3] {
    let footprints = site.footprints.movement.as_ref();
    let images = site
        .images
        .iter()
        .filter_map(|image| image.movement.as_ref());
    let samples = images.flat_map(|movement| &movement.samples);
    [
        (
            "footprints",
            footprints.map_or_else(Vec::new, |of| of.places.clone()),
        ),
        ("tie points", site.ties.clone()),
        (
            "boresights of images",
            samples.filter_map(|sample| sample.grounds).collect(),
        ),
    ]
}

/// Axes of one scale that hold all places, and the height of the map.
pub(crate) fn sheet(places: impl Iterator<Item = (f64, f64)> + Clone) -> (Extent, Extent, u32) {
    let x = Extent::of(places.clone().map(|place| place.0));
    let y = Extent::of(places.map(|place| place.1));
    let wide = f64::from(WIDTH - BESIDE);
    let (width_km, height_km) = (x.high - x.low, y.high - y.low);
    let height = (wide * height_km / width_km).clamp(HEIGHTS[0], HEIGHTS[1]);
    // If the height does not give one scale, the shorter axis is extended.
    let per_km = (wide / width_km).min(height / height_km);
    let about = |axis: Extent, length: f64| {
        let middle = f64::midpoint(axis.low, axis.high);
        let half = 0.5 * length / per_km;
        Extent {
            low: middle - half,
            high: middle + half,
        }
    };
    (about(x, wide), about(y, height), height.round() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_axes_have_one_scale() {
        for (width_km, height_km) in [(1.0, 1.0), (3.0, 200.0), (500.0, 2.0)] {
            let ends = [(0.0, 0.0), (width_km, height_km)];
            let (x, y, height) = sheet(ends.into_iter());
            let [across, up] = [
                f64::from(WIDTH - BESIDE) / (x.high - x.low),
                f64::from(height) / (y.high - y.low),
            ];
            // The height is rounded to a whole unit.
            assert!((across / up - 1.0).abs() < 2e-3, "{across} {up}");
            assert!(x.low <= 0.0 && x.high >= width_km && y.low <= 0.0 && y.high >= height_km);
        }
    }
}
