//! Line times from the prefixes of rows, as pieces with one line period each; damaged prefixes are identified by the
//! regularity of times.
//!
//! A line begins when the exposure of the preceding one ends, except after lines that were not transmitted and have no
//! row. The time of a row that contradicts both its neighbours, which agree with each other, is replaced; any other
//! contradiction is an error. Exposures define where pieces begin, but times define the line period: a line in which
//! the exposure changes has neither the period in its prefix nor the period of its neighbours.

use super::{error::HrscError, prefixes::Prefix};
use crate::image_label::RowTimes;
use areograph_base::{line_times::LinePiece, time::Et};

/// Tolerance between a time and the preceding exposures, seconds: twice the accumulated difference over the 6664 lines
/// of `h5270_0000_ir2`, and 2 % of the shortest line of the camera.
const REGULAR_S: f64 = 5e-5;
/// Share of rows whose prefixes must have a time and an exposure.
const KNOWN_SHARE_MIN: f64 = 0.9;
/// Most rows without a time at either end of an image that are extrapolated by their exposures: no time would show a
/// change of these.
const CONTINUED_MAX: usize = 10;
/// Remarks of one kind that are reported individually.
const REMARKS_MAX: usize = 5;

/// The pieces of line times from prefixes.
///
/// # Errors
/// [`HrscError::NoTimes`] where there are none, [`HrscError::TimeGap`] and [`HrscError::Overlap`] where they contradict
/// each other and the wrong one cannot be identified.
pub(super) fn row_times(prefixes: &[Prefix]) -> Result<RowTimes, HrscError> {
    let mut rows = Rows::of(prefixes)?;
    rows.fill_times()?;
    let mut first_of_piece = vec![0];
    for row in 0..rows.start_s.len() - 1 {
        if rows.settle(row)? {
            first_of_piece.push(row + 1);
        }
    }
    let ends = first_of_piece[1..].iter().copied();
    let ends = ends.chain([rows.start_s.len()]);
    let mut pieces = Vec::new();
    for (first, end) in first_of_piece.iter().zip(ends) {
        rows.straight_pieces(*first, end, &mut pieces);
    }
    Ok(RowTimes {
        lines: u32::try_from(prefixes.len()).unwrap_or(u32::MAX),
        pieces,
        remarks: rows.told(),
    })
}

/// Times and exposures of all rows, seconds, corrected in place.
struct Rows {
    start_s: Vec<f64>,
    period_s: Vec<f64>,
    /// Rows without a time.
    is_timeless: Vec<bool>,
    /// Remarks on times and exposures that are damaged, and on lines that have no row.
    damaged: Vec<String>,
    lacking: Vec<String>,
}

impl Rows {
    /// Times unchanged; an invalid exposure is replaced by the exposure of the preceding row, or by the first valid
    /// one.
    fn of(prefixes: &[Prefix]) -> Result<Self, HrscError> {
        let whole = |prefix: &&Prefix| prefix.start_s.is_some() && prefix.period_s.is_some();
        let (known, lines) = (prefixes.iter().filter(whole).count(), prefixes.len());
        let first = prefixes.iter().find_map(|prefix| prefix.period_s);
        let Some(mut before_s) = first.filter(|_| known as f64 >= KNOWN_SHARE_MIN * lines as f64)
        else {
            return Err(HrscError::NoTimes { known, lines });
        };
        let mut damaged = Vec::new();
        let period_s = prefixes.iter().enumerate().map(|(row, prefix)| {
            if prefix.period_s.is_none() && prefix.start_s.is_some() {
                damaged.push(format!(
                    "line {row}: no exposure in its prefix; the exposure of an adjacent line is used"
                ));
            }
            before_s = prefix.period_s.unwrap_or(before_s);
            before_s
        });
        let period_s = period_s.collect();
        let start_s = prefixes.iter();
        Ok(Self {
            start_s: start_s
                .map(|prefix| prefix.start_s.unwrap_or(0.0))
                .collect(),
            period_s,
            is_timeless: prefixes
                .iter()
                .map(|prefix| prefix.start_s.is_none())
                .collect(),
            damaged,
            lacking: Vec::new(),
        })
    }

    /// Fills in missing times from the adjacent rows, which must agree across the gap.
    fn fill_times(&mut self) -> Result<(), HrscError> {
        let lines = self.start_s.len();
        let mut row = 0;
        while row < lines {
            let first = row;
            while row < lines && self.is_timeless[row] {
                row += 1;
            }
            if first == row {
                row += 1;
                continue;
            }
            let is_at_an_end = first == 0 || row == lines;
            if is_at_an_end && row - first > CONTINUED_MAX {
                let last = row - 1;
                return Err(HrscError::TimeGap { first, last });
            }
            if first == 0 && row < lines {
                for filled in (0..row).rev() {
                    self.start_s[filled] = self.start_s[filled + 1] - self.period_s[filled];
                }
            } else if let Some(before) = first.checked_sub(1) {
                for filled in before..row - 1 {
                    self.start_s[filled + 1] = self.start_s[filled] + self.period_s[filled];
                }
                let ends_s = self.start_s[row - 1] + self.period_s[row - 1];
                let limit_s = REGULAR_S * (row - first) as f64;
                if let Some(next_s) = self.start_s.get(row) {
                    let apart_s = next_s - ends_s;
                    if apart_s.abs() > limit_s {
                        let last = row - 1;
                        return Err(HrscError::TimeGap { first, last });
                    }
                    // Accumulated exposures differ slightly from the times between.
                    for filled in first..row {
                        let share = (filled - before) as f64 / (row - before) as f64;
                        self.start_s[filled] += share * apart_s;
                    }
                }
            }
            self.damaged.push(format!(
                "lines {first} to {}: no times in their prefixes; times from the adjacent lines are used",
                row - 1
            ));
        }
        Ok(())
    }

    /// Whether `later` begins as predicted by the exposures from `row` on.
    fn agrees(&self, row: usize, later: usize) -> bool {
        let exposed_s: f64 = self.period_s[row..later].iter().sum();
        (self.start_s[later] - self.start_s[row] - exposed_s).abs() <= REGULAR_S
    }

    /// Corrects the step from a row to the next one; returns whether a new piece begins after it.
    fn settle(&mut self, row: usize) -> Result<bool, HrscError> {
        let (next, lines) = (row + 1, self.start_s.len());
        let step_s = self.start_s[next] - self.start_s[row];
        let period_s = self.period_s[row];
        let steps = (step_s / period_s).round();
        let is_whole = steps >= 2.0 && (step_s - steps * period_s).abs() <= REGULAR_S * steps;
        let beside_s = [row.saturating_sub(1), next].map(|beside| self.period_s[beside]);
        let like = |beside_s: &f64| (step_s - beside_s).abs() <= REGULAR_S;
        let is_a_line = beside_s
            .iter()
            .any(|beside_s| (0.5 * beside_s..1.5 * beside_s).contains(&step_s) && !is_whole);
        if self.agrees(row, next) {
            // Regular.
        } else if next + 1 < lines && self.agrees(row, next + 1) {
            self.time_is(next, self.start_s[row] + period_s);
        } else if self.is_change(row, step_s) {
            self.period_s[row] = step_s;
        } else if beside_s.iter().any(like) || is_a_line && self.is_regular_beside(row) {
            let exposed_s = beside_s.into_iter().find(like);
            self.exposure_is(row, exposed_s.unwrap_or(step_s));
        } else if row == 0 && !is_whole && lines > 2 && self.agrees(1, 2) {
            self.time_is(0, self.start_s[1] - period_s);
        } else if next == lines - 1 && !is_whole {
            self.time_is(next, self.start_s[row] + period_s);
        } else if step_s < period_s {
            let early_s = period_s - step_s;
            return Err(HrscError::Overlap { row: next, early_s });
        } else {
            let pause_s = step_s - period_s;
            self.lacking.push(format!(
                "before line {next}: a gap of {pause_s:.4} s ({:.1} missing lines)",
                pause_s / period_s
            ));
            return Ok(true);
        }
        let changes = self.period_s[next].to_bits() != self.period_s[row].to_bits();
        // No later time confirms the exposure of the last line.
        if changes && next == lines - 1 {
            self.exposure_is(next, self.period_s[row]);
            return Ok(false);
        }
        Ok(changes)
    }

    /// Whether the exposure changes at a row, so that some of its detector lines have the old one and some the new one:
    /// the mean in its prefix is wrong by a third of the change in `h5270_0000_ir2`.
    fn is_change(&self, row: usize, step_s: f64) -> bool {
        let [before_s, next_s] =
            [row.saturating_sub(1), row + 1].map(|beside| self.period_s[beside]);
        let (least_s, largest_s) = (before_s.min(next_s), before_s.max(next_s));
        // The exposure before the first line is unknown.
        row > 0
            && least_s < largest_s
            && (least_s..=largest_s).contains(&self.period_s[row])
            && (least_s - REGULAR_S..=largest_s + REGULAR_S).contains(&step_s)
    }

    /// Whether the steps before a row and after the next one agree with their exposures, so that both times are
    /// correct.
    fn is_regular_beside(&self, row: usize) -> bool {
        let before = row.checked_sub(1);
        before.is_none_or(|before| self.agrees(before, row))
            && (row + 2 == self.start_s.len() || self.agrees(row + 1, row + 2))
    }

    fn time_is(&mut self, row: usize, start_s: f64) {
        let apart_s = self.start_s[row] - start_s;
        self.damaged.push(format!(
            "line {row}: the time in its prefix differs by {apart_s:.6} s from the time from the adjacent lines, which is used"
        ));
        self.start_s[row] = start_s;
    }

    fn exposure_is(&mut self, row: usize, period_s: f64) {
        self.damaged.push(format!(
            "line {row}: the exposure in its prefix is {:.6} ms; the adjacent times give {:.6} ms, which is used",
            1e3 * self.period_s[row],
            1e3 * period_s
        ));
        self.period_s[row] = period_s;
    }

    /// Pieces of the rows from `first` to before `end`, whose times deviate from them by at most [`REGULAR_S`]: usually
    /// one.
    fn straight_pieces(&self, first: usize, end: usize, pieces: &mut Vec<LinePiece>) {
        // Up to the start of the next piece, if it follows without a gap.
        let follows = end < self.start_s.len() && self.agrees(end - 1, end);
        let last = if follows { end } else { end - 1 };
        let mut from = first;
        loop {
            let (mut low_s, mut high_s) = (0.0_f64, f64::INFINITY);
            let (mut to, mut period_s) = (from, self.period_s[from]);
            for row in from + 1..=last {
                let (after_s, rows) = (self.start_s[row] - self.start_s[from], (row - from) as f64);
                let mean_s = after_s / rows;
                if !(low_s..=high_s).contains(&mean_s) {
                    break;
                }
                low_s = low_s.max((after_s - REGULAR_S) / rows);
                high_s = high_s.min((after_s + REGULAR_S) / rows);
                (to, period_s) = (row, mean_s);
            }
            pieces.push(LinePiece {
                first_line: u32::try_from(from).unwrap_or(u32::MAX),
                start: Et::from_seconds(self.start_s[from]),
                period_s,
            });
            if to == from || to >= last {
                return;
            }
            from = to;
        }
    }

    /// All remarks: the first ones of each kind, and the number of further ones.
    fn told(self) -> Vec<String> {
        let kinds = [self.damaged, self.lacking].into_iter();
        let told = kinds.flat_map(|mut remarks| {
            let more = remarks.len().saturating_sub(REMARKS_MAX);
            remarks.truncate(REMARKS_MAX);
            let more = (more > 0).then(|| format!("and {more} more remarks of this kind"));
            remarks.into_iter().chain(more)
        });
        told.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::line_times::LineTimes;

    const START_S: f64 = 255_744_599.027_481_65;
    /// Lines and exposures of the pieces, milliseconds, as floats; one of them has a single line.
    const PIECES: [(usize, f32); 3] = [(60, 12.800_79), (1, 12.907_45), (79, 13.227_428)];

    fn prefixes() -> Vec<Prefix> {
        let mut after_s = 0.0;
        let rows = PIECES
            .iter()
            .flat_map(|(rows, period_ms)| vec![*period_ms; *rows]);
        let rows = rows.map(|period_ms| {
            let period_s = f64::from(period_ms) * 1e-3;
            let prefix = Prefix {
                start_s: Some(START_S + after_s),
                period_s: Some(period_s),
            };
            // The clock of the camera differs slightly from the exposures.
            after_s += period_s + 4e-9;
            prefix
        });
        rows.collect()
    }

    /// Largest distance of line times from the times of the good prefixes, seconds.
    fn apart_s(times: &RowTimes, prefixes: &[Prefix]) -> f64 {
        let table = LineTimes::of_pieces(times.lines, &times.pieces).unwrap();
        let start_s = times.pieces[0].start.seconds();
        let rows = prefixes.iter().enumerate().map(|(row, prefix)| {
            let found_s = start_s + table.seconds(row as f64 + 1e-9);
            (found_s - prefix.start_s.unwrap()).abs()
        });
        rows.fold(0.0, f64::max)
    }

    #[test]
    fn regular_prefixes_are_pieces_of_one_exposure() {
        let good = prefixes();
        let times = row_times(&good).unwrap();
        assert_eq!(times.remarks, [""; 0]);
        let first: Vec<u32> = times.pieces.iter().map(|piece| piece.first_line).collect();
        assert_eq!(first, [0, 60, 61]);
        assert!(apart_s(&times, &good) < 2e-7); // seconds, rounding of ET
    }

    #[test]
    fn lines_without_rows_are_a_gap() {
        let mut cut = prefixes();
        cut.drain(100..107);
        let times = row_times(&cut).unwrap();
        assert_eq!(times.pieces.len(), 4);
        assert!(apart_s(&times, &cut) < 2e-7); // seconds, rounding of ET
        assert_eq!(
            times.remarks,
            ["before line 100: a gap of 0.0926 s (7.0 missing lines)"]
        );
    }

    #[test]
    fn a_line_in_which_the_exposure_changes_takes_what_the_times_say() {
        let mut changing = prefixes();
        for prefix in &mut changing[61..] {
            // As in the published table of h5270_0000_ir2.
            prefix.start_s = prefix.start_s.map(|start_s| start_s + 1.6e-4);
        }
        let times = row_times(&changing).unwrap();
        assert_eq!(times.remarks, [""; 0]);
        assert!(apart_s(&times, &changing) < 2e-7); // seconds, rounding of ET
    }

    #[test]
    fn every_flipped_bit_of_a_time_is_told_or_harmless() {
        let good = prefixes();
        let mut silent = 0;
        for row in [0, 1, 30, 59, 60, 61, 100, 138, 139] {
            for bit in 0..64 {
                let mut damaged = good.clone();
                let flipped = f64::from_bits(good[row].start_s.unwrap().to_bits() ^ (1 << bit));
                damaged[row] = Prefix {
                    start_s: (-1e9..1.9e9).contains(&flipped).then_some(flipped),
                    ..good[row]
                };
                let Ok(times) = row_times(&damaged) else {
                    continue;
                };
                silent += usize::from(times.remarks.is_empty());
                let apart_s = apart_s(&times, &good);
                // Seconds: possible deviation of prefixes from regular ones.
                let is_harmless = apart_s < 1.1 * REGULAR_S;
                assert!(
                    is_harmless || !times.remarks.is_empty(),
                    "{row} {bit}: {apart_s}"
                );
            }
        }
        // The last eleven of 64 bits are each worth less than 5e-5 s.
        assert!(silent <= 9 * 11, "{silent}");
    }

    #[test]
    fn damaged_exposures_are_told_and_change_no_time() {
        let good = prefixes();
        for row in [0, 30, 59, 60, 61, 100, 139] {
            for period_s in [None, Some(0.002), Some(0.5)] {
                let mut damaged = good.clone();
                damaged[row].period_s = period_s;
                let times = row_times(&damaged).unwrap();
                let remark = &times.remarks[0];
                assert!(remark.starts_with(&format!("line {row}: ")), "{remark}");
                assert!(apart_s(&times, &good) < 2e-7, "{row}"); // seconds, rounding of ET
            }
        }
    }

    #[test]
    fn lines_without_times_are_continued_where_their_neighbours_agree() {
        let nothing = Prefix {
            start_s: None,
            period_s: None,
        };
        for lost in [0..3, 20..31, 136..140] {
            let mut damaged = prefixes();
            damaged[lost.clone()].fill(nothing);
            let times = row_times(&damaged).unwrap();
            assert!(apart_s(&times, &prefixes()) < 1e-6); // seconds: of exposures alone
            assert_eq!(times.remarks.len(), 1);
        }
        // The exposure changes within the gap.
        let mut damaged = prefixes();
        damaged[55..64].fill(nothing);
        let failure = row_times(&damaged).unwrap_err();
        assert!(matches!(
            failure,
            HrscError::TimeGap {
                first: 55,
                last: 63
            }
        ));
        // More rows than are extrapolated.
        let mut damaged = prefixes();
        damaged[129..].fill(nothing);
        let failure = row_times(&damaged).unwrap_err();
        assert!(matches!(
            failure,
            HrscError::TimeGap {
                first: 129,
                last: 139
            }
        ));
        assert!(row_times(&vec![nothing; 10]).is_err());
        assert!(row_times(&[]).is_err());
    }

    #[test]
    fn times_that_go_back_are_refused() {
        let mut damaged = prefixes();
        for prefix in &mut damaged[70..] {
            prefix.start_s = prefix.start_s.map(|start_s| start_s - 0.01);
        }
        let told = row_times(&damaged).unwrap_err().to_string();
        assert!(
            told.starts_with("row 70 begins 0.010000 s before"),
            "{told}"
        );
    }
}
