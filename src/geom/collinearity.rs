//! Collinearity of one ground point and one exterior orientation, with its partial derivatives.
//!
//! With `d = P − C` and `q = M d`, `M` from Mars-fixed to camera components:
//! `x = −f q₁/q₃` along the track and `y = −f q₂/q₃` across it. A pushbroom line sees the points of its
//! own plane only: with the orientation of that line `x = 0`.

use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

use super::attitude::OmegaPhiKappa;
use crate::error::{Fault, Kind};

/// A point that the camera cannot see because it lies behind the plane of the perspective centre.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the ground point lies {depth_m:.1} m along the boresight, expected in front of the camera"
)]
pub struct BehindCamera {
    /// Component of the point along the boresight, metres; not positive, or not a number.
    pub depth_m: f64,
}

impl Fault for BehindCamera {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "check that the point belongs to this image and that positions and angles are in metres and radians"
            .to_owned()
    }
}

/// Position of the perspective centre and pointing of one image line, Mars-fixed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineOrientation {
    /// Perspective centre, metres.
    pub position_m: Vector3<f64>,
    /// Pointing angles.
    pub angles: OmegaPhiKappa,
}

/// Focal-plane coordinates of a point and how they change, in the unit of the focal length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocalPoint {
    /// Along-track `x` and across-track `y`.
    pub focal: Vector2<f64>,
    /// Change per metre of the point in camera components: what any other rotation is chained to.
    pub by_camera_point: Matrix2x3<f64>,
    /// Change per metre of the ground point; per metre of the perspective centre it is the negative.
    pub by_ground: Matrix2x3<f64>,
    /// Change per radian of ω, φ and κ.
    pub by_angles: Matrix2x3<f64>,
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
    // Written so that NaN is refused.
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

/// Change of camera components per radian of ω, φ and κ, one column each.
///
/// `M = Rx(ω) Ry(φ) Rz(κ)`, so each angle turns `q` about the axis it has after the rotations that
/// follow it.
#[must_use]
pub fn camera_point_by_angles(
    mars_to_camera: &Matrix3<f64>,
    omega_rad: f64,
    camera_point_m: &Vector3<f64>,
) -> Matrix3<f64> {
    let (sin, cos) = omega_rad.sin_cos();
    Matrix3::from_columns(&[
        Vector3::x().cross(camera_point_m),
        Vector3::new(0.0, cos, sin).cross(camera_point_m),
        mars_to_camera.column(2).cross(camera_point_m),
    ])
}

/// Focal-plane coordinates of `ground_m` seen by a line, with all partial derivatives.
///
/// # Errors
/// The point is not in front of the camera.
/// # Source
/// Shan et al. 2005, eq. 1; the printed second equation of Yoon & Shan 2004 has the denominators of the first.
pub fn observe(
    ground_m: &Vector3<f64>,
    line: &LineOrientation,
    focal_length: f64,
) -> Result<FocalPoint, BehindCamera> {
    let mars_to_camera = line.angles.camera_to_mars().transpose();
    let camera_point_m = mars_to_camera * (ground_m - line.position_m);
    let focal = project(&camera_point_m, focal_length)?;
    let by_camera_point = by_camera_point(&camera_point_m, focal_length);
    Ok(FocalPoint {
        focal,
        by_camera_point,
        by_ground: by_camera_point * mars_to_camera,
        by_angles: by_camera_point
            * camera_point_by_angles(&mars_to_camera, line.angles.omega_rad, &camera_point_m),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::RADIANS_PER_DEGREE;
    use proptest::prelude::*;

    /// Nominal focal length in pixels of an image that sums two detectors.
    const FOCAL_LENGTH_PX: f64 = 3500.0 / 0.026;

    fn line(omega_rad: f64, phi_rad: f64, kappa_rad: f64) -> LineOrientation {
        LineOrientation {
            position_m: Vector3::new(2_743_679.0, -2_435_358.0, -895_114.0),
            angles: OmegaPhiKappa {
                omega_rad,
                phi_rad,
                kappa_rad,
            },
        }
    }

    proptest! {
        #[test]
        fn partials_equal_central_differences(
            omega_rad in -3.0..3.0_f64, phi_rad in -1.5..1.5_f64, kappa_rad in -3.0..3.0_f64,
            along in -0.05..0.05_f64, across in -0.05..0.05_f64, depth_m in 3e5..6e5_f64,
        ) {
            let line = line(omega_rad, phi_rad, kappa_rad);
            let ground_m = line.position_m
                + line.angles.camera_to_mars() * (depth_m * Vector3::new(along, across, 1.0));
            let seen = observe(&ground_m, &line, FOCAL_LENGTH_PX).unwrap();
            let focal = |ground_m: Vector3<f64>, line: &LineOrientation| {
                observe(&ground_m, line, FOCAL_LENGTH_PX).unwrap().focal
            };
            // Steps for which truncation and rounding are both near 1e-9 of the derivative.
            let (step_m, step_rad) = (50.0, 1e-4);
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = step_m;
                let ground = (focal(ground_m + step, &line) - focal(ground_m - step, &line)) / (2.0 * step_m);
                prop_assert!((ground - seen.by_ground.column(axis)).norm() < 1e-6 * seen.by_ground.norm());
                let moved = |sign: f64| LineOrientation { position_m: line.position_m + sign * step, ..line };
                let position = (focal(ground_m, &moved(1.0)) - focal(ground_m, &moved(-1.0))) / (2.0 * step_m);
                prop_assert!((position + seen.by_ground.column(axis)).norm() < 1e-6 * seen.by_ground.norm());
                let turned = |sign: f64| {
                    let mut angles = [omega_rad, phi_rad, kappa_rad];
                    angles[axis] += sign * step_rad;
                    self::line(angles[0], angles[1], angles[2])
                };
                let angle = (focal(ground_m, &turned(1.0)) - focal(ground_m, &turned(-1.0))) / (2.0 * step_rad);
                prop_assert!((angle - seen.by_angles.column(axis)).norm() < 1e-6 * seen.by_angles.norm());
            }
        }
    }

    #[test]
    fn flight_is_towards_positive_x() {
        // Corrected right image of the 2002 table, start; the end of the image lies ahead.
        let line = line(
            11.3701 * RADIANS_PER_DEGREE,
            -75.9648 * RADIANS_PER_DEGREE,
            -126.5760 * RADIANS_PER_DEGREE,
        );
        let flight = Vector3::new(2_749_133.0, -2_450_626.0, -836_828.0) - line.position_m;
        let below = line.position_m + line.angles.camera_to_mars() * Vector3::new(0.0, 0.0, 380e3);
        let ahead = observe(&(below + flight), &line, FOCAL_LENGTH_PX).unwrap();
        assert!(ahead.focal.x > 0.0);
        let centre = observe(&below, &line, FOCAL_LENGTH_PX).unwrap();
        assert!(centre.focal.norm() < 1e-6); // pixels, rounding
    }

    #[test]
    fn points_behind_the_camera_are_refused() {
        let line = line(0.1, 0.2, 0.3);
        let up = line.angles.camera_to_mars() * Vector3::new(0.0, 0.0, -380e3);
        let fault = observe(&(line.position_m + up), &line, FOCAL_LENGTH_PX).unwrap_err();
        assert!((fault.depth_m + 380e3).abs() < 1e-6); // metres, rounding
        assert!(observe(&line.position_m, &line, FOCAL_LENGTH_PX).is_err());
        assert!(project(&Vector3::new(0.0, 0.0, f64::NAN), FOCAL_LENGTH_PX).is_err());
    }
}
