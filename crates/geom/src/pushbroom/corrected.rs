//! Corrections that an adjustment adds to an orientation of any form.

use nalgebra::Vector3;

use super::{ExteriorOrientation, Pose, PoseRate};
use crate::attitude::{left_jacobian_product, matrix_of_rotation_vector};

/// Small polynomials of second order in `t = x/half_lines`, of position and of rotation.
///
/// The rotation vector `θ(t)` has camera components: `M = exp([θ]×) M_base`, the sense of [`PoseRate::turn_rad`]. Hence
/// there is no gimbal lock in any look direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientationCorrection {
    /// Coefficients of `1`, `t` and `t²` of the position, Mars-fixed, metres.
    pub position_m: [Vector3<f64>; 3],
    /// Coefficients of `1`, `t` and `t²` of the rotation vector, camera components, radians.
    pub rotation_rad: [Vector3<f64>; 3],
    /// Half the number of lines of the image, the unit of `t`.
    pub half_lines: f64,
    /// Lines by which the lines were exposed later than their tags: the base is evaluated there.
    pub time_shift_lines: f64,
}

/// An orientation with its correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrectedOrientation<M> {
    /// The orientation before correction.
    pub base: M,
    /// Its correction.
    pub correction: OrientationCorrection,
}

impl OrientationCorrection {
    /// The correction with these coefficients at `[3·quantity + power]`, quantities X, Y and Z and the
    /// rotations about x, y and z.
    #[must_use]
    pub fn of(coefficients: &[f64; 18], half_lines: f64, time_shift_lines: f64) -> Self {
        let vectors = |first: usize| {
            [0, 1, 2]
                .map(|power| Vector3::from_fn(|axis, _| coefficients[3 * (first + axis) + power]))
        };
        Self {
            position_m: vectors(0),
            rotation_rad: vectors(3),
            half_lines,
            time_shift_lines,
        }
    }

    /// The coefficients in the order of [`Self::of`].
    #[must_use]
    pub fn coefficients(&self) -> [f64; 18] {
        std::array::from_fn(|index| {
            let vectors = if index < 9 {
                &self.position_m
            } else {
                &self.rotation_rad
            };
            vectors[index % 3][index / 3 % 3]
        })
    }

    /// The rotation vector `θ` at line `x`, radians.
    #[must_use]
    pub fn turn_rad(&self, x: f64) -> Vector3<f64> {
        value(&self.rotation_rad, x / self.half_lines)
    }

    /// The position correction at line `x`, metres.
    #[must_use]
    pub fn shift_m(&self, x: f64) -> Vector3<f64> {
        value(&self.position_m, x / self.half_lines)
    }

    /// The pose of line `x` from the pose `base` of its base there, time shift included.
    #[must_use]
    pub fn applied(&self, x: f64, base: &Pose) -> Pose {
        Pose {
            position_m: base.position_m + self.shift_m(x),
            mars_to_camera: matrix_of_rotation_vector(&self.turn_rad(x)) * base.mars_to_camera,
        }
    }
}

fn value([constant, linear, square]: &[Vector3<f64>; 3], t: f64) -> Vector3<f64> {
    constant + (linear + square * t) * t
}

fn rate([_, linear, square]: &[Vector3<f64>; 3], t: f64) -> Vector3<f64> {
    linear + square * (2.0 * t)
}

impl<M: ExteriorOrientation> ExteriorOrientation for CorrectedOrientation<M> {
    fn pose(&self, x: f64) -> Pose {
        let base = self.base.pose(x + self.correction.time_shift_lines);
        self.correction.applied(x, &base)
    }

    fn pose_and_rate(&self, x: f64) -> (Pose, PoseRate) {
        let correction = &self.correction;
        let (base, motion) = self.base.pose_and_rate(x + correction.time_shift_lines);
        let t = x / correction.half_lines;
        let vector_rad = value(&correction.rotation_rad, t);
        let vector_rate_rad = rate(&correction.rotation_rad, t) / correction.half_lines;
        let rotation = matrix_of_rotation_vector(&vector_rad);
        let pose = Pose {
            position_m: base.position_m + value(&correction.position_m, t),
            mars_to_camera: rotation * base.mars_to_camera,
        };
        let motion = PoseRate {
            advance_m: motion.advance_m + rate(&correction.position_m, t) / correction.half_lines,
            turn_rad: left_jacobian_product(&vector_rad, &vector_rate_rad)
                + rotation * motion.turn_rad,
        };
        (pose, motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pushbroom::{EulerPolynomial, VectorPolynomial};

    fn corrected(scale: f64) -> CorrectedOrientation<EulerPolynomial> {
        let coefficients = std::array::from_fn(|index| {
            let sign = if index % 2 == 0 { scale } else { -scale };
            let size = if index < 9 { 150.0 } else { 4e-3 };
            sign * size * (1.0 + 0.1 * index as f64)
        });
        CorrectedOrientation {
            base: EulerPolynomial {
                path_m: VectorPolynomial {
                    coefficients: [
                        Vector3::new(3_776e3, 10e3, -300.0),
                        Vector3::new(0.1, 0.2, 4.4),
                        Vector3::new(-1e-6, 2e-7, 0.0),
                    ],
                },
                angles_rad: VectorPolynomial {
                    coefficients: [
                        Vector3::new(0.3, -1.2, 1e-3),
                        Vector3::new(1e-6, 2e-6, -3e-6),
                        Vector3::new(1e-11, -3e-11, 2e-11),
                    ],
                },
            },
            correction: OrientationCorrection::of(&coefficients, 5_000.0, 12.5 * scale),
        }
    }

    #[test]
    fn no_correction_changes_nothing() {
        let orientation = corrected(0.0);
        for x in [-4_000.0, 0.0, 731.5] {
            assert_eq!(
                orientation.pose_and_rate(x),
                orientation.base.pose_and_rate(x)
            );
            assert_eq!(orientation.pose(x), orientation.base.pose(x));
        }
    }

    #[test]
    fn motion_is_the_derivative_of_the_pose() {
        const STEP: f64 = 1.0; // lines
        let orientation = corrected(1.0);
        for x in [-4_900.0, -3.0, 2_500.0] {
            let (pose, motion) = orientation.pose_and_rate(x);
            assert_eq!(pose, orientation.pose(x));
            let (before, after) = (orientation.pose(x - STEP), orientation.pose(x + STEP));
            let advance_m = (after.position_m - before.position_m) / (2.0 * STEP);
            // Positions of 4e6 m are rounded at 1e-9 m.
            assert!((advance_m - motion.advance_m).norm() < 1e-9 * 4.4);
            let change = (after.mars_to_camera - before.mars_to_camera) / (2.0 * STEP);
            let expected = motion.turn_rad.cross_matrix() * pose.mars_to_camera;
            // Truncation is 1e-9 of turns of 1e-5 a line that change by 1e-9.
            assert!((change - expected).norm() < 1e-8 * motion.turn_rad.norm());
        }
    }

    #[test]
    fn coefficients_go_in_and_out() {
        let correction = corrected(1.0).correction;
        let again = OrientationCorrection::of(&correction.coefficients(), 5_000.0, 12.5);
        assert_eq!(again, correction);
    }
}
