//! States of planned files, and the outcomes of their transfer.

use crate::{plan::PlannedFile, state::Record};
use areograph_base::error::Result;

/// State of a planned file.
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

/// Way in which a file became complete.
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

/// Outcome of a planned file.
#[derive(Debug)]
pub struct Outcome {
    /// The file.
    pub file: PlannedFile,
    /// Its record, or why it is not complete.
    pub result: Result<(Done, Record)>,
}
