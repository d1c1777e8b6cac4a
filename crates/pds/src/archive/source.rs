//! A file of the archive before its records are searched.

use std::{
    iter,
    ops::Range,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock, atomic::AtomicBool},
};

use super::{Found, IndexedFile, Indexes, Judged, Query};
use crate::pedr::{Complaint, FieldGuard, PedrLabel, Reader, decide_datum};
use areograph_base::{
    altimetry::DatumChoice,
    body::Datum,
    error::{Cause, Locate, Result},
    footprints::SourceFile,
};
use areograph_store::files::{Identity, file_name};

/// A stand-in with an entry of another version.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the file on the server was indexed by a different version of areograph")]
#[cause(Input: "run `areograph pedr index URL --verify` again with the same folder")]
struct OtherEntry;

/// A file and the interpretation of its records.
#[derive(Debug, Clone)]
pub struct Source {
    path: PathBuf,
    version: Option<char>,
    datum: Datum,
    label: PedrLabel,
    records: usize,
    first_s: f64,
    /// Number of the first data record.
    first_record: u32,
    identity: Identity,
    head_complaints: Vec<Complaint>,
    trailing_complaint: Option<Complaint>,
    indexed: Option<Arc<IndexedFile>>,
    /// Set once all records are known to be in order of time.
    in_order: OnceLock<()>,
}

impl Source {
    /// Reads the label of a file and searches its first valid record.
    ///
    /// # Errors
    /// A file that cannot be read, contains no valid record, or whose datum is unknown.
    pub fn open(path: &Path, choice: DatumChoice, indexes: &Indexes) -> Result<Self> {
        let reader = Reader::open(path)?;
        let indexed = match reader.stated_entry() {
            Some(entry) => {
                let entry = IndexedFile::decode(entry).ok_or(OtherEntry).in_file(path)?;
                Some(Arc::new(entry))
            }
            None => indexes.find(path, &reader.identity()),
        };
        let first_s = reader.require_records()?;
        let head = reader.head();
        let version = head.name().map(|name| name.version);
        Ok(Self {
            path: path.to_owned(),
            version,
            datum: decide_datum(choice, version, head.label().datum).in_file(path)?,
            label: head.label().clone(),
            records: head.record_count(),
            first_s,
            first_record: head.record_number(0),
            identity: reader.identity(),
            head_complaints: head.label_complaints().to_vec(),
            trailing_complaint: head.trailing_complaint(),
            indexed,
            in_order: OnceLock::new(),
        })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file as footprints refer to it; its hash is unknown to a search.
    #[must_use]
    pub fn file(&self) -> SourceFile {
        SourceFile {
            name: file_name(&self.path),
            version: self.version,
            datum: self.datum,
            blake3: String::new(),
            is_table: false,
        }
    }

    /// Version letter of its name.
    #[must_use]
    pub const fn version(&self) -> Option<char> {
        self.version
    }

    /// Datum of its coordinates.
    #[must_use]
    pub const fn datum(&self) -> Datum {
        self.datum
    }

    /// Version of the software that made it.
    #[must_use]
    pub const fn software_version(&self) -> Option<f64> {
        self.label.software_version
    }

    /// Data records.
    #[must_use]
    pub const fn records(&self) -> usize {
        self.records
    }

    /// Time tag of its first valid record, ET seconds.
    #[must_use]
    pub const fn first_s(&self) -> f64 {
        self.first_s
    }

    /// BLAKE3 of its bytes, hexadecimal, as its index or stand-in states; `None` without one.
    #[must_use]
    pub fn blake3(&self) -> Option<String> {
        self.indexed.as_ref().map(|indexed| indexed.blake3())
    }

    /// First and last time tag of its records, ET seconds; without the extents of an index, it may contain any time.
    pub(super) fn tags_s(&self) -> [f64; 2] {
        let indexed = self.indexed.as_ref();
        let tags_s = indexed.and_then(|indexed| indexed.tags_s(self.records));
        tags_s.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    }

    /// Complaints about its label.
    #[must_use]
    pub fn label_complaints(&self) -> &[Complaint] {
        &self.head_complaints
    }

    /// Reopens the file for its records, if it is unchanged.
    pub(super) fn reopen(&self) -> Result<Reader> {
        let reader = Reader::open(&self.path)?;
        reader.require_identity(&self.identity)?;
        let indexed = self.indexed.as_ref();
        let is_indexed = indexed.is_some_and(|indexed| indexed.has_blocks(self.records));
        if is_indexed || self.in_order.get().is_some() {
            reader.set_in_order();
        }
        Ok(reader)
    }

    /// Marks the file as in order of time for later readers.
    pub(super) fn set_in_order(&self) {
        let _known_before = self.in_order.set(());
    }

    /// Requests read-ahead for the file, if it will be read as a whole.
    pub(super) fn announce(&self) {
        let indexed = self.indexed.as_ref();
        let is_read = !indexed.is_some_and(|indexed| indexed.has_blocks(self.records));
        // A file that cannot be opened is reported when its turn comes.
        if is_read && let Ok(reader) = self.reopen() {
            reader.announce();
        }
    }

    pub(super) fn guard(&self) -> FieldGuard {
        FieldGuard::new(self.label.software_version)
    }

    /// The rows that may contain requested shots, or must be checked in any case.
    ///
    /// # Errors
    /// A read error; a file that has changed; [`Stopped`](areograph_base::error::Stopped).
    pub(super) fn rows_to_read(
        &self,
        query: &Query<'_>,
        stop: &AtomicBool,
    ) -> Result<Vec<Range<usize>>> {
        let indexed = self.indexed.as_ref();
        let indexed = indexed.and_then(|indexed| indexed.rows(query, self.datum, self.records));
        match (indexed, query.judged) {
            (Some(rows), _) => Ok(rows),
            (None, Judged::Near) => self.look(query, stop),
            (None, Judged::All) => Ok(iter::once(0..self.records).collect()),
        }
    }

    /// Whether an index holds all requested complaints.
    pub(super) fn complaints_known(&self, query: &Query<'_>) -> bool {
        let indexed = self.indexed.as_ref();
        query.judged == Judged::All
            && indexed.is_some_and(|indexed| indexed.has_blocks(self.records))
    }

    /// Reports faults of the head of the file.
    pub(super) fn tell_of_head(&self, found: &mut Found) {
        for complaint in &self.head_complaints {
            found.complain(complaint.clone());
        }
    }

    /// Reports faults that an index holds for these rows, merged in order with those found in them.
    pub(super) fn tell_known(&self, query: &Query<'_>, rows: Range<usize>, found: &mut Found) {
        let Some(indexed) = (self.indexed.as_ref()).filter(|_| self.complaints_known(query)) else {
            return;
        };
        for complaint in &indexed.complaints {
            let row = complaint
                .record
                .and_then(|record| record.checked_sub(self.first_record));
            if row.is_some_and(|row| rows.contains(&(row as usize))) {
                found.complain(complaint.clone());
            }
        }
        found.complaints.sort_by_key(|complaint| complaint.record);
    }

    /// Reports faults of the end of the file.
    pub(super) fn tell_of_end(&self, found: &mut Found) {
        if let Some(complaint) = &self.trailing_complaint {
            found.complain(complaint.clone());
        }
    }
}
