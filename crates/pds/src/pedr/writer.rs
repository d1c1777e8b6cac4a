//! Writer of PEDR files: the label, then records.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use super::{LABEL_BYTES, LABEL_RECORDS, RECORD_BYTES, Record};
use areograph_base::{
    body::Datum,
    error::{Cause, IoError, Locate, Result},
};

/// Data set of every PEDR.
const DATA_SET_ID: &str = "MGS-M-MOLA-3-PEDR-L1A-V1.0";

/// Contents of the label of a written file.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelInfo {
    /// Product, for example `AP19215L.B`.
    pub product_id: String,
    /// Software version, 0 to 9.99; two decimals are written.
    pub software_version: f64,
    /// Datum of longitudes and latitudes.
    pub datum: Datum,
    /// Description of the file as synthetic, in one line of ASCII without quotes.
    pub note: String,
}

/// The label does not fit its format.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input: "shorten or correct the text for the label")]
pub(super) enum LabelError {
    /// A version that does not fit into four characters.
    #[error("software version is {0}; expected 0 to 9.99")]
    Version(f64),
    /// A text that a label cannot hold.
    #[error(
        "{keyword} is {text:?}; expected at most 600 printable ASCII characters without quotes"
    )]
    Text {
        /// Keyword of the label.
        keyword: &'static str,
        /// Its text.
        text: String,
    },
}

impl LabelInfo {
    /// The ten label records: ASCII, lines end in CR LF, padded with blanks.
    ///
    /// `pedr2tab` looks for `SOFTWARE_NAME =` in the first record and reads the version from the four
    /// characters that begin 25 after its `S`: one blank, a quote and eight characters stand between.
    ///
    /// # Errors
    /// A version or text that does not fit.
    fn to_bytes(&self) -> std::result::Result<Vec<u8>, LabelError> {
        if !(0.0..9.995).contains(&self.software_version) {
            return Err(LabelError::Version(self.software_version));
        }
        for (keyword, text) in [("PRODUCT_ID", &self.product_id), ("NOTE", &self.note)] {
            let printable = |byte: u8| (b' '..=b'~').contains(&byte) && byte != b'"';
            if text.len() > 600 || !text.bytes().all(printable) {
                let text = text.clone();
                return Err(LabelError::Text { keyword, text });
            }
        }
        let lines = [
            "CCSD3ZF0000100000001NJPL3IF0PDSX00000001".to_owned(),
            "PDS_VERSION_ID = PDS3".to_owned(),
            format!("SOFTWARE_NAME = \"AREOGR {:5.2}\"", self.software_version),
            "RECORD_TYPE = FIXED_LENGTH".to_owned(),
            format!("RECORD_BYTES = {RECORD_BYTES}"),
            "FILE_RECORDS = UNK".to_owned(),
            format!("LABEL_RECORDS = {LABEL_RECORDS}"),
            format!("DATA_SET_ID = \"{DATA_SET_ID}\""),
            format!("PRODUCT_ID = \"{}\"", self.product_id),
            "INSTRUMENT_ID = MOLA".to_owned(),
            "TARGET_NAME = MARS".to_owned(),
            format!(
                "COORDINATE_SYSTEM_NAME = \"{} PLANETOCENTRIC\"",
                self.datum.to_string().to_uppercase()
            ),
            format!("NOTE = \"{}\"", self.note),
            "END".to_owned(),
        ];
        let mut bytes = (lines.join("\r\n") + "\r\n").into_bytes();
        bytes.resize(LABEL_BYTES, b' ');
        Ok(bytes)
    }
}

/// Writes a PEDR file record by record.
#[derive(Debug)]
pub struct PedrWriter {
    path: PathBuf,
    file: BufWriter<File>,
    records: u32,
}

impl PedrWriter {
    /// Creates `path`, or empties it, and writes the label.
    ///
    /// # Errors
    /// A label that does not fit its format; the file cannot be created.
    pub fn create(path: &Path, label: &LabelInfo) -> Result<Self> {
        let bytes = label.to_bytes().in_file(path)?;
        let file = File::create(path)
            .map_err(IoError::on("create"))
            .in_file(path)?;
        let mut writer = Self {
            path: path.to_owned(),
            file: BufWriter::new(file),
            records: 0,
        };
        writer.write(&bytes)?;
        Ok(writer)
    }

    /// Appends one record.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_record(&mut self, record: &Record) -> Result<()> {
        self.write(&record.to_bytes())?;
        self.records += 1;
        Ok(())
    }

    /// Writes buffered data to the disk; returns the number of data records.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<u32> {
        self.file
            .flush()
            .and_then(|()| self.file.get_ref().sync_all())
            .map_err(IoError::on("write"))
            .in_file(&self.path)?;
        Ok(self.records)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file
            .write_all(bytes)
            .map_err(IoError::on("write"))
            .in_file(&self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label() -> LabelInfo {
        LabelInfo {
            product_id: "AP19215L.B".to_owned(),
            software_version: 7.25,
            datum: Datum::Iau2000,
            note: "synthetic".to_owned(),
        }
    }

    #[test]
    fn pedr2tab_finds_the_software_version() {
        let bytes = label().to_bytes().unwrap();
        assert_eq!(bytes.len(), 7_760);
        assert!(bytes.starts_with(b"CCSD3ZF0"));
        let first = std::str::from_utf8(&bytes[..RECORD_BYTES]).unwrap();
        let at = first.find("SOFTWARE_NAME =").unwrap();
        assert_eq!(&first[at + 25..at + 29], "7.25");
    }

    #[test]
    fn labels_that_do_not_fit_are_refused() {
        let version = LabelInfo {
            software_version: 10.0,
            ..label()
        };
        assert_eq!(version.to_bytes(), Err(LabelError::Version(10.0)));
        for note in ["a \"quote\"", "two\nlines", "überall", &"x".repeat(601)] {
            let note = note.to_owned();
            assert!(LabelInfo { note, ..label() }.to_bytes().is_err());
        }
    }
}
