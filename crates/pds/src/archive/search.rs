//! The search: a load of pieces is read, then scanned by all threads in waves, whose results are delivered in order.

use std::{
    collections::{BTreeMap, BTreeSet},
    iter, mem,
    ops::Range,
    sync::atomic::AtomicBool,
};

use rayon::prelude::*;

use super::{Found, Query, Source, scan::Scan};
use crate::pedr::{Complaint, RECORD_BYTES, Reader, Stretch};
use areograph_base::error::{Cause, Error, Kind, Result, Stopped};
use areograph_store::files::stand_in::{Part, elsewhere};

/// Records in memory at once: 51 MB, more than any day of the mission.
pub(super) const LOAD_RECORDS: usize = 1 << 16;
/// Pieces of a load: each may belong to another file, which is open meanwhile.
const PIECES_MAX: usize = 256;
/// Records of a task: 0.4 MB, and at most 1.5 MB of shots.
const TASK_RECORDS: usize = 512;
/// Tasks per thread in a wave, and the maximum of a wave: their results are in memory at once.
const TASKS_PER_THREAD: usize = 8;
const TASKS_MAX: usize = 64;

/// Unusable records: more than this number and more than `UNUSABLE_SHARE_MAX` of a file indicate a damaged file rather
/// than damaged records. Files of the archive have few or none.
pub const UNUSABLE_MAX: u64 = 10;
/// The corresponding share of the file's records.
pub const UNUSABLE_SHARE_MAX: f64 = 0.01;

/// A file with more than isolated damaged records.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "{unusable} of {records} records are unusable; expected at most {UNUSABLE_MAX} plus 1 % of the records. The first: {first}"
)]
#[cause(Input: "the file was damaged in transfer: fetch it again, or omit it")]
struct Damaged {
    unusable: u64,
    records: u64,
    first: String,
}

/// Unusable records of a file.
#[derive(Default)]
struct Unusable {
    count: u64,
    first: Option<String>,
}

impl Unusable {
    fn add(&mut self, complaints: &[Complaint]) {
        for complaint in complaints.iter().filter(|complaint| complaint.leaves_out()) {
            self.count += 1;
            self.first.get_or_insert_with(|| complaint.to_string());
        }
    }

    /// The reason for which a file with these records is not used.
    fn failure(self, records: u64) -> Option<Damaged> {
        let allowed = UNUSABLE_SHARE_MAX * records as f64 + UNUSABLE_MAX as f64;
        let first = self.first.filter(|_| self.count as f64 > allowed)?;
        Some(Damaged {
            unusable: self.count,
            records,
            first,
        })
    }
}

/// Receives the results of a search, in order of files, records and shots.
pub trait Sink {
    /// Receives the results from a stretch of file `file`.
    ///
    /// # Errors
    /// An error that ends the search.
    fn found(&mut self, file: usize, found: Found) -> Result<()>;

    /// Receives the failure of file `file`: no more results follow, and those delivered may be incomplete.
    ///
    /// # Errors
    /// An error that ends the search.
    fn failed(&mut self, file: usize, failure: Error) -> Result<()>;
}

/// Searches the files for requested shots and passes them to `sink`; `stop` is checked before every piece.
///
/// Results do not depend on the number of threads. At most 65,535 files are supported.
///
/// # Errors
/// An error of `sink`; [`Stopped`].
pub fn search(
    sources: &[Source],
    query: &Query<'_>,
    stop: &AtomicBool,
    sink: &mut dyn Sink,
) -> Result<()> {
    let mut search = Search {
        sources,
        query,
        stop,
        sink,
        readers: BTreeMap::new(),
        failed: BTreeSet::new(),
        unusable: BTreeMap::new(),
        buffers: Vec::new(),
    };
    let mut pieces: Vec<Piece> = Vec::new();
    for (file, source) in sources.iter().enumerate() {
        if let Some(next) = sources.get(file + 1) {
            next.announce();
        }
        match source.rows_to_read(query, stop) {
            Ok(rows) => pieces.extend(pieces_of(file, &rows)),
            Err(failure) if failure.kind() == Kind::Interrupted => return Err(failure),
            Err(failure) => {
                search.load_all(&mut pieces, 0)?;
                search.sink.failed(file, failure)?;
            }
        }
        search.load_all(&mut pieces, LOAD_RECORDS)?;
    }
    search.load_all(&mut pieces, 0)
}

/// Successive rows of a file.
struct Piece {
    file: usize,
    rows: Range<usize>,
    /// End of the preceding piece.
    after: usize,
    is_first: bool,
    is_last: bool,
}

/// The pieces of a file: at least one, which may be empty.
fn pieces_of(file: usize, rows: &[Range<usize>]) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = rows
        .iter()
        .flat_map(|rows| {
            let starts = rows.clone().step_by(LOAD_RECORDS);
            starts.map(move |start| start..rows.end.min(start + LOAD_RECORDS))
        })
        .scan(0, |end, rows| {
            let after = std::mem::replace(end, rows.end);
            Some((after, rows))
        })
        .map(|(after, rows)| Piece {
            file,
            rows,
            after,
            is_first: false,
            is_last: false,
        })
        .collect();
    if pieces.is_empty() {
        pieces.push(Piece {
            file,
            rows: 0..0,
            after: 0,
            is_first: false,
            is_last: false,
        });
    }
    pieces[0].is_first = true;
    if let Some(last) = pieces.last_mut() {
        last.is_last = true;
    }
    pieces
}

/// Number of pieces, from the first on, that fit into memory together; each one fits on its own.
fn next_load(pieces: &[Piece]) -> usize {
    let mut records = 0;
    let fit = pieces.iter().take(PIECES_MAX).take_while(|piece| {
        records += piece.rows.len();
        records <= LOAD_RECORDS
    });
    fit.count()
}

/// A search in progress.
struct Search<'a> {
    sources: &'a [Source],
    query: &'a Query<'a>,
    stop: &'a AtomicBool,
    sink: &'a mut dyn Sink,
    /// Files of the pieces in memory.
    readers: BTreeMap<usize, Reader>,
    failed: BTreeSet<usize>,
    unusable: BTreeMap<usize, Unusable>,
    /// Buffers of earlier pieces, reused: fresh memory costs as much as reading.
    buffers: Vec<Vec<u8>>,
}

/// A part of a piece in memory, for one thread.
struct Task {
    piece: usize,
    rows: Range<usize>,
    /// End of the preceding task.
    after: usize,
    is_first: bool,
    is_last: bool,
}

impl Search<'_> {
    /// Reads and scans pieces, one load after the other, until few enough are left.
    ///
    /// * `left` – number of records that may be left, to be read with the next pieces
    fn load_all(&mut self, pieces: &mut Vec<Piece>, left: usize) -> Result<()> {
        let are_few = |pieces: &[Piece]| {
            let records: usize = pieces.iter().map(|piece| piece.rows.len()).sum();
            pieces.is_empty() || records < left && pieces.len() < PIECES_MAX
        };
        while !are_few(pieces) {
            let load = next_load(pieces);
            self.load(&pieces[..load])?;
            pieces.drain(..load);
        }
        Ok(())
    }

    /// Reads and scans pieces that fit into memory together.
    fn load(&mut self, pieces: &[Piece]) -> Result<()> {
        Stopped::check(self.stop)?;
        let mut failures = self.open(pieces);
        self.bring(pieces, &mut failures);
        Stopped::check(self.stop)?;
        let stretches = self.read(pieces, &mut failures);
        let tasks: Vec<Task> = (0..)
            .zip(pieces)
            .flat_map(|(number, piece)| tasks_of(number, piece))
            .collect();
        let (sources, query) = (self.sources, self.query);
        let wave = (TASKS_PER_THREAD * rayon::current_num_threads()).min(TASKS_MAX);
        for tasks in tasks.chunks(wave) {
            Stopped::check(self.stop)?;
            let scanned: Vec<Found> = tasks
                .par_iter()
                .map(|task| {
                    let (piece, stretch) = (&pieces[task.piece], &stretches[task.piece]);
                    scan(
                        &sources[piece.file],
                        query,
                        piece.file,
                        task,
                        stretch.as_ref(),
                    )
                })
                .collect();
            for (task, found) in tasks.iter().zip(scanned) {
                self.hand_on(pieces[task.piece].file, task, found, &mut failures)?;
            }
        }
        let buffers = stretches.into_iter().flatten().map(Stretch::into_buffer);
        let mut kept_bytes = 0;
        self.buffers = buffers
            .take_while(|buffer| {
                kept_bytes += buffer.capacity();
                kept_bytes <= 2 * LOAD_RECORDS * RECORD_BYTES
            })
            .collect();
        Ok(())
    }

    /// Opens the files of these pieces, except failed ones, and closes others. Returns the failures.
    fn open(&mut self, pieces: &[Piece]) -> BTreeMap<usize, Error> {
        // Some rows of each file.
        let read = pieces.iter().filter(|piece| !piece.rows.is_empty());
        let files: BTreeMap<usize, &Range<usize>> =
            read.map(|piece| (piece.file, &piece.rows)).collect();
        self.readers.retain(|file, _| files.contains_key(file));
        let mut failures = BTreeMap::new();
        for (file, rows) in files {
            if self.failed.contains(&file) || self.readers.contains_key(&file) {
                continue;
            }
            let opened = self.sources[file].reopen().and_then(|reader| {
                reader.prepare(rows)?;
                Ok(reader)
            });
            match opened {
                Ok(reader) => drop(self.readers.insert(file, reader)),
                Err(failure) => drop(failures.insert(file, failure)),
            }
        }
        failures
    }

    /// Brings the pieces of files on servers to this computer, all at once.
    fn bring(&self, pieces: &[Piece], failures: &mut BTreeMap<usize, Error>) {
        let part = |piece: &Piece| {
            let reader = self.readers.get(&piece.file)?;
            let part = reader.part(&piece.rows).filter(|_| !piece.rows.is_empty());
            Some((piece.file, part?))
        };
        let (files, parts): (Vec<usize>, Vec<Part<'_>>) = pieces.iter().filter_map(part).unzip();
        if parts.is_empty() {
            return;
        }
        let failed = match elsewhere() {
            Ok(reader) => reader.bring(&parts, self.stop),
            // Reading them states the reason.
            Err(_) => Vec::new(),
        };
        for (part, failure) in failed {
            failures.entry(files[part]).or_insert(failure);
        }
    }

    /// Reads the pieces; `None` for pieces of failed files.
    fn read(
        &mut self,
        pieces: &[Piece],
        failures: &mut BTreeMap<usize, Error>,
    ) -> Vec<Option<Stretch>> {
        let earlier = mem::take(&mut self.buffers).into_iter();
        let buffers: Vec<Vec<u8>> = earlier
            .chain(iter::repeat_with(Vec::new))
            .take(pieces.len())
            .collect();
        let (readers, failed) = (&self.readers, &*failures);
        let stretches: Vec<Option<Result<Stretch>>> = pieces
            .par_iter()
            .zip(buffers)
            .map(|(piece, buffer)| {
                let reader = readers.get(&piece.file)?;
                if failed.contains_key(&piece.file) {
                    return None;
                }
                Some(reader.stretch(piece.rows.clone(), buffer))
            })
            .collect();
        let read = stretches.into_iter().zip(pieces);
        read.map(|(stretch, piece)| match stretch? {
            Ok(stretch) => Some(stretch),
            Err(failure) => {
                failures.entry(piece.file).or_insert(failure);
                None
            }
        })
        .collect()
    }

    /// Passes results to the sink, unless the file has failed.
    fn hand_on(
        &mut self,
        file: usize,
        task: &Task,
        found: Found,
        failures: &mut BTreeMap<usize, Error>,
    ) -> Result<()> {
        if self.failed.contains(&file) {
            return Ok(());
        }
        let mut failure = failures.remove(&file);
        if failure.is_none() && task.is_last {
            let reader = self.readers.get(&file);
            failure = reader.and_then(|reader| reader.unchanged().err());
        }
        if failure.is_none() {
            let unusable = self.unusable.entry(file).or_default();
            unusable.add(&found.complaints);
            self.sink.found(file, found)?;
            if task.is_last {
                let source = &self.sources[file];
                let unusable = self.unusable.remove(&file).unwrap_or_default();
                let damaged = unusable.failure(source.records() as u64);
                failure = damaged.map(|damaged| Error::from(damaged).in_file(source.path()));
            }
        }
        if let Some(failure) = failure {
            self.failed.insert(file);
            self.sink.failed(file, failure)?;
        }
        Ok(())
    }
}

/// Searches the rows of a task.
fn scan(
    source: &Source,
    query: &Query<'_>,
    file: usize,
    task: &Task,
    stretch: Option<&Stretch>,
) -> Found {
    let mut found = Found::new();
    if task.is_first {
        found.frames_read = source.records() as u64;
        source.tell_of_head(&mut found);
    }
    if let Some(stretch) = stretch {
        let scan = Scan {
            source,
            // The number of files was checked before.
            index: u16::try_from(file).unwrap_or(u16::MAX),
            query,
        };
        scan.rows(stretch, task.rows.clone(), &mut found);
    }
    let end = if task.is_last {
        source.records()
    } else {
        task.rows.end
    };
    source.tell_known(query, task.after..end, &mut found);
    if task.is_last {
        source.tell_of_end(&mut found);
    }
    found
}

/// The parts of a piece: at least one, which may be empty.
fn tasks_of(number: usize, piece: &Piece) -> Vec<Task> {
    let rows = piece.rows.clone();
    let count = rows.len().div_ceil(TASK_RECORDS).max(1);
    let task = |part: usize| {
        let start = rows.start + part * TASK_RECORDS;
        Task {
            piece: number,
            rows: start..rows.end.min(start + TASK_RECORDS),
            after: if part == 0 { piece.after } else { start },
            is_first: piece.is_first && part == 0,
            is_last: piece.is_last && part + 1 == count,
        }
    };
    (0..count).map(task).collect()
}
