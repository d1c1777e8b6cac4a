//! Covariances of adjusted points, and the part of them that points share.
//!
//! Tie points of a site share the error of its orientations, 110 m on an axis; footprints share the shift of their profile,
//! 70 m. Neither averages out over points; both are stated separately.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::{
    components::variance_factor, height_summary, input::LaserShots, network::Assembled,
    points::PointKind,
};
use areograph_geom::{bundle::Adjustment, ellipsoid::local_axes, statistics::BAARDA_LIMIT};

/// An error that a point has in common with others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SharedError {
    /// Standard deviations of the error in east, north and height, metres: for tie points the error of their mean, for
    /// a footprint the shift of its profile.
    pub sigma_m: [f64; 3],
    /// Covariance of the point without it, m².
    pub relative_m2: Matrix3<f64>,
}

/// Uncertainty of an adjusted point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PointErrors {
    /// Covariance with all errors, m².
    pub(super) covariance_m2: Matrix3<f64>,
    pub(super) shared: Option<SharedError>,
}

/// Uncertainties of all points, by the index in the network; `None` without adjusted coordinates.
pub(super) fn point_errors<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
    shots: &LaserShots,
) -> Vec<Option<PointErrors>> {
    let factor = variance_factor(assembled, adjustment);
    let contradicted_m2 = contradicted_m2(adjustment);
    let datum_m = height_summary::datum_sigma_m(adjustment, factor);
    let of_point = |point: usize| {
        let found = adjustment.points[point].as_ref().ok()?;
        let added_m2 = contradicted_m2[point];
        let covariance_m2 = found.cofactor_m2 * factor + added_m2;
        let relative_m2 = found.relative_m2.map(|of| of * factor + added_m2);
        let shared = |sigma_m| {
            relative_m2.map(|relative_m2| SharedError {
                sigma_m,
                relative_m2,
            })
        };
        if assembled.kind(point) == PointKind::Tie {
            let shared = datum_m.and_then(shared);
            return Some(PointErrors {
                covariance_m2,
                shared,
            });
        }
        if let Some(sigma_m) = shift_sigma_m(assembled, adjustment, shots, point, factor) {
            return Some(PointErrors {
                covariance_m2,
                shared: shared(sigma_m),
            });
        }
        // The shift of the profile is no unknown: its a priori uncertainty is added.
        let profile_m = shots.profile_sigmas_m[shots.shots[point].profile];
        let shift_m2 = shift_m2(&found.ground_m, &profile_m);
        Some(PointErrors {
            covariance_m2: covariance_m2 + shift_m2,
            shared: Some(SharedError {
                sigma_m: profile_m.into(),
                relative_m2: covariance_m2,
            }),
        })
    };
    (0..assembled.points.len()).map(of_point).collect()
}

/// Covariance of the shift of a profile at a place, m².
fn shift_m2(place_m: &Vector3<f64>, sigma_m: &Vector3<f64>) -> Matrix3<f64> {
    let to_local = local_axes(place_m);
    let variances_m2 = sigma_m.component_mul(sigma_m);
    to_local.transpose() * Matrix3::from_diagonal(&variances_m2) * to_local
}

/// Standard deviations of the shift of a footprint's profile where it is an unknown, metres.
fn shift_sigma_m<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
    shots: &LaserShots,
    point: usize,
    factor: f64,
) -> Option<[f64; 3]> {
    let bus = adjustment.common_bus.as_ref()?;
    let profile = shots.shots.get(point)?.profile;
    let place = assembled
        .profiles
        .iter()
        .position(|of| of.index == profile)?;
    let shift = bus.profile_shifts_m.get(place)?;
    Some(shift.map(|found| found.root_cofactor * factor.sqrt()))
}

/// A priori covariance of the footprint of a shot, m²: its own error and the shift of its profile.
#[must_use]
pub fn recorded_m2(place_m: &Vector3<f64>, single_m: f64, profile_m: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal_element(single_m.powi(2)) + shift_m2(place_m, &profile_m.into())
}

/// Additional height variance of points that fail the test against the surface, m².
///
/// Such points stand out, but not enough for a blunder, or a neighbour confirms them: ground between the profiles, or
/// measurements with a common error. The data do not show whether image or altimeter is right.
fn contradicted_m2(adjustment: &Adjustment) -> Vec<Matrix3<f64>> {
    let mut added_m2 = vec![Matrix3::zeros(); adjustment.points.len()];
    for height in &adjustment.compared {
        let stands_out = height.above_m.abs() > BAARDA_LIMIT * height.sigma_m();
        if let (true, Ok(point)) = (stands_out, &adjustment.points[height.point]) {
            let up_m = point.ground_m.normalize() * height.above_m;
            added_m2[height.point] = up_m * up_m.transpose();
        }
    }
    added_m2
}
