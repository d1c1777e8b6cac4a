//! Collinearity of one ground point and one exterior orientation, with its partial derivatives.
//!
//! With `d = P − C` and `q = M d`, `M` from Mars-fixed to camera components: `x = −f q₁/q₃` along the track and
//! `y = −f q₂/q₃` across it. A pushbroom line sees only the points of its plane: with the orientation of that line
//! `x = 0`.

use nalgebra::{Matrix2x3, Vector2, Vector3};

use areograph_base::error::Cause;

/// A point that the camera cannot see because it lies behind the plane of the perspective centre.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, Cause)]
#[error(
    "the ground point lies {depth_m:.1} m along the boresight; expected a point in front of the camera"
)]
#[cause(Input: "check that the point belongs to this image and that positions are in metres and angles in radians")]
pub struct BehindCamera {
    /// Component of the point along the boresight, metres; not positive, or not a number.
    pub depth_m: f64,
}

/// Focal-plane coordinates of the point `camera_point_m` in camera components.
///
/// The result has the unit of `focal_length`: metres, millimetres, or pixels of the image.
///
/// # Errors
/// The point is not in front of the camera.
pub fn project(
    camera_point_m: &Vector3<f64>,
    focal_length: f64,
) -> Result<Vector2<f64>, BehindCamera> {
    let depth_m = camera_point_m.z;
    // Written so that NaN is rejected.
    if !(depth_m > 0.0) {
        return Err(BehindCamera { depth_m });
    }
    Ok(-focal_length / depth_m * camera_point_m.xy())
}

/// Change of [`project`] per metre of the point, which is in front of the camera.
#[must_use]
pub fn by_camera_point(camera_point_m: &Vector3<f64>, focal_length: f64) -> Matrix2x3<f64> {
    let q = camera_point_m;
    let scale = -focal_length / q.z;
    Matrix2x3::new(
        scale,
        0.0,
        -scale * q.x / q.z,
        0.0,
        scale,
        -scale * q.y / q.z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::OmegaPhiKappa;
    use areograph_base::units::RADIANS_PER_DEGREE;
    use proptest::prelude::*;

    /// Nominal focal length in pixels of an image that sums two detectors.
    const FOCAL_LENGTH_PX: f64 = 3500.0 / 0.026;

    proptest! {
        #[test]
        fn partials_equal_central_differences(
            along in -0.05..0.05_f64, across in -0.05..0.05_f64, depth_m in 3e5..6e5_f64,
        ) {
            // A step for which truncation and rounding are both near 1e-9 of the derivative.
            const STEP_M: f64 = 50.0;
            let camera_m = depth_m * Vector3::new(along, across, 1.0);
            let analytic = by_camera_point(&camera_m, FOCAL_LENGTH_PX);
            let focal = |camera_m: Vector3<f64>| project(&camera_m, FOCAL_LENGTH_PX).unwrap();
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = STEP_M;
                let numeric = (focal(camera_m + step) - focal(camera_m - step)) / (2.0 * STEP_M);
                prop_assert!((numeric - analytic.column(axis)).norm() < 1e-6 * analytic.norm());
            }
        }
    }

    #[test]
    fn flight_is_towards_positive_x() {
        // Corrected right image of the 2002 table, start; the end of the image lies ahead.
        let angles = OmegaPhiKappa {
            omega_rad: 11.3701 * RADIANS_PER_DEGREE,
            phi_rad: -75.9648 * RADIANS_PER_DEGREE,
            kappa_rad: -126.5760 * RADIANS_PER_DEGREE,
        };
        let start_m = Vector3::new(2_743_679.0, -2_435_358.0, -895_114.0);
        let flight_m = Vector3::new(2_749_133.0, -2_450_626.0, -836_828.0) - start_m;
        let ahead_m = angles.camera_to_mars().tr_mul(&flight_m) + Vector3::new(0.0, 0.0, 380e3);
        assert!(project(&ahead_m, FOCAL_LENGTH_PX).unwrap().x > 0.0);
    }

    #[test]
    fn points_behind_the_camera_are_refused() {
        let behind_m = Vector3::new(10.0, 20.0, -380e3);
        let error = project(&behind_m, FOCAL_LENGTH_PX).unwrap_err();
        assert!((error.depth_m + 380e3).abs() < 1e-9); // metres, rounding
        assert!(project(&Vector3::zeros(), FOCAL_LENGTH_PX).is_err());
        assert!(project(&Vector3::new(0.0, 0.0, f64::NAN), FOCAL_LENGTH_PX).is_err());
    }
}
