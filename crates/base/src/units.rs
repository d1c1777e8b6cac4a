//! Conversions at the boundary: kilometres, degrees, microdegrees and centimetres exist only in files.
//!
//! Inside areograph lengths are metres, angles radians and times seconds. Parsers multiply by these
//! constants and writers divide by them; nothing else does.
//!
//! Kilometres exist in `spice`, in camera models and exchange files, degrees in configuration, tables and the report,
//! milliseconds in labels. A key or column ends in its unit.
//!
//! ```
//! use areograph_base::units::{METRES_PER_KM, RADIANS_PER_DEGREE, wrap_two_pi};
//!
//! // A label states 178.2° W; inside, longitudes are radians east.
//! let longitude_rad = wrap_two_pi(-178.2 * RADIANS_PER_DEGREE);
//! assert!((longitude_rad / RADIANS_PER_DEGREE - 181.8).abs() < 1e-12); // rounding, degrees
//!
//! let altitude_m = 378.5 * METRES_PER_KM;
//! assert!((altitude_m - 378_500.0).abs() < 1e-9); // rounding, metres
//! ```

/// Metres in a kilometre.
pub const METRES_PER_KM: f64 = 1_000.0;
/// Metres in a centimetre, the length unit of PEDR integers.
pub const METRES_PER_CM: f64 = 0.01;
/// Radians in a degree.
pub const RADIANS_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Radians in a microdegree, the angle unit of PEDR integers.
pub const RADIANS_PER_MICRODEGREE: f64 = RADIANS_PER_DEGREE * 1e-6;
/// Radians in an arcsecond.
pub const RADIANS_PER_ARCSECOND: f64 = RADIANS_PER_DEGREE / 3_600.0;
/// Seconds in a millisecond.
pub const SECONDS_PER_MS: f64 = 1e-3;
/// Seconds in a day of 86 400 s.
pub const SECONDS_PER_DAY: f64 = 86_400.0;

/// An angle in radians brought into `0 <= angle < 2π`.
#[must_use]
pub fn wrap_two_pi(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let wrapped = angle_rad.rem_euclid(turn);
    // A tiny negative angle rounds up to the full turn itself.
    if wrapped >= turn { 0.0 } else { wrapped }
}

/// An angle in radians brought into `-π <= angle < π`.
#[must_use]
pub fn wrap_pi(angle_rad: f64) -> f64 {
    wrap_two_pi(angle_rad + std::f64::consts::PI) - std::f64::consts::PI
}

/// Steps in longitude this close to half a turn or a whole turn, radians, count as such (3 µm on the ground).
const TURN_TOLERANCE_RAD: f64 = 1e-12;

/// A step in longitude as written, radians, or the shorter direction if it is longer than half a turn.
///
/// A whole turn is kept: polar caps are written with an edge from −180° to 180°.
#[must_use]
pub fn longitude_step_rad(written_rad: f64) -> f64 {
    let (half, whole) = (std::f64::consts::PI, std::f64::consts::TAU);
    let length = written_rad.abs();
    if length <= half + TURN_TOLERANCE_RAD || (length - whole).abs() <= TURN_TOLERANCE_RAD {
        written_rad
    } else {
        wrap_pi(written_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn wrapping_keeps_the_half_open_ranges() {
        for turns in -3..=3 {
            for angle in [-1e-17, 0.0, 1e-17, 1.0, PI, TAU - 1e-9] {
                let shifted = angle + f64::from(turns) * TAU;
                assert!((0.0..TAU).contains(&wrap_two_pi(shifted)), "{shifted}");
                assert!((-PI..PI).contains(&wrap_pi(shifted)), "{shifted}");
            }
        }
    }
}
