//! Content of products: each is read and hashed once while the file system reports no change of its file.

use std::{
    fs::File,
    io::{self, Read as _, Seek as _},
    path::{Component, Path},
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Instant, SystemTime, UNIX_EPOCH},
};

use rustix::{
    fs::{CWD, Mode, OFlags, ResolveFlags, openat, openat2},
    io::Errno,
};

use areograph_store::files::{Identity, KnownFile, KnownFiles};

/// Files whose hashes are remembered; beyond it they are read again.
const FILES_MAX: usize = 1 << 16;
/// Files that are read at the same time.
const READERS: usize = 4;
/// Bytes read at a time.
const CHUNK: usize = 256 << 10;
/// Readings of a file that changes meanwhile.
const TRIES: usize = 3;

/// Hashes of files, valid while the identity of the file is unchanged.
#[derive(Debug, Default)]
pub struct Contents {
    known: Mutex<KnownFiles>,
    /// Concurrent requests for one file read it once.
    turns: [Mutex<()>; READERS],
}

/// Size and BLAKE3 of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Content {
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of the content.
    pub blake3: blake3::Hash,
}

impl Content {
    /// Whether it has this size and this hash, hexadecimal.
    #[must_use]
    pub fn is(&self, bytes: u64, blake3: &str) -> bool {
        self.bytes == bytes && self.blake3.to_hex().as_str() == blake3
    }
}

/// The file changed repeatedly while it was being read.
#[derive(Debug, thiserror::Error)]
#[error("the file changed while it was being read")]
struct Changes;

impl Contents {
    /// The content of an open file, read only if it is not known.
    ///
    /// # Errors
    /// The file cannot be read, or changes meanwhile.
    pub fn of(&self, file: &File) -> io::Result<Content> {
        let identity = Identity::of(&file.metadata()?);
        if let Some(known) = self.known(&identity) {
            return Ok(known);
        }
        // At most READERS, so that it fits.
        let turn = usize::try_from(identity.inode % READERS as u64).unwrap_or_default();
        let _turn = lock(&self.turns[turn]);
        match self.known(&identity) {
            Some(known) => Ok(known),
            None => self.read(file, |_| true),
        }
    }

    /// The content of a file that is read in any case; `step` receives the number of bytes of each step, and stops the
    /// reading by `false`.
    ///
    /// # Errors
    /// As [`Self::of`]; [`io::ErrorKind::Interrupted`] if `step` stopped it.
    pub fn read(&self, file: &File, mut step: impl FnMut(usize) -> bool) -> io::Result<Content> {
        for _ in 0..TRIES {
            let (begun, before) = (SystemTime::now(), Identity::of(&file.metadata()?));
            let blake3 = hash(file, &mut step)?;
            if Identity::of(&file.metadata()?) != before {
                continue;
            }
            if before.is_steady(begun) {
                let since = begun.duration_since(UNIX_EPOCH);
                self.note(KnownFile {
                    identity: before,
                    blake3: *blake3.as_bytes(),
                    checked: 0,
                    read_s: since.map_or(0, |since| since.as_secs()),
                });
            }
            return Ok(Content {
                bytes: before.bytes,
                blake3,
            });
        }
        Err(io::Error::other(Changes))
    }

    fn known(&self, identity: &Identity) -> Option<Content> {
        let known = lock(&self.known);
        known.get(identity).map(|file| Content {
            bytes: identity.bytes,
            blake3: file.blake3.into(),
        })
    }

    fn note(&self, file: KnownFile) {
        let mut known = lock(&self.known);
        if known.iter().len() >= FILES_MAX {
            *known = KnownFiles::default();
        }
        known.add(file);
    }
}

fn hash(mut file: &File, step: &mut impl FnMut(usize) -> bool) -> io::Result<blake3::Hash> {
    file.rewind()?;
    let mut hasher = blake3::Hasher::new();
    let mut chunk = vec![0; CHUNK];
    loop {
        let read = match file.read(&mut chunk) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            read => read?,
        };
        if read == 0 {
            return Ok(hasher.finalize());
        }
        hasher.update(&chunk[..read]);
        if !step(read) {
            return Err(io::ErrorKind::Interrupted.into());
        }
    }
}

/// Entries are complete, so that a panic of another thread leaves no partial state.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens the file `path` below `folder`: no component may be a symbolic link or lead outside.
///
/// # Errors
/// Errors of the system, except for a missing file or an invalid path.
pub fn open_below(folder: &Path, path: &Path) -> io::Result<Option<File>> {
    let plain = |part: Component<'_>| matches!(part, Component::Normal(_));
    if path.as_os_str().is_empty() || !path.components().all(plain) {
        return Ok(None);
    }
    let of_folder = OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let folder = match openat(CWD, folder, of_folder, Mode::empty()) {
        Ok(folder) => folder,
        Err(Errno::NOENT) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    // Does not wait for a writer if it is a pipe.
    let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK | OFlags::NOCTTY;
    let resolve = ResolveFlags::BENEATH | ResolveFlags::NO_SYMLINKS | ResolveFlags::NO_MAGICLINKS;
    let opened = match openat2(folder, path, flags, Mode::empty(), resolve) {
        Ok(opened) => File::from(opened),
        Err(
            Errno::NOENT
            | Errno::LOOP
            | Errno::XDEV
            | Errno::NOTDIR
            | Errno::NAMETOOLONG
            | Errno::INVAL,
        ) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let is_file = opened.metadata()?.is_file();
    Ok(is_file.then_some(opened))
}

/// Keeps the rate of reading below a limit.
#[derive(Debug)]
pub struct Pace {
    bytes_per_s: f64,
    begun: Instant,
    bytes: u64,
}

impl Pace {
    /// * `mib_per_s` – mebibytes per second
    #[must_use]
    pub fn new(mib_per_s: f64) -> Self {
        const MIB: f64 = 1_048_576.0;
        Self {
            bytes_per_s: mib_per_s * MIB,
            begun: Instant::now(),
            bytes: 0,
        }
    }

    /// Bytes read so far.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Waits after `bytes` were read, in pieces until `stops`; returns false if it was stopped.
    pub fn step(&mut self, bytes: usize, stops: impl Fn() -> bool) -> bool {
        const PIECE_S: f64 = 0.1;
        self.bytes += bytes as u64;
        loop {
            if stops() {
                return false;
            }
            let due_s = self.bytes as f64 / self.bytes_per_s;
            let left_s = due_s - self.begun.elapsed().as_secs_f64();
            if left_s <= 0.0 {
                return true;
            }
            std::thread::sleep(std::time::Duration::from_secs_f64(left_s.min(PIECE_S)));
        }
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    reason = "files of a test, one of them damaged"
)]
mod tests {
    use std::{fs, os::unix::fs::FileExt as _, time::Duration};

    use super::*;

    /// A file whose times lie far enough back, as far as a program can set them.
    fn aged(path: &Path, text: &str) -> File {
        fs::write(path, text).unwrap();
        let file = File::options().read(true).write(true).open(path).unwrap();
        std::thread::sleep(Duration::from_millis(2100));
        file
    }

    #[test]
    fn a_file_is_read_once_and_again_after_any_change_of_its_identity() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let file = aged(&path, "whole");
        let contents = Contents::default();
        let whole = blake3::hash(b"whole");
        assert_eq!(contents.of(&file).unwrap().blake3, whole);
        let known = |contents: &Contents| lock(&contents.known).iter().len();
        assert_eq!(known(&contents), 1);
        // Damage that restores the time of the content changes the time of the file.
        let modified = file.metadata().unwrap().modified().unwrap();
        file.write_all_at(b"d", 0).unwrap();
        file.set_modified(modified).unwrap();
        assert_eq!(contents.of(&file).unwrap().blake3, blake3::hash(b"dhole"));
        // A link is the same file; its content is read in any case when that is asked for.
        file.write_all_at(b"w", 0).unwrap();
        fs::hard_link(&path, folder.path().join("b")).unwrap();
        let link = File::open(folder.path().join("b")).unwrap();
        assert_eq!(contents.of(&link).unwrap().blake3, whole);
        assert_eq!(contents.of(&file).unwrap().bytes, 5);
        let stopped = contents.read(&file, |_| false).unwrap_err();
        assert_eq!(stopped.kind(), io::ErrorKind::Interrupted);
    }

    #[test]
    fn reading_keeps_its_pace_and_stops() {
        let mut pace = Pace::new(1.0);
        let begun = Instant::now();
        assert!(pace.step(200 << 10, || false));
        // 200 KiB at 1 MiB per second.
        assert!(begun.elapsed() >= Duration::from_millis(190));
        assert!(!pace.step(1 << 30, || begun.elapsed() > Duration::from_millis(300)));
        // A loaded machine may sleep longer, but not for the 1,024 s of the rate.
        assert!(begun.elapsed() < Duration::from_secs(100));
    }
}
