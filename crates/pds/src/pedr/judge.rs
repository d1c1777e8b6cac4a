//! The records of a file judged: by themselves, by the file's chronology, by their neighbours.
//!
//! A record is judged here and nowhere else: by itself (`check`), by the chronology of the file, and by its neighbours;
//! `spoiled_shots` marks single shots of a good frame. A bad record is a complaint with file and record, counted in the
//! manifest, and good records are kept. `docs/records.md` has the bounds, and the errors that they cannot detect.

use std::ops::Range;

use super::{
    FieldGuard, File, Frame, Record, RecordError,
    chronology::Misplaced,
    neighbours::{Comparison, NEIGHBOURS},
};

/// Frames that follow each other begin at most this much apart, seconds: else one is missing between them.
const ADJOINING_S: f64 = 3.0;

impl File {
    /// The frames of some rows of the file, counted from 0, each with its row and decoded with its neighbours in
    /// the file, or with the impossible value that spoils it. Rows that are not in memory are left out.
    ///
    /// Of a good frame single shots may still be spoiled: [`Frame::spoiled_shots`].
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

    /// What is wrong with the records of some rows.
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

    /// Times of the records in memory, of those without an impossible value.
    pub(super) fn sound_times(&self) -> impl Iterator<Item = Option<f64>> {
        let (mapping, guard) = (self.is_mapping(), self.guard());
        let records = self.records().iter();
        records.map(move |record| {
            let is_sound = record.check(mapping, guard).is_ok();
            is_sound.then_some(record.time_s.get())
        })
    }

    /// Crossover residual of the frame before row `row`, metres, when that frame is good and adjoins.
    ///
    /// Before the first frame stands its next one mirrored, `x₁ − (x₂ − x₁)`, as in `pedr2tab`.
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
