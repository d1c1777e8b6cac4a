//! A PEDR file: its label, its records, and what is wrong with it.

use std::{
    fs,
    io::Read as _,
    ops::Range,
    path::{Path, PathBuf},
};

use super::{
    Complaint, FieldGuard, FileName, Frame, LABEL_BYTES, LABEL_RECORDS, PedrLabel, RECORD_BYTES,
    Reason, Record, RecordError, check::out_of_order,
};
use crate::{
    error::{Cause, Error, IoError, Kind, Locate, Result},
    files::file_name,
};

/// A PEDR file in memory: all of it, or its head and some of its records.
#[derive(Debug)]
pub struct File {
    path: PathBuf,
    /// The label's bytes and then those of records.
    bytes: Vec<u8>,
    /// Bytes that the whole file has.
    length: u64,
    name: Option<FileName>,
    label: PedrLabel,
    label_complaints: Vec<Complaint>,
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
}

impl Cause for NoGoodRecord {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "fetch the file again if it is a PEDR file (AP#####v.B), else leave it out".to_owned()
    }
}

/// Opens a file that can hold records.
pub(super) fn open_regular(path: &Path) -> Result<fs::File> {
    // Asked before opening: opening a pipe would wait for its writer.
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
    /// Reads a file; [`Reader`](super::Reader) reads one piece by piece.
    ///
    /// # Errors
    /// The system's refusal; not a regular file. What is wrong inside is complained of, not refused.
    pub fn open(path: &Path) -> Result<Self> {
        let mut bytes = Vec::new();
        let mut file = open_regular(path)?;
        file.read_to_end(&mut bytes)
            .map_err(IoError::on("read"))
            .in_file(path)?;
        Ok(Self::from_bytes(bytes, path))
    }

    /// A file that is already in memory; `name` stands for its path.
    #[must_use]
    pub fn from_bytes(bytes: Vec<u8>, name: &Path) -> Self {
        let length = bytes.len() as u64;
        Self::of_length(bytes, length, name.to_owned())
    }

    /// A file of `length` bytes of which these are the first: at least those of the label, or all.
    pub(super) fn of_length(bytes: Vec<u8>, length: u64, path: PathBuf) -> Self {
        let mut file = Self {
            name: FileName::parse(&path),
            path,
            bytes,
            length,
            label: PedrLabel::default(),
            label_complaints: Vec::new(),
        };
        file.read_label();
        file
    }

    /// The same file with other records in memory: `bytes` holds them after as many bytes as the label has.
    pub(super) fn with_records(&self, bytes: Vec<u8>) -> Self {
        Self {
            path: self.path.clone(),
            bytes,
            length: self.length,
            name: self.name,
            label: self.label.clone(),
            label_complaints: Vec::new(),
        }
    }

    /// The bytes of the label, as many as the file has of them.
    #[must_use]
    pub fn label_bytes(&self) -> &[u8] {
        &self.bytes[..self.bytes.len().min(LABEL_BYTES)]
    }

    /// The memory of the file.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    fn read_label(&mut self) {
        let length = self.length;
        if length < LABEL_BYTES as u64 {
            let text = format!(
                "the file has {length} bytes; expected at least the {LABEL_BYTES} of the label"
            );
            self.complain_of_label(Reason::TruncatedLabel, text);
        }
        match PedrLabel::parse(&self.bytes) {
            Ok(label) => self.label = label,
            Err(error) => self.complain_of_label(Reason::UnreadableLabel, error.to_string()),
        }
        let records = (LABEL_RECORDS + self.record_count()) as u64;
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

    /// Where the file lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Data records of the whole file, as many as its size has room for, whatever the label says.
    #[must_use]
    pub fn record_count(&self) -> usize {
        let data = self.length.saturating_sub(LABEL_BYTES as u64);
        usize::try_from(data / RECORD_BYTES as u64).unwrap_or(usize::MAX)
    }

    /// The complaint of bytes after the last whole record, if there are any.
    #[must_use]
    pub fn trailing_complaint(&self) -> Option<Complaint> {
        let data = self.length.checked_sub(LABEL_BYTES as u64)?;
        let trailing = data % RECORD_BYTES as u64;
        (trailing > 0).then(|| {
            let text =
                format!("{trailing} bytes after the last whole record of {RECORD_BYTES}; ignored");
            self.complaint(
                Some(Self::record_number(self.record_count())),
                Reason::TrailingBytes,
                text,
            )
        })
    }

    /// The complaint of the record in row `row`, counted from 0.
    #[must_use]
    pub fn record_complaint(&self, row: usize, error: &RecordError) -> Complaint {
        self.complaint(
            Some(Self::record_number(row)),
            error.reason(),
            error.to_string(),
        )
    }

    /// The data records in memory, as many as there is room for, whatever the label says.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        Record::slice_of(self.bytes.get(LABEL_BYTES..).unwrap_or_default())
    }

    /// Makes sure that the file holds at least one good record; a file of another kind holds none.
    ///
    /// # Errors
    /// What is wrong with the label, else with the first record.
    pub fn require_records(&self) -> Result<()> {
        let guard = FieldGuard::new(self.label.software_version);
        let mut frames = self.frames(0..self.records().len(), guard);
        let first = frames.next();
        if matches!(first, Some((_, Ok(_)))) || frames.any(|(_, frame)| frame.is_ok()) {
            return Ok(());
        }
        let first = first.and_then(|(row, frame)| Some((row, frame.err()?)));
        Err(self.no_good_record(first))
    }

    /// The failure of a file without a good record, of which this is the first.
    pub(super) fn no_good_record(&self, first: Option<(usize, RecordError)>) -> Error {
        let label = self.label_complaints.first();
        let why = match (label, first) {
            (Some(complaint), _) => complaint.text.clone(),
            (None, Some((row, error))) => {
                format!("record {}: {error}", Self::record_number(row))
            }
            (None, None) => format!("nothing of {RECORD_BYTES} bytes follows the label"),
        };
        Error::from(NoGoodRecord { why }).in_file(&self.path)
    }

    /// BLAKE3 of the file's bytes, hexadecimal.
    #[must_use]
    pub fn blake3(&self) -> String {
        blake3::hash(&self.bytes).to_hex().to_string()
    }

    /// The frames of some rows, counted from 0, each with its row and decoded with its neighbours in
    /// the file, or with the impossible value that spoils it. Rows that are not there are left out.
    pub fn frames(
        &self,
        rows: Range<usize>,
        guard: FieldGuard,
    ) -> impl Iterator<Item = (usize, std::result::Result<Frame<'_>, RecordError>)> {
        let end = rows.end.min(self.records().len());
        (rows.start..end)
            .zip(self.records().get(rows.start..end).unwrap_or_default())
            .map(move |(row, record)| (row, self.frame(row, record, guard)))
    }

    fn frame<'a>(
        &self,
        row: usize,
        record: &'a Record,
        guard: FieldGuard,
    ) -> std::result::Result<Frame<'a>, RecordError> {
        record.check(self.is_mapping())?;
        let time_s = |row: Option<usize>| Some(self.sound_record(row?)?.time_s.get());
        let neighbours_s = [
            time_s(row.checked_sub(2)),
            time_s(row.checked_sub(1)),
            time_s(Some(row)),
            time_s(row.checked_add(1)),
        ];
        if out_of_order(neighbours_s) {
            return Err(RecordError::Order(record.time_s.get()));
        }
        Ok(Frame::new(
            record,
            guard,
            self.crossover_before_m(row, guard),
        ))
    }

    /// Crossover residual of the frame before row `row`, metres.
    ///
    /// Before the first frame stands its next one mirrored, `x₁ − (x₂ − x₁)`, as in `pedr2tab`.
    fn crossover_before_m(&self, row: usize, guard: FieldGuard) -> Option<f64> {
        let residual_m = |row| guard.crossover_m(self.sound_record(row)?);
        if row == 0 {
            let first_m = residual_m(0)?;
            return residual_m(1).map(|next_m| first_m - (next_m - first_m));
        }
        residual_m(row - 1)
    }

    /// The record in row `row`, when there is one without an impossible value.
    fn sound_record(&self, row: usize) -> Option<&Record> {
        let record = self.records().get(row)?;
        record.check(self.is_mapping()).ok().map(|()| record)
    }

    /// Number of the record in row `row` of the data, counted from 1 with the label records.
    #[must_use]
    pub fn record_number(row: usize) -> u32 {
        u32::try_from(row + LABEL_RECORDS + 1).unwrap_or(u32::MAX)
    }

    fn is_mapping(&self) -> bool {
        self.name.is_some_and(FileName::is_mapping)
    }
}
