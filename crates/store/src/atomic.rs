//! Files appear under their final names complete or not at all.
//!
//! Files are written under a temporary name, read back, flushed and renamed. The next command that writes into a folder
//! removes the remains of a killed one.

use std::{
    fs::File,
    io::{self, Read, Write as _},
    path::Path,
};

use crate::files::{Mark, StagedFile};
use areograph_base::error::{IoError, Locate, Result};

/// Writes `bytes` beside `path` under a temporary name, flushes them to the disk and renames.
///
/// # Errors
/// The folder cannot be created or written, or the disk is full; `path` is then unchanged.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_parts(path, &[bytes])
}

/// Writes bytes in several consecutive parts.
///
/// # Errors
/// As [`write()`].
pub fn write_parts(path: &Path, parts: &[&[u8]]) -> Result<()> {
    finish(StagedFile::create(path)?, parts)
}

/// Writes `head`, and behind it all that `payload` contains.
///
/// # Errors
/// As [`write()`]; `payload` cannot be read.
pub fn write_from(path: &Path, head: &[u8], payload: &mut impl Read) -> Result<()> {
    write_with(StagedFile::create(path)?, |writer| {
        writer.write_all(head)?;
        io::copy(payload, writer).map(drop)
    })
}

/// Writes at a path of the user, where an existing file is replaced only if it has this mark.
///
/// # Errors
/// As [`write()`]; an existing file that areograph did not write.
pub fn replace(path: &Path, bytes: &[u8], mark: Mark) -> Result<()> {
    finish(StagedFile::replacing(path, mark)?, &[bytes])
}

fn finish(staged: StagedFile, parts: &[&[u8]]) -> Result<()> {
    write_with(staged, |writer| {
        parts.iter().try_for_each(|part| writer.write_all(part))
    })
}

fn write_with(staged: StagedFile, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
    let path = staged.path().to_owned();
    let written = write(&mut staged.writer()?);
    written.map_err(IoError::on("write")).in_file(&path)?;
    staged.finish()?;
    sync_folder(path.parent().unwrap_or(Path::new(".")));
    Ok(())
}

/// Flushes a file that is about to be renamed.
///
/// # Errors
/// The file cannot be opened or flushed.
pub fn sync_file(path: &Path) -> Result<()> {
    File::open(path)
        .and_then(|file| file.sync_all())
        .map_err(IoError::on("flush"))
        .in_file(path)
}

/// Makes renames in `folder` durable, if the system supports it.
pub fn sync_folder(folder: &Path) {
    // Some file systems refuse to flush folders; the data are safe nevertheless.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}
