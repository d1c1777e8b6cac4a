//! Orientation as polynomials: with pointing angles, and with a rotation vector.

use nalgebra::{Matrix3, Vector3};
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExteriorOrientation, PolynomialPath, Pose, PoseRate};
use crate::{
    attitude::{left_jacobian_product, matrix_of_rotation_vector},
    nearby_angle::NearbyAngle,
    polynomial::Polynomial,
};

/// Form of the exterior orientation of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum CameraModel {
    /// Positions and angles as polynomials of first order.
    FirstOrder,
    /// Positions and angles as polynomials of second order.
    SecondOrder,
    /// Positions and a rotation vector as polynomials of second order.
    RotationVector,
    /// Interpolation between the samples, without a polynomial over the whole image.
    Samples,
}

impl CameraModel {
    /// Every model, with its word in configuration and products.
    pub const WORDS: [(&'static str, Self); 4] = [
        ("first_order", Self::FirstOrder),
        ("second_order", Self::SecondOrder),
        ("rotation_vector", Self::RotationVector),
        ("samples", Self::Samples),
    ];
}

/// Three polynomials of at most second order in the image line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VectorPolynomial {
    /// Coefficients of `1`, `x` and `x²`.
    pub coefficients: [Vector3<f64>; 3],
}

/// Positions and pointing angles as polynomials of order 1 or 2.
///
/// # Source
/// Shan et al. 2005, eq. 1 and 2; `M = Rx(ω) Ry(φ) Rz(κ)`, see
/// [`OmegaPhiKappa`](crate::attitude::OmegaPhiKappa).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EulerPolynomial {
    /// Positions, metres.
    pub path_m: VectorPolynomial,
    /// ω, φ, κ, radians.
    pub angles_rad: VectorPolynomial,
}

/// Positions and a rotation vector as polynomials: no gimbal lock near the equator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationVectorPolynomial {
    /// Positions, metres.
    pub path_m: VectorPolynomial,
    /// `r(x)` with `M(x) = exp([r(x)]×) · reference`, radians.
    pub vector_rad: VectorPolynomial,
    /// `M` where the rotation vector is zero.
    pub reference: Matrix3<f64>,
}

impl VectorPolynomial {
    /// The polynomial of three components; coefficients above the second order are ignored.
    #[must_use]
    pub fn of(components: [&Polynomial; 3]) -> Self {
        let coefficient = |power: usize| {
            Vector3::from_iterator(components.iter().map(|component| {
                let coefficients = component.coefficients();
                coefficients.get(power).copied().unwrap_or(0.0)
            }))
        };
        Self {
            coefficients: [coefficient(0), coefficient(1), coefficient(2)],
        }
    }

    /// Value at `x`.
    #[must_use]
    pub fn value(&self, x: f64) -> Vector3<f64> {
        let [constant, linear, square] = &self.coefficients;
        constant + (linear + square * x) * x
    }

    /// Derivative at `x`.
    #[must_use]
    pub fn rate(&self, x: f64) -> Vector3<f64> {
        let [_, linear, square] = &self.coefficients;
        linear + square * (2.0 * x)
    }
}

/// Angles of a line, from which the sines and cosines of those of lines near it follow.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Anchor([NearbyAngle; 3]);

/// `M` of ω, φ, κ, and `Ω` of their rates.
struct EulerRotation {
    sin: Vector3<f64>,
    cos: Vector3<f64>,
}

impl EulerRotation {
    fn of(angles_rad: &Vector3<f64>) -> Self {
        let (mut sin, mut cos) = (Vector3::zeros(), Vector3::zeros());
        for index in 0..3 {
            (sin[index], cos[index]) = angles_rad[index].sin_cos();
        }
        Self { sin, cos }
    }

    /// The same within rounding, by the angles of a line nearby.
    fn near(angles_rad: &Vector3<f64>, anchor: &Anchor) -> Self {
        let [omega, phi, kappa] = &anchor.0;
        let (omega, phi, kappa) = (
            omega.sin_cos(angles_rad.x),
            phi.sin_cos(angles_rad.y),
            kappa.sin_cos(angles_rad.z),
        );
        Self {
            sin: Vector3::new(omega.0, phi.0, kappa.0),
            cos: Vector3::new(omega.1, phi.1, kappa.1),
        }
    }

    fn mars_to_camera(&self) -> Matrix3<f64> {
        let (so, sp, sk) = (self.sin.x, self.sin.y, self.sin.z);
        let (co, cp, ck) = (self.cos.x, self.cos.y, self.cos.z);
        Matrix3::new(
            cp * ck,
            -cp * sk,
            sp,
            co * sk + so * sp * ck,
            co * ck - so * sp * sk,
            -so * cp,
            so * sk - co * sp * ck,
            so * ck + co * sp * sk,
            co * cp,
        )
    }

    /// `Ω = ω' e₁ + Rx (φ' e₂ + Ry κ' e₃)`.
    fn turn_rad(&self, rates_rad: &Vector3<f64>) -> Vector3<f64> {
        let (so, sp) = (self.sin.x, self.sin.y);
        let (co, cp) = (self.cos.x, self.cos.y);
        let (omega, phi, kappa) = (rates_rad.x, rates_rad.y, rates_rad.z);
        Vector3::new(
            omega + sp * kappa,
            co * phi - so * cp * kappa,
            so * phi + co * cp * kappa,
        )
    }
}

impl ExteriorOrientation for EulerPolynomial {
    fn pose(&self, x: f64) -> Pose {
        Pose {
            position_m: self.path_m.value(x),
            mars_to_camera: EulerRotation::of(&self.angles_rad.value(x)).mars_to_camera(),
        }
    }

    fn pose_and_rate(&self, x: f64) -> (Pose, PoseRate) {
        self.turned(x, &EulerRotation::of(&self.angles_rad.value(x)))
    }

    fn anchor(&self, x: f64) -> Anchor {
        let angles_rad: [f64; 3] = self.angles_rad.value(x).into();
        Anchor(angles_rad.map(NearbyAngle::new))
    }

    fn pose_and_rate_near(&self, x: f64, anchor: &Anchor) -> (Pose, PoseRate) {
        self.turned(x, &EulerRotation::near(&self.angles_rad.value(x), anchor))
    }
}

impl EulerPolynomial {
    /// The pose with its change per line, with the rotation of the line.
    fn turned(&self, x: f64, rotation: &EulerRotation) -> (Pose, PoseRate) {
        let pose = Pose {
            position_m: self.path_m.value(x),
            mars_to_camera: rotation.mars_to_camera(),
        };
        let motion = PoseRate {
            advance_m: self.path_m.rate(x),
            turn_rad: rotation.turn_rad(&self.angles_rad.rate(x)),
        };
        (pose, motion)
    }
}

impl PolynomialPath for EulerPolynomial {
    fn path_m(&self) -> &VectorPolynomial {
        &self.path_m
    }
}

impl ExteriorOrientation for RotationVectorPolynomial {
    fn pose(&self, x: f64) -> Pose {
        Pose {
            position_m: self.path_m.value(x),
            mars_to_camera: matrix_of_rotation_vector(&self.vector_rad.value(x)) * self.reference,
        }
    }

    fn pose_and_rate(&self, x: f64) -> (Pose, PoseRate) {
        let motion = PoseRate {
            advance_m: self.path_m.rate(x),
            turn_rad: left_jacobian_product(&self.vector_rad.value(x), &self.vector_rad.rate(x)),
        };
        (self.pose(x), motion)
    }
}

impl PolynomialPath for RotationVectorPolynomial {
    fn path_m(&self) -> &VectorPolynomial {
        &self.path_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_near_a_line_are_those_of_the_line_within_rounding() {
        let polynomial = |constant, linear, square| VectorPolynomial {
            coefficients: [constant, linear, square],
        };
        let path_m = polynomial(
            Vector3::new(3.7e6, 1e5, -4e5),
            Vector3::new(0.1, 0.5, 3.0),
            Vector3::new(-1e-6, 1e-7, 1e-6),
        );
        let turn = Vector3::new(4e-7, -6e-7, 2e-7);
        let euler = EulerPolynomial {
            path_m,
            angles_rad: polynomial(Vector3::new(2.9, -1.1, -2.0), turn, 1e-4 * turn),
        };
        // Within the image, at the limit of the series, and beyond.
        for (anchor, x) in [
            (0.0, 0.0),
            (0.0, 80.0),
            (-4_000.0, -4_080.0),
            (0.0, 9_000.0),
            (0.0, 4e5),
        ] {
            let (pose, motion) = euler.pose_and_rate(x);
            let (near, motion_near) = euler.pose_and_rate_near(x, &euler.anchor(anchor));
            assert_eq!(pose.position_m, near.position_m);
            // Rounding of products of sines and cosines.
            assert!((pose.mars_to_camera - near.mars_to_camera).amax() < 1e-15);
            assert!((motion.turn_rad - motion_near.turn_rad).amax() < 1e-20);
        }
    }
}
