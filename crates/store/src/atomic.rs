//! Files appear under their final names complete or not at all.
//!
//! Files are written under a temporary name, read back, flushed and renamed. Stored outputs and hashes are not flushed:
//! a run recognises an incomplete one by its hash, and makes it again. The next command that writes into a folder
//! removes the remains of a killed one.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read, Write as _},
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use crate::files::{Mark, StagedFile};
use areograph_base::error::{IoError, Locate, Result};

/// Files that are flushed at the same time.
const FLUSHED_TOGETHER: usize = 32;
/// Stack of a thread that flushes files, bytes.
const FLUSHING_STACK: usize = 1 << 17;

/// Writes `bytes` beside `path` under a temporary name, flushes them to the disk and renames.
///
/// # Errors
/// The folder cannot be created or written, or the disk is full; `path` is then unchanged.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    flushed(StagedFile::create(path)?, bytes)
}

/// Writes `head`, and behind it all that `payload` contains, and does not wait until they are on the disk: see
/// [`StagedFile::finish_unflushed`].
///
/// # Errors
/// As [`write()`]; `payload` cannot be read.
pub fn write_unflushed(path: &Path, head: &[u8], payload: &mut impl Read) -> Result<()> {
    filled(StagedFile::create(path)?, |writer| {
        writer.write_all(head)?;
        io::copy(payload, writer).map(drop)
    })?
    .finish_unflushed()
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
    let staged = StagedFile::replacing(path, mark)?;
    filled(staged, |writer| writer.write_all(bytes))?.finish_unflushed()
}

fn flushed(staged: StagedFile, bytes: &[u8]) -> Result<()> {
    let path = staged.path().to_owned();
    filled(staged, |writer| writer.write_all(bytes))?.finish()?;
    sync_folder(path.parent().unwrap_or(Path::new(".")));
    Ok(())
}

fn filled(
    staged: StagedFile,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<StagedFile> {
    let written = write(&mut staged.writer()?);
    written
        .map_err(IoError::on("write"))
        .in_file(staged.path())?;
    Ok(staged)
}

/// Flushes files that are about to be renamed.
///
/// Many threads wait for the disk: file systems write their journal once for all files that wait.
///
/// # Errors
/// A file cannot be opened or flushed: the first one in their order.
pub fn sync_files(paths: &[PathBuf]) -> Result<()> {
    let next = AtomicUsize::new(0);
    let failed = Mutex::new(BTreeMap::new());
    let flush = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(path) = paths.get(index) else {
                break;
            };
            if let Err(failure) = sync_file(path) {
                let mut failed = failed.lock().unwrap_or_else(PoisonError::into_inner);
                failed.insert(index, failure);
            }
        }
    };
    thread::scope(|scope| {
        for _ in 1..FLUSHED_TOGETHER.min(paths.len()) {
            let thread = thread::Builder::new().stack_size(FLUSHING_STACK);
            if thread.spawn_scoped(scope, flush).is_err() {
                // The system has no more threads; those that exist do all the work.
                break;
            }
        }
        flush();
    });
    let failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
    failed.into_values().next().map_or(Ok(()), Err)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_files_the_first_that_cannot_be_flushed_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let paths: Vec<PathBuf> = (0..100)
            .map(|index| folder.path().join(format!("{index}")))
            .collect();
        for path in &paths {
            write(path, b"content").unwrap();
        }
        sync_files(&paths).unwrap();
        sync_files(&[]).unwrap();
        for index in [90, 41] {
            std::fs::remove_file(&paths[index]).unwrap();
        }
        let failure = sync_files(&paths).unwrap_err();
        assert_eq!(failure.file.as_deref(), Some(&*paths[41]));
    }
}
