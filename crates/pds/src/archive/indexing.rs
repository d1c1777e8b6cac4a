//! Building an index: every record of a file is read once, hashed, checked and located.

use std::{ops::Range, path::Path, sync::atomic::AtomicBool};

use rayon::prelude::*;

use super::{
    block::{BLOCK_RECORDS, Block},
    index::IndexedFile,
    search::LOAD_RECORDS,
};
use crate::pedr::{Complaint, FieldGuard, Reader, Stretch};
use areograph_base::error::{Result, Stopped};

/// Maximum number of a file's complaints in an index; a file with more is always read as a whole.
const COMPLAINTS_MAX: usize = 100;
impl IndexedFile {
    /// Index entry of the file `path`, which is `below` the folder of the index. `stop` is checked before every piece.
    ///
    /// # Errors
    /// A file that cannot be read, contains no valid record, or changes while it is read; [`Stopped`].
    pub fn of(path: &Path, below: &Path, stop: &AtomicBool) -> Result<Self> {
        let reader = Reader::open(path)?;
        reader.require_steady()?;
        reader.require_records()?;
        let guard = FieldGuard::new(reader.head().label().software_version);
        let mut hasher = blake3::Hasher::new();
        hasher.update(reader.head().label_bytes());
        let (mut blocks, mut complaints, mut buffer) = (Vec::new(), Vec::new(), Vec::new());
        let records = reader.head().record_count();
        for start in (0..records).step_by(LOAD_RECORDS) {
            Stopped::check(stop)?;
            let stretch = reader.stretch(start..start + LOAD_RECORDS, buffer)?;
            let ((), judged) = rayon::join(
                || {
                    hasher.update(stretch.bytes());
                },
                || judge(&stretch, start..records.min(start + LOAD_RECORDS), guard),
            );
            for (block, found) in judged {
                blocks.push(block);
                complaints.extend(found);
            }
            buffer = stretch.into_buffer();
        }
        hasher.update(&reader.trailing_bytes()?);
        reader.unchanged()?;
        let is_sound = complaints.len() <= COMPLAINTS_MAX
            && !complaints.iter().any(Complaint::is_of_many_records);
        if !is_sound {
            complaints.clear();
        }
        Ok(Self {
            path: below.to_owned(),
            identity: reader.identity(),
            blake3: *hasher.finalize().as_bytes(),
            complaints,
            blocks: is_sound.then_some(blocks),
        })
    }
}

/// The blocks of the stretch, each with the faults of its records.
fn judge(stretch: &Stretch, rows: Range<usize>, guard: FieldGuard) -> Vec<(Block, Vec<Complaint>)> {
    let starts: Vec<usize> = rows.clone().step_by(BLOCK_RECORDS).collect();
    let block = |start: usize| {
        let rows = start..rows.end.min(start + BLOCK_RECORDS);
        let complaints = stretch
            .frames(rows.clone(), guard)
            .filter_map(|(row, frame)| Some(stretch.complaint(row, &frame.err()?)))
            .collect();
        (
            Block::of(stretch.records(rows).map(|(_, record)| record)),
            complaints,
        )
    };
    starts.into_par_iter().map(block).collect()
}
