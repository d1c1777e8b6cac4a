//! A writer that hashes what it passes on.

use std::io::{self, Write};

/// Bytes that are hashed at once: numbers are encoded one by one.
pub(crate) const HASHED_AT_ONCE: usize = 1 << 17;

/// A writer that hashes its data, and keeps the reason of an error, which postcard discards.
pub(crate) struct Hashed<W> {
    pub(crate) to: W,
    hash: blake3::Hasher,
    pub(crate) bytes: u64,
    pub(crate) refusal: Option<io::Error>,
}

impl<W: Write> Hashed<W> {
    pub(crate) fn new(to: W) -> Self {
        Self {
            to,
            hash: blake3::Hasher::new(),
            bytes: 0,
            refusal: None,
        }
    }

    /// BLAKE3 of what was written.
    pub(crate) fn hash(&self) -> blake3::Hash {
        self.hash.finalize()
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.to.write(bytes) {
            Ok(count) => {
                self.hash.update(&bytes[..count]);
                self.bytes += count as u64;
                Ok(count)
            }
            // Is tried again.
            Err(refusal) if refusal.kind() == io::ErrorKind::Interrupted => Err(refusal),
            Err(refusal) => {
                let kind = refusal.kind();
                self.refusal = Some(refusal);
                Err(kind.into())
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}
