//! The state of a filled folder, `fetch.json`: what every file is and where it came from.

use std::{collections::BTreeMap, fs, io::ErrorKind, path::Path};

use serde::{Deserialize, Serialize};

use crate::{error::FetchError, hashed::Hashed};
use areograph_base::error::{IoError, Locate as _, Result};
use areograph_store::atomic;

/// Form of the file.
const FORMAT: u32 = 1;

/// Known properties of a fetched file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Its source; for a table of shots, the query.
    pub url: String,
    /// Address of the table that a service made for the query.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_url: Option<String>,
    /// Size.
    pub bytes: u64,
    /// MD5, hexadecimal.
    pub md5: String,
    /// SHA-256, hexadecimal.
    pub sha256: String,
    /// Basis of its verification.
    pub verified_by: Verified,
    /// UTC when it was complete.
    pub complete_utc: String,
    /// Reason why it was fetched.
    pub why: String,
}

/// Basis on which a file was verified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verified {
    /// Checksum of the archive.
    Md5,
    /// Size by the server; the archive states no checksum.
    Size,
    /// Rows of a table of shots, and their number where the service states it.
    Rows,
}

impl Record {
    pub(crate) fn of(url: &str, hashed: Hashed, verified_by: Verified, why: &str) -> Self {
        Self {
            url: url.to_owned(),
            made_url: None,
            bytes: hashed.bytes,
            md5: hashed.md5,
            sha256: hashed.sha256,
            verified_by,
            complete_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
            why: why.to_owned(),
        }
    }

    /// Whether a file is the recorded one.
    pub(crate) fn is(&self, hashed: &Hashed) -> bool {
        self.bytes == hashed.bytes && self.sha256 == hashed.sha256
    }
}

/// The files of a folder, by their paths seen from it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    format: u32,
    /// Records by path.
    pub files: BTreeMap<String, Record>,
}

impl State {
    /// Reads the state; without a file it is empty.
    ///
    /// # Errors
    /// The file cannot be read, or is malformed.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = match fs::read(path) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => return Err(IoError::on("read")(error)).in_file(path),
        };
        let malformed = |problem: String| FetchError::State(problem);
        let state: Self = serde_json::from_slice(&text)
            .map_err(|error| malformed(error.to_string()))
            .in_file(path)?;
        if state.format != FORMAT {
            let problem = format!("format is {}; expected {FORMAT}", state.format);
            return Err(malformed(problem)).in_file(path);
        }
        Ok(state)
    }

    /// Writes the state, completely or not at all.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        let state = Self {
            format: FORMAT,
            files: self.files.clone(),
        };
        let text = serde_json::to_string_pretty(&state)
            .map_err(|error| FetchError::State(error.to_string()))
            .in_file(path)?;
        atomic::write(path, text.as_bytes())
    }
}
