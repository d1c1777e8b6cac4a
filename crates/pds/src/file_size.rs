//! Sizes of input files: a larger file is not one of its kind, and is refused before it is read or hashed.

use std::path::Path;

use areograph_base::error::{Cause, Locate as _, Result};

/// Kinds of input files with a largest size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SizedFile {
    /// A label of an image, with or without its pixels.
    Label,
    /// Support data of an image.
    SupportData,
    /// A PEDR file.
    Pedr,
    /// Tie points.
    Ties,
}

impl SizedFile {
    /// Largest size, bytes: an image of HRSC with its label takes up to 2 GB, the PEDR file of a day 100 MB, and a million
    /// tie points 100 MB.
    const fn bytes_max(self) -> u64 {
        match self {
            Self::Label => 1 << 32,
            Self::SupportData | Self::Pedr | Self::Ties => 1 << 30,
        }
    }

    const fn words(self) -> &'static str {
        match self {
            Self::Label => "a label, or an image with its label",
            Self::SupportData => "support data",
            Self::Pedr => "a PEDR file",
            Self::Ties => "tie points",
        }
    }

    /// Ensures that the file is not larger than files of its kind.
    ///
    /// # Errors
    /// A larger file, of kind input. A missing file is left to its reader.
    pub fn require(self, path: &Path) -> Result<()> {
        let Ok(metadata) = path.metadata() else {
            return Ok(());
        };
        let (bytes, bytes_max) = (metadata.len(), self.bytes_max());
        if bytes <= bytes_max {
            return Ok(());
        }
        Err(TooLarge {
            bytes,
            bytes_max,
            kind: self.words(),
        })
        .in_file(path)
    }
}

/// A file that is larger than any of its kind.
#[derive(Debug, thiserror::Error, Cause)]
#[error("has {bytes} bytes; expected at most {bytes_max} for {kind}")]
#[cause(Input: "name the correct file, or fetch the file again: it is damaged or of a different kind")]
struct TooLarge {
    bytes: u64,
    bytes_max: u64,
    kind: &'static str,
}
