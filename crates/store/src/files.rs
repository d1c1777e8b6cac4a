//! Files: their hash, read once while they are unchanged, their name without folders, and how they receive that name
//! complete or not at all.

mod known;
mod outputs;
mod own;
mod partial;
mod staged;
pub mod stand_in;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{Seek as _, SeekFrom},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::{SystemTime, UNIX_EPOCH},
};

use rayon::prelude::*;

pub use self::known::{Identity, KnownFile, KnownFiles};
pub use self::outputs::{overlap, real_path, require_apart};
pub use self::own::{Mark, MarkAt, require_own};
pub use self::partial::{ASIDE, PartialFolder, TEMPORARY, remove_abandoned};
pub use self::staged::StagedFile;
use self::stand_in::StandIn;
use areograph_base::{
    error::{Cause, IoError, Locate, Result},
    watch::Watch,
};

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

/// Input files of one run: each is hashed once, and must not change.
#[derive(Debug, Default)]
pub struct InputFiles {
    earlier: KnownFiles,
    roots: Vec<PathBuf>,
    seen: Mutex<Seen>,
}

/// Findings of a run.
#[derive(Debug, Default)]
struct Seen {
    files: BTreeMap<PathBuf, SeenFile>,
    /// Hashes of contents that passed a check of kernels, with its version.
    passed: BTreeSet<(String, u32)>,
    /// Findings that have been stored for later runs.
    kept: Vec<KnownFile>,
}

/// A file that the run has read or hashed.
#[derive(Debug, Clone)]
struct SeenFile {
    identity: Identity,
    file: HashedFile,
    /// Time at which it was read, seconds of UTC since 1970; `None` for a file that changed just before, or meanwhile.
    read_s: Option<u64>,
}

/// A file that differs from what was read earlier in the run.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the file changed while it was in use: its hash was {was} and is {is}")]
#[cause(Input: "run again when no other program is writing to the input files")]
struct ChangedFile {
    was: String,
    is: String,
}

/// A file outside the permitted folders.
#[derive(Debug, thiserror::Error)]
#[error("a path below {}; this path leads to {}", listed(.roots), .leads_to.display())]
pub struct Outside {
    leads_to: PathBuf,
    roots: Vec<PathBuf>,
}

/// An input file that a run must not read.
#[derive(Debug, thiserror::Error, Cause)]
#[error("lies outside the permitted folders; expected {0}")]
#[cause(Configuration: "move the file into one of these folders, or have its folder added to the permitted folders")]
struct NotAdmitted(Outside);

/// Reason why the file must not be read, if it lies below none of the folders `roots`, links followed. Without folders
/// there is no restriction.
///
/// * `roots` – without links
#[must_use]
pub fn outside(path: &Path, roots: &[PathBuf]) -> Option<Outside> {
    if roots.is_empty() {
        return None;
    }
    // A missing file leads nowhere.
    let leads_to = path.canonicalize().ok()?;
    let within = roots.iter().any(|root| leads_to.starts_with(root));
    (!within).then(|| Outside {
        leads_to,
        roots: roots.to_vec(),
    })
}

fn listed(folders: &[PathBuf]) -> String {
    let folders = folders.iter().map(|folder| folder.display().to_string());
    folders.collect::<Vec<_>>().join(", ")
}

impl InputFiles {
    /// Input files of a run that does not read known files of earlier runs again.
    #[must_use]
    pub fn knowing(earlier: KnownFiles) -> Self {
        let checked = earlier.iter().filter(|file| file.checked > 0);
        let passed = checked.map(|file| (hexadecimal(file.blake3), file.checked));
        Self {
            seen: Mutex::new(Seen {
                passed: passed.collect(),
                ..Seen::default()
            }),
            earlier,
            roots: Vec::new(),
        }
    }

    /// Input files of a run that may read only below the folders `roots`; see [`outside`].
    #[must_use]
    pub fn within(self, roots: &[PathBuf]) -> Self {
        Self {
            roots: roots.to_vec(),
            ..self
        }
    }

    /// Ensures that the run may read a file.
    ///
    /// # Errors
    /// The file is outside the permitted folders, of kind configuration.
    pub fn admit(&self, path: &Path) -> Result<()> {
        match outside(path, &self.roots) {
            None => Ok(()),
            Some(outside) => Err(NotAdmitted(outside)).in_file(path),
        }
    }

    /// The file with its hash; a file that was hashed before is not read again.
    ///
    /// # Errors
    /// The file cannot be read, must not be read, or has changed.
    pub fn hash(&self, path: &Path) -> Result<HashedFile> {
        self.hash_from(path, 0)
    }

    /// Hashes a file that is always hashed from the same byte `start` on: known hashes do not contain it.
    ///
    /// # Errors
    /// As [`Self::hash`].
    pub fn hash_from(&self, path: &Path, start: u64) -> Result<HashedFile> {
        self.admit(path)?;
        let now = identity(path)?;
        let earlier = self.lock().files.get(path).cloned();
        if let Some(seen) = &earlier
            && seen.identity == now
        {
            return Ok(seen.file.clone());
        }
        let seen = match self.earlier.get(&now) {
            Some(known) => SeenFile::known(path, known),
            None => SeenFile::read(path, start)?,
        };
        if let Some(earlier) = earlier {
            unchanged(&earlier.file, &seen.file)?;
        }
        let file = seen.file.clone();
        self.lock().files.insert(path.to_owned(), seen);
        Ok(file)
    }

    /// Forgets a file that the run has replaced.
    pub fn forget(&self, path: &Path) {
        self.lock().files.remove(path);
    }

    /// Whether the run has hashed this file before.
    #[must_use]
    pub fn knows(&self, path: &Path) -> bool {
        self.lock().files.contains_key(path)
    }

    /// Whether content with this hash has passed that version of the check of kernels.
    #[must_use]
    pub fn has_passed(&self, blake3: &str, check: u32) -> bool {
        self.lock().passed.contains(&(blake3.to_owned(), check))
    }

    /// Records that content with this hash has passed that version of the check of kernels.
    pub fn note_passed(&self, blake3: &str, check: u32) {
        self.lock().passed.insert((blake3.to_owned(), check));
    }

    /// All files that the run has hashed.
    #[must_use]
    pub fn all(&self) -> Vec<HashedFile> {
        let seen = self.lock();
        seen.files.values().map(|seen| seen.file.clone()).collect()
    }

    /// Findings that later runs need not repeat, beyond those that were known.
    #[must_use]
    pub fn learnt(&self) -> Vec<KnownFile> {
        let mut learnt = self.findings();
        learnt.retain(|file| self.earlier.get(&file.identity) != Some(file));
        learnt
    }

    /// Whether exactly these findings have been stored for later runs.
    pub(super) fn has_kept(&self, learnt: &[KnownFile]) -> bool {
        self.lock().kept == learnt
    }

    /// Records that these findings have been stored for later runs.
    pub(super) fn note_kept(&self, learnt: Vec<KnownFile>) {
        self.lock().kept = learnt;
    }

    /// Findings that later runs need not repeat.
    #[must_use]
    pub fn findings(&self) -> Vec<KnownFile> {
        let seen = self.lock();
        let findings = seen.files.values().filter_map(|known| {
            let passed = seen.passed.iter();
            let checks = passed.filter(|(blake3, _)| *blake3 == known.file.blake3);
            Some(KnownFile {
                identity: known.identity,
                blake3: *blake3::Hash::from_hex(&known.file.blake3).ok()?.as_bytes(),
                checked: checks.map(|(_, check)| *check).max().unwrap_or(0),
                read_s: known.read_s?,
            })
        });
        findings.collect()
    }

    /// Several files in order; `watch` is checked before each, and counts those that were not known before.
    ///
    /// # Errors
    /// As [`Self::hash`]; [`Stopped`](areograph_base::error::Stopped).
    pub fn hash_all<'a>(
        &self,
        paths: &[PathBuf],
        watch: impl Into<Watch<'a>>,
    ) -> Result<Vec<HashedFile>> {
        let watch = watch.into();
        let unknown = paths.iter().filter(|path| !self.knows(path)).count();
        watch.announce(unknown);
        let hash = |path: &PathBuf| {
            watch.check()?;
            let is_known = self.knows(path);
            let hashed = self.hash(path)?;
            if !is_known {
                watch.step(1, "files hashed");
            }
            Ok(hashed)
        };
        paths.par_iter().map(hash).collect()
    }

    /// Ensures that a file that was hashed is unchanged. Other files are ignored.
    ///
    /// # Errors
    /// The file cannot be read, or has changed.
    pub fn verify(&self, path: &Path) -> Result<()> {
        if !self.knows(path) {
            return Ok(());
        }
        self.hash(path).map(|_| ())
    }

    /// Ensures that every file is unchanged.
    ///
    /// # Errors
    /// As [`Self::verify`], for the first of them.
    pub fn verify_all(&self) -> Result<()> {
        let paths: Vec<PathBuf> = self.lock().files.keys().cloned().collect();
        paths.iter().try_for_each(|path| self.verify(path))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Seen> {
        // Each entry is complete, even if the thread that wrote another one failed.
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl SeenFile {
    /// A file that an earlier run has read.
    fn known(path: &Path, known: &KnownFile) -> Self {
        Self {
            identity: known.identity,
            file: HashedFile {
                path: path.to_owned(),
                bytes: known.identity.bytes,
                blake3: hexadecimal(known.blake3),
            },
            read_s: Some(known.read_s),
        }
    }

    fn read(path: &Path, start: u64) -> Result<Self> {
        let begun = SystemTime::now();
        let file = open(path)?;
        let identity = identity_of(&file).in_file(path)?;
        let stand_in = if start == 0 {
            StandIn::of_open(&file).in_file(path)?
        } else {
            None
        };
        if let Some(file) = stand_in {
            // The file for which it stands is the input; it is never known by the identity of its stand-in.
            return Ok(Self {
                identity,
                file: HashedFile {
                    path: path.to_owned(),
                    bytes: file.bytes(),
                    blake3: file.blake3(),
                },
                read_s: None,
            });
        }
        let (blake3, bytes) = hash_open(&file, start).in_file(path)?;
        let steady = identity.is_steady(begun) && identity_of(&file).in_file(path)? == identity;
        let read_s = begun.duration_since(UNIX_EPOCH).ok().filter(|_| steady);
        Ok(Self {
            identity,
            file: HashedFile {
                path: path.to_owned(),
                bytes,
                blake3,
            },
            read_s: read_s.map(|since| since.as_secs()),
        })
    }
}

fn identity(path: &Path) -> Result<Identity> {
    let metadata = path.metadata().map_err(IoError::on("open")).in_file(path)?;
    Ok(Identity::of(&metadata))
}

fn identity_of(file: &File) -> std::result::Result<Identity, IoError> {
    let metadata = file.metadata().map_err(IoError::on("look at"))?;
    Ok(Identity::of(&metadata))
}

fn hexadecimal(blake3: [u8; 32]) -> String {
    blake3::Hash::from_bytes(blake3).to_hex().to_string()
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
    hash_open(&open(path)?, 0).in_file(path)
}

fn open(path: &Path) -> Result<File> {
    File::open(path).map_err(IoError::on("open")).in_file(path)
}

fn hash_open(mut file: &File, start: u64) -> std::result::Result<(String, u64), IoError> {
    let sought = file.seek(SeekFrom::Start(start));
    sought.map_err(IoError::on("read"))?;
    let mut hasher = blake3::Hasher::new();
    // It reads in pieces that fill vector registers; `std::io::copy` reads 8 KiB at a time.
    hasher.update_reader(file).map_err(IoError::on("read"))?;
    Ok((hasher.finalize().to_hex().to_string(), hasher.count()))
}

/// The name of a file without its folders, as in products, which do not depend on the location of files.
#[must_use]
pub fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The first digits of a hash: enough to distinguish files.
#[must_use]
pub fn short_hash(blake3: &str) -> String {
    blake3.chars().take(12).collect()
}

#[cfg(test)]
mod tests {
    use areograph_base::error::Kind;

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
