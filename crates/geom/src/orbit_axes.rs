//! The axes in which orbits are compared.

use nalgebra::{Matrix3, Vector3};

/// Unit vectors of an orbit as columns: radial, along the track, across it (along the orbit's normal).
///
/// Position and velocity are in one inertial frame, of any length; along the track is at right angles to the radius,
/// hence not exactly the direction of flight. The three are right-handed.
#[must_use]
pub fn radial_along_cross(position: &Vector3<f64>, velocity: &Vector3<f64>) -> Matrix3<f64> {
    let radial = position.normalize();
    let cross = position.cross(velocity).normalize();
    Matrix3::from_columns(&[radial, cross.cross(&radial), cross])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_climbing_eastward_flight_over_the_equator() {
        // Over longitude 90°, flying east (towards −x) and upwards: the normal points north.
        let position = Vector3::new(0.0, 3.8e6, 0.0);
        let velocity = Vector3::new(-3.3e3, 50.0, 0.0);
        let expected = Matrix3::from_columns(&[Vector3::y(), -Vector3::x(), Vector3::z()]);
        assert!((radial_along_cross(&position, &velocity) - expected).norm() < 1e-15); // rounding
    }
}
