//! Hashes of files, kept between runs: an unchanged file is not read again.
//!
//! Stored hashes only save time. A file of hashes that is damaged, foreign or not writable is treated as absent.
//!
//! Kernels, labels, PEDR and tie point files are hashed once in a run (`files.rs`), and again in later runs only when
//! the file system reports a change; `--rehash` reads all of them. Their identity (device, inode, size, times) is
//! compared after each stage that read them and before publishing. A changed file ends the run, and everything made
//! from it is discarded. Hashes of the products and large stage outputs of a site are in a separate file among these outputs; a
//! run makes a changed one again.

use std::{
    ffi::OsString,
    fs::{self, File, TryLockError},
    io::Write as _,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use super::atomic;
use crate::files::{InputFiles, KnownFile, KnownFiles, Mark, MarkAt};
use areograph_base::error::{IoError, Locate, Result};

/// Name of the file in a folder of products.
pub const HASHES: &str = ".hashes";

/// Header of the file: its kind, and the form of its entries. BLAKE3 of the rest follows, then the entries in
/// postcard.
const HEADER: &[u8] = b"areograph hashes 1\n";
/// Mark by which an earlier file of hashes is recognised.
const MARK: Mark = Mark {
    what: "a file of hashes that areograph wrote",
    at: MarkAt::Start(HEADER),
};
/// Bytes of a BLAKE3 hash.
const HASH_SIZE: usize = 32;
/// Maximum number of files; the oldest entries are removed first.
const FILES_MAX: usize = 200_000;
/// Largest file of hashes that is read, bytes: more than this number of entries occupies.
const SIZE_MAX: u64 = 64 << 20;
/// Number and duration of waits for another run that writes the same file, which takes it a few milliseconds.
const WAITS: usize = 1_000;
const WAIT: Duration = Duration::from_millis(2);

/// A file of hashes that runs share.
#[derive(Debug, Clone)]
pub struct HashCache {
    path: PathBuf,
    rehash: bool,
}

impl HashCache {
    /// The hashes in the file `path`; with `rehash` they are not used, but recomputed.
    #[must_use]
    pub fn new(path: &Path, rehash: bool) -> Self {
        Self {
            path: path.to_owned(),
            rehash,
        }
    }

    /// The hashes in a folder of products.
    #[must_use]
    pub fn in_folder(out: &Path, rehash: bool) -> Self {
        Self::new(&out.join(HASHES), rehash)
    }

    /// Hashes of the products and stage outputs of a site, in the folder `cache` of these outputs.
    #[must_use]
    pub fn of_own(&self, cache: &Path) -> Self {
        Self::in_folder(cache, self.rehash)
    }

    /// Input files of a run that knows these hashes.
    #[must_use]
    pub fn files(&self) -> InputFiles {
        if self.rehash {
            return InputFiles::default();
        }
        InputFiles::knowing(self.known())
    }

    /// The content of the file.
    #[must_use]
    pub fn known(&self) -> KnownFiles {
        read(&self.path).unwrap_or_default()
    }

    /// Adds the findings of a run about its input files, unless it has added the same before. Nothing is stored if the
    /// folder does not exist.
    pub fn keep(&self, files: &InputFiles) {
        let learnt = files.learnt();
        if learnt.is_empty() || files.has_kept(&learnt) || !self.folder().is_dir() {
            return;
        }
        match self.add(&learnt) {
            Ok(true) => files.note_kept(learnt),
            Ok(false) => {}
            Err(failure) => tracing::warn!("hashes of input files cannot be stored: {failure}"),
        }
    }

    /// Replaces the stored hashes by the hashes of a run over all files, because files that were replaced do not
    /// return.
    pub fn keep_only(&self, files: &InputFiles) {
        if files.learnt().is_empty() || !self.folder().is_dir() {
            return;
        }
        let Some(bytes) = encoded(files.findings()) else {
            return;
        };
        // The folder belongs to areograph, and an incomplete file is treated as absent.
        let written = File::create(&self.path).and_then(|mut file| file.write_all(&bytes));
        if let Err(failure) = written {
            tracing::warn!("hashes of products cannot be stored: {failure}");
        }
    }

    fn folder(&self) -> &Path {
        match self.path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        }
    }

    /// Whether they were added.
    fn add(&self, learnt: &[KnownFile]) -> Result<bool> {
        let mut name = OsString::from(&self.path);
        name.push(".lock");
        let Some(_lock) = wait_for_lock(Path::new(&name))? else {
            // The holder of the lock is stopped. Reading files again costs less than waiting for it.
            return Ok(false);
        };
        let mut known = self.known();
        for file in learnt {
            known.add(*file);
        }
        match encoded(known.iter().copied().collect()) {
            Some(bytes) => atomic::replace_unflushed(&self.path, &bytes, MARK).map(|()| true),
            None => Ok(false),
        }
    }
}

/// The content of a file of these hashes.
fn encoded(mut known: Vec<KnownFile>) -> Option<Vec<u8>> {
    known.sort_by_key(|file| std::cmp::Reverse(file.read_s));
    known.truncate(FILES_MAX);
    let entries = postcard::to_stdvec(&known).ok()?;
    let hash = blake3::hash(&entries);
    Some([HEADER, hash.as_bytes(), &entries].concat())
}

fn read(path: &Path) -> Option<KnownFiles> {
    let metadata = fs::metadata(path).ok()?;
    if !metadata.is_file() || metadata.len() > SIZE_MAX {
        return None;
    }
    let bytes = fs::read(path).ok()?;
    let (hash, entries) = bytes.strip_prefix(HEADER)?.split_at_checked(HASH_SIZE)?;
    if blake3::hash(entries).as_bytes() != hash {
        return None;
    }
    let known: Vec<KnownFile> = postcard::from_bytes(entries).ok()?;
    Some(known.into_iter().collect())
}

/// The lock in a separate file, since the file of hashes is replaced; `None` if another process does not release it.
fn wait_for_lock(path: &Path) -> Result<Option<File>> {
    let file = File::options()
        .write(true)
        .create(true)
        .truncate(false)
        .open(path)
        .map_err(IoError::on("create"))
        .in_file(path)?;
    for _ in 0..WAITS {
        match file.try_lock() {
            Ok(()) => return Ok(Some(file)),
            Err(TryLockError::WouldBlock) => thread::sleep(WAIT),
            Err(TryLockError::Error(error)) => {
                return Err(IoError::on("lock")(error)).in_file(path);
            }
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::Identity;

    fn file(inode: u64) -> KnownFile {
        KnownFile {
            identity: Identity {
                device: 1,
                inode,
                bytes: 2,
                modified: [3, 4],
                changed: [5, 6],
            },
            blake3: [7; 32],
            checked: 0,
            read_s: 1_000 + inode,
        }
    }

    #[test]
    fn hashes_come_back_and_every_damaged_bit_leaves_none() {
        let folder = tempfile::tempdir().unwrap();
        let cache = HashCache::in_folder(folder.path(), false);
        assert_eq!(cache.known(), KnownFiles::default());
        cache.add(&[file(1), file(2)]).unwrap();
        cache.add(&[file(3)]).unwrap();
        assert_eq!(cache.known(), (1..=3).map(file).collect());
        let path = folder.path().join(HASHES);
        let good = fs::read(&path).unwrap();
        for bit in 0..8 * good.len() {
            let mut bytes = good.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            atomic::write(&path, &bytes).unwrap();
            assert_eq!(cache.known(), KnownFiles::default(), "bit {bit}");
        }
        atomic::write(&path, &good[..10]).unwrap();
        cache.add(&[file(4)]).unwrap();
        assert_eq!(cache.known(), [file(4)].into_iter().collect());
    }

    #[test]
    fn writers_at_the_same_time_lose_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let cache = &HashCache::in_folder(folder.path(), false);
        thread::scope(|scope| {
            for writer in 0..8 {
                scope.spawn(move || {
                    for part in 0..5 {
                        cache.add(&[file(5 * writer + part)]).unwrap();
                    }
                });
            }
        });
        assert_eq!(cache.known(), (0..40).map(file).collect());
    }
}
