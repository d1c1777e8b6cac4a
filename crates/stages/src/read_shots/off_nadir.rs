//! Passes off nadir by their ranges, where shots have no position of the spacecraft: a slanted beam is longer.

use std::collections::BTreeMap;

use areograph_base::footprints::{AsRead, Footprints};
use areograph_geom::statistics::median;

/// Radius of the ground plus range may exceed that of the usual pass of a window by this much, metres: orbits of passes at nadir
/// over six windows differ by up to 4.3 km, those of the seven slanted passes by 8.4 km or more.
const EXCESS_MAX_M: f64 = 6_000.0;
/// Fewest orbits in which one is unusual.
const ORBITS_MIN: usize = 5;

/// A pass off nadir.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OffNadirPass {
    /// Its orbit.
    pub(super) orbit: u32,
    /// Mean angle of its beam off nadir, radians.
    pub(super) angle_rad: f64,
}

/// Finds the orbits whose beam was slanted, and gives their shots the angle off nadir that the range and the usual orbit imply.
pub(super) fn mark_passes(footprints: &mut Footprints<AsRead>) -> Vec<OffNadirPass> {
    let mut of_orbits: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for row in 0..footprints.len() {
        of_orbits
            .entry(footprints.orbit[row])
            .or_default()
            .push(row);
    }
    if of_orbits.len() < ORBITS_MIN {
        return Vec::new();
    }
    let reach_m = |row: &usize| footprints.radius_m[*row] + footprints.range_m[*row];
    let means_m: Vec<f64> = of_orbits
        .values()
        .map(|rows| rows.iter().map(reach_m).sum::<f64>() / rows.len() as f64)
        .collect();
    let orbit_m = median(&mut means_m.clone());
    let mut passes = Vec::new();
    for ((orbit, rows), mean_m) in of_orbits.iter().zip(means_m) {
        if mean_m - orbit_m <= EXCESS_MAX_M {
            continue;
        }
        let mut sum_rad = 0.0;
        for row in rows {
            let (ground_m, range_m) = (footprints.radius_m[*row], footprints.range_m[*row]);
            // The triangle of centre, spacecraft and footprint.
            let cosine =
                (orbit_m.powi(2) + range_m.powi(2) - ground_m.powi(2)) / (2.0 * orbit_m * range_m);
            let angle_rad = cosine.clamp(-1.0, 1.0).acos();
            footprints.off_nadir_rad[*row] = angle_rad;
            sum_rad += angle_rad;
        }
        passes.push(OffNadirPass {
            orbit: *orbit,
            angle_rad: sum_rad / rows.len() as f64,
        });
    }
    passes
}
