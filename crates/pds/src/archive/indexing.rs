//! Building an index: every record of a file is read once, hashed, checked and located.

use std::{ops::Range, path::Path, sync::atomic::AtomicBool};

use rayon::prelude::*;

use super::{
    block::{BLOCK_RECORDS, Block},
    index::IndexedFile,
    parts::Parts,
    search::LOAD_RECORDS,
};
use crate::pedr::{Complaint, FieldGuard, RECORD_BYTES, Reader, Record, Stretch};
use areograph_base::error::{Cause, Locate as _, Result, Stopped};
use areograph_store::files::stand_in::StandIn;

/// Maximum number of a file's complaints in an index; a file with more is always read as a whole.
const COMPLAINTS_MAX: usize = 100;
/// Bytes of a block of a file on a server, which is read and verified as a whole: 32 records.
const HASHED_BYTES: u64 = 32 * RECORD_BYTES as u64;

/// A server that serves stand-ins.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the server has a stand-in of areograph in place of the PEDR file")]
#[cause(Input: "give the address of the archive itself")]
struct IsStandIn;

/// An entry that cannot be encoded.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the index entry of the file cannot be encoded")]
#[cause(Bug: "this is a bug in areograph; please report it")]
struct NotEncoded;

impl IndexedFile {
    /// Index entry of the file `path`, which is `below` the folder of the index. `stop` is checked before every piece.
    ///
    /// # Errors
    /// A file that cannot be read, contains no valid record, or changes while it is read; [`Stopped`].
    pub fn of(path: &Path, below: &Path, stop: &AtomicBool) -> Result<Self> {
        let reader = Reader::open(path)?;
        reader.require_steady()?;
        let parts = Vec::new();
        let entry = Self::of_reader(&reader, below, stop)?;
        Ok(Self { parts, ..entry })
    }

    /// Index entry of a file of which the caller knows that no other program writes to it.
    fn of_reader(reader: &Reader, below: &Path, stop: &AtomicBool) -> Result<Self> {
        reader.require_records()?;
        let guard = FieldGuard::new(reader.head().label().software_version);
        let mut hasher = blake3::Hasher::new();
        hasher.update(reader.head().label_bytes());
        let (mut blocks, mut complaints, mut buffer) = (Vec::new(), Vec::new(), Vec::new());
        let mut parts = Vec::new();
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
            for (block, of_block, found) in judged {
                blocks.push(block);
                parts.push(of_block);
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
            parts.clear();
        }
        Ok(Self {
            path: below.to_owned(),
            identity: reader.identity(),
            blake3: *hasher.finalize().as_bytes(),
            complaints,
            blocks: is_sound.then_some(blocks),
            parts,
        })
    }
}

/// A stand-in, which describes a file on a server and contains its index entry, from the complete copy of the file at
/// `place`, to which no other program writes. `stop` is checked before every piece.
///
/// * `path` – path of the stand-in, whose name is that of the file
/// * `stated` – the server's strong validator of the file, and its time of the last change
///
/// # Errors
/// A file that cannot be read, or contains no valid record; [`Stopped`].
pub fn stand_in(
    place: &Path,
    path: &Path,
    stated: [Option<String>; 2],
    stop: &AtomicBool,
) -> Result<StandIn> {
    let reader = Reader::open_as(place, path)?;
    if reader.stated_entry().is_some() {
        return Err(IsStandIn).in_file(path);
    }
    let entry = IndexedFile::of_reader(&reader, Path::new(""), stop)?;
    let entry = entry.encode().ok_or(NotEncoded).in_file(path)?;
    let note = reader.note(entry)?.ok_or(NotEncoded).in_file(path)?;
    StandIn::of(place, HASHED_BYTES, stated, note)
}

/// The blocks of the stretch, each with the faults of its records.
fn judge(
    stretch: &Stretch,
    rows: Range<usize>,
    guard: FieldGuard,
) -> Vec<(Block, Parts, Vec<Complaint>)> {
    let starts: Vec<usize> = rows.clone().step_by(BLOCK_RECORDS).collect();
    let block = |start: usize| {
        let rows = start..rows.end.min(start + BLOCK_RECORDS);
        let complaints = stretch
            .frames(rows.clone(), guard)
            .filter_map(|(row, frame)| Some(stretch.complaint(row, &frame.err()?)))
            .collect();
        let records: Vec<&Record> = stretch.records(rows).map(|(_, record)| record).collect();
        let block = Block::of(records.iter().copied());
        let parts = Parts::of(&block, &records);
        (block, parts, complaints)
    };
    starts.into_par_iter().map(block).collect()
}
