//! Faults of a record, with the value found and the value expected.

use serde::{Deserialize, Serialize};

use super::{bounds, quantity::Quantity};

/// Reason code of a complaint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The file ends within its label.
    TruncatedLabel,
    /// The label cannot be read.
    UnreadableLabel,
    /// A keyword of the label is missing, or differs from every PEDR.
    LabelKeyword,
    /// The label states a number of records that differs from the file's.
    RecordCount,
    /// The file ends within a record.
    TrailingBytes,
    /// A time is not finite, outside the mission, or the two times of the record disagree.
    Time,
    /// Times do not increase.
    TimeOrder,
    /// The record repeats the shots of another record.
    Repeated,
    /// The clock frequency is far from 100 MHz.
    Frequency,
    /// A latitude lies beyond a pole.
    Latitude,
    /// A longitude is outside the turns that the format has.
    Longitude,
    /// The ground track or the spacecraft is faster than possible.
    Track,
    /// The spacecraft is inside Mars or far from it.
    SpacecraftRadius,
    /// A return comes from deep inside or high above Mars.
    Radius,
    /// The range differs from the distance between spacecraft and footprint.
    Distance,
    /// Parallax does not follow the beam.
    Parallax,
    /// The crossover residual exceeds any orbit error.
    Crossover,
    /// The areoid, or its slope, is impossible on Mars.
    Areoid,
    /// The off-nadir angle points away from Mars.
    OffNadir,
    /// The orbit or its model differs from the neighbouring records.
    Orbit,
    /// The record does not fit between its neighbours.
    Neighbours,
    /// The row of a table is not a shot.
    Row,
}

/// An impossible value in a record.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// The double is not finite.
    #[error("time is {0}; expected seconds past J2000")]
    NoTime(f64),
    /// The spacecraft was not at Mars at this time.
    #[error(
        "time is ET {} s; expected {} to {} s, the time of the mission at Mars",
        legible(*.0), bounds::MISSION_S.start(), bounds::MISSION_S.end()
    )]
    OutsideMission(f64),
    /// The double and the two integers disagree.
    #[error("the times of the record are {} s and {integers_s} s; expected agreement within 1e-6 s", legible(*.time_s))]
    TwoTimes {
        /// From the double, ET seconds.
        time_s: f64,
        /// From the two integers, ET seconds.
        integers_s: f64,
    },
    /// The record is out of order with its neighbours.
    #[error("time is {} s, out of order with the neighbouring records", legible(*.0))]
    Order(f64),
    /// Another record of the file contains the same shots.
    #[error(
        "time is {time_s} s, which repeats the shots of record {record}; expected every shot once, in frames at least {} s apart",
        bounds::APART_S
    )]
    Repeated {
        /// Mid-point, ET seconds.
        time_s: f64,
        /// The record that contains them first, counted as in complaints.
        record: u32,
    },
    /// Clock frequency, hertz.
    #[error("clock frequency is {0} Hz; expected 1e8 Hz within 1 %")]
    Frequency(u32),
    /// Ground or spacecraft latitude.
    #[error("{whose} latitude is {microdegrees} microdegrees; expected -90 to 90 degrees")]
    Latitude {
        /// "ground" or "spacecraft".
        whose: &'static str,
        /// The value of the record.
        microdegrees: i32,
    },
    /// Ground or spacecraft longitude.
    #[error("{whose} longitude is {microdegrees} microdegrees; expected -360 to 360 degrees")]
    Longitude {
        /// "ground" or "spacecraft".
        whose: &'static str,
        /// The value of the record.
        microdegrees: i32,
    },
    /// Displacement of the ground track or of the spacecraft over the frame.
    #[error(
        "{whose} moves by {longitude_microdegrees} microdegrees in longitude and {latitude_microdegrees} in latitude \
         over the frame ({metres:.0} m); expected at most {limit_m} m"
    )]
    Track {
        /// "the ground track" or "the spacecraft".
        whose: &'static str,
        /// Change of longitude.
        longitude_microdegrees: i32,
        /// Change of latitude.
        latitude_microdegrees: i32,
        /// Length of the displacement, metres.
        metres: f64,
        /// Longest possible displacement, metres.
        limit_m: f64,
    },
    /// Distance of the spacecraft, centimetres.
    #[error("the spacecraft is {0} cm from the centre of Mars; expected {min} to {max} cm",
        min = if *.1 { bounds::MAPPING_ORBIT_CM.start() } else { bounds::EARLIER_ORBIT_CM.start() },
        max = if *.1 { bounds::MAPPING_ORBIT_CM.end() } else { bounds::EARLIER_ORBIT_CM.end() })]
    SpacecraftRadius(u32, bool),
    /// Change of the distance of the spacecraft over the frame, centimetres.
    #[error(
        "the spacecraft rises by {0} cm over the frame; expected a change of at most {limit} cm", limit = bounds::CLIMB_MAX_CM)]
    Climb(i32),
    /// Radius of a returned shot (0: of the mid-point), centimetres.
    #[error("radius of {} is {centimetres} cm; expected {} to {} cm for a return",
        if *.shot == 0 { "the mid-point".to_owned() } else { format!("shot {shot}") },
        bounds::RADIUS_CM.start(), bounds::RADIUS_CM.end())]
    Radius {
        /// Shot, 1 to 20, or 0 for the mid-point.
        shot: u8,
        /// The value of the record.
        centimetres: i32,
    },
    /// The radius to which parallax refers differs widely from every return.
    #[error(
        "radius of the mid-point is {centimetres} cm, {apart_m:.0} m from the radius of the nearest return; expected at most \
         {} m",
        bounds::MID_RADIUS_M
    )]
    MidRadius {
        /// The value of the record.
        centimetres: i32,
        /// Distance from the nearest radius of a return, metres.
        apart_m: f64,
    },
    /// Range against the record's own positions.
    #[error(
        "range of shot {shot} is {range_m:.2} m, but spacecraft and footprint are {distance_m:.2} m apart; expected agreement \
         within {limit_m:.1} m{}", and_more(*.shots)
    )]
    Distance {
        /// The first shot, 1 to 20.
        shot: u8,
        /// Its range.
        range_m: f64,
        /// From the spacecraft to the footprint.
        distance_m: f64,
        /// Largest possible difference.
        limit_m: f64,
        /// Shots of the frame with this error.
        shots: u8,
    },
    /// Parallax against the direction of the beam.
    #[error(
        "parallax in {whose} is {found:.4} m on the ground per metre of radius; expected {expected:.4} ± {limit:.4}, \
         along the beam"
    )]
    Parallax {
        /// "latitude" or "longitude".
        whose: &'static str,
        /// The value of the record.
        found: f64,
        /// From spacecraft and footprint.
        expected: f64,
        /// Largest possible difference.
        limit: f64,
    },
    /// Crossover residual, centimetres.
    #[error(
        "crossover residual is {0} cm; expected a magnitude of at most {limit} cm", limit = bounds::CROSSOVER_MAX_CM)]
    Crossover(i32),
    /// Areoid radius, centimetres.
    #[error("areoid radius is {centimetres} cm; expected {} to {} cm at this latitude", .expected_cm[0], .expected_cm[1])]
    AreoidRadius {
        /// The value of the record.
        centimetres: u32,
        /// Smallest and largest at the latitude of the footprint.
        expected_cm: [u32; 2],
    },
    /// Change of the areoid radius over the frame, centimetres.
    #[error(
        "the areoid rises by {0} cm over the frame; expected a change of at most {limit} cm",
        limit = bounds::AREOID_CHANGE_MAX_CM)]
    AreoidChange(i32),
    /// Off-nadir angle, microdegrees.
    #[error("off-nadir angle is {0} microdegrees; expected at most 90 degrees")]
    OffNadir(i32),
    /// The neighbours on both sides agree on another value.
    #[error("{what} is {found}; expected {expected}, as in the neighbouring records")]
    OddOne {
        /// Name of the field.
        what: &'static str,
        /// The value of the record.
        found: u32,
        /// The value of its neighbours.
        expected: u32,
    },
    /// A value that is not continuous with a neighbour's.
    #[error(
        "{} is {value} {}, {apart:.1} {} from the extrapolation of record {record}; expected at most {limit:.1} {}",
        .quantity.name(), .quantity.unit(), .quantity.step_unit(), .quantity.step_unit()
    )]
    Neighbours {
        /// The discontinuous quantity.
        quantity: Quantity,
        /// The value of the record.
        value: f64,
        /// Deviation from the extrapolation.
        apart: f64,
        /// Largest possible deviation.
        limit: f64,
        /// The neighbour, counted as in complaints.
        record: u32,
    },
}

impl RecordError {
    /// The reason code under which it is counted.
    #[must_use]
    pub const fn reason(&self) -> Reason {
        match self {
            Self::NoTime(_) | Self::OutsideMission(_) | Self::TwoTimes { .. } => Reason::Time,
            Self::Order(_) => Reason::TimeOrder,
            Self::Repeated { .. } => Reason::Repeated,
            Self::Frequency(_) => Reason::Frequency,
            Self::Latitude { .. } => Reason::Latitude,
            Self::Longitude { .. } => Reason::Longitude,
            Self::Track { .. } => Reason::Track,
            Self::SpacecraftRadius(..) | Self::Climb(_) => Reason::SpacecraftRadius,
            Self::Radius { .. } | Self::MidRadius { .. } => Reason::Radius,
            Self::Distance { .. } => Reason::Distance,
            Self::Parallax { .. } => Reason::Parallax,
            Self::Crossover(_) => Reason::Crossover,
            Self::AreoidRadius { .. } | Self::AreoidChange(_) => Reason::Areoid,
            Self::OffNadir(_) => Reason::OffNadir,
            Self::OddOne { .. } => Reason::Orbit,
            Self::Neighbours { .. } => Reason::Neighbours,
        }
    }
}

/// Seconds as text, in powers of ten where they exceed the range or resolution of the clocks: a damaged double has 300
/// digits.
fn legible(seconds: f64) -> String {
    if matches!(seconds.abs(), 0.0 | 1e-9..1e12) {
        seconds.to_string()
    } else {
        format!("{seconds:e}")
    }
}

fn and_more(shots: u8) -> String {
    match shots {
        0 | 1 => String::new(),
        shots => format!(" ({shots} shots of the frame)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            "the times of the record are -1.25e300 s and 4.5 s; expected agreement within 1e-6 s"
        );
        assert!(told(-1.5e-308).contains("are -1.5e-308 s and"));
        let order = RecordError::Order(-1.5e-308).to_string();
        assert!(order.starts_with("time is -1.5e-308 s, out"), "{order}");
        assert!(told(0.0).contains("are 0 s and"));
        assert!(told(38_593_125.159_874).contains("are 38593125.159874 s"));
    }
}
