//! Vocabulary of the altimeter: its clock bias, the datum of its files, the shots that are kept.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{body::Datum, season::solar_longitude_rad, time::Et};

/// Clock bias of MOLA: correction of time tags to shot times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct MolaClock {
    /// Size, seconds, not negative.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub bias_s: f64,
    /// Sign of the time tag error.
    pub sign: TagSign,
    /// Computations that use the corrected shot time.
    pub scope: BiasScope,
    /// Citation that products repeat.
    pub source: String,
}

/// Sign of the time tag error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum TagSign {
    /// Time tags are late: true time = tag − bias.
    Late,
    /// Time tags are early: true time = tag + bias.
    Early,
}

/// Computations that use the corrected shot time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum BiasScope {
    /// The spacecraft's position in the range check: the default, one of three interpretations of Shan et al. 2005.
    SpkLookup,
    /// The rotation into IAU 2000 (the rotation from the file's datum remains at the time tag).
    Rotation,
    /// Both.
    Both,
    /// None: time tags are used unchanged.
    None,
}

impl MolaClock {
    /// Largest bias of time tags, seconds.
    pub const BIAS_MAX_S: f64 = 10.0;

    /// A clock whose tags are late by `late_s`, or early if it is negative, for the position of the spacecraft.
    #[must_use]
    pub fn late_by(late_s: f64, source: String) -> Self {
        Self {
            bias_s: late_s.abs(),
            sign: if late_s < 0.0 {
                TagSign::Early
            } else {
                TagSign::Late
            },
            scope: BiasScope::SpkLookup,
            source,
        }
    }

    /// Seconds to add to a tag: `−bias` for late tags, `+bias` for early ones, 0 when switched off.
    #[must_use]
    pub fn correction_s(&self) -> f64 {
        match (self.scope, self.sign) {
            (BiasScope::None, _) => 0.0,
            // 0 − bias, not −bias: a zero correction has no sign.
            (_, TagSign::Late) => 0.0 - self.bias_s,
            (_, TagSign::Early) => self.bias_s,
        }
    }

    /// Whether the spacecraft's position is looked up at the corrected time.
    #[must_use]
    pub const fn moves_spacecraft(&self) -> bool {
        matches!(self.scope, BiasScope::SpkLookup | BiasScope::Both)
    }

    /// The instant of the spacecraft position of a shot with this tag, ET seconds.
    #[must_use]
    pub fn spacecraft_time(&self, tag_s: f64) -> Et {
        Et::from_seconds(if self.moves_spacecraft() {
            tag_s + self.correction_s()
        } else {
            tag_s
        })
    }

    /// Whether Mars rotates between the rotation out of the file's datum and the rotation into IAU 2000.
    #[must_use]
    pub const fn moves_rotation(&self) -> bool {
        matches!(self.scope, BiasScope::Rotation | BiasScope::Both)
    }
}

/// Way in which the datum of a PEDR file is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatumChoice {
    /// By version letter and label: L is IAU 2000, older ones IAU 1991.
    Auto,
    /// As stated; a contradiction with letter or label is an error.
    Stated(Datum),
}

/// Radius of a shot that all stages use for the ground.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum GroundRadius {
    /// Corrected by the crossover residual, where the file states one.
    #[default]
    Corrected,
    /// Uncorrected: the measured range laid off from the orbit in the file.
    Raw,
}

impl GroundRadius {
    /// Its name in configurations and products.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Corrected => "corrected",
            Self::Raw => "raw",
        }
    }

    /// Description, following "the radii".
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Corrected => "after the crossover correction",
            Self::Raw => "before the crossover correction",
        }
    }
}

/// From this attitude flag of a shot on, its attitude is unknown for it or for a part of its frame, and its footprint
/// assumes nadir pointing.
pub const NO_ATTITUDE: u16 = 2;

/// Selection of shots; a shot must meet every criterion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShotFilter {
    /// Classification codes (1 ground, 0 cloud or noise).
    pub classes: Vec<i16>,
    /// Trigger channels, 1 to 4.
    pub channels: Vec<u8>,
    /// Attitude flags (0 known, 2 partly, 3 unknown).
    pub attitude_flags: Vec<u16>,
    /// Largest off-nadir angle, radians.
    pub off_nadir_max_rad: f64,
    /// First and last areocentric longitude of the Sun, radians from 0 to 2π: the season of Mars; first above last is over 0.
    pub solar_longitude_rad: [f64; 2],
}

impl ShotFilter {
    /// First and last trigger channel.
    pub const CHANNELS: [u8; 2] = [1, 4];
    /// Upper limit of the largest off-nadir angle, degrees; the lower limit is above 0.
    pub const OFF_NADIR_LIMIT_DEG: f64 = 90.0;

    /// The full year of Mars.
    pub const ALL_SEASONS: [f64; 2] = [0.0, std::f64::consts::TAU];

    /// Whether the filter selects a season.
    #[must_use]
    pub fn has_season(&self) -> bool {
        /// Degrees to radians round.
        const ROUNDING_RAD: f64 = 1e-12;
        let [first, last] = self.solar_longitude_rad;
        first > ROUNDING_RAD || last < Self::ALL_SEASONS[1] - ROUNDING_RAD
    }

    /// Whether an instant is in the season.
    #[must_use]
    pub fn is_in_season(&self, et: Et) -> bool {
        let [first, last] = self.solar_longitude_rad;
        let longitude_rad = || solar_longitude_rad(et);
        !self.has_season()
            || if first <= last {
                (first..=last).contains(&longitude_rad())
            } else {
                !(last..first).contains(&longitude_rad())
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_season_may_be_over_0_and_the_whole_year_is_none() {
        // 1999-01-29, Ls 90°; seconds past J2000.
        let solstice = Et::from_seconds(-337.0 * 86_400.0);
        let kept = |edges_deg: [f64; 2]| {
            let filter = ShotFilter {
                classes: Vec::new(),
                channels: Vec::new(),
                attitude_flags: Vec::new(),
                off_nadir_max_rad: 1.0,
                solar_longitude_rad: edges_deg.map(f64::to_radians),
            };
            (filter.has_season(), filter.is_in_season(solstice))
        };
        assert_eq!(kept([0.0, 360.0]), (false, true));
        assert_eq!(kept([80.0, 100.0]), (true, true));
        assert_eq!(kept([100.0, 80.0]), (true, false));
        assert_eq!(kept([300.0, 100.0]), (true, true));
        assert_eq!(kept([300.0, 80.0]), (true, false));
    }
}
