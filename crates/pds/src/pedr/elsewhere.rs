//! What a stand-in states of a PEDR file on a server, so that the file is opened without asking the server.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Complaint, PedrLabel, RULES};
use areograph_base::error::{Cause, Locate as _, Result};
use areograph_store::files::stand_in::StandIn;

/// A stand-in of a file that was checked by other rules.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the file on the server was indexed by a different version of areograph")]
#[cause(Input: "run `areograph pedr index URL --verify` again with the same folder")]
struct OtherRules;

/// The head of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Head {
    pub(super) label: PedrLabel,
    pub(super) label_records: usize,
    pub(super) label_complaints: Vec<Complaint>,
    /// Time tag of the first valid record, ET seconds.
    pub(super) first_s: f64,
}

/// The note of a stand-in.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Note {
    /// Version of the rules by which records were checked.
    rules: u32,
    pub(super) head: Head,
    /// The file's entry in an index, as the archive encodes it.
    pub(super) entry: Vec<u8>,
}

impl Note {
    /// The note of the stand-in at `path`.
    ///
    /// # Errors
    /// Other rules, or a note of another version.
    pub(super) fn of(stand_in: &StandIn, path: &Path) -> Result<Self> {
        let note: Option<Self> = postcard::from_bytes(stand_in.note()).ok();
        let note = note.filter(|note| note.rules == RULES);
        note.ok_or(OtherRules).in_file(path)
    }

    /// The note of a stand-in; `None` if it cannot be encoded.
    pub(super) fn encoded(head: Head, entry: Vec<u8>) -> Option<Vec<u8>> {
        let rules = RULES;
        postcard::to_stdvec(&Self { rules, head, entry }).ok()
    }
}
