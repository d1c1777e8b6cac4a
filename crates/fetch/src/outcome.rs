//! Where planned files are, and what became of them.

use crate::{plan::PlannedFile, state::Record};
use areograph_base::error::Result;

/// Where a planned file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// In the folder, with the recorded size.
    Present,
    /// In the folder, of unknown origin.
    Unknown,
    /// In the folder, with another size or another checksum than recorded or stated.
    Other,
    /// So many bytes have arrived.
    Begun(u64),
    /// Not in the folder.
    Missing,
}

/// How a file came to be complete.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// It was in the folder, as recorded.
    Present,
    /// It was in the folder; it is the file of the archive, and is recorded now.
    Adopted,
    /// It was transferred; so many of its bytes had arrived earlier.
    Fetched {
        /// Bytes that were not transferred again.
        resumed: u64,
    },
    /// It is a table without rows: the service has no shot in its box, and shots in others of the same window.
    Empty,
}

/// What became of a planned file.
#[derive(Debug)]
pub struct Outcome {
    /// The file.
    pub file: PlannedFile,
    /// Its record, or why it is not complete.
    pub result: Result<(Done, Record)>,
}
