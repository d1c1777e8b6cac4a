//! Light time and stellar aberration: the origin of the straight rays of the geometry.
//!
//! Light that a line exposed at `t` records left the ground `λ = range / c` earlier, and the camera, which moves over
//! the ground with `v`, sees it displaced forwards. To the first order in `v/c` both effects together are equivalent to
//! a camera at its position at `t − λ`, relative to Mars as it was then, with its attitude at `t`: the ray from there
//! to the ground is straight. The motion of Mars around the Sun cancels.
//!
//! Source: the first order of light time to the surface point and of stellar aberration (NAIF's `spkcpt` with `LT+S`);
//! omitted terms are of the order `(V/c)²` of the range, with the 24 km/s of Mars 1 mm at 380 km.

use nalgebra::Vector3;
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::{constants::SPEED_OF_LIGHT_M_S, time::Interval};

/// Steps of the inverse of the aberration; each reduces the error to 1e-4.
const STEPS: u32 = 4;

/// Light-time convention: instant and observer to which camera positions refer; one convention for a whole run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LightTime {
    /// Position of the camera when the light left the ground, with light time to the ground point and aberration.
    Surface,
    /// Position of the camera when the line was exposed.
    None,
    /// Apparent position of the camera from the centre of the body, with light time and aberration, as in ISIS and ALE.
    Centre,
    /// Position of the camera in the support data of an image; not a convention of a run.
    Support,
}

impl LightTime {
    /// Every convention of a run, with its word in configuration and products.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("surface", Self::Surface),
        ("none", Self::None),
        ("centre", Self::Centre),
    ];

    /// Largest time by which positions may be read earlier than exposures, seconds: light from the highest point of the
    /// orbits that MGS flew, 54 000 km, takes 0.18 s.
    pub const REACH_S: f64 = 0.2;

    /// Its word in configuration and products.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::None => "none",
            Self::Centre => "centre",
            Self::Support => "support",
        }
    }

    /// Definition of the camera positions, a clause for people.
    #[must_use]
    pub const fn positions(self) -> &'static str {
        match self {
            Self::Surface => {
                "where the camera was relative to the body when the light left the ground (light time to the surface and \
                 aberration)"
            }
            Self::None => "geometric, at the exposure (no light time, no aberration)",
            Self::Centre => {
                "as seen from the centre of the body with light time and aberration (LT+S), as in ISIS and ALE"
            }
            Self::Support => {
                "as in the support data of the image (neither light time nor aberration is added or removed)"
            }
        }
    }

    /// The interval of instants at which positions are read for `exposures`; files for ISIS and ALE need positions with
    /// light time in every convention of a run.
    #[must_use]
    pub fn read_over(self, exposures: Interval) -> Interval {
        match self {
            Self::Support => exposures,
            Self::None | Self::Surface | Self::Centre => {
                Interval::new(exposures.start.plus(-Self::REACH_S), exposures.stop)
            }
        }
    }
}

/// Seconds that light takes for a distance in metres.
#[must_use]
pub fn light_time_s(distance_m: f64) -> f64 {
    distance_m / SPEED_OF_LIGHT_M_S
}

/// The apparent position for an observer that moves with `velocity_m_s`: turned towards the velocity, at the same
/// distance.
///
/// # Source
/// NAIF's `stelab`: `sin φ = |r̂ × v| / c`.
#[must_use]
pub fn aberrated_m(position_m: &Vector3<f64>, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
    let share = velocity_m_s / SPEED_OF_LIGHT_M_S;
    let square_m = position_m.norm_squared();
    let across_m =
        share * position_m.norm() - position_m * (position_m.dot(&share) / position_m.norm());
    position_m * (1.0 - across_m.norm_squared() / square_m).sqrt() + across_m
}

/// The inverse of [`aberrated_m`].
#[must_use]
pub fn without_aberration_m(seen_m: &Vector3<f64>, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
    (0..STEPS).fold(*seen_m, |position_m, _| {
        position_m + (seen_m - aberrated_m(&position_m, velocity_m_s))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::time::Et;

    #[test]
    fn aberration_turns_towards_the_velocity_and_back() {
        let position_m = Vector3::new(2.7e6, -2.4e6, 0.9e6);
        let velocity_m_s = Vector3::new(-9e3, 21e3, 7e3);
        let seen_m = aberrated_m(&position_m, &velocity_m_s);
        assert!((seen_m.norm() - position_m.norm()).abs() < 1e-8); // metres, rounding
        let turned_rad = seen_m.angle(&position_m);
        let across = velocity_m_s
            .normalize()
            .cross(&position_m.normalize())
            .norm();
        let expected_rad = (across * velocity_m_s.norm() / SPEED_OF_LIGHT_M_S).asin();
        // An angle of 8e-5 rad from the arc cosine is good to 1e-12.
        assert!(
            (turned_rad - expected_rad).abs() < 2e-12,
            "{turned_rad} {expected_rad}"
        );
        assert!(seen_m.angle(&velocity_m_s) < position_m.angle(&velocity_m_s));
        let back_m = without_aberration_m(&seen_m, &velocity_m_s);
        assert!((back_m - position_m).norm() < 1e-8); // metres, rounding
    }

    #[test]
    fn positions_are_read_earlier_where_light_takes_its_time() {
        let exposures = Interval::new(Et::from_seconds(10.0), Et::from_seconds(20.0));
        assert_eq!(LightTime::Support.read_over(exposures), exposures);
        for (_, light_time) in LightTime::WORDS {
            let read = light_time.read_over(exposures);
            assert!((exposures.start.since(read.start) - 0.2).abs() < 1e-12); // rounding
            assert_eq!(read.stop, exposures.stop);
        }
        for (word, light_time) in LightTime::WORDS {
            assert_eq!(word, light_time.word());
        }
    }
}
