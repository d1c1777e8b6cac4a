//! Files appear under their final name whole or not at all.

use std::{
    fs::{self, File},
    io::Write,
    path::Path,
};

use crate::error::{IoError, Locate, Result};

/// How names of half-written files begin.
pub(super) const TEMPORARY: &str = ".partial-";

/// Writes `bytes` beside `path` under a temporary name, flushes them to the disk and renames.
///
/// # Errors
/// The folder cannot be made or written, or the disk is full; `path` is then as it was.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .map_err(IoError::on("create the folder"))
        .in_file(folder)?;
    let mut temporary = tempfile::Builder::new()
        .prefix(TEMPORARY)
        .tempfile_in(folder)
        .map_err(IoError::on("create a file"))
        .in_file(folder)?;
    let written = temporary
        .write_all(bytes)
        .and_then(|()| temporary.as_file().sync_all());
    written.map_err(IoError::on("write")).in_file(path)?;
    make_readable(temporary.as_file())
        .map_err(IoError::on("set permissions of"))
        .in_file(path)?;
    temporary
        .persist(path)
        .map_err(|error| IoError::on("rename into place")(error.error))
        .in_file(path)?;
    sync_folder(folder);
    Ok(())
}

/// Temporary files are private; products are for everyone whom the folder lets in.
#[cfg(unix)]
fn make_readable(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_file: &File) -> std::io::Result<()> {
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

/// Makes renames in `folder` durable, where the system can do that.
pub fn sync_folder(folder: &Path) {
    // Some file systems refuse to flush folders; the data are safe all the same.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}
