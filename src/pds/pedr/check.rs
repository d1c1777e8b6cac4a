//! Impossible values: what no record of a healthy file holds.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::Record;
use crate::units::METRES_PER_CM;

/// Radii of Mars that a laser return can have, centimetres: Hellas lies near 3.38e6 m, Olympus Mons
/// near 3.42e6 m; clouds and noise stay within the range gate.
const RADIUS_CM: RangeInclusive<i32> = 330_000_000..=345_000_000;
/// Two possible radii differ by this at most, metres.
pub(super) const RELIEF_MAX_M: f64 = (*RADIUS_CM.end() - *RADIUS_CM.start()) as f64 * METRES_PER_CM;
/// Distance of the spacecraft from the centre of Mars in mapping orbit, centimetres.
const MAPPING_ORBIT_CM: RangeInclusive<u32> = 340_000_000..=420_000_000;
/// The same before mapping, when the orbit was still an ellipse.
const EARLIER_ORBIT_CM: RangeInclusive<u32> = 340_000_000..=2_200_000_000;
/// Clock frequencies, hertz: one per cent about the nominal 100 MHz.
const FREQUENCY_HZ: RangeInclusive<u32> = 99_000_000..=101_000_000;
/// Latitudes, microdegrees.
const LATITUDE: RangeInclusive<i32> = -90_000_000..=90_000_000;
/// Largest difference between the two times of a record, seconds: the last digit of the integers, and
/// room for the rounding of the double.
const TIMES_AGREE_S: f64 = 1.1e-6;

/// Why a file or record is complained of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The file ends within its label.
    TruncatedLabel,
    /// The label cannot be read.
    UnreadableLabel,
    /// The label states another number of records than the file holds.
    RecordCount,
    /// The file ends within a record.
    TrailingBytes,
    /// A time is no number, or the two times of the record disagree.
    Time,
    /// Times do not increase.
    TimeOrder,
    /// The clock frequency is far from 100 MHz.
    Frequency,
    /// A latitude lies beyond a pole.
    Latitude,
    /// The spacecraft is inside Mars or far away.
    SpacecraftRadius,
    /// A return comes from deep inside or high above Mars.
    Radius,
}

/// An impossible value in a record.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// The double is no number.
    #[error("time is {0}; expected seconds past J2000")]
    NoTime(f64),
    /// The double and the two integers disagree.
    #[error("the times of the record are {} s and {integers_s} s; expected equal to 1e-6 s", legible(*.time_s))]
    TwoTimes {
        /// From the double, ET seconds.
        time_s: f64,
        /// From the two integers, ET seconds.
        integers_s: f64,
    },
    /// The record is not between its neighbours.
    #[error("time is {0} s, out of the order of the neighbouring records")]
    Order(f64),
    /// Clock frequency, hertz.
    #[error("clock frequency is {0} Hz; expected within 1 % of 1e8")]
    Frequency(u32),
    /// Ground or spacecraft latitude.
    #[error("{whose} latitude is {microdegrees} microdegrees; expected at most 90 degrees")]
    Latitude {
        /// "ground" or "spacecraft".
        whose: &'static str,
        /// The value of the record.
        microdegrees: i32,
    },
    /// Distance of the spacecraft, centimetres.
    #[error("the spacecraft is {0} cm from the centre of Mars; expected {min} to {max}",
        min = if *.1 { MAPPING_ORBIT_CM.start() } else { EARLIER_ORBIT_CM.start() },
        max = if *.1 { MAPPING_ORBIT_CM.end() } else { EARLIER_ORBIT_CM.end() })]
    SpacecraftRadius(u32, bool),
    /// Radius of a returned shot (0: of the mid-point), centimetres.
    #[error("radius of {} is {centimetres} cm; expected {} to {} for a return",
        if *.shot == 0 { "the mid-point".to_owned() } else { format!("shot {shot}") },
        RADIUS_CM.start(), RADIUS_CM.end())]
    Radius {
        /// Shot, 1 to 20, or 0 for the mid-point.
        shot: u8,
        /// The value of the record.
        centimetres: i32,
    },
}

impl RecordError {
    /// The code under which it is counted.
    #[must_use]
    pub const fn reason(&self) -> Reason {
        match self {
            Self::NoTime(_) | Self::TwoTimes { .. } => Reason::Time,
            Self::Order(_) => Reason::TimeOrder,
            Self::Frequency(_) => Reason::Frequency,
            Self::Latitude { .. } => Reason::Latitude,
            Self::SpacecraftRadius(..) => Reason::SpacecraftRadius,
            Self::Radius { .. } => Reason::Radius,
        }
    }
}

impl Record {
    /// Whether shot `shot` (0 to 19) came back.
    #[must_use]
    pub fn returned(&self, shot: usize) -> bool {
        self.range_cm[shot].get() > 0
    }

    /// Whether laser shot `shot` (0 to 19) and the mid-point that its parallax counts from have radii
    /// that a return can have.
    #[must_use]
    pub fn radius_is_possible(&self, shot: usize) -> bool {
        [self.shot_radius_cm[shot], self.mid_radius_cm]
            .iter()
            .all(|radius_cm| RADIUS_CM.contains(&radius_cm.get()))
    }

    /// Checks what makes the whole frame unusable when wrong.
    ///
    /// # Errors
    /// The first impossible value.
    pub(super) fn check(&self, mapping_orbit: bool) -> Result<(), RecordError> {
        let time_s = self.time_s.get();
        if !time_s.is_finite() {
            return Err(RecordError::NoTime(time_s));
        }
        let fraction_s = f64::from(self.time_fraction_us.get()) * 1e-6;
        let integers_s = f64::from(self.time_whole_s.get()) + fraction_s;
        if (time_s - integers_s).abs() > TIMES_AGREE_S {
            return Err(RecordError::TwoTimes { time_s, integers_s });
        }
        let frequency_hz = self.clock_frequency_hz.get();
        if !FREQUENCY_HZ.contains(&frequency_hz) {
            return Err(RecordError::Frequency(frequency_hz));
        }
        for (whose, microdegrees) in [
            ("ground", self.ground_latitude_microdegrees.get()),
            ("spacecraft", self.spacecraft_latitude_microdegrees.get()),
        ] {
            if !LATITUDE.contains(&microdegrees) {
                return Err(RecordError::Latitude {
                    whose,
                    microdegrees,
                });
            }
        }
        let orbit_cm = if mapping_orbit {
            MAPPING_ORBIT_CM
        } else {
            EARLIER_ORBIT_CM
        };
        let radius_cm = self.spacecraft_radius_cm.get();
        if !orbit_cm.contains(&radius_cm) {
            return Err(RecordError::SpacecraftRadius(radius_cm, mapping_orbit));
        }
        Ok(())
    }

    /// Checks the radii of the shots that came back; wrong ones spoil only their shots, that of the
    /// mid-point all of them.
    ///
    /// # Errors
    /// The first impossible radius.
    pub fn check_radii(&self) -> Result<(), RecordError> {
        let mut any = false;
        for (shot, radius_cm) in (1..).zip(self.shot_radius_cm) {
            if self.returned(usize::from(shot) - 1) {
                any = true;
                let centimetres = radius_cm.get();
                if !RADIUS_CM.contains(&centimetres) {
                    return Err(RecordError::Radius { shot, centimetres });
                }
            }
        }
        let centimetres = self.mid_radius_cm.get();
        if any && !RADIUS_CM.contains(&centimetres) {
            return Err(RecordError::Radius {
                shot: 0,
                centimetres,
            });
        }
        Ok(())
    }
}

/// The number, in powers of ten where no clock of ours counts so far: a spoiled double has 300 digits.
fn legible(seconds: f64) -> String {
    if seconds.abs() < 1e12 {
        seconds.to_string()
    } else {
        format!("{seconds:e}")
    }
}

/// Whether `time_s` is the odd one out among its neighbours in the file.
///
/// Either it is not later than the one before, or it is not earlier than the one after while these two
/// are in order: a single wild time is found, not the good record behind it. `None`: no neighbour.
pub(super) fn out_of_order(neighbours_s: [Option<f64>; 4]) -> bool {
    let [second_before, before, Some(time_s), after] = neighbours_s else {
        return false;
    };
    let wild = |before: Option<f64>, time_s: f64, after: Option<f64>| {
        after.is_some_and(|after| time_s >= after && before.is_none_or(|before| before < after))
    };
    if wild(before, time_s, after) {
        return true;
    }
    before.is_some_and(|before| before >= time_s && !wild(second_before, before, Some(time_s)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pds::pedr::FrameValues;

    fn order(times_s: &[f64]) -> Vec<f64> {
        let at = |index: Option<usize>| index.and_then(|index| times_s.get(index)).copied();
        (0..times_s.len())
            .filter(|&i| {
                out_of_order([
                    at(i.checked_sub(2)),
                    at(i.checked_sub(1)),
                    at(Some(i)),
                    at(Some(i + 1)),
                ])
            })
            .map(|index| times_s[index])
            .collect()
    }

    #[test]
    fn the_wild_time_is_found_and_not_its_neighbours() {
        assert!(order(&[1.0, 2.0, 3.0, 4.0]).is_empty());
        assert_eq!(order(&[1.0, 2.0, 99.0, 3.0, 4.0]), [99.0]);
        assert_eq!(order(&[1.0, 2.0, 0.5, 3.0, 4.0]), [0.5]);
        assert_eq!(order(&[99.0, 2.0, 3.0]), [99.0]);
        assert_eq!(order(&[1.0, 2.0, 0.5]), [0.5]);
        assert_eq!(order(&[1.0, 2.0, 2.0, 3.0]).len(), 1);
        assert_eq!(order(&[5.0, 6.0, 1.0, 2.0, 3.0]), [1.0]); // a block out of place: where it starts
    }

    fn good() -> Record {
        Record::from_frame(&FrameValues {
            time_s: 38_000_000.25,
            clock_frequency_hz: 1e8,
            spacecraft_radius_m: 3.78e6,
            mid_radius_m: 3.39e6,
            shot_radius_m: [3.39e6; 20],
            range_m: [3.9e5; 20],
            frame_index: 1,
            ..FrameValues::default()
        })
        .unwrap()
    }

    /// Spoils a good record and returns what is said of it.
    fn said(spoil: impl Fn(&mut Record)) -> (Reason, String) {
        let mut record = good();
        spoil(&mut record);
        let error = record
            .check(true)
            .and_then(|()| record.check_radii())
            .unwrap_err();
        (error.reason(), error.to_string())
    }

    #[test]
    fn each_impossible_value_is_named() {
        assert_eq!(
            good().check(true).and_then(|()| good().check_radii()),
            Ok(())
        );
        let cases = [
            (
                said(|record| record.time_s.set(f64::NAN)),
                Reason::Time,
                "time is NaN; expected seconds past J2000",
            ),
            (
                said(|record| record.time_fraction_us.set(250_003)),
                Reason::Time,
                "the times of the record are 38000000.25 s and 38000000.250003 s; expected equal to 1e-6 s",
            ),
            (
                said(|record| record.clock_frequency_hz.set(50)),
                Reason::Frequency,
                "clock frequency is 50 Hz; expected within 1 % of 1e8",
            ),
            (
                said(|record| record.ground_latitude_microdegrees.set(90_000_001)),
                Reason::Latitude,
                "ground latitude is 90000001 microdegrees; expected at most 90 degrees",
            ),
            (
                said(|record| record.spacecraft_radius_cm.set(420_000_001)),
                Reason::SpacecraftRadius,
                "the spacecraft is 420000001 cm from the centre of Mars; expected 340000000 to 420000000",
            ),
            (
                said(|record| record.shot_radius_cm[19].set(0)),
                Reason::Radius,
                "radius of shot 20 is 0 cm; expected 330000000 to 345000000 for a return",
            ),
            (
                said(|record| record.mid_radius_cm.set(-1)),
                Reason::Radius,
                "radius of the mid-point is -1 cm; expected 330000000 to 345000000 for a return",
            ),
        ];
        for ((reason, text), expected_reason, expected_text) in cases {
            assert_eq!((reason, text.as_str()), (expected_reason, expected_text));
        }
    }

    #[test]
    fn radii_of_shots_that_did_not_return_are_not_judged() {
        let mut record = good();
        record.shot_radius_cm[3].set(0);
        record.range_cm[3].set(0);
        assert_eq!(record.check_radii(), Ok(()));
    }

    #[test]
    fn orbits_before_mapping_may_be_high() {
        let mut record = good();
        record.spacecraft_radius_cm.set(2_000_000_000);
        assert!(record.check(true).is_err() && record.check(false).is_ok());
    }

    #[test]
    fn impossible_times_are_told_in_few_digits() {
        let told = |time_s| {
            RecordError::TwoTimes {
                time_s,
                integers_s: 4.5,
            }
            .to_string()
        };
        assert_eq!(
            told(-1.25e300),
            "the times of the record are -1.25e300 s and 4.5 s; expected equal to 1e-6 s"
        );
        assert!(told(38_593_125.159_874).contains("are 38593125.159874 s"));
    }
}
