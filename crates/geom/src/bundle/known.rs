//! A priori coordinates of points.

use nalgebra::{Matrix3, Vector3};

/// A priori uncertainty of coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownCoordinates {
    /// Principal axes of their covariance, Mars-fixed unit vectors, one a row.
    pub axes: Matrix3<f64>,
    /// Standard deviation along each of these, metres.
    pub sigma_m: Vector3<f64>,
}

impl KnownCoordinates {
    /// X, Y and Z with these standard deviations, metres.
    #[must_use]
    pub fn of_sigmas(sigma_m: Vector3<f64>) -> Self {
        Self {
            axes: Matrix3::identity(),
            sigma_m,
        }
    }

    /// Coordinates with this covariance, m².
    ///
    /// # Errors
    /// The least of its eigenvalues, m², where that is not positive or not a number.
    pub fn of_covariance(covariance_m2: &Matrix3<f64>) -> Result<Self, f64> {
        if !covariance_m2.iter().all(|value| value.is_finite()) {
            return Err(f64::NAN);
        }
        let eigen = covariance_m2.symmetric_eigen();
        let least_m2 = eigen.eigenvalues.min();
        if least_m2 > 0.0 {
            Ok(Self {
                axes: eigen.eigenvectors.transpose(),
                sigma_m: eigen.eigenvalues.map(f64::sqrt),
            })
        } else {
            Err(least_m2)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covariance_becomes_axes_and_one_that_is_none_is_refused() {
        // Well known in height, poorly in planimetry: the axes belong to the ground, not to Mars.
        let up = Vector3::new(1.0, 2.0, -2.0) / 3.0;
        let covariance_m2 = Matrix3::identity() * 1e6 - up * up.transpose() * (1e6 - 4.0);
        let known = KnownCoordinates::of_covariance(&covariance_m2).unwrap();
        let again = known.axes.transpose()
            * Matrix3::from_diagonal(&known.sigma_m.map(|sigma_m| sigma_m.powi(2)))
            * known.axes;
        // m²: rounding of 1e6.
        assert!((again - covariance_m2).norm() < 1e-8, "{again}");
        assert!((known.sigma_m.min() - 2.0).abs() < 1e-9); // metres
        let flat = Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 1.0));
        assert_eq!(KnownCoordinates::of_covariance(&flat), Err(0.0));
        assert!(KnownCoordinates::of_covariance(&Matrix3::repeat(f64::NAN)).is_err());
    }
}
