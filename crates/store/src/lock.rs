//! Only one process at a time works in a site's folder.

use std::{
    fs::{self, File, TryLockError},
    path::{Path, PathBuf},
};

use super::publish::{CACHE, STAGING};
use crate::files::TEMPORARY;
use areograph_base::error::{Cause, Error, IoError, Locate, Result};

/// Held while a run works in a site's folder; the system releases it when the process ends for any reason.
#[derive(Debug)]
pub struct SiteLock {
    _file: File,
}

/// Another run is using the folder.
#[derive(Debug, thiserror::Error, Cause)]
#[error("another run is using this folder")]
#[cause(Io: "wait for it, or give this run another --out")]
pub struct Busy;

impl Busy {
    /// Whether a failure was caused by the lock; then nothing was tried.
    #[must_use]
    pub fn is_cause_of(failure: &Error) -> bool {
        let cause: &(dyn std::error::Error + 'static) = &*failure.cause;
        cause.is::<Self>()
    }
}

impl SiteLock {
    /// Takes the lock of `folder`, which is created if necessary.
    ///
    /// # Errors
    /// Another process holds it, or the folder cannot be written.
    pub fn take(folder: &Path) -> Result<Self> {
        fs::create_dir_all(folder)
            .map_err(IoError::on("create the folder"))
            .in_file(folder)?;
        let path: PathBuf = folder.join(".lock");
        let file = File::create(&path)
            .map_err(IoError::on("create"))
            .in_file(&path)?;
        match file.try_lock() {
            Ok(()) => {
                remove_temporaries(folder);
                remove_temporaries(&folder.join(CACHE));
                // Incomplete products of a killed run; files that cannot be removed are reported when publishing.
                let _ = fs::remove_dir_all(folder.join(STAGING));
                Ok(Self { _file: file })
            }
            Err(TryLockError::WouldBlock) => Err(Busy).in_file(folder),
            Err(TryLockError::Error(error)) => Err(IoError::on("lock")(error)).in_file(&path),
        }
    }
}

/// Removes incomplete files of a killed run; no other process works here while the lock is held.
fn remove_temporaries(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(TEMPORARY) {
            // A file that cannot be removed does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}
