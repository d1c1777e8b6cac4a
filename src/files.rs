//! Files as several floors need them: their hash, read once in a run, and their name without folders.

use std::{
    collections::BTreeMap,
    fs::{File, Metadata},
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError, atomic::AtomicBool},
};

use rayon::prelude::*;

use crate::error::{Cause, IoError, Kind, Locate, Result, Stopped};

/// A file as it was when it was first read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HashedFile {
    /// Path as given.
    pub path: PathBuf,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub blake3: String,
}

/// Input files of one run: each is hashed once, and must stay what it was.
#[derive(Debug, Default)]
pub struct InputFiles {
    known: Mutex<BTreeMap<PathBuf, (Identity, HashedFile)>>,
}

/// What the file system says of a file; writing to a file changes its times, as finely as the system counts them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Identity {
    device: u64,
    inode: u64,
    bytes: u64,
    modified: [i64; 2],
    changed: [i64; 2],
}

impl Identity {
    fn of(metadata: &Metadata) -> Self {
        Self {
            device: metadata.dev(),
            inode: metadata.ino(),
            bytes: metadata.size(),
            modified: [metadata.mtime(), metadata.mtime_nsec()],
            changed: [metadata.ctime(), metadata.ctime_nsec()],
        }
    }
}

/// A file that is no longer what was read earlier in the run.
#[derive(Debug, thiserror::Error)]
#[error("the file changed while it was in use: its hash was {was} and is {is}")]
struct ChangedFile {
    was: String,
    is: String,
}

impl Cause for ChangedFile {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "run again when nobody is writing to the input files".to_owned()
    }
}

impl InputFiles {
    /// The file with its hash; a file that was hashed before is not read again.
    ///
    /// # Errors
    /// The file cannot be read, or is no longer what it was.
    pub fn hash(&self, path: &Path) -> Result<HashedFile> {
        let now = identity(path)?;
        let earlier = self.lock().get(path).cloned();
        if let Some((identity, file)) = &earlier
            && *identity == now
        {
            return Ok(file.clone());
        }
        let (blake3, bytes) = hash_file(path)?;
        let file = HashedFile {
            path: path.to_owned(),
            bytes,
            blake3,
        };
        if let Some((_, earlier)) = earlier {
            unchanged(&earlier, &file)?;
        }
        self.lock().insert(path.to_owned(), (now, file.clone()));
        Ok(file)
    }

    /// Whether the run has hashed this file before.
    #[must_use]
    pub fn knows(&self, path: &Path) -> bool {
        self.lock().contains_key(path)
    }

    /// Several files in their order; `stop` is looked at before each.
    ///
    /// # Errors
    /// As [`Self::hash`]; [`Stopped`].
    pub fn hash_all(&self, paths: &[PathBuf], stop: &AtomicBool) -> Result<Vec<HashedFile>> {
        let hash = |path: &PathBuf| {
            Stopped::check(stop)?;
            self.hash(path)
        };
        paths.par_iter().map(hash).collect()
    }

    /// Makes sure that a file which was hashed is still what it was. Other files are no concern.
    ///
    /// # Errors
    /// The file cannot be read, or is no longer what it was.
    pub fn verify(&self, path: &Path) -> Result<()> {
        if !self.knows(path) {
            return Ok(());
        }
        self.hash(path).map(|_| ())
    }

    /// Makes sure that every file is still what it was.
    ///
    /// # Errors
    /// As [`Self::verify`], for the first of them.
    pub fn verify_all(&self) -> Result<()> {
        let paths: Vec<PathBuf> = self.lock().keys().cloned().collect();
        paths.iter().try_for_each(|path| self.verify(path))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<PathBuf, (Identity, HashedFile)>> {
        // Each entry is whole, whatever happened to the thread that wrote another one.
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn identity(path: &Path) -> Result<Identity> {
    let metadata = path.metadata().map_err(IoError::on("open")).in_file(path)?;
    Ok(Identity::of(&metadata))
}

fn unchanged(earlier: &HashedFile, now: &HashedFile) -> Result<()> {
    if earlier.blake3 == now.blake3 {
        return Ok(());
    }
    Err(ChangedFile {
        was: short_hash(&earlier.blake3),
        is: short_hash(&now.blake3),
    })
    .in_file(&now.path)
}

/// BLAKE3 of a file, hexadecimal, and its size in bytes.
///
/// # Errors
/// The file cannot be read.
pub fn hash_file(path: &Path) -> Result<(String, u64)> {
    let mut hasher = blake3::Hasher::new();
    let file = File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)?;
    let bytes = std::io::copy(&mut &file, &mut hasher)
        .map_err(IoError::on("read"))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::disallowed_methods, reason = "files of a test")]
    fn a_file_that_changes_during_a_run_is_found_and_one_that_is_touched_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mgs.tsc");
        std::fs::write(&path, b"one").unwrap();
        let files = InputFiles::default();
        let first = files.hash(&path).unwrap();
        assert_eq!(first.bytes, 3);
        std::fs::write(&path, b"one").unwrap();
        files.verify_all().unwrap();
        std::fs::write(&path, b"three").unwrap();
        let failure = files.verify(&path).unwrap_err();
        assert_eq!(failure.kind(), Kind::Input);
        assert!(
            failure
                .to_string()
                .contains("mgs.tsc: the file changed while it was in use")
        );
        assert!(files.hash(&path).is_err());
        files.verify(&folder.path().join("another")).unwrap();
    }
}
