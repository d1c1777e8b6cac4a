//! A PEDR file: its label, its records, and their faults.

use std::{
    collections::BTreeMap,
    fs,
    ops::Range,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use super::{
    Complaint, FieldGuard, FileName, LABEL_BYTES, LABEL_RECORDS, PedrLabel, RECORD_BYTES, Reason,
    Record, RecordError,
    chronology::{Misplaced, in_order, misplaced},
    elsewhere::Head,
    foreign::{Foreign, label_records},
};
use areograph_base::error::{Cause, Error, IoError, Locate, Result};
use areograph_store::files::file_name;

/// A PEDR file in memory: all of it, or its head and some of its records.
#[derive(Debug)]
pub struct File {
    path: PathBuf,
    /// The bytes of the label, followed by the bytes of records.
    bytes: Vec<u8>,
    /// Length of the complete file, bytes.
    length: u64,
    /// Row of the file that is the first one in memory.
    first_row: usize,
    name: Option<FileName>,
    label: PedrLabel,
    /// Records that the label takes.
    label_records: usize,
    label_complaints: Vec<Complaint>,
    /// Rows that do not fit into the chronology of the complete file.
    misplaced: OnceLock<Chronology>,
}

/// An invalid record, and its fault.
#[derive(Debug)]
pub(super) struct Bad {
    row: usize,
    record: Record,
    error: RecordError,
}

/// Records checked at a time.
const STEP: usize = 1_024;

/// Rows of a file that do not fit into its chronology.
pub(super) type Chronology = Arc<BTreeMap<usize, Misplaced>>;

/// A path that does not name a regular file.
#[derive(Debug, thiserror::Error, Cause)]
#[error("not a regular file")]
#[cause(Input: "name PEDR files (AP#####v.B) in pedr.files, not folders or devices")]
struct NotAFile;

/// A file without a valid record.
#[derive(Debug, thiserror::Error, Cause)]
#[error("no valid record: {why}")]
#[cause(Input: "{}", foreign.map_or(
    "fetch the file again if it is a PEDR file (AP#####v.B); otherwise omit it",
    Foreign::advice,
))]
struct NoGoodRecord {
    why: String,
    foreign: Option<Foreign>,
}

/// Opens a regular file.
pub(super) fn open_regular(path: &Path) -> Result<fs::File> {
    // Checked before opening: opening a pipe would wait for its writer.
    let metadata = fs::metadata(path)
        .map_err(IoError::on("open"))
        .in_file(path)?;
    if !metadata.is_file() {
        return Err(NotAFile).in_file(path);
    }
    fs::File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)
}

impl File {
    /// A file that is already in memory; `name` stands for its path.
    #[must_use]
    pub fn from_bytes(bytes: Vec<u8>, name: &Path) -> Self {
        let length = bytes.len() as u64;
        Self::of_length(bytes, length, name.to_owned())
    }

    /// A file of `length` bytes whose first bytes are given: at least the bytes of the label, or all.
    pub(super) fn of_length(bytes: Vec<u8>, length: u64, path: PathBuf) -> Self {
        let mut file = Self {
            name: FileName::parse(&path),
            path,
            bytes,
            length,
            first_row: 0,
            label: PedrLabel::default(),
            label_records: LABEL_RECORDS,
            label_complaints: Vec::new(),
            misplaced: OnceLock::new(),
        };
        file.read_label();
        file
    }

    /// A file of `length` bytes on a server, whose head is known.
    pub(super) fn of_head(head: Head, length: u64, path: PathBuf) -> Self {
        Self {
            name: FileName::parse(&path),
            path,
            bytes: Vec::new(),
            length,
            first_row: 0,
            label: head.label,
            label_records: head.label_records,
            label_complaints: head.label_complaints,
            misplaced: OnceLock::new(),
        }
    }

    /// The file with the records from row `first_row` on in memory: `bytes` contains them after as many bytes as
    /// the label has. The chronology is `misplaced`, or else follows from the records in memory.
    pub(super) fn with_records(
        &self,
        first_row: usize,
        bytes: Vec<u8>,
        misplaced: Option<Chronology>,
    ) -> Self {
        Self {
            path: self.path.clone(),
            bytes,
            length: self.length,
            first_row,
            name: self.name,
            label: self.label.clone(),
            label_records: self.label_records,
            label_complaints: Vec::new(),
            misplaced: misplaced.map_or_else(OnceLock::new, OnceLock::from),
        }
    }

    /// Its head, with the time of its first valid record.
    pub(super) fn as_head(&self, first_s: f64) -> Head {
        Head {
            label: self.label.clone(),
            label_records: self.label_records,
            label_complaints: self.label_complaints.clone(),
            first_s,
        }
    }

    /// The bytes of the label, as far as the file contains them.
    #[must_use]
    pub fn label_bytes(&self) -> &[u8] {
        &self.bytes[..self.bytes.len().min(self.label_length())]
    }

    /// The memory of the file.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    fn read_label(&mut self) {
        let length = self.length;
        if length < LABEL_BYTES as u64 {
            let text = format!(
                "the file has {length} bytes; expected at least the {LABEL_BYTES} bytes of the label"
            );
            self.complain_of_label(Reason::TruncatedLabel, text);
        }
        match PedrLabel::parse(&self.bytes) {
            Ok(label) => self.label = label,
            Err(error) => self.complain_of_label(Reason::UnreadableLabel, error.to_string()),
        }
        let stated = self.label.label_records;
        self.label_records = label_records(&self.bytes, stated, self.is_mapping(), self.guard());
        if self.label_records != LABEL_RECORDS {
            let text = format!(
                "records begin after {} label records; expected {LABEL_RECORDS} label records",
                self.label_records
            );
            self.complain_of_label(Reason::LabelKeyword, text);
        }
        for text in self.label.departures() {
            self.complain_of_label(Reason::LabelKeyword, text);
        }
        let records = (self.label_records + self.record_count()) as u64;
        if let Some(stated) = self.label.file_records.filter(|stated| *stated != records) {
            let text = format!("the label states {stated} records; the file contains {records}");
            self.complain_of_label(Reason::RecordCount, text);
        }
    }

    fn complain_of_label(&mut self, reason: Reason, text: String) {
        let complaint = self.complaint(None, reason, text);
        self.label_complaints.push(complaint);
    }

    fn complaint(&self, record: Option<u32>, reason: Reason, text: String) -> Complaint {
        Complaint {
            file: file_name(&self.path),
            record,
            reason,
            text,
        }
    }

    /// The parts of the file's name, when it has the archive's form.
    #[must_use]
    pub const fn name(&self) -> Option<FileName> {
        self.name
    }

    /// The attached label.
    #[must_use]
    pub const fn label(&self) -> &PedrLabel {
        &self.label
    }

    /// Complaints about the label, which precede those about records.
    #[must_use]
    pub fn label_complaints(&self) -> &[Complaint] {
        &self.label_complaints
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of data records of the complete file by its size, independent of the label.
    #[must_use]
    pub fn record_count(&self) -> usize {
        let data = self.length.saturating_sub(self.label_length() as u64);
        usize::try_from(data / RECORD_BYTES as u64).unwrap_or(usize::MAX)
    }

    /// The complaint about bytes after the last complete record, if any.
    #[must_use]
    pub fn trailing_complaint(&self) -> Option<Complaint> {
        let data = self.length.checked_sub(self.label_length() as u64)?;
        let trailing = data % RECORD_BYTES as u64;
        (trailing > 0).then(|| {
            let text = format!(
                "{trailing} bytes after the last whole record of {RECORD_BYTES} bytes are ignored"
            );
            self.complaint(
                Some(self.record_number(self.record_count())),
                Reason::TrailingBytes,
                text,
            )
        })
    }

    /// The complaint about the record in row `row`, counted from 0.
    #[must_use]
    pub fn record_complaint(&self, row: usize, error: &RecordError) -> Complaint {
        self.complaint(
            Some(self.record_number(row)),
            error.reason(),
            error.to_string(),
        )
    }

    /// The data records in memory.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        Record::slice_of(self.bytes.get(self.label_length()..).unwrap_or_default())
    }

    /// The rows of the file that are in memory.
    #[must_use]
    pub fn rows(&self) -> Range<usize> {
        self.first_row..self.first_row + self.records().len()
    }

    /// The record in a row that is in memory.
    pub(super) fn record(&self, row: usize) -> &Record {
        &self.records()[row - self.first_row]
    }

    /// Checks that at least one valid record is in memory; a file of a different kind contains none.
    ///
    /// # Errors
    /// The actual kind of the file, or the fault of the label, or else of the first record.
    pub fn require_records(&self) -> Result<()> {
        let mut first = None;
        for row in self.rows().step_by(STEP) {
            if self.good_record(row..row + STEP, &mut first).is_some() {
                return Ok(());
            }
        }
        Err(self.no_good_record(first))
    }

    /// The first valid record of these rows; without one, `first` is the first invalid one of all examined.
    pub(super) fn good_record(
        &self,
        rows: Range<usize>,
        first: &mut Option<Bad>,
    ) -> Option<&Record> {
        for (row, frame) in self.frames(rows, self.guard()) {
            let record = self.record(row);
            match frame {
                Ok(_) => return Some(record),
                Err(error) => {
                    first.get_or_insert_with(|| Bad {
                        row,
                        record: Record::from_bytes(&record.to_bytes()),
                        error,
                    });
                }
            }
        }
        None
    }

    /// The failure of a file without a valid record, with its first invalid record and the fault.
    pub(super) fn no_good_record(&self, first: Option<Bad>) -> Error {
        let record = first.as_ref().map(|bad| &bad.record);
        let foreign = Foreign::of(&self.bytes, record);
        let label = self.label_complaints.first();
        let why = match (foreign, label, first) {
            (Some(foreign), _, _) => foreign.to_string(),
            (None, Some(complaint), _) => complaint.text.clone(),
            (None, None, Some(bad)) => {
                format!("record {}: {}", self.record_number(bad.row), bad.error)
            }
            (None, None, None) => format!("no record of {RECORD_BYTES} bytes follows the label"),
        };
        Error::from(NoGoodRecord { why, foreign }).in_file(&self.path)
    }

    /// BLAKE3 of the file's bytes, hexadecimal.
    #[must_use]
    pub fn blake3(&self) -> String {
        blake3::hash(&self.bytes).to_hex().to_string()
    }

    /// Rows that do not fit into the chronology of the file.
    pub(super) fn misplaced(&self) -> &BTreeMap<usize, Misplaced> {
        self.misplaced.get_or_init(|| {
            // A faster test, which nearly every file passes.
            if in_order(self.records().iter().map(|record| record.time_s.get())) {
                return Chronology::default();
            }
            let times_s: Vec<Option<f64>> = self.sound_times().collect();
            Arc::new(misplaced(&times_s))
        })
    }

    /// Number of the record in row `row` of the data, counted from 1 with the label records.
    #[must_use]
    pub fn record_number(&self, row: usize) -> u32 {
        u32::try_from(row + self.label_records + 1).unwrap_or(u32::MAX)
    }

    /// Bytes before the first data record.
    pub(super) const fn label_length(&self) -> usize {
        self.label_records * RECORD_BYTES
    }

    /// Fields that the file's software wrote.
    pub(super) fn guard(&self) -> FieldGuard {
        FieldGuard::new(self.label.software_version)
    }

    /// Whether the file's name is one of the mapping phase.
    pub(super) fn is_mapping(&self) -> bool {
        self.name.is_some_and(FileName::is_mapping)
    }
}
