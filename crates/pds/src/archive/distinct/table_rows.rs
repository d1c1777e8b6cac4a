//! Rows of tables that hold the same shot: tables of windows that overlap have their common shots in both.
//!
//! In a table of the Orbital Data Explorer every shot is one pulse of one laser, so that its time decides. Other lasers
//! have several spots a pulse: there rows are the same shot where time and place are.

use std::{collections::HashMap, f64::consts::TAU};

use super::SAME_SHOT_S;
use crate::shot_table::ShotRow;

/// Differences of one shot in two tables by the rounding of either: 1e-5 degrees of longitude and latitude, radians, and
/// a centimetre of radius and range, metres; with room for the last bit.
const SAME_ANGLE_RAD: f64 = 1.01e-5 * areograph_base::units::RADIANS_PER_DEGREE;
const SAME_LENGTH_M: f64 = 0.0101;

/// Whether a row repeats an earlier one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repetition {
    /// It is a new shot.
    New,
    /// It holds a shot of an earlier row.
    Same,
    /// It holds a shot of an earlier row with other values: file, counted from 0, and line of that row.
    Other(u16, u32),
}

/// The shots of all rows so far.
#[derive(Debug, Default)]
pub struct TableRows {
    /// By time, in steps of twice the distance of shots that are the same.
    by_time: HashMap<i64, Vec<Taken>>,
}

/// A row that was counted.
#[derive(Debug, Clone, Copy)]
struct Taken {
    file: u16,
    line: u32,
    et_s: f64,
    place: [f64; 3],
    range_m: f64,
    is_pulse: bool,
}

impl Taken {
    const fn of(file: u16, row: &ShotRow) -> Self {
        Self {
            file,
            line: row.line,
            et_s: row.et_s,
            place: [row.longitude_rad, row.latitude_rad, row.radius_m],
            range_m: row.range_m,
            // Only these tables have no spacecraft.
            is_pulse: row.spacecraft.is_none(),
        }
    }

    /// Whether time and place are equal to the last bit.
    fn equals(&self, other: &Self) -> bool {
        let bits =
            |row: &Self| [row.et_s, row.place[0], row.place[1], row.place[2]].map(f64::to_bits);
        bits(self) == bits(other)
    }

    fn is_same_shot(&self, other: &Self) -> bool {
        if self.is_pulse || other.is_pulse {
            (self.et_s - other.et_s).abs() <= SAME_SHOT_S
        } else {
            self.equals(other)
        }
    }

    /// Whether the values of one shot agree within their rounding.
    fn agrees(&self, other: &Self) -> bool {
        let [longitude_rad, latitude_rad, radius_m] =
            [0, 1, 2].map(|at| (self.place[at] - other.place[at]).abs());
        longitude_rad.min((TAU - longitude_rad).abs()) <= SAME_ANGLE_RAD
            && latitude_rad <= SAME_ANGLE_RAD
            && radius_m <= SAME_LENGTH_M
            && (self.range_m - other.range_m).abs() <= SAME_LENGTH_M
    }
}

impl TableRows {
    /// Compares a row of table `file` with all before; a new shot is kept for later rows.
    pub fn take(&mut self, file: u16, row: &ShotRow) -> Repetition {
        let taken = Taken::of(file, row);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "times are within centuries of J2000"
        )]
        let step = (row.et_s / (2.0 * SAME_SHOT_S)).floor() as i64;
        let near = (step - 1..=step + 1).filter_map(|step| self.by_time.get(&step));
        let same = near.flatten().find(|other| taken.is_same_shot(other));
        match same {
            Some(other) if taken.agrees(other) => Repetition::Same,
            Some(other) => Repetition::Other(other.file, other.line),
            None => {
                self.by_time.entry(step).or_default().push(taken);
                Repetition::New
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shot of the Orbital Data Explorer, or of a table with the spacecraft.
    fn row(line: u32, et_s: f64, radius_m: f64, is_pulse: bool) -> ShotRow {
        ShotRow {
            line,
            et_s,
            longitude_rad: 1.0,
            latitude_rad: 0.5,
            radius_m,
            range_m: 4e5,
            spacecraft: (!is_pulse).then_some([1.0, 0.5, 3.8e6]),
            orbit: 1,
            areoid_radius_m: None,
            channel: 1,
            class: 1,
            attitude_flag: 0,
        }
    }

    #[test]
    fn a_pulse_counts_once_and_other_values_are_named() {
        let mut rows = TableRows::default();
        let mut take = |file, row: &ShotRow| rows.take(file, row);
        assert_eq!(take(0, &row(2, 10.0, 3.39e6, true)), Repetition::New);
        assert_eq!(take(1, &row(7, 10.0, 3.39e6, true)), Repetition::Same);
        // Shots are 0.1 s apart, and a centimetre is the last digit.
        assert_eq!(take(1, &row(8, 10.1, 3.39e6, true)), Repetition::New);
        assert_eq!(
            take(1, &row(9, 10.04, 3.39e6 + 0.01, true)),
            Repetition::Same
        );
        let other = take(1, &row(10, 10.0, 3.39e6 + 5.0, true));
        assert_eq!(other, Repetition::Other(0, 2));
        // The same shot in a table with the spacecraft, as areograph writes it.
        assert_eq!(
            take(2, &row(3, 10.000_002, 3.39e6, false)),
            Repetition::Same
        );
    }

    #[test]
    fn spots_of_one_pulse_are_different_shots() {
        let mut rows = TableRows::default();
        let spots = [3.39e6, 3.39e6 + 0.001, 3.39e6];
        let found = spots.map(|radius_m| rows.take(0, &row(2, 10.0, radius_m, false)));
        assert_eq!(found, [Repetition::New, Repetition::New, Repetition::Same]);
    }
}
