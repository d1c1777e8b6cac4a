//! Files as several floors need them: their hash, and their name without folders.

use std::{fs::File, path::Path};

use crate::error::{IoFault, Place, Result};

/// BLAKE3 of a file, hexadecimal, and its size in bytes.
///
/// # Errors
/// The file cannot be read.
pub fn hash_file(path: &Path) -> Result<(String, u64)> {
    let mut hasher = blake3::Hasher::new();
    let file = File::open(path)
        .map_err(IoFault::on("open"))
        .in_file(path)?;
    let bytes = std::io::copy(&mut &file, &mut hasher)
        .map_err(IoFault::on("read"))
        .in_file(path)?;
    Ok((hasher.finalize().to_hex().to_string(), bytes))
}

/// The name of a file without its folders, as products quote it: they do not depend on where files lie.
#[must_use]
pub fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The first digits of a hash: enough for people to tell files apart.
#[must_use]
pub fn short_hash(blake3: &str) -> String {
    blake3.chars().take(12).collect()
}
