//! Errors that prevent the rows of an image from being read.

use areograph_base::error::Cause;

/// A file whose rows cannot be read, or do not match its label.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(crate) enum HrscError {
    #[error("the file contains only a label; expected image rows after the label")]
    #[cause("give the archive file (.IMG), which contains the rows")]
    NoRows,
    #[error("the label has no {key}; expected {expected}")]
    #[cause("give a level-2 archive file (h…2.IMG) as delivered")]
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
        "the file has {found} bytes; expected {expected}, according to FILE_RECORDS and RECORD_BYTES in its label"
    )]
    #[cause("fetch the file again: it is truncated or extended, or differs from the archive file")]
    Size { found: u64, expected: u64 },
    #[error(
        "{lines} rows of {row_bytes} bytes, beginning at byte {start}, end at byte {end}; expected the end of the file, \
         byte {bytes}"
    )]
    #[cause(like = Size)]
    Rows {
        lines: u32,
        row_bytes: u64,
        start: u64,
        end: u64,
        bytes: u64,
    },
    #[error("{key} in the VICAR label is {vicar}; expected {expected}, the value in the PDS label")]
    #[cause("fetch the file again: its labels belong to two images, or one label was edited")]
    Vicar {
        key: &'static str,
        vicar: u64,
        expected: u64,
    },
    #[error("SAMPLE_TYPE is {stated:?}, but {because}; expected samples in the stated byte order")]
    #[cause(
        "fetch the file again: the bytes of its samples were swapped after the label was written, or the label was edited"
    )]
    ByteOrder { stated: String, because: String },
    #[error(
        "{known} of {lines} rows have a time and an exposure in their prefixes; expected all or nearly all rows"
    )]
    #[cause(
        "fetch the file again, or give the pieces of the line times in images.exposures, and the label without rows"
    )]
    NoTimes { known: usize, lines: usize },
    #[error(
        "rows {first} to {last} have no times in their prefixes, and adjacent rows do not determine the times"
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
