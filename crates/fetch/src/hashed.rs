//! Size and hashes of a file: its identity.

use std::{
    fmt::Write as _,
    fs::File,
    io::{self, Read as _},
    path::Path,
};

use md5::{Digest as _, Md5};
use sha2::Sha256;

use areograph_base::error::{IoError, Locate as _, Result};

/// Identity of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Hashed {
    pub(crate) bytes: u64,
    /// Hexadecimal, lower case.
    pub(crate) md5: String,
    /// Hexadecimal, lower case.
    pub(crate) sha256: String,
}

impl Hashed {
    /// Reads the file.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn of(path: &Path) -> Result<Self> {
        read(path).map_err(IoError::on("read")).in_file(path)
    }
}

fn read(path: &Path) -> io::Result<Hashed> {
    let mut file = File::open(path)?;
    let (mut md5, mut sha256, mut bytes) = (Md5::new(), Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 17];
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            break;
        }
        md5.update(&buffer[..count]);
        sha256.update(&buffer[..count]);
        bytes += count as u64;
    }
    Ok(Hashed {
        bytes,
        md5: hexadecimal(&md5.finalize()),
        sha256: hexadecimal(&sha256.finalize()),
    })
}

/// SHA-256 of a text, hexadecimal.
pub(crate) fn sha256_of(text: &str) -> String {
    hexadecimal(&Sha256::digest(text.as_bytes()))
}

/// Bytes as hexadecimal digits.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
