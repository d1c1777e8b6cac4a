//! The PEDR files in and below folders.

use std::{
    collections::{BTreeSet, VecDeque},
    ffi::OsString,
    fs::{self, DirEntry, Metadata},
    io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use areograph_base::error::{Cause, Error, IoError, Locate as _, Result};

/// Suffixes that compression programs append to a file name.
const COMPRESSED: [&str; 7] = ["gz", "z", "zip", "bz2", "xz", "zst", "7z"];

/// Result of a search of folders: `paths` in order of their names, and the entries that could not be read.
#[derive(Debug, Default)]
pub struct Listing {
    /// PEDR files.
    pub paths: Vec<PathBuf>,
    /// Folders that the system refuses to list, broken links, compressed PEDR files.
    pub failures: Vec<Error>,
}

/// A PEDR file that must be decompressed first.
#[derive(Debug, thiserror::Error, Cause)]
#[error("a compressed PEDR file; expected {0} beside it")]
#[cause(Input: "decompress it (gunzip, unzip) in place, or move it out of the archive")]
struct Compressed(String);

impl Listing {
    /// The files with the ending `.b`, in upper or lower case, in and below `folder`, links followed. Each folder is
    /// searched once, under its own name where it has one below `folder`.
    #[must_use]
    pub fn below(folder: &Path) -> Self {
        let mut walk = Walk {
            linked: VecDeque::from([folder.to_owned()]),
            ..Walk::default()
        };
        // The target of a link may also be below the folder: its own name comes first.
        while let Some(folder) = walk.linked.pop_front() {
            if let Err(failure) = walk.enter(&folder) {
                walk.listing.failures.push(failure);
            }
        }
        walk.listing.paths.sort();
        walk.listing
    }

    /// The files among `paths` and those in and below the folders among them; a file with several names is listed once.
    #[must_use]
    pub fn of(paths: &[PathBuf]) -> Self {
        let mut all = Self::default();
        for path in paths {
            if path.is_dir() {
                let below = Self::below(path);
                all.failures.extend(below.failures);
                all.paths.extend(below.paths);
            } else {
                all.paths.push(path.clone());
            }
        }
        // The file's own name comes before links to it.
        all.paths
            .sort_by_cached_key(|path| (path.is_symlink(), path.clone()));
        all.paths.dedup();
        let mut seen = BTreeSet::new();
        // Opening such a file reports the reason.
        let is_first =
            |path: &PathBuf| fs::metadata(path).map_or(true, |metadata| seen.insert(id(&metadata)));
        all.paths.retain(is_first);
        all.paths.sort();
        all
    }
}

/// Device and inode.
fn id(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}

/// A walk through folders.
#[derive(Default)]
struct Walk {
    listing: Listing,
    /// Folders already entered: links may form cycles.
    entered: BTreeSet<(u64, u64)>,
    /// Links to folders that are still to be followed.
    linked: VecDeque<PathBuf>,
}

impl Walk {
    fn enter(&mut self, folder: &Path) -> Result<()> {
        let refused = |error: io::Error| Error::from(IoError::on("list")(error)).in_file(folder);
        let metadata = fs::metadata(folder).map_err(refused)?;
        if !self.entered.insert(id(&metadata)) {
            return Ok(());
        }
        let mut entries = Vec::new();
        for entry in fs::read_dir(folder).map_err(refused)? {
            match entry {
                Ok(entry) => entries.push(entry),
                Err(error) => self.listing.failures.push(refused(error)),
            }
        }
        entries.sort_by_key(DirEntry::file_name);
        let names: BTreeSet<OsString> = entries.iter().map(DirEntry::file_name).collect();
        for entry in &entries {
            if let Err(failure) = self.take(entry, &names) {
                self.listing.failures.push(failure);
            }
        }
        Ok(())
    }

    /// Processes an entry of a folder with these names.
    fn take(&mut self, entry: &DirEntry, names: &BTreeSet<OsString>) -> Result<()> {
        let path = entry.path();
        let refused = |error: io::Error| Error::from(IoError::on("open")(error)).in_file(&path);
        let own = entry.file_type().map_err(refused)?;
        if own.is_dir() {
            return self.enter(&path);
        }
        if own.is_symlink() || is_pedr(&path) {
            // A broken link may have pointed to a volume.
            let metadata = fs::metadata(&path).map_err(refused)?;
            if metadata.is_dir() {
                self.linked.push_back(path);
                return Ok(());
            }
        }
        if is_pedr(&path) {
            self.listing.paths.push(path);
        } else if let Some(name) = decompressed(&path).filter(|name| !names.contains(name)) {
            let name = name.to_string_lossy().into_owned();
            return Err(Compressed(name)).in_file(path);
        }
        Ok(())
    }
}

fn is_pedr(path: &Path) -> bool {
    let ending = path.extension();
    ending.is_some_and(|ending| ending.eq_ignore_ascii_case("b"))
}

/// The name of a compressed PEDR file without its compression suffix; `None` for any other file.
#[must_use]
pub fn decompressed(path: &Path) -> Option<OsString> {
    let ending = path.extension()?.to_str()?;
    let stem = path.file_stem()?;
    let is_compressed = COMPRESSED
        .iter()
        .any(|known| ending.eq_ignore_ascii_case(known));
    (is_compressed && is_pedr(Path::new(stem))).then(|| stem.to_owned())
}
