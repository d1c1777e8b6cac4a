//! Only one process at a time works in a site's folder.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::ErrorKind,
    path::{Path, PathBuf},
};

use super::publish::{CACHE, remove_staging};
use crate::files::remove_abandoned;
use areograph_base::error::{Cause, Error, IoError, Locate, Result};

/// Held while a run works in a site's folder; the system releases it when the process ends for any reason.
#[derive(Debug)]
pub struct SiteLock {
    _file: File,
}

/// Another run is using the folder.
#[derive(Debug, thiserror::Error, Cause)]
#[error("another run is using this folder")]
#[cause(Io: "wait for the other run, or give this run a different --out")]
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
        // Its content, if any, does not belong to areograph.
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .or_else(|refused| match refused.kind() {
                // A run that changes nothing may read products that it cannot write.
                ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => File::open(&path)
                    .or_else(|_| File::open(folder))
                    .map_err(|_| refused),
                _ => Err(refused),
            })
            .map_err(IoError::on("create"))
            .in_file(&path)?;
        match file.try_lock() {
            Ok(()) => {
                remove_abandoned(folder);
                remove_abandoned(&folder.join(CACHE));
                remove_staging(folder);
                Ok(Self { _file: file })
            }
            Err(TryLockError::WouldBlock) => Err(Busy).in_file(folder),
            Err(TryLockError::Error(error)) => Err(IoError::on("lock")(error)).in_file(&path),
        }
    }
}
