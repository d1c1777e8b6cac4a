//! Pointing angles ω φ κ, quaternions and rotation vectors.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::body_rotation::{frame_rotation_1, frame_rotation_2, frame_rotation_3};
use areograph_base::{instruments::Mounting, units::wrap_pi};

/// Pointing angles of a camera, radians.
///
/// `R(camera → Mars) = [κ]₃ [φ]₂ [ω]₁` with rotations of the frame, hence
/// `M = R(Mars → camera)` has `m13 = sin φ`, `m23 = −sin ω cos φ`, `m12 = −cos φ sin κ`.
///
/// # Source
/// Shan, Lee & Yoon 2002 give the angles, not their order; the order is the one under which their
/// nadir image looks at nadir. It is `eul2m(κ, φ, ω, 3, 2, 1)` in SPICE's notation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OmegaPhiKappa {
    /// ω, radians, `-π..π` when extracted from a matrix.
    pub omega_rad: f64,
    /// φ, radians, `|φ| ≤ π/2` when extracted from a matrix.
    pub phi_rad: f64,
    /// κ, radians, `-π..π` when extracted from a matrix.
    pub kappa_rad: f64,
}

impl OmegaPhiKappa {
    /// Angles of the matrix from camera to Mars-fixed components.
    #[must_use]
    pub fn from_camera_to_mars(camera_to_mars: &Matrix3<f64>) -> Self {
        let m = camera_to_mars.transpose();
        Self {
            omega_rad: (-m[(1, 2)]).atan2(m[(2, 2)]),
            // hypot keeps full accuracy where asin(m13) loses half the digits, at |φ| near 90°.
            phi_rad: m[(0, 2)].atan2(m[(1, 2)].hypot(m[(2, 2)])),
            kappa_rad: (-m[(0, 1)]).atan2(m[(0, 0)]),
        }
    }

    /// The matrix from camera to Mars-fixed components.
    #[must_use]
    pub fn camera_to_mars(&self) -> Matrix3<f64> {
        frame_rotation_3(self.kappa_rad)
            * frame_rotation_2(self.phi_rad)
            * frame_rotation_1(self.omega_rad)
    }
}

/// Adds full turns so that neighbouring angles, radians, differ by at most π.
pub fn unwrap_angles(angles_rad: &mut [f64]) {
    for index in 1..angles_rad.len() {
        let previous = angles_rad[index - 1];
        angles_rad[index] = previous + wrap_pi(angles_rad[index] - previous);
    }
}

/// Unit quaternion `(w, x, y, z)` in SPICE's convention (`m2q`) of the matrix `from → to`.
///
/// SPICE's quaternion of a matrix is the one whose active rotation *is* that matrix.
/// The sign makes `w` not negative.
#[must_use]
pub fn spice_quaternion(from_to: &Matrix3<f64>) -> [f64; 4] {
    let quaternion =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*from_to));
    let sign = if quaternion.w < 0.0 { -1.0 } else { 1.0 };
    [
        sign * quaternion.w,
        sign * quaternion.i,
        sign * quaternion.j,
        sign * quaternion.k,
    ]
}

/// The matrix of a SPICE quaternion `(w, x, y, z)` (`q2m`); it need not have unit length.
#[must_use]
pub fn matrix_of_spice_quaternion([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
        .to_rotation_matrix()
        .into_inner()
}

/// Quaternions of matrices in the convention of [`spice_quaternion`], each with the sign nearest to the one before.
#[must_use]
pub fn continuous_quaternions<'a>(
    matrices: impl IntoIterator<Item = &'a Matrix3<f64>>,
) -> Vec<[f64; 4]> {
    let mut quaternions: Vec<[f64; 4]> = matrices.into_iter().map(spice_quaternion).collect();
    make_continuous(&mut quaternions);
    quaternions
}

/// Chooses signs so that each quaternion is nearest to the one before it.
pub fn make_continuous(quaternions: &mut [[f64; 4]]) {
    for index in 1..quaternions.len() {
        let previous = quaternions[index - 1];
        let dot: f64 = previous
            .iter()
            .zip(quaternions[index])
            .map(|(a, b)| a * b)
            .sum();
        if dot < 0.0 {
            quaternions[index] = quaternions[index].map(|component| -component);
        }
    }
}

/// Matrix from the bus to a camera with this mounting.
#[must_use]
pub fn bus_to_camera(mounting: &Mounting) -> Matrix3<f64> {
    frame_rotation_3(mounting.yaw_rad)
        * frame_rotation_2(mounting.pitch_rad)
        * frame_rotation_1(mounting.roll_rad)
}

/// Rotation vector `r`, radians, with `exp([r]×) = matrix`.
#[must_use]
pub fn rotation_vector(matrix: &Matrix3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*matrix)).scaled_axis()
}

/// The matrix `exp([r]×)` of a rotation vector, radians.
#[must_use]
pub fn matrix_of_rotation_vector(vector_rad: &Vector3<f64>) -> Matrix3<f64> {
    Rotation3::new(*vector_rad).into_inner()
}

/// Below this angle, radians, the two factors of [`left_jacobian_product`] are taken from their series,
/// whose next terms are below 1e-11 of them there.
const SERIES_BELOW_RAD: f64 = 1e-2;

/// `Ω`, radians, with `d exp([r]×) = [Ω]× exp([r]×)` while `r` changes by `rate`: the left Jacobian of the
/// rotation times `rate`. Its transpose is the same with `−r`.
#[must_use]
pub fn left_jacobian_product(vector_rad: &Vector3<f64>, rate_rad: &Vector3<f64>) -> Vector3<f64> {
    let square = vector_rad.norm_squared();
    let angle = square.sqrt();
    let (first, second) = if angle < SERIES_BELOW_RAD {
        (
            0.5 - square / 24.0 + square * square / 720.0,
            1.0 / 6.0 - square / 120.0 + square * square / 5_040.0,
        )
    } else {
        (
            (1.0 - angle.cos()) / square,
            (angle - angle.sin()) / (square * angle),
        )
    };
    let across = vector_rad.cross(rate_rad);
    rate_rad + across * first + vector_rad.cross(&across) * second
}

/// Maximum number of steps towards the mean rotation; each leaves the cube of the remaining error.
const MEAN_STEPS_MAX: u32 = 20;
/// A step below this ends the iteration, radians.
const MEAN_STEP_RAD: f64 = 1e-14;

/// The rotation from which the rotation vectors to all of `matrices` add up to zero.
///
/// It is unique for rotations less than a right angle apart; it is the identity for an empty slice.
#[must_use]
pub fn mean_rotation(matrices: &[Matrix3<f64>]) -> Matrix3<f64> {
    let Some(first) = matrices.first() else {
        return Matrix3::identity();
    };
    let share = 1.0 / matrices.len() as f64;
    let mut mean = *first;
    for _ in 0..MEAN_STEPS_MAX {
        let step_rad: Vector3<f64> = matrices
            .iter()
            .map(|matrix| share * rotation_vector(&(matrix * mean.transpose())))
            .sum();
        mean = matrix_of_rotation_vector(&step_rad) * mean;
        if step_rad.norm() < MEAN_STEP_RAD {
            break;
        }
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::RADIANS_PER_DEGREE;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angles_and_quaternions_give_the_same_matrix_back(
            omega_rad in -3.1..3.1_f64, phi_rad in -1.57..1.57_f64, kappa_rad in -3.1..3.1_f64,
        ) {
            let matrix = OmegaPhiKappa { omega_rad, phi_rad, kappa_rad }.camera_to_mars();
            let angles = OmegaPhiKappa::from_camera_to_mars(&matrix);
            prop_assert!((angles.camera_to_mars() - matrix).abs().max() < 1e-14); // rounding of nine products
            prop_assert!(angles.phi_rad.abs() <= std::f64::consts::FRAC_PI_2);
            let quaternion = spice_quaternion(&matrix);
            prop_assert!((matrix_of_spice_quaternion(quaternion) - matrix).abs().max() < 1e-14);
            let vector = rotation_vector(&matrix);
            prop_assert!((matrix_of_rotation_vector(&vector) - matrix).abs().max() < 1e-13);
        }
    }

    #[test]
    fn the_nadir_image_of_shan_2002_looks_at_nadir() {
        // Right image of the EO table, start, its Y corrected to -2435.358 km (orbit radius 3776.24 km).
        let angles = OmegaPhiKappa {
            omega_rad: 11.3701 * RADIANS_PER_DEGREE,
            phi_rad: -75.9648 * RADIANS_PER_DEGREE,
            kappa_rad: -126.5760 * RADIANS_PER_DEGREE,
        };
        let boresight = angles.camera_to_mars() * Vector3::z();
        let nadir = -Vector3::new(2743.679, -2435.358, -895.114).normalize();
        let off_nadir_deg = boresight.angle(&nadir) / RADIANS_PER_DEGREE;
        assert!((off_nadir_deg - 0.125).abs() < 0.001, "{off_nadir_deg} deg"); // angles have 1e-4 deg
    }

    #[test]
    fn the_mean_rotation_lies_in_the_middle() {
        let about_z = |angle_rad: f64| {
            matrix_of_rotation_vector(&Vector3::new(0.0, 0.0, angle_rad)) * frame_rotation_1(0.3)
        };
        let mean = mean_rotation(&[about_z(0.1), about_z(0.2), about_z(0.6)]);
        assert!((mean - about_z(0.3)).norm() < 1e-14); // rounding
        let (tilted, other) = (frame_rotation_1(1e-3), frame_rotation_2(-2e-3));
        let mean = mean_rotation(&[tilted, other, about_z(0.0)]);
        let rest: Vector3<f64> = [tilted, other, about_z(0.0)]
            .iter()
            .map(|matrix| rotation_vector(&(matrix * mean.transpose())))
            .sum();
        assert!(rest.norm() < 1e-13); // the definition, to the size of the last step
        assert_eq!(mean_rotation(&[]), Matrix3::identity());
    }

    #[test]
    fn unwrapping_crosses_the_branch_cut() {
        let mut angles = [179.9, -179.9, -179.7, 179.8].map(|deg| deg * RADIANS_PER_DEGREE);
        unwrap_angles(&mut angles);
        let expected = [179.9, 180.1, 180.3, 179.8];
        for (angle, expected_deg) in angles.iter().zip(expected) {
            assert!((angle / RADIANS_PER_DEGREE - expected_deg).abs() < 1e-9); // degrees, rounding only
        }
    }
}
