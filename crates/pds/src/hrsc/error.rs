//! Errors that prevent the rows of an image from being read.

use areograph_base::error::Cause;

/// A file whose rows cannot be read, or do not match its label.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(crate) enum HrscError {
    #[error("the file holds a label only; expected the rows of the image after it")]
    #[cause("give the file of the archive (.IMG), with its rows")]
    NoRows,
    #[error("the label has no {key}; expected {expected}")]
    #[cause("give a level-2 file of the archive (h…2.IMG) as it was delivered")]
    Lacking {
        key: &'static str,
        expected: &'static str,
    },
    #[error("{key} is {value:?}; expected {expected}")]
    #[cause(like = Lacking)]
    Raster {
        key: &'static str,
        value: String,
        expected: String,
    },
    #[error(
        "the file has {found} bytes; expected {expected}, as FILE_RECORDS and RECORD_BYTES of its label state"
    )]
    #[cause("fetch the file again: it is truncated, extended, or differs from the archive")]
    Size { found: u64, expected: u64 },
    #[error(
        "{lines} rows of {row_bytes} bytes from byte {start} on end at byte {end}; expected the end of the file, {bytes}"
    )]
    #[cause(like = Size)]
    Rows {
        lines: u32,
        row_bytes: u64,
        start: u64,
        end: u64,
        bytes: u64,
    },
    #[error("{key} of the VICAR label is {vicar}; expected {expected}, as the PDS label states")]
    #[cause("fetch the file again: its labels belong to two images, or one of them was edited")]
    Vicar {
        key: &'static str,
        vicar: u64,
        expected: u64,
    },
    #[error("SAMPLE_TYPE is {stated:?}, but {because}; expected samples in the stated byte order")]
    #[cause(
        "fetch the file again: its samples were swapped after the label was written, or its label was edited"
    )]
    ByteOrder { stated: String, because: String },
    #[error(
        "{known} of {lines} rows have a time and an exposure in their prefixes; expected all of them, or nearly all"
    )]
    #[cause(
        "fetch the file again; or give the pieces of its line times as images.exposures, and its label without rows"
    )]
    NoTimes { known: usize, lines: usize },
    #[error(
        "rows {first} to {last} have no time in their prefixes, and adjacent rows do not determine it"
    )]
    #[cause(like = NoTimes)]
    TimeGap { first: usize, last: usize },
    #[error(
        "row {row} begins {early_s:.6} s before the exposure of the preceding row ends, and adjacent rows do not determine which \
         time is wrong"
    )]
    #[cause(like = NoTimes)]
    Overlap { row: usize, early_s: f64 },
}
