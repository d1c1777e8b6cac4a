//! Height of the ground in the view of an image before matching, from nearby shots of the altimeter.

use nalgebra::Vector3;

use crate::group_profiles::Profile;
use areograph_base::{body::Body, footprints::Footprints, frames::BodyFixed};
use areograph_geom::ellipsoid::spherical_to_xyz_m;

/// Shots that determine a height.
const SHOTS: usize = 8;
/// Standard deviation of the slope of the ground away from a shot, metres per metre: MOLA slopes over kilometres.
const SLOPE: f64 = 0.05;
/// Least standard deviation of a height, metres.
const SIGMA_MIN_M: f64 = 10.0;
/// Standard deviation where there is no shot, metres: the relief of the planet about its ellipsoid.
const SIGMA_WITHOUT_SHOTS_M: f64 = 2_000.0;

/// A priori heights of the ground.
pub struct Heights {
    body: Body,
    shots_m: Vec<Vector3<f64>>,
}

/// Height of the ground as a radius.
pub struct Height {
    /// Distance from the centre of the body, metres.
    pub radius_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
}

impl Heights {
    /// Heights from shots at these places, body-fixed, metres.
    #[must_use]
    pub const fn at(body: Body, shots_m: Vec<Vector3<f64>>) -> Self {
        Self { body, shots_m }
    }

    pub(crate) fn of(footprints: &Footprints<BodyFixed>, profiles: &[Profile]) -> Self {
        let rows = profiles.iter().flat_map(|profile| &profile.rows);
        let shots = rows.map(|row| {
            let at = *row as usize;
            let (longitude, latitude) = (
                footprints.longitude_rad.at(at),
                footprints.latitude_rad.at(at),
            );
            spherical_to_xyz_m(longitude, latitude, footprints.ground_radius_m(at))
        });
        Self::at(footprints.body, shots.collect())
    }

    /// Their shots, body-fixed, metres.
    pub(crate) fn shots_m(&self) -> &[Vector3<f64>] {
        &self.shots_m
    }

    /// The height at a place, metres body-fixed, of which only the direction is used: the mean of the nearest shots,
    /// weighted by proximity. Its standard deviation grows with the distance from them.
    #[must_use]
    pub fn near(&self, place_m: &Vector3<f64>) -> Height {
        let direction = place_m.normalize();
        let mut nearest: Vec<(f64, f64)> = Vec::with_capacity(SHOTS + 1);
        for shot_m in &self.shots_m {
            let radius_m = shot_m.norm();
            let apart_m = (shot_m - radius_m * direction).norm();
            if nearest.len() == SHOTS && nearest.last().is_some_and(|(far_m, _)| apart_m >= *far_m)
            {
                continue;
            }
            let at = nearest.partition_point(|(known_m, _)| *known_m < apart_m);
            nearest.insert(at, (apart_m, radius_m));
            nearest.truncate(SHOTS);
        }
        let Some((closest_m, _)) = nearest.first().copied() else {
            let ellipsoid = self.body.model();
            let equatorial = direction.x.hypot(direction.y) / ellipsoid.equatorial_radius_m;
            return Height {
                radius_m: 1.0 / equatorial.hypot(direction.z / ellipsoid.polar_radius_m),
                sigma_m: SIGMA_WITHOUT_SHOTS_M,
            };
        };
        let weight = |apart_m: f64| 1.0 / (apart_m * apart_m + 1.0);
        let weights: f64 = nearest.iter().map(|(apart_m, _)| weight(*apart_m)).sum();
        let mean = |of: &dyn Fn(f64) -> f64| {
            let weighted = nearest
                .iter()
                .map(|(apart_m, radius_m)| weight(*apart_m) * of(*radius_m));
            weighted.sum::<f64>() / weights
        };
        let radius_m = mean(&|radius_m| radius_m);
        let scatter_m = mean(&|of_shot_m| (of_shot_m - radius_m).powi(2)).sqrt();
        Height {
            radius_m,
            sigma_m: SIGMA_MIN_M.hypot(scatter_m).hypot(SLOPE * closest_m),
        }
    }
}
