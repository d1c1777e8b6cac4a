//! Standard deviations of the surface between shots against rough ground that is known everywhere.

use nalgebra::{Vector2, Vector3};

use super::RoughPatch;
use crate::{error_sources::Roughness, random::Random, terrain::REFERENCE_RADIUS_M};
use areograph_geom::surface::{LaserSurface, SurfaceOptions, SurfaceShot};

const SITE: Vector3<f64> = Vector3::new(0.6, 0.8, 0.0);
/// Distance of shots along a profile, and the angle of the second beam off nadir.
const STEP_M: f64 = 300.0;
const OFF_NADIR_RAD: f64 = 0.28;
/// Error of the second profile across its track: an attitude error of 0.3 mrad.
const ASIDE_SIGMA_M: f64 = 110.0;

/// The point of the ground with these coordinates, Mars-fixed.
fn ground_m(patch: &RoughPatch, east_m: f64, north_m: f64) -> Vector3<f64> {
    let aside = (patch.east * east_m + patch.north * north_m) / REFERENCE_RADIUS_M;
    let up = (SITE + aside).normalize();
    let height_m = patch.height_m(&(up * REFERENCE_RADIUS_M)).unwrap();
    up * (REFERENCE_RADIUS_M + height_m)
}

/// Where a beam from the west, 16° off nadir, meets the ground.
fn slanted_m(patch: &RoughPatch, east_m: f64, north_m: f64) -> Vector3<f64> {
    let mut met_m = ground_m(patch, east_m, north_m);
    let mut at_m = east_m;
    for _ in 0..20 {
        let height_m = met_m.norm() - REFERENCE_RADIUS_M;
        at_m += 0.5 * (east_m - OFF_NADIR_RAD.tan() * height_m - at_m);
        met_m = ground_m(patch, at_m, north_m);
    }
    met_m
}

/// The shots of a profile at nadir and of one off nadir 40 m beside it, as a pair of simultaneous images has them, the second
/// recorded `aside_m` east of its true position.
fn shots(patch: &RoughPatch, aside_m: f64, random: &mut Random) -> Vec<SurfaceShot> {
    let places = (-70..70).map(|index| STEP_M * f64::from(index));
    let mut shots = Vec::new();
    for (profile, off_nadir_rad) in [0.0, OFF_NADIR_RAD].into_iter().enumerate() {
        for north_m in places.clone() {
            let east_m = -900.0 + 0.13 * north_m;
            let met_m = if profile == 0 {
                ground_m(patch, east_m, north_m)
            } else {
                let met_m = slanted_m(patch, east_m + 40.0, north_m + 40.0);
                (met_m + patch.east * aside_m).normalize() * met_m.norm()
            };
            shots.push(SurfaceShot {
                ground_m: met_m * (1.0 + random.normal() / met_m.norm()),
                profile,
                attitude_known: true,
                off_nadir_rad,
            });
        }
    }
    shots
}

#[test]
fn a_profile_off_nadir_beside_one_at_nadir_does_not_tilt_the_surface() {
    const PATCHES: u64 = 60;
    let mut squares = 0.0;
    for seed in 0..PATCHES {
        let patch = RoughPatch::new(40_000 + seed, &SITE, Roughness::Rough);
        let mut random = Random::new(seed, "profiles beside each other");
        let aside_m = ASIDE_SIGMA_M * random.normal();
        let shots = shots(&patch, aside_m, &mut random);
        let places = (0..60).map(|_| {
            let [across, along] = [0, 1].map(|_| random.between(-1.0, 1.0));
            Vector2::new(2_000.0 * across, 12_000.0 * along)
        });
        let places = places.map(|at_m| ground_m(&patch, at_m.x, at_m.y));
        let places: Vec<Vector3<f64>> = places.collect();
        // Images at their true places.
        let options = SurfaceOptions {
            plan_sigma_m: 0.0,
            ..SurfaceOptions::default()
        };
        let surface = LaserSurface::new(&shots, &places, &options).unwrap();
        let found = surface.predict(&places);
        let count = places.len() as f64;
        let errors = found.heights_m.iter().zip(&places);
        let errors = errors.map(|(height_m, place_m)| height_m - surface.height_m(place_m).0);
        let mean_m = errors.sum::<f64>() / count;
        squares += mean_m.powi(2) / (found.covariance_m2.sum() / count.powi(2));
    }
    let ratio = (squares / PATCHES as f64).sqrt();
    println!("{ratio:.2} of the stated standard deviation of the mean height");
    // Chance of 60 patches with normal errors: three times 9 %.
    assert!((0.75..1.3).contains(&ratio), "{ratio}");
}
