//! Rotation of Mars by the closed formulas of the IAU reports.

use nalgebra::{Matrix3, Vector3};

use crate::{
    constants::MarsModel,
    frames::{J2000, MarsDatum, MarsFixed, Position, Rotation},
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY},
};

/// Days in the Julian century of the IAU formulas.
const DAYS_PER_CENTURY: f64 = 36_525.0;

/// Rotation of the frame by `angle_rad` about axis 1 (x).
#[must_use]
pub fn frame_rotation_1(angle_rad: f64) -> Matrix3<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, -sin, cos)
}

/// Rotation of the frame by `angle_rad` about axis 2 (y).
#[must_use]
pub fn frame_rotation_2(angle_rad: f64) -> Matrix3<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Matrix3::new(cos, 0.0, -sin, 0.0, 1.0, 0.0, sin, 0.0, cos)
}

/// Rotation of the frame by `angle_rad` about axis 3 (z).
#[must_use]
pub fn frame_rotation_3(angle_rad: f64) -> Matrix3<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0)
}

/// Matrix from J2000 to the Mars-fixed frame of `model` at `et`.
///
/// # Accuracy
/// Equals CSPICE's text-kernel rotation to 1e-12 within decades of J2000.
/// # Source
/// `[W]₃ [90° − dec]₁ [90° + ra]₃`, NAIF PCK required reading; constants in [`crate::constants`].
#[must_use]
pub fn mars_matrix(model: &MarsModel, et: Et) -> Matrix3<f64> {
    let days = et.seconds() / SECONDS_PER_DAY;
    let centuries = days / DAYS_PER_CENTURY;
    let ra_deg = model.pole_ra_deg + model.pole_ra_deg_per_century * centuries;
    let dec_deg = model.pole_dec_deg + model.pole_dec_deg_per_century * centuries;
    let meridian_deg = (model.meridian_deg + model.meridian_deg_per_day * days).rem_euclid(360.0);
    frame_rotation_3(meridian_deg * RADIANS_PER_DEGREE)
        * frame_rotation_1((90.0 - dec_deg) * RADIANS_PER_DEGREE)
        * frame_rotation_3((90.0 + ra_deg) * RADIANS_PER_DEGREE)
}

/// Spin of Mars in its own axes, radians per second (the pole's own motion is 1e-14 rad/s).
#[must_use]
pub fn mars_spin_rad_s(model: &MarsModel) -> Vector3<f64> {
    Vector3::z() * (model.meridian_deg_per_day * RADIANS_PER_DEGREE / SECONDS_PER_DAY)
}

/// Rotation from J2000 to the Mars-fixed frame `F` at `et`.
#[must_use]
pub fn mars_rotation<F: MarsFixed>(et: Et) -> Rotation<J2000, F> {
    Rotation::new(mars_matrix(F::model(), et), et)
}

/// Takes a position out of the Mars-fixed frame of `datum` at `out_at` and into `F` at `into_at`.
///
/// Both instants are the same unless a clock correction is meant to turn Mars in between.
#[must_use]
pub fn convert_datum<F: MarsFixed>(
    xyz_m: Vector3<f64>,
    datum: MarsDatum,
    out_at: Et,
    into_at: Et,
) -> Position<F> {
    let inertial = mars_matrix(datum.model(), out_at).tr_mul(&xyz_m);
    mars_rotation::<F>(into_at).apply(&Position::new(inertial))
}
