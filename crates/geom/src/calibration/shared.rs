//! The effect of errors that control points share on the estimated parameters.
//!
//! The points of a laser profile share errors of the orbit and attitude of the laser. Points are weighted as if their errors were
//! independent: the estimate stays unbiased, and its covariance is that of independent errors plus the response to every shared one.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Vector3};

use super::{
    camera::CalibrationState,
    elimination::response,
    freedom::Freedom,
    sight::{GroundPoint, SightError},
};
use crate::ellipsoid::local_axes;

/// Covariance of the free combinations with shared errors of the points.
///
/// * `covariance` – of the free combinations for independent errors
/// * `places_m` – of the points under `state`
///
/// # Errors
/// The index of a point without a position, with the reason.
pub(super) fn with_shared_errors(
    covariance: &DMatrix<f64>,
    points: &[GroundPoint],
    state: &CalibrationState,
    freedom: &Freedom,
    places_m: &[Vector3<f64>],
) -> Result<DMatrix<f64>, (usize, SightError)> {
    let mut groups: BTreeMap<usize, DMatrix<f64>> = BTreeMap::new();
    for (index, (point, place_m)) in points.iter().zip(places_m).enumerate() {
        let Some((known, shared)) = point.known.and_then(|known| Some((known, known.shared?)))
        else {
            continue;
        };
        let [horizontal_m, vertical_m] = shared.sigma_m;
        let size_m = [horizontal_m, horizontal_m, vertical_m];
        let axes = local_axes(&known.place_m);
        let shifts_m = [0, 1, 2].map(|axis| axes.row(axis).transpose() * size_m[axis]);
        let of_point =
            response(point, state, freedom, place_m, &shifts_m).map_err(|why| (index, why))?;
        groups
            .entry(shared.group)
            .and_modify(|of_group| *of_group += &of_point)
            .or_insert(of_point);
    }
    let mut whole = covariance.clone();
    for of_group in groups.values() {
        let moved = covariance * of_group;
        whole += &moved * moved.transpose();
    }
    Ok(whole)
}
