//! Checks of the records of a file: each on its own, by the file's chronology, and by its neighbours.
//!
//! Records are checked only here: individually (`check`), by the chronology of the file, and by their neighbours;
//! `spoiled_shots` marks single shots of a valid frame. An invalid record becomes a complaint with file and record,
//! counted in the manifest; valid records are kept. `docs/records.md` has the bounds, and the errors that they cannot
//! detect.

use std::ops::Range;

use super::{
    FieldGuard, File, Frame, Record, RecordError,
    chronology::Misplaced,
    neighbours::{Comparison, NEIGHBOURS},
};

/// Largest time between the starts of adjoining frames, seconds; beyond it a frame is missing.
const ADJOINING_S: f64 = 3.0;

impl File {
    /// The frames of some rows of the file, counted from 0, each with its row and decoded with its neighbours in the
    /// file, or with the impossible value that invalidates it. Rows that are not in memory are left out.
    ///
    /// Single shots of a valid frame may still be spoiled: [`Frame::spoiled_shots`].
    pub fn frames(
        &self,
        rows: Range<usize>,
        guard: FieldGuard,
    ) -> impl Iterator<Item = (usize, Result<Frame<'_>, RecordError>)> {
        let held = self.rows();
        let end = rows.end.clamp(held.start, held.end);
        let start = rows.start.clamp(held.start, end);
        let first = start.saturating_sub(NEIGHBOURS).max(held.start);
        let last = (end + NEIGHBOURS).min(held.end);
        let errors = self.judge(first..last, guard);
        (start..end).map(move |row| {
            if let Some(error) = errors[row - first] {
                return (row, Err(error));
            }
            let good = |row: usize| errors.get(row.wrapping_sub(first)) == Some(&None);
            let before_m = self.crossover_before_m(row, guard, good);
            (row, Ok(Frame::new(self.record(row), guard, before_m)))
        })
    }

    /// Faults of the records in some rows.
    fn judge(&self, rows: Range<usize>, guard: FieldGuard) -> Vec<Option<RecordError>> {
        let comparison = Comparison {
            guard,
            mapping: self.is_mapping(),
        };
        let misplaced = self.misplaced();
        let mut errors: Vec<Option<RecordError>> = rows
            .clone()
            .map(|row| {
                let record = self.record(row);
                if let Err(error) = record.check(comparison.mapping, guard) {
                    return Some(error);
                }
                let time_s = record.time_s.get();
                misplaced.get(&row).map(|place| match place {
                    Misplaced::Order => RecordError::Order(time_s),
                    Misplaced::Repeats(first) => RecordError::Repeated {
                        time_s,
                        record: self.record_number(*first),
                    },
                })
            })
            .collect();
        let sound: Vec<(usize, &Record)> = rows
            .clone()
            .zip(&errors)
            .filter(|(_, error)| error.is_none())
            .map(|(row, _)| (row, self.record(row)))
            .collect();
        for (row, error) in comparison.odd(&sound, |row| self.record_number(row)) {
            errors[row - rows.start] = Some(error);
        }
        errors
    }

    /// Times of the records in memory without impossible values.
    pub(super) fn sound_times(&self) -> impl Iterator<Item = Option<f64>> {
        let (mapping, guard) = (self.is_mapping(), self.guard());
        let records = self.records().iter();
        records.map(move |record| {
            let is_sound = record.check(mapping, guard).is_ok();
            is_sound.then_some(record.time_s.get())
        })
    }

    /// Crossover residual of the frame before row `row`, metres, if that frame is valid and adjoins.
    ///
    /// The first frame is preceded by its next one mirrored, `x₁ − (x₂ − x₁)`, as in `pedr2tab`.
    fn crossover_before_m(
        &self,
        row: usize,
        guard: FieldGuard,
        good: impl Fn(usize) -> bool,
    ) -> Option<f64> {
        let (earlier, later) = if row == 0 { (0, 1) } else { (row - 1, row) };
        if !good(earlier) || !good(later) {
            return None;
        }
        let [before, after] = [earlier, later].map(|row| self.record(row));
        let apart_s = after.time_s.get() - before.time_s.get();
        if apart_s > ADJOINING_S {
            return None;
        }
        let before_m = guard.crossover_m(before)?;
        if row == 0 {
            return guard
                .crossover_m(after)
                .map(|next_m| before_m - (next_m - before_m));
        }
        Some(before_m)
    }
}
