//! Heights of laser and model along every pass: elevation curves.
//!
//! # Source
//! Li et al. 2023, figures 8 (laser, model and shifted model of a unit) and 9 (one pass).

use std::collections::BTreeMap;

use super::{
    pass::{Pass, PassShot},
    result::UnitResult,
    search::shifted_m,
    shots::Shot,
    units::Unit,
};
use areograph_geom::{height_grid::HeightGrid, image_outline::angle_rad};

/// The passes of `shots`, which are in the order of time, with the results of `units`, in their order.
pub(super) fn passes(
    grid: &HeightGrid,
    shots: &[Shot],
    units: &[Unit<'_>],
    results: &[UnitResult],
) -> Vec<Pass> {
    let mut members: BTreeMap<&str, (&UnitResult, bool)> = BTreeMap::new();
    for (unit, result) in units.iter().zip(results) {
        let of_unit = unit.members();
        members.extend(of_unit.map(|(shot, is_held_out)| (&*shot.name, (result, is_held_out))));
    }
    let tracks = shots.chunk_by(|a, b| a.track == b.track);
    let passes = tracks.map(|track| Pass {
        pass: track[0].track + 1,
        shots: along(grid, track, &members),
    });
    passes.collect()
}

fn along(
    grid: &HeightGrid,
    track: &[Shot],
    members: &BTreeMap<&str, (&UnitResult, bool)>,
) -> Vec<PassShot> {
    let mut distance_m = 0.0;
    let mut before_rad: Option<[f64; 2]> = None;
    let shots = track.iter().map(|shot| {
        let place_rad = [shot.longitude_rad, shot.latitude_rad];
        distance_m += before_rad.map_or(0.0, |before| grid.radius_m * angle_rad(before, place_rad));
        before_rad = Some(place_rad);
        let member = members.get(&*shot.name);
        let kept = member.and_then(|(unit, _)| unit.found.filter(|_| unit.is_kept()));
        PassShot {
            name: shot.name.clone(),
            distance_m,
            place_rad,
            laser_m: shot.height_m,
            model_m: shifted_m(grid, shot, [0.0; 2]),
            shifted_model_m: kept.and_then(|found| {
                let [east, north] = found.shift_cells;
                shifted_m(grid, shot, [-north, east])
            }),
            unit: member.map(|(unit, _)| unit.unit),
            is_held_out: member.is_some_and(|(_, is_held_out)| *is_held_out),
        }
    });
    shots.collect()
}
