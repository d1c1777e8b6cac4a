//! A PEDR file read a stretch at a time: archives are searched where they lie, in little memory.
//!
//! Stretches are copied by `pread`. A mapping would save the copy, but whoever shortens a mapped file ends the process:
//! docs/decisions/0019.

use std::{
    fs, io,
    ops::Range,
    os::unix::fs::{FileExt as _, MetadataExt as _},
    path::Path,
    thread,
    time::{Duration, SystemTime},
};

use rayon::prelude::*;
use rustix::fs::Advice;
use zerocopy::IntoBytes as _;

use super::{Complaint, FieldGuard, File, Frame, LABEL_BYTES, RECORD_BYTES, Record, RecordError};
use crate::{
    error::{Cause, IoError, Kind, Locate, Result},
    files::Identity,
};

/// Records that are read on either side of a stretch: a record is judged with its neighbours.
const NEIGHBOURS: usize = 4;
/// Records among which the first good one is looked for.
const FIRST_RECORDS: usize = 16;
const NEXT_RECORDS: usize = 1_024;
/// How long a file is waited for that was written just now, and how often.
const WAIT: Duration = Duration::from_millis(100);
const WAITS: usize = 30;
/// Bytes that a thread reads at once.
const READ_BYTES: usize = 1 << 20;

/// A PEDR file open for reading.
#[derive(Debug)]
pub struct Reader {
    handle: fs::File,
    identity: Identity,
    head: File,
}

/// Some successive records of a file, with neighbours to judge them by.
#[derive(Debug)]
pub struct Stretch {
    file: File,
    /// Row of the file that is the first in memory.
    first_row: usize,
    /// Rows in memory that the stretch is about.
    inner: Range<usize>,
}

/// A file is not what it was when it was opened.
#[derive(Debug, thiserror::Error)]
enum Changed {
    #[error("the file ended early while it was read: it had {0} bytes when it was opened")]
    Shorter(u64),
    #[error("the file changed while it was read")]
    Content,
    #[error("the file was removed while it was read")]
    Removed,
    #[error("the file is being written")]
    Young,
}

impl Cause for Changed {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "run again when nobody is writing to the PEDR files".to_owned()
    }
}

impl Reader {
    /// Opens a file and reads its label.
    ///
    /// # Errors
    /// As [`File::open`].
    pub fn open(path: &Path) -> Result<Self> {
        let handle = super::file::open_regular(path)?;
        let metadata = handle.metadata();
        let metadata = metadata.map_err(IoError::on("look at")).in_file(path)?;
        let identity = Identity::of(&metadata);
        let mut label = vec![0; LABEL_BYTES.min(usize::try_from(identity.bytes).unwrap_or(0))];
        read_at(&handle, &mut label, 0, identity.bytes).in_file(path)?;
        Ok(Self {
            handle,
            identity,
            head: File::of_length(label, identity.bytes, path.to_owned()),
        })
    }

    /// The file without its records: name, label, and what is wrong with it as a whole.
    #[must_use]
    pub const fn head(&self) -> &File {
        &self.head
    }

    /// What the file system said of the file when it was opened.
    #[must_use]
    pub const fn identity(&self) -> Identity {
        self.identity
    }

    /// Reads some rows, counted from 0, into `buffer`; those that are not there are left out.
    ///
    /// # Errors
    /// What the disk refuses; a file that has become shorter.
    pub fn stretch(&self, rows: Range<usize>, mut buffer: Vec<u8>) -> Result<Stretch> {
        let end = rows.end.min(self.head.record_count());
        let start = rows.start.min(end);
        let first_row = start.saturating_sub(NEIGHBOURS);
        let last_row = (end + NEIGHBOURS).min(self.head.record_count());
        // The label's place stays in front of the records, as in the file.
        buffer.resize(LABEL_BYTES + (last_row - first_row) * RECORD_BYTES, 0);
        let from = (LABEL_BYTES + first_row * RECORD_BYTES) as u64;
        let parts = buffer[LABEL_BYTES..].par_chunks_mut(READ_BYTES);
        let read = |(number, part): (usize, &mut [u8])| {
            let from = from + (number * READ_BYTES) as u64;
            read_at(&self.handle, part, from, self.identity.bytes)
        };
        let read = parts.enumerate().try_for_each(read);
        read.in_file(self.head.path())?;
        Ok(Stretch {
            file: self.head.with_records(buffer),
            first_row,
            inner: start - first_row..end - first_row,
        })
    }

    /// Has the system read the file ahead; whether it does is its own affair.
    pub fn announce(&self) {
        let _ = rustix::fs::fadvise(&self.handle, 0, None, Advice::WillNeed);
    }

    /// Makes sure that the file is what it was when it was opened, and still has a name.
    ///
    /// # Errors
    /// It is not.
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

    /// Makes sure that the file is the one that had this identity before.
    ///
    /// # Errors
    /// It is another one, or has changed.
    pub fn require_identity(&self, earlier: &Identity) -> Result<()> {
        let content = |of: &Identity| (of.device, of.inode, of.bytes, of.modified);
        if content(&self.identity) == content(earlier) {
            return Ok(());
        }
        Err(Changed::Content).in_file(self.head.path())
    }

    /// Makes sure that the file was not written just now, so that any later change shows in its times; a young file is
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

    /// The bytes after the last whole record.
    ///
    /// # Errors
    /// What the disk refuses; a file that has become shorter.
    pub fn trailing_bytes(&self) -> Result<Vec<u8>> {
        let from = (LABEL_BYTES + self.head.record_count() * RECORD_BYTES) as u64;
        let length = self.identity.bytes.saturating_sub(from);
        let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
        read_at(&self.handle, &mut bytes, from, self.identity.bytes).in_file(self.head.path())?;
        Ok(bytes)
    }

    /// Time tag of the first good record, ET seconds; a file of another kind holds none.
    ///
    /// # Errors
    /// What is wrong with the label, else with the first record; what the disk refuses.
    pub fn require_records(&self) -> Result<f64> {
        let guard = FieldGuard::new(self.head.label().software_version);
        let (mut row, mut next, mut first) = (0, FIRST_RECORDS, None);
        while row < self.head.record_count() {
            let stretch = self.stretch(row..row + next, Vec::new())?;
            for (row, record) in stretch.records(row..row + next) {
                match stretch.frame(row, guard) {
                    Some(Err(error)) => first = first.or(Some((row, error))),
                    Some(Ok(_)) => return Ok(record.time_s.get()),
                    None => {}
                }
            }
            (row, next) = (row + next, NEXT_RECORDS);
        }
        Err(self.head.no_good_record(first))
    }
}

impl Stretch {
    /// Those of the records in rows `rows` of the file that the stretch is about, with their rows.
    pub fn records(&self, rows: Range<usize>) -> impl Iterator<Item = (usize, &Record)> {
        let inner = &self.inner;
        let start = rows
            .start
            .saturating_sub(self.first_row)
            .clamp(inner.start, inner.end);
        let end = rows
            .end
            .saturating_sub(self.first_row)
            .clamp(start, inner.end);
        (self.first_row + start..).zip(&self.file.records()[start..end])
    }

    /// The frame of row `row` of the file, when the stretch is about that row.
    #[must_use]
    pub fn frame(
        &self,
        row: usize,
        guard: FieldGuard,
    ) -> Option<std::result::Result<Frame<'_>, RecordError>> {
        let row = row.checked_sub(self.first_row)?;
        let row = Some(row).filter(|row| self.inner.contains(row))?;
        let (_, frame) = self.file.frames(row..row + 1, guard).next()?;
        Some(frame)
    }

    /// The frame of row `row` of the file, when it is a good one, and what there is to complain of.
    #[must_use]
    pub fn judged(&self, row: usize, guard: FieldGuard) -> (Option<Frame<'_>>, Option<Complaint>) {
        let (frame, error) = match self.frame(row, guard) {
            Some(Ok(frame)) => (Some(frame), frame.record().check_radii().err()),
            Some(Err(error)) => (None, Some(error)),
            None => (None, None),
        };
        (
            frame,
            error.map(|error| self.file.record_complaint(row, &error)),
        )
    }

    /// The bytes of the records that the stretch is about.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.file.records()[self.inner.clone()].as_bytes()
    }

    /// The memory, for the next stretch.
    #[must_use]
    pub fn into_buffer(self) -> Vec<u8> {
        self.file.into_bytes()
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
