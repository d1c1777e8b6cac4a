//! A partial download, and the known properties of its file.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Seek as _, SeekFrom, Write as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use areograph_base::error::{IoError, Locate as _, Result};
use areograph_store::atomic;

/// The server's statements on the file at its first byte.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Meta {
    pub(crate) url: String,
    /// Strong validator.
    pub(crate) etag: Option<String>,
    pub(crate) last_modified: Option<String>,
    /// Length of the complete file.
    pub(crate) length: Option<u64>,
    /// MD5 by the server, hexadecimal.
    pub(crate) md5: Option<String>,
    /// SHA-256 of the complete file, once it was verified and is about to receive its name.
    pub(crate) sha256: Option<String>,
}

impl Meta {
    /// Validator that a server must still have for the rest to belong to the part.
    pub(crate) fn validator(&self) -> Option<&str> {
        self.etag.as_deref().or(self.last_modified.as_deref())
    }
}

/// A part with its description beside it.
#[derive(Debug)]
pub(crate) struct Part {
    path: PathBuf,
    meta_path: PathBuf,
    pub(crate) meta: Meta,
}

impl Part {
    /// The part that an earlier attempt left; empty if it was from a different address.
    pub(crate) fn at(path: PathBuf, url: &str) -> Self {
        let meta_path = path.with_extension("meta");
        let meta = fs::read(&meta_path)
            .ok()
            .and_then(|text| serde_json::from_slice(&text).ok());
        let meta: Meta = meta.unwrap_or_default();
        let known = meta.url == url;
        Self {
            path,
            meta_path,
            meta: if known { meta } else { Meta::default() },
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes that have arrived and may be continued.
    pub(crate) fn bytes(&self) -> u64 {
        if self.meta.url.is_empty() {
            return 0;
        }
        self.path.metadata().map_or(0, |found| found.len())
    }

    /// Begins anew, with the server's current statements.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(crate) fn restart(&mut self, meta: Meta) -> Result<()> {
        // In this order a killed process never leaves bytes of one file beside the description of another.
        self.discard()?;
        self.meta = meta;
        self.write_meta()?;
        File::create(&self.path)
            .map(drop)
            .map_err(IoError::on("create"))
            .in_file(&self.path)
    }

    /// Notes the hash of the complete file.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(crate) fn note_verified(&mut self, sha256: &str) -> Result<()> {
        self.meta.sha256 = Some(sha256.to_owned());
        self.write_meta()
    }

    fn write_meta(&self) -> Result<()> {
        // A description of texts and numbers always becomes JSON.
        let text = serde_json::to_vec(&self.meta).unwrap_or_default();
        atomic::write(&self.meta_path, &text)
    }

    /// A writer behind the bytes that have arrived.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub(crate) fn continued(&self) -> Result<PartWriter> {
        let open = || -> io::Result<PartWriter> {
            let mut file = OpenOptions::new()
                .write(true)
                .create(true)
                .truncate(false)
                .open(&self.path)?;
            let bytes = file.seek(SeekFrom::End(0))?;
            Ok(PartWriter { file, bytes })
        };
        open().map_err(IoError::on("write")).in_file(&self.path)
    }

    /// Removes it.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(crate) fn discard(&mut self) -> Result<()> {
        self.meta = Meta::default();
        for path in [&self.path, &self.meta_path] {
            match fs::remove_file(path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(IoError::on("remove")(error)).in_file(path);
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Writes behind the bytes that have arrived.
#[derive(Debug)]
pub(crate) struct PartWriter {
    file: File,
    pub(crate) bytes: u64,
}

impl PartWriter {
    pub(crate) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}
