//! Files appear under their final names complete or not at all.
//!
//! Files are written under a temporary name, read back, flushed and renamed. Stored outputs and hashes are not flushed:
//! a run recognises an incomplete one by its hash, and makes it again. The next command that writes into a folder
//! removes the remains of a killed one.

use std::{fs::File, io::Write as _, path::Path};

use crate::files::{Mark, StagedFile};
use areograph_base::error::{IoError, Locate, Result};

/// Writes `bytes` beside `path` under a temporary name, flushes them to the disk and renames.
///
/// # Errors
/// The folder cannot be created or written, or the disk is full; `path` is then unchanged.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    flushed(StagedFile::create(path)?, bytes)
}

/// Writes bytes in several consecutive parts, and does not wait until they are on the disk: see
/// [`StagedFile::finish_unflushed`].
///
/// # Errors
/// As [`write()`].
pub fn write_unflushed(path: &Path, parts: &[&[u8]]) -> Result<()> {
    filled(StagedFile::create(path)?, parts)?.finish_unflushed()
}

/// Writes at a path of the user, where an existing file is replaced only if it has this mark.
///
/// # Errors
/// As [`write()`]; an existing file that areograph did not write.
pub fn replace(path: &Path, bytes: &[u8], mark: Mark) -> Result<()> {
    flushed(StagedFile::replacing(path, mark)?, bytes)
}

/// As [`replace`], and as [`write_unflushed`].
///
/// # Errors
/// As [`replace`].
pub fn replace_unflushed(path: &Path, bytes: &[u8], mark: Mark) -> Result<()> {
    filled(StagedFile::replacing(path, mark)?, &[bytes])?.finish_unflushed()
}

fn flushed(staged: StagedFile, bytes: &[u8]) -> Result<()> {
    let path = staged.path().to_owned();
    filled(staged, &[bytes])?.finish()?;
    sync_folder(path.parent().unwrap_or(Path::new(".")));
    Ok(())
}

fn filled(staged: StagedFile, parts: &[&[u8]]) -> Result<StagedFile> {
    let mut writer = staged.writer()?;
    let written = parts.iter().try_for_each(|part| writer.write_all(part));
    let written = written.map_err(IoError::on("write"));
    written.in_file(staged.path())?;
    Ok(staged)
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
