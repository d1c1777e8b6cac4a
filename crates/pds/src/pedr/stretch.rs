//! Successive records of a file in memory.

use std::ops::Range;

use zerocopy::IntoBytes as _;

use super::{Complaint, FieldGuard, File, Frame, Record, RecordError, chronology::in_order};

/// Successive records of a file, with neighbours to check them by.
#[derive(Debug)]
pub struct Stretch {
    pub(super) file: File,
    /// Rows of the stretch itself; their neighbours are in memory as well.
    pub(super) inner: Range<usize>,
}

impl Stretch {
    /// Records of the rows `rows` of the stretch, with their rows.
    pub fn records(&self, rows: Range<usize>) -> impl Iterator<Item = (usize, &Record)> {
        self.about(rows).map(|row| (row, self.file.record(row)))
    }

    /// The frames of the rows `rows` of the stretch, with their rows: each is checked with its neighbours, which cost
    /// less the more rows are requested at once.
    pub fn frames(
        &self,
        rows: Range<usize>,
        guard: FieldGuard,
    ) -> impl Iterator<Item = (usize, std::result::Result<Frame<'_>, RecordError>)> {
        self.file.frames(self.about(rows), guard)
    }

    /// The complaint about the record in row `row` of the file.
    #[must_use]
    pub fn complaint(&self, row: usize, error: &RecordError) -> Complaint {
        self.file.record_complaint(row, error)
    }

    /// Number of the record in row `row` of the file.
    #[must_use]
    pub fn record_number(&self, row: usize) -> u32 {
        self.file.record_number(row)
    }

    /// Whether the records, and their neighbours in memory, follow each other in time without sharing a shot.
    #[must_use]
    pub fn is_in_order(&self) -> bool {
        in_order(self.file.records().iter().map(|record| record.time_s.get()))
    }

    /// The rows that belong to the stretch itself.
    fn about(&self, rows: Range<usize>) -> Range<usize> {
        let start = rows.start.clamp(self.inner.start, self.inner.end);
        start..rows.end.clamp(start, self.inner.end)
    }

    /// The bytes of the records of the stretch itself.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        let first = self.inner.start - self.file.rows().start;
        self.file.records()[first..first + self.inner.len()].as_bytes()
    }

    /// The buffer, for the next stretch.
    #[must_use]
    pub fn into_buffer(self) -> Vec<u8> {
        self.file.into_bytes()
    }
}
