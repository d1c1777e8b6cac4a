//! Passes off nadir by their ranges, where shots have no position of the spacecraft: a slanted beam is longer.

use std::collections::BTreeMap;

use areograph_base::footprints::Footprint;
use areograph_geom::statistics::median;

/// Radius of the ground plus range may exceed the usual pass by this much, metres: orbits of passes at nadir over six
/// windows differ by up to 4.3 km, orbits of the seven slanted passes by 8.4 km or more.
const EXCESS_MAX_M: f64 = 6_000.0;
/// Fewest orbits in which one is unusual.
const ORBITS_MIN: usize = 5;
/// Smallest number of an orbit of the mapping phase: MOLA adds 10,000 to these (datainfo.txt of the archive). Earlier orbits were not
/// circular.
const MAPPING_ORBIT: u32 = 10_000;
/// Longest time between shots of a pass, seconds: the beam is turned for a pass over a place, not for an orbit.
const GAP_S: f64 = 60.0;
/// Orbits are compared in belts of latitude: the radius of the mapping orbit grows by 16 km between 15° S and 18° N, 500 m in a degree
/// (medians of two real tables).
const BELT_RAD: f64 = std::f64::consts::PI / 180.0;

/// A pass off nadir.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffNadirPass {
    /// Its orbit.
    pub orbit: u32,
    /// Mean angle of its beam off nadir, radians.
    pub angle_rad: f64,
}

/// Passes off nadir, and the angle of each shot.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OffNadir {
    /// The passes, by orbit.
    pub passes: Vec<OffNadirPass>,
    /// Angle of the beam off nadir of each shot, radians; 0 where the pass is not known to be off nadir.
    pub angles_rad: Vec<f64>,
}

impl OffNadir {
    /// Finds the passes whose beam was slanted, by the ranges and by the usual orbit of the others in each belt of latitude.
    #[must_use]
    pub fn of(shots: &[Footprint]) -> Self {
        let usual_m = usual_radii_m(shots);
        let mut found = Self {
            passes: Vec::new(),
            angles_rad: vec![0.0; shots.len()],
        };
        for rows in passes(shots) {
            let known = rows.iter().filter_map(|row| {
                let shot = &shots[*row];
                usual_m
                    .get(&belt(shot))
                    .map(|orbit_m| (*row, reach_m(shot) - orbit_m, angle_rad(shot, *orbit_m)))
            });
            let known: Vec<(usize, f64, f64)> = known.collect();
            let mean = |of: fn(&(usize, f64, f64)) -> f64| {
                known.iter().map(of).sum::<f64>() / known.len() as f64
            };
            // Written so that NaN, of no known shot, is no pass off nadir.
            if !(mean(|(_, excess_m, _)| *excess_m) > EXCESS_MAX_M) {
                continue;
            }
            let angle_rad = mean(|(.., angle_rad)| *angle_rad);
            for row in &rows {
                found.angles_rad[*row] = angle_rad;
            }
            for (row, _, angle_rad) in &known {
                found.angles_rad[*row] = *angle_rad;
            }
            let orbit = shots[rows[0]].orbit;
            found.passes.push(OffNadirPass { orbit, angle_rad });
        }
        found
    }
}

/// The shots of each pass, passes by orbit and time.
fn passes(shots: &[Footprint]) -> Vec<Vec<usize>> {
    let mut rows: Vec<usize> = (0..shots.len()).collect();
    let key = |row: usize| (shots[row].orbit, shots[row].et_tag_s);
    rows.sort_by(|one, other| {
        let ((orbit, et_s), (other_orbit, other_s)) = (key(*one), key(*other));
        orbit.cmp(&other_orbit).then(et_s.total_cmp(&other_s))
    });
    let is_one = |before: &usize, row: &usize| {
        let ((orbit, et_s), (next, next_s)) = (key(*before), key(*row));
        orbit == next && next_s - et_s <= GAP_S
    };
    rows.chunk_by(is_one).map(<[usize]>::to_vec).collect()
}

/// Radius of the spacecraft if it was above the footprint, metres.
fn reach_m(shot: &Footprint) -> f64 {
    shot.radius_m + shot.range_m
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "there are a few hundred belts"
)]
fn belt(shot: &Footprint) -> i32 {
    (shot.latitude_rad / BELT_RAD).floor() as i32
}

/// Median over orbits of the radius of the spacecraft, by belt; of belts with enough orbits.
fn usual_radii_m(shots: &[Footprint]) -> BTreeMap<i32, f64> {
    let mut belts: BTreeMap<i32, BTreeMap<u32, Vec<f64>>> = BTreeMap::new();
    for shot in shots.iter().filter(|shot| shot.orbit >= MAPPING_ORBIT) {
        let of_belt = belts.entry(belt(shot)).or_default();
        of_belt.entry(shot.orbit).or_default().push(reach_m(shot));
    }
    belts.retain(|_, orbits| orbits.len() >= ORBITS_MIN);
    let usual = belts.into_iter().map(|(belt, orbits)| {
        let mut means_m: Vec<f64> = orbits
            .values()
            .map(|of_orbit| of_orbit.iter().sum::<f64>() / of_orbit.len() as f64)
            .collect();
        (belt, median(&mut means_m))
    });
    usual.collect()
}

/// The angle at the spacecraft in the triangle of centre, spacecraft and footprint.
fn angle_rad(shot: &Footprint, orbit_m: f64) -> f64 {
    let (ground_m, range_m) = (shot.radius_m, shot.range_m);
    let cosine = (orbit_m.powi(2) + range_m.powi(2) - ground_m.powi(2)) / (2.0 * orbit_m * range_m);
    cosine.clamp(-1.0, 1.0).acos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shot_table::ShotRow;
    use areograph_base::body::Body;

    /// A shot of a pass from an orbit whose radius changes with latitude, the beam slanted by an angle.
    fn shot(orbit: u32, latitude_deg: f64, off_nadir_rad: f64) -> Footprint {
        let orbit_m = 3_775_000.0 + 400.0 * latitude_deg;
        let radius_m = 3_390_000.0;
        // Law of sines and of cosines in the triangle of centre, spacecraft and footprint.
        let at_ground_rad = (orbit_m * off_nadir_rad.sin() / radius_m).asin();
        let at_centre_rad = at_ground_rad - off_nadir_rad;
        let range_m = (orbit_m.powi(2) + radius_m.powi(2)
            - 2.0 * orbit_m * radius_m * at_centre_rad.cos())
        .sqrt();
        let row = ShotRow {
            line: 2,
            et_s: latitude_deg * 18.0,
            longitude_rad: 0.0,
            latitude_rad: latitude_deg.to_radians(),
            radius_m,
            range_m,
            spacecraft: None,
            orbit,
            areoid_radius_m: None,
            channel: 1,
            class: 1,
            attitude_flag: 0,
        };
        row.footprint(Body::Mars, 0, 0.0)
    }

    #[test]
    fn a_slanted_pass_is_found_over_a_long_window() {
        let orbits = 10_100..10_110;
        let mut shots: Vec<Footprint> = orbits
            .flat_map(|orbit| {
                // Each orbit is clipped by the window in a different way.
                let first = (orbit % 7) * 3;
                (first..40).map(move |step| shot(orbit, 0.5 * f64::from(step), 0.0))
            })
            .collect();
        let upright = OffNadir::of(&shots);
        assert!(upright.passes.is_empty(), "{upright:?}");
        shots.extend((0..30).map(|step| shot(18_563, 0.5 * f64::from(step), 0.25)));
        // The same orbit was upright over another place, minutes earlier.
        shots.extend((0..30).map(|step| shot(18_563, 0.1 * f64::from(step) - 20.0, 0.0)));
        shots.extend((10_100..10_110).map(|orbit| shot(orbit, -19.5, 0.0)));
        let found = OffNadir::of(&shots);
        assert_eq!(found.passes.len(), 1);
        assert_eq!(found.passes[0].orbit, 18_563);
        // The orbit is the mean of a belt: 200 m of 390 km.
        assert!((found.passes[0].angle_rad - 0.25).abs() < 0.001);
        let angles = found.angles_rad.iter().zip(&shots);
        for (angle_rad, shot) in angles {
            assert_eq!(
                *angle_rad > 0.0,
                shot.orbit == 18_563 && shot.latitude_rad >= 0.0
            );
        }
    }

    #[test]
    fn few_orbits_and_orbits_before_the_mapping_phase_show_nothing() {
        let mut shots = vec![shot(10_001, 1.0, 0.3)];
        shots.extend((10_002..10_005).map(|orbit| shot(orbit, 1.0, 0.0)));
        assert!(OffNadir::of(&shots).passes.is_empty());
        let early = (500..520).map(|orbit| shot(orbit, 1.0, 0.0));
        let mut shots: Vec<Footprint> = early.collect();
        shots.push(shot(520, 1.0, 0.3));
        assert!(OffNadir::of(&shots).passes.is_empty());
    }
}
