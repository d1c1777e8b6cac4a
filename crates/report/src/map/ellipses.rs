//! Precision of tie points: ellipses of one standard deviation, magnified.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Matrix3, SymmetricEigen, Vector3};

use super::super::plots::{Arrow, label, magnification, thinned};
use areograph_geom::ellipsoid::local_axes;
use areograph_stages::adjust::CorrectedPoint;

/// Largest number of ellipses on the map: more would hide the ground.
const ELLIPSES: usize = 12;
/// Number of points of an ellipse.
const STEPS: u32 = 40;
/// Largest share of the map's width for the largest semi-axis.
const LONGEST: f64 = 0.05;

/// Ellipses on a map.
#[derive(Debug, Default)]
pub(super) struct Ellipses {
    /// Points of each, Mars-fixed, metres.
    pub(super) rings_m: Vec<Vec<Vector3<f64>>>,
    /// Their magnification.
    magnification: f64,
    /// Largest true semi-axis of all, metres.
    largest_m: f64,
}

impl Ellipses {
    /// Ellipses of a selection of adjusted tie points, for a map of this width.
    pub(super) fn of<'a>(ties: impl Iterator<Item = &'a CorrectedPoint>, width_m: f64) -> Self {
        let ties: Vec<&CorrectedPoint> = ties.collect();
        let axes: Vec<(Vector3<f64>, [Vector3<f64>; 2])> = thinned(&ties, ELLIPSES)
            .into_iter()
            .map(|tie| {
                let place_m = tie.ground.xyz_m;
                (place_m, semi_axes_m(&place_m, &tie.covariance_m2))
            })
            .collect();
        let lengths = axes
            .iter()
            .flat_map(|(_, axes)| axes.map(|axis| axis.norm()));
        let largest_m = lengths.fold(0.0, f64::max);
        let longest = Arrow {
            from: (0.0, 0.0),
            by: (largest_m, 0.0),
        };
        let room_m = LONGEST * width_m;
        let magnification = magnification(&[longest], (room_m, room_m)).max(1.0);
        let ring_m = |(place_m, [one, other]): &(Vector3<f64>, [Vector3<f64>; 2])| {
            let turns = (0..STEPS).map(|step| TAU * f64::from(step) / f64::from(STEPS));
            turns
                .map(|turn| place_m + magnification * (one * turn.cos() + other * turn.sin()))
                .collect()
        };
        Self {
            rings_m: axes.iter().map(ring_m).collect(),
            magnification,
            largest_m,
        }
    }

    /// The entry of the legend; `None` without ellipses.
    pub(super) fn key(&self) -> Option<String> {
        let times = label(self.magnification, 0);
        (!self.rings_m.is_empty()).then(|| format!("1 σ of tie points in plan, × {times}"))
    }

    /// A sentence of the caption.
    pub(super) fn words(&self) -> String {
        if self.rings_m.is_empty() {
            return String::new();
        }
        format!(
            "Ellipses: 1 σ of {} tie points in plan, largest semi-axis {} m. ",
            self.rings_m.len(),
            label(self.largest_m, 0)
        )
    }
}

/// Semi-axes of the ellipse of one standard deviation in the horizontal plane, Mars-fixed, metres.
fn semi_axes_m(place_m: &Vector3<f64>, covariance_m2: &Matrix3<f64>) -> [Vector3<f64>; 2] {
    let local = local_axes(place_m);
    let covariance_m2 = local * covariance_m2 * local.transpose();
    let plan_m2: Matrix2<f64> = covariance_m2.fixed_view::<2, 2>(0, 0).into_owned();
    let parts = SymmetricEigen::new(plan_m2);
    [0, 1].map(|axis| {
        let direction = parts.eigenvectors.column(axis);
        let sigma_m = parts.eigenvalues[axis].max(0.0).sqrt();
        local.transpose() * Vector3::new(direction[0], direction[1], 0.0) * sigma_m
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_geom::ellipsoid::spherical_to_xyz_m;

    #[test]
    fn semi_axes_lie_east_and_north_also_near_the_pole() {
        for latitude_deg in [0.0_f64, -14.6, 89.9] {
            let place_m = spherical_to_xyz_m(3.06, latitude_deg.to_radians(), 3_396_000.0);
            let local = local_axes(&place_m);
            let variances = Vector3::new(112.0_f64.powi(2), 9.0, 1.0);
            let covariance = local.transpose() * Matrix3::from_diagonal(&variances) * local;
            let axes = semi_axes_m(&place_m, &covariance).map(|axis| local * axis);
            for axis in axes {
                let [east_m, north_m, up_m] = [axis.x, axis.y, axis.z].map(f64::abs);
                assert!(up_m < 1e-9, "{axis}"); // metres, rounding
                let along_east = (east_m - 112.0).abs() < 1e-9 && north_m < 1e-9;
                let along_north = (north_m - 3.0).abs() < 1e-9 && east_m < 1e-9;
                assert!(along_east || along_north, "{axis}");
            }
        }
    }
}
