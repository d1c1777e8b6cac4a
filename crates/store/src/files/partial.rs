//! Incomplete files and folders under temporary names.
//!
//! Their writer holds a lock on them, which the system releases when the process ends for any reason. An incomplete
//! file that no process holds belongs to a killed command: the next command that writes into the folder removes it.

use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    sync::{LazyLock, Mutex, PoisonError},
};

use tempfile::{Builder, NamedTempFile, TempDir};

/// Prefix of the names of incomplete files and folders; random letters and digits follow.
pub const TEMPORARY: &str = ".partial-areograph-";
/// Number of these letters and digits.
const RANDOM: usize = 6;
/// In a temporary folder, the folder of entries that were moved aside, each under its name.
pub const ASIDE: &str = "aside";
/// Attempts to hold a new file before another process, which takes it for abandoned, removes it.
const ATTEMPTS: usize = 20;

/// A new incomplete file in `folder`, held by this process; what killed commands left there is removed first.
pub(super) fn file_in(folder: &Path) -> io::Result<NamedTempFile> {
    remove_abandoned_once(folder);
    let make = || builder().tempfile_in(folder);
    let mut file = make()?;
    for _ in 0..ATTEMPTS {
        if is_held(file.as_file(), file.path()) {
            break;
        }
        file = make()?;
    }
    Ok(file)
}

/// An incomplete folder; it is removed when dropped.
#[derive(Debug)]
pub struct PartialFolder {
    folder: TempDir,
    _held: File,
}

impl PartialFolder {
    /// A new one in `parent`; what killed commands left there is removed first.
    ///
    /// # Errors
    /// The system's.
    pub fn new_in(parent: &Path) -> io::Result<Self> {
        remove_abandoned(parent);
        for _ in 0..ATTEMPTS {
            let folder = builder().tempdir_in(parent)?;
            let held = match File::open(folder.path()) {
                // Another process took it for abandoned before it could be held.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                held => held?,
            };
            if is_held(&held, folder.path()) {
                return Ok(Self {
                    folder,
                    _held: held,
                });
            }
        }
        Err(io::Error::other(format!(
            "{ATTEMPTS} new folders were removed by other processes"
        )))
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

fn builder() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(TEMPORARY).rand_bytes(RANDOM);
    builder
}

/// Takes the lock of a new entry; `false` if another process holds or has removed it.
fn is_held(entry: &File, path: &Path) -> bool {
    match entry.try_lock() {
        Ok(()) => path.exists(),
        Err(TryLockError::WouldBlock) => false,
        // Where there are no locks, no process takes the entry for abandoned.
        Err(TryLockError::Error(_)) => true,
    }
}

/// Calls [`remove_abandoned`] once for each folder in a process.
fn remove_abandoned_once(folder: &Path) {
    static SEEN: LazyLock<Mutex<BTreeSet<PathBuf>>> = LazyLock::new(Mutex::default);
    let mut seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    if seen.insert(folder.to_owned()) {
        drop(seen);
        remove_abandoned(folder);
    }
}

/// Removes the remains of killed commands in `folder`. Files of other programs, and of a living writer, remain.
pub fn remove_abandoned(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_temporary(&entry.file_name()) {
            // An entry that cannot be removed does no harm.
            let _ = remove_if_abandoned(&entry.path());
        }
    }
}

fn is_temporary(name: &OsStr) -> bool {
    let rest = name.to_str().and_then(|name| name.strip_prefix(TEMPORARY));
    rest.is_some_and(|rest| {
        rest.len() == RANDOM && rest.bytes().all(|byte| byte.is_ascii_alphanumeric())
    })
}

fn remove_if_abandoned(path: &Path) -> io::Result<()> {
    let kind = fs::symlink_metadata(path)?.file_type();
    if !kind.is_file() && !kind.is_dir() {
        return Ok(());
    }
    let entry = File::open(path)?;
    if entry.try_lock().is_err() {
        return Ok(());
    }
    if kind.is_file() {
        return fs::remove_file(path);
    }
    put_back(path)?;
    fs::remove_dir_all(path)
}

/// Returns entries that were moved aside, unless their names have been given to others.
fn put_back(folder: &Path) -> io::Result<()> {
    let parent = folder.parent().unwrap_or(folder);
    for entry in fs::read_dir(folder.join(ASIDE)).into_iter().flatten() {
        let entry = entry?;
        let place = parent.join(entry.file_name());
        if fs::symlink_metadata(&place).is_err() {
            fs::rename(entry.path(), place)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> BTreeSet<String> {
        let entries = fs::read_dir(folder).unwrap();
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        entries
            .map(|entry| name(entry).to_string_lossy().into_owned())
            .collect()
    }

    #[test]
    fn writers_that_begin_at_once_in_one_folder_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..300 {
                        let partial = PartialFolder::new_in(folder.path()).unwrap();
                        File::create(partial.path().join("product")).unwrap();
                    }
                });
            }
        });
        assert_eq!(names(folder.path()), BTreeSet::new());
    }

    #[test]
    fn what_nobody_holds_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let living = file_in(folder.path()).unwrap();
        for name in [
            ".partial-areograph-a1B2c3",
            ".partial-areograph-mine",
            ".partial-areograph-a1B2c3d",
            ".partial-a1B2c3",
        ] {
            File::create(path(name)).unwrap();
        }
        fs::create_dir(path(".partial-areograph-folder")).unwrap();
        std::os::unix::fs::symlink(path("nowhere"), path(".partial-areograph-linked")).unwrap();
        remove_abandoned(folder.path());
        let living_name = living.path().file_name().unwrap().to_string_lossy();
        let expected = [
            ".partial-areograph-mine",
            ".partial-areograph-a1B2c3d",
            ".partial-a1B2c3",
            ".partial-areograph-linked",
            &*living_name,
        ];
        let expected: BTreeSet<String> = expected.map(str::to_owned).into();
        assert_eq!(names(folder.path()), expected);
    }

    #[test]
    fn an_entry_that_was_moved_aside_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let aside = folder.path().join(".partial-areograph-a1B2c3").join(ASIDE);
        fs::create_dir_all(aside.join("older")).unwrap();
        fs::create_dir_all(aside.join("replaced")).unwrap();
        fs::create_dir(folder.path().join("replaced")).unwrap();
        let living = PartialFolder::new_in(folder.path()).unwrap();
        assert!(living.path().is_dir());
        drop(living);
        let expected: BTreeSet<String> = ["older", "replaced"].map(str::to_owned).into();
        assert_eq!(names(folder.path()), expected);
    }
}
