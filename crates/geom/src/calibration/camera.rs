//! The line camera: offset rotation, look angles, and their residuals with partial derivatives.

use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Position and axes of the spacecraft while a line is exposed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinePose {
    /// Position, body-fixed, metres.
    pub position_m: Vector3<f64>,
    /// From body-fixed components to the axes across the flight, along it and down.
    pub body_to_axes: Matrix3<f64>,
    /// Time from the middle of the orbit's images, mean line periods: the abscissa of an orbit's drift.
    pub after_lines: f64,
}

/// Offset angles of a line camera, radians.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Offset {
    /// φ, about the flight: roll.
    pub phi_rad: f64,
    /// ω, about the axis across the flight: pitch.
    pub omega_rad: f64,
    /// κ, about the axis that looks down: yaw.
    pub kappa_rad: f64,
}

impl Offset {
    /// `R_u = R_φ R_ω R_κ`, from the camera to the axes of the spacecraft.
    ///
    /// # Source
    /// Li et al. 2023, eq. 6.
    #[must_use]
    pub fn rotation(&self) -> Matrix3<f64> {
        let (sp, cp) = self.phi_rad.sin_cos();
        let (so, co) = self.omega_rad.sin_cos();
        let (sk, ck) = self.kappa_rad.sin_cos();
        Matrix3::new(
            cp * ck + sp * so * sk,
            -cp * sk + sp * so * ck,
            sp * co,
            co * sk,
            co * ck,
            -so,
            -sp * ck + cp * so * sk,
            sp * sk + cp * so * ck,
            cp * co,
        )
    }

    /// Change of `(XX, YY, ZZ)ᵀ = R_uᵀ u` by φ, ω and κ, columns.
    ///
    /// # Source
    /// Li et al. 2023, eq. 10, corrected.
    fn partials(&self, u: &Vector3<f64>, turned: &Vector3<f64>) -> Matrix3<f64> {
        let r = self.rotation();
        let (sk, ck) = self.kappa_rad.sin_cos();
        let by_phi = Vector3::new(
            r[(2, 0)] * u.x - r[(0, 0)] * u.z,
            r[(2, 1)] * u.x - r[(0, 1)] * u.z,
            r[(2, 2)] * u.x - r[(0, 2)] * u.z,
        );
        let by_omega = Vector3::new(sk * turned.z, ck * turned.z, -sk * turned.x - ck * turned.y);
        let by_kappa = Vector3::new(turned.y, -turned.x, 0.0);
        Matrix3::from_columns(&[by_phi, by_omega, by_kappa])
    }
}

/// A line of the camera: its offset rotation and the polynomials of its look angles.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LineCamera {
    /// Offset from the mounting in the support data.
    pub offset: Offset,
    /// `tan ψx` across the flight: coefficients of the powers of `s'`, which is −1 at the first edge and 1 at the last.
    pub m: Vec<f64>,
    /// `tan ψy` along the flight.
    pub n: Vec<f64>,
}

fn value(coefficients: &[f64], s: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * s + c)
}

impl LineCamera {
    /// Tangents across and along the flight of a sample `s'`, before the offset rotation.
    #[must_use]
    pub fn tangents(&self, s: f64) -> Vector2<f64> {
        Vector2::new(value(&self.m, s), value(&self.n, s))
    }

    /// Look direction of a sample `s'` in the axes of the spacecraft, of any length.
    #[must_use]
    pub fn look(&self, s: f64) -> Vector3<f64> {
        self.offset.rotation() * self.tangents(s).push(1.0)
    }
}

/// All estimated parameters.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CalibrationState {
    /// The lines of the camera.
    pub cameras: Vec<LineCamera>,
    /// Drift of the orbit, body-fixed, metres per image line: the same for all lines of the camera, as they fly
    /// together. The constant part of an orbit's error is not separable from the offsets, which absorb it.
    pub drift_m_per_line: [f64; 3],
}

/// A residual and its partial derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Linear {
    /// `V`, tangents across and along.
    pub(super) residual: Vector2<f64>,
    /// By φ, ω, κ.
    pub(super) by_offset: Matrix2x3<f64>,
    /// By the ground point, body-fixed metres; the derivative by the position of the spacecraft is the negative.
    pub(super) by_place: Matrix2x3<f64>,
}

impl CalibrationState {
    /// Position of the spacecraft, body-fixed metres.
    pub(super) fn position_m(&self, pose: &LinePose) -> Vector3<f64> {
        pose.position_m + self.drift_m(pose.after_lines)
    }

    /// Error of the orbit after this many line periods, body-fixed metres.
    #[must_use]
    pub fn drift_m(&self, after_lines: f64) -> Vector3<f64> {
        Vector3::from(self.drift_m_per_line) * after_lines
    }

    /// Residual of a ground point seen at a sample `s'` of a line; `None` behind the camera, or when it is not finite.
    pub(super) fn linear(
        &self,
        camera: usize,
        pose: &LinePose,
        s: f64,
        place_m: &Vector3<f64>,
    ) -> Option<Linear> {
        let line = &self.cameras[camera];
        let position_m = self.position_m(pose);
        let u = pose.body_to_axes * (place_m - position_m);
        let rotation = line.offset.rotation();
        let q = rotation.tr_mul(&u);
        // Written so that NaN is rejected.
        if !(q.z > 0.0) {
            return None;
        }
        let by_q = Matrix2x3::new(
            1.0 / q.z,
            0.0,
            -q.x / (q.z * q.z),
            0.0,
            1.0 / q.z,
            -q.y / (q.z * q.z),
        );
        let residual = Vector2::new(q.x / q.z, q.y / q.z) - line.tangents(s);
        residual.norm().is_finite().then(|| Linear {
            residual,
            by_offset: by_q * line.offset.partials(&u, &q),
            by_place: by_q * rotation.transpose() * pose.body_to_axes,
        })
    }
}
