//! Faults of a file that do not prevent it from being read.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Reason;

/// A fault in a file; the rest of the file is kept.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Complaint {
    /// Name of the file, without folders.
    pub file: String,
    /// Record, counted from 1 with the label records, or line of a table; `None` when it concerns the file in general.
    pub record: Option<u32>,
    /// Reason code, for counts.
    pub reason: Reason,
    /// The value found and the value expected.
    pub text: String,
}

impl Complaint {
    /// Whether it depends on more records than the adjacent ones, so that a stretch of the file cannot determine it.
    #[must_use]
    pub const fn is_of_many_records(&self) -> bool {
        matches!(self.reason, Reason::TimeOrder | Reason::Repeated)
    }

    /// Whether shots of a record are left out that no other record contains.
    #[must_use]
    pub fn leaves_out(&self) -> bool {
        self.record.is_some() && !self.is_of_many_records()
    }
}

impl fmt::Display for Complaint {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.file)?;
        if let Some(record) = self.record {
            let line = self.reason == Reason::Row;
            let counted = if line { "line" } else { "record" };
            write!(formatter, " {counted} {record}")?;
        }
        write!(formatter, ": {}", self.text)
    }
}
