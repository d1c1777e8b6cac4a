//! Tie points against the ground between laser points.
//!
//! Two lines of a camera determine the place of a tie point and one residual, across the flight. A measurement that is
//! wrong along the flight leaves no residual: it moves the point and changes its height. Only the ground around it can
//! contradict that.

use super::{
    read::OrbitPoint,
    result::{PointKind, TieGround},
};
use areograph_geom::{
    calibration::CalibrationState,
    ellipsoid::local_axes,
    scattered_heights::{POINTS_MIN, ScatteredHeights},
    statistics::Summary,
};
use nalgebra::{DMatrix, Vector3};

/// A tie point is left out when it is farther from the ground than this many standard deviations: of a hundred million
/// good points on ground without surprises not one is.
const OFF_SIGMAS: f64 = 6.0;
/// Factor from the error that one in a hundred of the laser points exceeds to the largest that ground explains.
const TAILS: f64 = 2.0;

/// A tie point off the ground.
pub(super) struct Off {
    /// Index of the point.
    pub(super) index: usize,
    /// Its height above the ground, metres.
    pub(super) above_m: f64,
    /// The same in standard deviations.
    pub(super) sigmas: f64,
}

/// The ground between the laser points that are in use; `None` for too few, or points nearly on a line.
pub(super) fn ground(points: &[OrbitPoint]) -> Option<ScatteredHeights> {
    let lasers = points.iter().filter(|of| of.is(PointKind::Control));
    let places_m: Vec<Vector3<f64>> = lasers
        .filter_map(|of| Some(of.point.known?.place_m))
        .collect();
    ScatteredHeights::new(&places_m)
}

/// Height of every tie point in use above the ground, and what the test can find.
pub(super) fn off_ground(
    points: &[OrbitPoint],
    ground: &ScatteredHeights,
    state: &CalibrationState,
    covariance: &DMatrix<f64>,
) -> (Vec<Off>, TieGround) {
    let limit = OFF_SIGMAS.max(TAILS * ground.tail);
    let (mut off, mut sigmas_m) = (Vec::new(), Vec::new());
    for (index, of) in points.iter().enumerate() {
        if !of.is(PointKind::Tie) {
            continue;
        }
        let point = of.point.unaided();
        let Some((place_m, beneath)) = point
            .place(state)
            .ok()
            .and_then(|place_m| Some((place_m, ground.at(&place_m)?)))
        else {
            continue;
        };
        let Ok(of_point) = point.covariance_m2(state, covariance, &place_m) else {
            continue;
        };
        let axes = local_axes(&place_m);
        let up_m2 = (axes * of_point * axes.transpose())[(2, 2)].max(0.0);
        let sigma_m = beneath.sigma_m.hypot(up_m2.sqrt());
        let above_m = place_m.norm() - beneath.radius_m;
        sigmas_m.push(sigma_m);
        let sigmas = above_m / sigma_m;
        // Written so that NaN counts.
        if !(sigmas.abs() <= limit) {
            off.push(Off {
                index,
                above_m,
                sigmas,
            });
        }
    }
    let tested = TieGround {
        tested: sigmas_m.len() as u64,
        limit_sigmas: limit,
        limit_m: (!sigmas_m.is_empty()).then(|| limit * Summary::of(&sigmas_m).median),
    };
    (off, tested)
}

/// Why tie points are not tested against the ground.
pub(super) fn untested(points: &[OrbitPoint]) -> String {
    let lasers = points.iter().filter(|of| of.is(PointKind::Control)).count();
    format!(
        "{lasers} laser points in use, fewer than {POINTS_MIN} or nearly on a line: heights of tie points are not tested, and \
         measurements that are wrong along the flight are not identified"
    )
}
