//! The first look at a file without an index: which rows may matter, told by a few fields of each record.

use std::{mem, ops::Range, sync::atomic::AtomicBool};

use rayon::prelude::*;

use super::{Query, Source};
use crate::{
    error::{Result, Stopped},
    pds::pedr::Stretch,
};

/// Records that a thread looks at at once: 0.4 MB, which stay in its processor's own cache.
const LOOK_RECORDS: usize = 512;
/// Rows that lie no farther apart than this are read together.
const GAP_RECORDS: usize = 64;

impl Source {
    /// The rows that may have shots that are asked for, and few others; `stop` is looked at before every piece.
    ///
    /// # Errors
    /// What the disk refuses; a file that has changed; [`Stopped`].
    pub(super) fn look(&self, query: &Query<'_>, stop: &AtomicBool) -> Result<Vec<Range<usize>>> {
        let reader = self.reopen()?;
        let starts: Vec<usize> = (0..self.records()).step_by(LOOK_RECORDS).collect();
        let found: Result<Vec<Option<Range<usize>>>> = starts
            .into_par_iter()
            .map_init(Vec::new, |buffer, start| {
                Stopped::check(stop)?;
                let rows = start..self.records().min(start + LOOK_RECORDS);
                let stretch = reader.unjudged(rows.clone(), mem::take(buffer))?;
                let near = self.near(&stretch, rows, query);
                *buffer = stretch.into_buffer();
                Ok(near)
            })
            .collect();
        let mut rows: Vec<Range<usize>> = Vec::new();
        for near in found?.into_iter().flatten() {
            match rows.last_mut() {
                Some(last) if near.start - last.end <= GAP_RECORDS => last.end = near.end,
                _ => rows.push(near),
            }
        }
        reader.unchanged()?;
        Ok(rows)
    }

    /// From the first to the last of those rows that may matter.
    fn near(
        &self,
        stretch: &Stretch,
        rows: Range<usize>,
        query: &Query<'_>,
    ) -> Option<Range<usize>> {
        let mut near = None;
        for (row, record) in stretch.records(rows) {
            if query.may_matter(record, self.datum()) {
                let first = near.map_or(row, |near: (usize, usize)| near.0);
                near = Some((first, row + 1));
            }
        }
        near.map(|(first, end)| first..end)
    }
}
