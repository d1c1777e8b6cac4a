//! A PEDR file: its label, its records, and what is wrong with it.

use std::{
    collections::BTreeMap,
    fs,
    ops::Deref,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use memmap2::Mmap;

use super::{
    Complaint, FieldGuard, FileName, LABEL_BYTES, LABEL_RECORDS, PedrLabel, RECORD_BYTES, Reason,
    Record, RecordError,
    chronology::Misplaced,
    foreign::{Foreign, label_records},
};
use crate::{
    error::{Cause, IoError, Kind, Locate, Result},
    files::file_name,
};

/// A PEDR file, open for reading.
#[derive(Debug)]
pub struct File {
    path: PathBuf,
    bytes: Bytes,
    name: Option<FileName>,
    label: PedrLabel,
    /// Records that the label takes.
    label_records: usize,
    label_complaints: Vec<Complaint>,
    misplaced: OnceLock<BTreeMap<usize, Misplaced>>,
}

#[derive(Debug)]
enum Bytes {
    Mapped(Mmap),
    Owned(Vec<u8>),
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Owned(bytes) => bytes,
        }
    }
}

/// The path names something that cannot hold records.
#[derive(Debug, thiserror::Error)]
#[error("not a regular file")]
struct NotAFile;

impl Cause for NotAFile {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "name PEDR files (AP#####v.B) in pedr.files, not folders or devices".to_owned()
    }
}

/// A file without a single good record.
#[derive(Debug, thiserror::Error)]
#[error("no good record: {why}")]
struct NoGoodRecord {
    why: String,
    foreign: Option<Foreign>,
}

impl Cause for NoGoodRecord {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        self.foreign
            .map_or(
                "fetch the file again if it is a PEDR file (AP#####v.B), else leave it out",
                Foreign::advice,
            )
            .to_owned()
    }
}

impl File {
    /// Opens a file by mapping it into memory, whatever its size.
    ///
    /// # Errors
    /// The system's refusal; not a regular file. What is wrong inside is complained of, not refused.
    pub fn open(path: &Path) -> Result<Self> {
        // Asked before opening: opening a pipe would wait for its writer.
        let metadata = fs::metadata(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        if !metadata.is_file() {
            return Err(NotAFile).in_file(path);
        }
        let file = fs::File::open(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        #[allow(
            unsafe_code,
            reason = "an archive is searched where it lies, without a copy"
        )]
        // SAFETY: the map is read only and private to this value, every bit pattern is a valid record,
        // and archive files are not written while they are read. Whoever truncates one nevertheless
        // ends the process with SIGBUS, the usual price of a mapping; it cannot corrupt the file.
        let map = unsafe { Mmap::map(&file) };
        let map = map.map_err(IoError::on("map")).in_file(path)?;
        Ok(Self::new(Bytes::Mapped(map), path.to_owned()))
    }

    /// A file that is already in memory; `name` stands for its path.
    #[must_use]
    pub fn from_bytes(bytes: Vec<u8>, name: &Path) -> Self {
        Self::new(Bytes::Owned(bytes), name.to_owned())
    }

    fn new(bytes: Bytes, path: PathBuf) -> Self {
        let mut file = Self {
            name: FileName::parse(&path),
            path,
            bytes,
            label: PedrLabel::default(),
            label_records: LABEL_RECORDS,
            label_complaints: Vec::new(),
            misplaced: OnceLock::new(),
        };
        file.read_label();
        file
    }

    fn read_label(&mut self) {
        let length = self.bytes.len();
        if length < LABEL_BYTES {
            let text = format!(
                "the file has {length} bytes; expected at least the {LABEL_BYTES} of the label"
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
                "records begin after {} of the label; expected after {LABEL_RECORDS}",
                self.label_records
            );
            self.complain_of_label(Reason::LabelKeyword, text);
        }
        for text in self.label.departures() {
            self.complain_of_label(Reason::LabelKeyword, text);
        }
        let records = self.label_records as u64 + self.records().len() as u64;
        if let Some(stated) = self.label.file_records.filter(|stated| *stated != records) {
            let text = format!("the label states {stated} records; the file holds {records}");
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

    /// Complaints of the label: they come before those of records.
    #[must_use]
    pub fn label_complaints(&self) -> &[Complaint] {
        &self.label_complaints
    }

    /// The complaint of bytes after the last whole record, if there are any.
    #[must_use]
    pub fn trailing_complaint(&self) -> Option<Complaint> {
        let data = self.bytes.get(self.label_bytes()..)?;
        let trailing = data.len() % RECORD_BYTES;
        (trailing > 0).then(|| {
            let text =
                format!("{trailing} bytes after the last whole record of {RECORD_BYTES}; ignored");
            self.complaint(
                Some(self.record_number(self.records().len())),
                Reason::TrailingBytes,
                text,
            )
        })
    }

    /// The complaint of the record in row `row`, counted from 0.
    #[must_use]
    pub fn record_complaint(&self, row: usize, error: &RecordError) -> Complaint {
        self.complaint(
            Some(self.record_number(row)),
            error.reason(),
            error.to_string(),
        )
    }

    /// The data records, as many as the file's size has room for, whatever the label says.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        Record::slice_of(self.bytes.get(self.label_bytes()..).unwrap_or_default())
    }

    /// Makes sure that the file holds at least one good record; a file of another kind holds none.
    ///
    /// # Errors
    /// Of what kind the file is instead, what is wrong with the label, else with the first record.
    pub fn require_records(&self) -> Result<()> {
        /// Records that are judged at a time.
        const STEP: usize = 1_024;
        let (guard, rows) = (self.guard(), self.records().len());
        let mut first = None;
        for row in (0..rows).step_by(STEP) {
            for (row, frame) in self.frames(row..row + STEP, guard) {
                match frame {
                    Ok(_) => return Ok(()),
                    Err(error) => first = first.or(Some((row, error))),
                }
            }
        }
        let foreign = Foreign::of(&self.bytes, self.records().first());
        let label = self.label_complaints.first();
        let why = match (foreign, label, first) {
            (Some(foreign), _, _) => foreign.to_string(),
            (None, Some(complaint), _) => complaint.text.clone(),
            (None, None, Some((row, error))) => {
                format!("record {}: {error}", self.record_number(row))
            }
            (None, None, None) => format!("nothing of {RECORD_BYTES} bytes follows the label"),
        };
        Err(NoGoodRecord { why, foreign }).in_file(&self.path)
    }

    /// BLAKE3 of the file's bytes, hexadecimal.
    #[must_use]
    pub fn blake3(&self) -> String {
        blake3::hash(&self.bytes).to_hex().to_string()
    }

    /// Rows that do not fit into the chronology of the file.
    pub(super) fn misplaced(
        &self,
        find: impl FnOnce() -> BTreeMap<usize, Misplaced>,
    ) -> &BTreeMap<usize, Misplaced> {
        self.misplaced.get_or_init(find)
    }

    /// Number of the record in row `row` of the data, counted from 1 with the label records.
    #[must_use]
    pub fn record_number(&self, row: usize) -> u32 {
        u32::try_from(row + self.label_records + 1).unwrap_or(u32::MAX)
    }

    /// Bytes before the first data record.
    const fn label_bytes(&self) -> usize {
        self.label_records * RECORD_BYTES
    }

    fn guard(&self) -> FieldGuard {
        FieldGuard::new(self.label.software_version)
    }

    /// Whether the file's name is one of the mapping phase.
    pub(super) fn is_mapping(&self) -> bool {
        self.name.is_some_and(FileName::is_mapping)
    }
}
