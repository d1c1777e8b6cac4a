//! A PEDR file read in stretches: archives are searched in place, with little memory.
//!
//! Stretches are copied by `pread`. A mapping would save the copy, but truncation of a mapped file ends the process:
//! docs/decisions/0020.

use std::{
    fs, io,
    ops::Range,
    os::unix::fs::{FileExt as _, MetadataExt as _},
    path::Path,
    sync::{Arc, OnceLock},
    thread,
    time::{Duration, SystemTime},
};

use rayon::prelude::*;
use rustix::fs::Advice;

use super::{
    File, LABEL_BYTES, RECORD_BYTES, chronology::misplaced, elsewhere::Note, file::Chronology,
    neighbours::NEIGHBOURS, stretch::Stretch,
};
use areograph_base::error::{Cause, IoError, Locate, Result};
use areograph_store::files::{
    Identity,
    stand_in::{Part, StandIn, elsewhere},
};

/// Records that are searched for the first valid one.
const FIRST_RECORDS: usize = 16;
const NEXT_RECORDS: usize = 1_024;
/// Time between checks of a recently written file, and their number.
const WAIT: Duration = Duration::from_millis(100);
const WAITS: usize = 30;
/// Records whose times are read at once.
const CHRONOLOGY_RECORDS: usize = 1 << 14;
/// Bytes that a thread reads at once.
const READ_BYTES: usize = 1 << 20;

/// A PEDR file open for reading.
#[derive(Debug)]
pub struct Reader {
    handle: fs::File,
    identity: Identity,
    /// Bytes of the file.
    length: u64,
    /// The file on a server for which the open file stands.
    elsewhere: Option<Remote>,
    head: File,
    /// Records outside the chronology of the file, once known.
    misplaced: OnceLock<Chronology>,
}

/// A file on a server.
#[derive(Debug)]
struct Remote {
    file: StandIn,
    note: Note,
}

/// A file that has changed since it was opened.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "run again when no other program is writing to the PEDR files")]
enum Changed {
    #[error("the file was truncated while it was read: it had {0} bytes when opened")]
    Shorter(u64),
    #[error("the file changed while it was read")]
    Content,
    #[error("the file was removed while it was read")]
    Removed,
    #[error("the file is being written")]
    Young,
}

impl File {
    /// Reads a complete file; a [`Reader`] reads one piece by piece.
    ///
    /// # Errors
    /// The file cannot be read; not a regular file; one that changes meanwhile. Faults of its content are reported as
    /// complaints, not as errors.
    pub fn open(path: &Path) -> Result<Self> {
        Reader::open(path)?.whole()
    }
}

impl Reader {
    /// Opens a file and reads its label.
    ///
    /// # Errors
    /// As [`File::open`].
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_as(path, path)
    }

    /// Opens a file that is at `place` under a temporary name; `path` is its name in messages.
    ///
    /// # Errors
    /// As [`File::open`].
    pub fn open_as(place: &Path, path: &Path) -> Result<Self> {
        let handle = super::file::open_regular(place)?;
        let metadata = handle.metadata();
        let metadata = metadata.map_err(IoError::on("look at")).in_file(path)?;
        let identity = Identity::of(&metadata);
        let mut label = vec![0; LABEL_BYTES.min(usize::try_from(identity.bytes).unwrap_or(0))];
        read_at(&handle, &mut label, 0, identity.bytes).in_file(path)?;
        let stand_in = if StandIn::begins(&label) {
            StandIn::of_open(&handle).in_file(path)?
        } else {
            None
        };
        let Some(file) = stand_in else {
            return Ok(Self {
                handle,
                identity,
                length: identity.bytes,
                elsewhere: None,
                head: File::of_length(label, identity.bytes, path.to_owned()),
                misplaced: OnceLock::new(),
            });
        };
        let note = Note::of(&file, path)?;
        let length = file.bytes();
        Ok(Self {
            handle,
            identity,
            length,
            head: File::of_head(note.head.clone(), length, path.to_owned()),
            elsewhere: Some(Remote { file, note }),
            misplaced: OnceLock::new(),
        })
    }

    /// The note of a stand-in of this file, with its entry in an index; `None` if it cannot be encoded.
    ///
    /// # Errors
    /// A file without a valid record; one that cannot be read.
    pub fn note(&self, entry: Vec<u8>) -> Result<Option<Vec<u8>>> {
        let first_s = self.require_records()?;
        Ok(Note::encoded(self.head.as_head(first_s), entry))
    }

    /// The entry of a file on a server in an index, as its stand-in has it.
    #[must_use]
    pub fn stated_entry(&self) -> Option<&[u8]> {
        self.elsewhere.as_ref().map(|remote| &*remote.note.entry)
    }

    /// BLAKE3 of the file, if it is on a server: its stand-in has it, and every byte that is read is verified.
    #[must_use]
    pub fn stated_blake3(&self) -> Option<String> {
        self.elsewhere.as_ref().map(|remote| remote.file.blake3())
    }

    /// The bytes of some rows with their neighbours, if they are on a server.
    #[must_use]
    pub fn part(&self, rows: &Range<usize>) -> Option<Part<'_>> {
        let remote = self.elsewhere.as_ref()?;
        let rows = self.with_neighbours(rows);
        let byte = |row: usize| (self.head.label_length() + row * RECORD_BYTES) as u64;
        Some(Part {
            path: self.head.path(),
            file: &remote.file,
            bytes: byte(rows.start)..byte(rows.end),
        })
    }

    /// Rows and their neighbours, as far as the file has them.
    fn with_neighbours(&self, rows: &Range<usize>) -> Range<usize> {
        let end = rows.end.min(self.head.record_count());
        let start = rows.start.min(end);
        start.saturating_sub(NEIGHBOURS)..(end + NEIGHBOURS).min(self.head.record_count())
    }

    /// Fills `buffer` from the byte `from` of the file.
    fn read_at(&self, buffer: &mut [u8], from: u64) -> Result<()> {
        let Some(remote) = &self.elsewhere else {
            return read_at(&self.handle, buffer, from, self.length);
        };
        let part = Part {
            path: self.head.path(),
            file: &remote.file,
            bytes: from..from + buffer.len() as u64,
        };
        elsewhere()?.read(&part, buffer)
    }

    /// The file without its records: name, label, and their faults.
    #[must_use]
    pub const fn head(&self) -> &File {
        &self.head
    }

    /// Identity of the file when it was opened.
    #[must_use]
    pub const fn identity(&self) -> Identity {
        self.identity
    }

    /// Reads some rows, counted from 0, into `buffer`; rows beyond the file are left out.
    ///
    /// # Errors
    /// A read error; a file that has become shorter.
    pub fn stretch(&self, rows: Range<usize>, buffer: Vec<u8>) -> Result<Stretch> {
        let chronology = if self.reaches_all(&rows) {
            None
        } else {
            Some(self.chronology()?)
        };
        self.stretch_in(rows, buffer, chronology)
    }

    /// Reads the chronology of the file, unless these rows suffice for it: once, before several threads request
    /// stretches of the file.
    ///
    /// # Errors
    /// A read error; a file that has become shorter.
    pub fn prepare(&self, rows: &Range<usize>) -> Result<()> {
        if !self.reaches_all(rows) {
            self.chronology()?;
        }
        Ok(())
    }

    /// Whether these rows and their neighbours include all records of the file.
    fn reaches_all(&self, rows: &Range<usize>) -> bool {
        rows.start <= NEIGHBOURS && rows.end.saturating_add(NEIGHBOURS) >= self.head.record_count()
    }

    /// A stretch of records that are not checked: the rest of the file is not read.
    ///
    /// # Errors
    /// As [`stretch`](Self::stretch).
    pub fn unjudged(&self, rows: Range<usize>, buffer: Vec<u8>) -> Result<Stretch> {
        self.stretch_in(rows, buffer, Some(Chronology::default()))
    }

    /// A stretch with a known chronology; without one, the rows in memory determine it.
    fn stretch_in(
        &self,
        rows: Range<usize>,
        buffer: Vec<u8>,
        chronology: Option<Chronology>,
    ) -> Result<Stretch> {
        let end = rows.end.min(self.head.record_count());
        let start = rows.start.min(end);
        let near = self.with_neighbours(&(start..end));
        let first_row = near.start;
        let buffer = self.read(near, buffer)?;
        Ok(Stretch {
            file: self.head.with_records(first_row, buffer, chronology),
            inner: start..end,
        })
    }

    /// The bytes of some rows, after as many as the label has, as in the file.
    fn read(&self, rows: Range<usize>, mut buffer: Vec<u8>) -> Result<Vec<u8>> {
        let label = self.head.label_length();
        buffer.resize(label + rows.len() * RECORD_BYTES, 0);
        let from = (label + rows.start * RECORD_BYTES) as u64;
        let parts = buffer[label..].par_chunks_mut(READ_BYTES);
        let read = |(number, part): (usize, &mut [u8])| {
            let from = from + (number * READ_BYTES) as u64;
            self.read_at(part, from)
        };
        let read = parts.enumerate().try_for_each(read);
        read.in_file(self.head.path())?;
        Ok(buffer)
    }

    /// Accepts the statement of an index that every record fits into the chronology.
    pub fn set_in_order(&self) {
        let _ = self.misplaced.set(Chronology::default());
    }

    /// Records outside the chronology of the file, from all its records.
    fn chronology(&self) -> Result<Chronology> {
        if let Some(known) = self.misplaced.get() {
            return Ok(Arc::clone(known));
        }
        let mut times_s = Vec::new();
        let mut buffer = Vec::new();
        let records = self.head.record_count();
        for start in (0..records).step_by(CHRONOLOGY_RECORDS) {
            buffer = self.read(start..records.min(start + CHRONOLOGY_RECORDS), buffer)?;
            let piece = self.head.with_records(start, buffer, None);
            times_s.extend(piece.sound_times());
            buffer = piece.into_bytes();
        }
        let found = Chronology::new(misplaced(&times_s));
        Ok(Arc::clone(self.misplaced.get_or_init(|| found)))
    }

    /// Reads all of the file.
    ///
    /// # Errors
    /// A read error; a file that has become shorter, has changed or lost its name.
    fn whole(&self) -> Result<File> {
        let path = self.head.path();
        let length = usize::try_from(self.length).unwrap_or(usize::MAX);
        let mut bytes = Vec::new();
        bytes
            .try_reserve_exact(length)
            .map_err(|_| IoError::on("read")(io::ErrorKind::OutOfMemory.into()))
            .in_file(path)?;
        bytes.resize(length, 0);
        self.read_at(&mut bytes, 0).in_file(path)?;
        self.unchanged()?;
        Ok(File::from_bytes(bytes, path))
    }

    /// Requests read-ahead of the file; the system may ignore it.
    pub fn announce(&self) {
        if self.elsewhere.is_some() {
            return;
        }
        let _ = rustix::fs::fadvise(&self.handle, 0, None, Advice::WillNeed);
    }

    /// Checks that the file has not changed since it was opened, and still has a name.
    ///
    /// # Errors
    /// The file has changed.
    pub fn unchanged(&self) -> Result<()> {
        let path = self.head.path();
        let metadata = self.handle.metadata();
        let metadata = metadata.map_err(IoError::on("look at")).in_file(path)?;
        if metadata.nlink() == 0 {
            return Err(Changed::Removed).in_file(path);
        }
        let now = Identity::of(&metadata);
        if (now.bytes, now.modified) != (self.identity.bytes, self.identity.modified) {
            return Err(Changed::Content).in_file(path);
        }
        Ok(())
    }

    /// Checks that the file is the one that had this identity before.
    ///
    /// # Errors
    /// It is another one, or has changed.
    pub fn require_identity(&self, earlier: &Identity) -> Result<()> {
        let content = |file: &Identity| (file.device, file.inode, file.bytes, file.modified);
        if content(&self.identity) == content(earlier) {
            return Ok(());
        }
        Err(Changed::Content).in_file(self.head.path())
    }

    /// Checks that the file was not written recently, so that any later change shows in its times; a recent file is
    /// waited for.
    ///
    /// # Errors
    /// It is still being written.
    pub fn require_steady(&self) -> Result<()> {
        for _ in 0..WAITS {
            if self.identity.is_steady(SystemTime::now()) {
                return self.unchanged();
            }
            thread::sleep(WAIT);
        }
        Err(Changed::Young).in_file(self.head.path())
    }

    /// The bytes after the last complete record.
    ///
    /// # Errors
    /// A read error; a file that has become shorter.
    pub fn trailing_bytes(&self) -> Result<Vec<u8>> {
        let from = (self.head.label_length() + self.head.record_count() * RECORD_BYTES) as u64;
        let length = self.length.saturating_sub(from);
        let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
        self.read_at(&mut bytes, from).in_file(self.head.path())?;
        Ok(bytes)
    }

    /// Time tag of the first valid record, ET seconds; a file of a different kind contains none.
    ///
    /// # Errors
    /// The fault of the label, otherwise of the first record; a read error.
    pub fn require_records(&self) -> Result<f64> {
        if let Some(remote) = &self.elsewhere {
            return Ok(remote.note.head.first_s);
        }
        let (mut row, mut next, mut first) = (0, FIRST_RECORDS, None);
        while row < self.head.record_count() {
            // One of the valid records fits into any chronology.
            let chronology = Chronology::default();
            let stretch = self.stretch_in(row..row + next, Vec::new(), Some(chronology))?;
            if let Some(good) = stretch.file.good_record(stretch.inner.clone(), &mut first) {
                return Ok(good.time_s.get());
            }
            (row, next) = (row + next, NEXT_RECORDS);
        }
        Err(self.head.no_good_record(first))
    }
}

/// Fills `buffer` from the byte `from` of a file that had `bytes` bytes.
fn read_at(handle: &fs::File, buffer: &mut [u8], from: u64, bytes: u64) -> Result<()> {
    handle
        .read_exact_at(buffer, from)
        .map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => Changed::Shorter(bytes).into(),
            _ => IoError::on("read")(error).into(),
        })
}

#[cfg(test)]
mod tests {
    use areograph_base::error::Kind;

    use super::*;

    #[test]
    #[allow(clippy::disallowed_methods, reason = "a file of a test")]
    fn a_file_that_changes_while_it_is_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ap19019l.b");
        fs::write(&path, vec![b' '; 10_000]).unwrap();
        assert_eq!(File::open(&path).unwrap().into_bytes(), vec![b' '; 10_000]);
        let refused = |change: &dyn Fn(&fs::File)| {
            let reader = Reader::open(&path).unwrap();
            change(&fs::File::options().write(true).open(&path).unwrap());
            let failure = reader.whole().unwrap_err();
            assert_eq!(failure.kind(), Kind::Input);
            failure.to_string()
        };
        let said = refused(&|file| file.set_len(9_000).unwrap());
        assert!(
            said.contains("ap19019l.b: the file was truncated"),
            "{said}"
        );
        let said = refused(&|file| file.set_len(10_000).unwrap());
        assert!(said.contains("the file changed while"), "{said}");
        // Other bytes, the same length: the time reveals the change.
        let said = refused(&|file| file.set_modified(SystemTime::UNIX_EPOCH).unwrap());
        assert!(said.contains("the file changed while"), "{said}");
        let said = refused(&|_| fs::remove_file(&path).unwrap());
        assert!(said.contains("the file was removed"), "{said}");
    }
}
