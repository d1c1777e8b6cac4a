//! Orientation as polynomials: with pointing angles, and with a rotation vector.

use nalgebra::{Matrix3, Vector3};
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExteriorOrientation, PolynomialPath, Pose, PoseRate};
use crate::{
    attitude::{left_jacobian_product, matrix_of_rotation_vector},
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
        let rotation = EulerRotation::of(&self.angles_rad.value(x));
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
