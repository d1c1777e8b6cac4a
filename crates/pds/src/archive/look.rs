//! First pass over a file without an index: a few fields of each record identify the candidate rows.

use std::{mem, ops::Range, sync::atomic::AtomicBool};

use rayon::prelude::*;

use super::{Query, Source};
use crate::pedr::Stretch;
use areograph_base::error::{Result, Stopped};
use areograph_store::files::stand_in::elsewhere;

/// Records that a thread examines at a time: 0.4 MB, which fit into the cache of a processor core.
const LOOK_RECORDS: usize = 512;
/// Rows at most this far apart are read together.
const GAP_RECORDS: usize = 64;

impl Source {
    /// The rows that may contain requested shots, and few others; `stop` is checked before every piece.
    ///
    /// # Errors
    /// A read error; a file that has changed; [`Stopped`].
    pub(super) fn look(&self, query: &Query<'_>, stop: &AtomicBool) -> Result<Vec<Range<usize>>> {
        let reader = self.reopen()?;
        if let Some(part) = reader.part(&(0..self.records())) {
            let failed = elsewhere()?.bring(&[part], stop).pop();
            failed.map_or(Ok(()), |(_, failure)| Err(failure))?;
        }
        let starts: Vec<usize> = (0..self.records()).step_by(LOOK_RECORDS).collect();
        let found: Result<Vec<Looked>> = starts
            .into_par_iter()
            .map_init(Vec::new, |buffer, start| {
                Stopped::check(stop)?;
                let rows = start..self.records().min(start + LOOK_RECORDS);
                let stretch = reader.unjudged(rows.clone(), mem::take(buffer))?;
                let looked = Looked {
                    near: self.near(&stretch, rows, query),
                    is_in_order: stretch.is_in_order(),
                };
                *buffer = stretch.into_buffer();
                Ok(looked)
            })
            .collect();
        let found = found?;
        reader.unchanged()?;
        if found.iter().all(|looked| looked.is_in_order) {
            self.set_in_order();
        }
        let mut rows: Vec<Range<usize>> = Vec::new();
        let near = found.into_iter().flat_map(|looked| looked.near);
        near.for_each(|near| join(&mut rows, near));
        Ok(rows)
    }

    /// The candidate rows among these.
    fn near(&self, stretch: &Stretch, rows: Range<usize>, query: &Query<'_>) -> Vec<Range<usize>> {
        let mut near = Vec::new();
        for (row, record) in stretch.records(rows) {
            if query.may_matter(record, self.datum()) {
                join(&mut near, row..row + 1);
            }
        }
        near
    }
}

/// Result for a piece of a file.
struct Looked {
    near: Vec<Range<usize>>,
    is_in_order: bool,
}

/// Appends rows to others, merged with those shortly before them.
fn join(rows: &mut Vec<Range<usize>>, next: Range<usize>) {
    match rows.last_mut() {
        Some(last) if next.start - last.end <= GAP_RECORDS => last.end = next.end,
        _ => rows.push(next),
    }
}
