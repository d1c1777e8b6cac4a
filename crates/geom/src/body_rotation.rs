//! Rotation of bodies by the closed formulas of the IAU reports.

use nalgebra::{Matrix3, Vector3};

use areograph_base::{
    body::{Body, BodyModel, Datum},
    frames::{BodyFixed, J2000, Position, Rotation},
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

/// Matrix from J2000 to the body-fixed frame of `model` at `et`.
///
/// # Accuracy
/// Equals CSPICE's text-kernel rotation to 1e-12 within decades of J2000.
/// # Source
/// `[W]₃ [90° − dec]₁ [90° + ra]₃`, NAIF PCK required reading; constants in [`areograph_base::body`].
#[must_use]
pub fn body_matrix(model: &BodyModel, et: Et) -> Matrix3<f64> {
    let days = et.seconds() / SECONDS_PER_DAY;
    let centuries = days / DAYS_PER_CENTURY;
    let mut ra_deg = model.pole_ra_deg + model.pole_ra_deg_per_century * centuries;
    let mut dec_deg = model.pole_dec_deg + model.pole_dec_deg_per_century * centuries;
    let mut meridian_deg = model.meridian_deg + model.meridian_deg_per_day * days;
    meridian_deg += model.meridian_deg_per_day2 * days * days;
    for term in &model.nutation {
        let angle_deg = term.angle_deg + term.angle_deg_per_century * centuries;
        let (sin, cos) = (angle_deg.rem_euclid(360.0) * RADIANS_PER_DEGREE).sin_cos();
        ra_deg += term.pole_ra_deg * sin;
        dec_deg += term.pole_dec_deg * cos;
        meridian_deg += term.meridian_deg * sin;
    }
    frame_rotation_3(meridian_deg.rem_euclid(360.0) * RADIANS_PER_DEGREE)
        * frame_rotation_1((90.0 - dec_deg) * RADIANS_PER_DEGREE)
        * frame_rotation_3((90.0 + ra_deg) * RADIANS_PER_DEGREE)
}

/// Spin of a body in its own axes, radians per second: the pole of Mars moves by 1e-14 rad/s, the periodic terms of the
/// Moon change its spin by 3e-9 rad/s, five millimetres a second on the ground.
#[must_use]
pub fn spin_rad_s(model: &BodyModel) -> Vector3<f64> {
    Vector3::z() * (model.meridian_deg_per_day * RADIANS_PER_DEGREE / SECONDS_PER_DAY)
}

/// Rotation from J2000 to the frame of the products of `body` at `et`.
#[must_use]
pub fn body_rotation(body: Body, et: Et) -> Rotation<J2000, BodyFixed> {
    Rotation::new(body_matrix(body.model(), et), et)
}

/// Conversion from the body-fixed frame of a datum at an instant to the products' frame of a body.
#[derive(Debug, Clone)]
pub struct DatumConversion {
    /// From J2000 to the frame of the datum.
    from_j2000: Matrix3<f64>,
    into: Rotation<J2000, BodyFixed>,
}

impl DatumConversion {
    /// From the frame of `datum` at `out_at` to the products' frame of `body` at `into_at`.
    ///
    /// Both instants are equal unless a clock correction rotates the body between them.
    #[must_use]
    pub fn of(body: Body, datum: Datum, out_at: Et, into_at: Et) -> Self {
        Self {
            from_j2000: body_matrix(datum.model(), out_at),
            into: body_rotation(body, into_at),
        }
    }

    /// The position in the products' frame.
    #[must_use]
    pub fn apply(&self, xyz_m: &Vector3<f64>) -> Position<BodyFixed> {
        self.into
            .apply(&Position::new(self.from_j2000.tr_mul(xyz_m)))
    }
}

/// Converts one position by [`DatumConversion`].
#[must_use]
pub fn convert_datum(
    body: Body,
    xyz_m: Vector3<f64>,
    datum: Datum,
    out_at: Et,
    into_at: Et,
) -> Position<BodyFixed> {
    DatumConversion::of(body, datum, out_at, into_at).apply(&xyz_m)
}
