//! Crossing profiles over invented ground, for tests.

use super::SurfaceShot;
use crate::ellipsoid::{Spherical, on_ellipsoid_m, spherical_to_xyz_m};
use areograph_base::body::{Body, MARS_IAU2000};

/// Slope of the ground towards north.
pub(super) const SLOPE: f64 = 0.01;

/// Straight profiles, every second one turned, `apart_m` from each other, on a slope, each recorded this much too
/// high.
pub(super) fn crossing(shifts_m: &[f64], apart_m: f64) -> Vec<SurfaceShot> {
    let radius_m = MARS_IAU2000.equatorial_radius_m;
    let mut shots = Vec::new();
    for (profile, shift_m) in shifts_m.iter().enumerate() {
        let lean = if profile % 2 == 0 { 0.3 } else { -0.3 };
        let middle_m = (profile as f64 - 0.5 * shifts_m.len() as f64) * apart_m;
        for shot in -60..60 {
            // Off the lattice of the other profiles.
            let north_m = 301.0 * f64::from(shot) + 7.0 * profile as f64;
            let east_m = middle_m + lean * north_m;
            let up = spherical_to_xyz_m(east_m / radius_m, north_m / radius_m, 1.0);
            let height_m = SLOPE * north_m + shift_m;
            shots.push(SurfaceShot {
                ground_m: on_ellipsoid_m(Body::Mars.model(), &up) + height_m * up,
                profile,
                attitude_known: true,
                off_nadir_rad: 0.0,
            });
        }
    }
    shots
}

/// Heights of waves in two directions, metres.
fn waves_m(east_m: f64, north_m: f64) -> f64 {
    let along = |length_m: f64, x_m: f64| (std::f64::consts::TAU * x_m / length_m).sin();
    30.0 * along(7_000.0, north_m) + 25.0 * along(5_000.0, east_m + 0.4 * north_m)
}

/// Crossing profiles over waves, each recorded this far to the east and north.
pub(super) fn over_waves(shifts_m: &[[f64; 2]]) -> Vec<SurfaceShot> {
    let radius_m = MARS_IAU2000.equatorial_radius_m;
    let mut shots = crossing(&vec![0.0; shifts_m.len()], 800.0);
    for shot in &mut shots {
        let place = Spherical::from_xyz_m(&shot.ground_m);
        let recorded_m = [place.longitude_rad, place.latitude.0].map(|angle| angle * radius_m);
        let [aside_m, ahead_m] = shifts_m[shot.profile];
        let up = shot.ground_m.normalize();
        let height_m = waves_m(recorded_m[0] - aside_m, recorded_m[1] - ahead_m);
        shot.ground_m = on_ellipsoid_m(Body::Mars.model(), &up) + height_m * up;
    }
    shots
}
