//! The folder of a fetch: its lock, partial downloads, copies of indexes.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    path::{Component, Path, PathBuf},
};

use crate::{error::FetchError, hashed::sha256_of};
use areograph_base::{
    constants::FETCH_FOLDER,
    error::{IoError, Locate as _, Result},
};
use areograph_store::files::remove_abandoned;

/// The folder that is filled.
#[derive(Debug, Clone)]
pub(crate) struct Folder {
    root: PathBuf,
}

/// Held while a process fills the folder; the system releases it when the process ends for any reason.
#[derive(Debug)]
pub(crate) struct FolderLock {
    _file: File,
}

impl Folder {
    /// The folder `root`, which need not exist.
    ///
    /// # Errors
    /// The current folder is unknown.
    pub(crate) fn at(root: &Path) -> Result<Self> {
        let root = std::path::absolute(root)
            .map_err(IoError::on("find"))
            .in_file(root)?;
        Ok(Self {
            root: without_parents(&root),
        })
    }

    /// Takes its lock; what killed processes left under temporary names is removed.
    ///
    /// # Errors
    /// [`FetchError::Busy`]; the folder cannot be written.
    pub(crate) fn lock(&self) -> Result<FolderLock> {
        for folder in [self.parts(), self.root.join(FETCH_FOLDER).join("indexes")] {
            fs::create_dir_all(&folder)
                .map_err(IoError::on("create the folder"))
                .in_file(&folder)?;
        }
        let path = self.root.join(FETCH_FOLDER).join("lock");
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(IoError::on("create"))
            .in_file(&path)?;
        match file.try_lock() {
            Ok(()) => {
                remove_abandoned(&self.root);
                remove_abandoned(&self.parts());
                Ok(FolderLock { _file: file })
            }
            Err(TryLockError::WouldBlock) => Err(FetchError::Busy).in_file(&self.root),
            Err(TryLockError::Error(error)) => Err(IoError::on("lock")(error)).in_file(&path),
        }
    }

    /// The file of its state.
    pub(crate) fn state(&self) -> PathBuf {
        self.root.join("fetch.json")
    }

    fn parts(&self) -> PathBuf {
        self.root.join(FETCH_FOLDER).join("parts")
    }

    /// Path at which the part of a file is collected, by its address and its place.
    pub(crate) fn part(&self, url: &str, path: &Path) -> PathBuf {
        let of = format!("{url}\n{}", path.display());
        self.parts().join(format!("{}.part", &sha256_of(&of)[..32]))
    }

    /// The copy of an index.
    pub(crate) fn index(&self, name: &str) -> PathBuf {
        self.root.join(FETCH_FOLDER).join("indexes").join(name)
    }

    /// A path seen from the folder, for its state.
    pub(crate) fn relative(&self, path: &Path) -> String {
        let path = std::path::absolute(path)
            .map_or_else(|_| path.to_owned(), |path| without_parents(&path));
        let (here, there): (Vec<Component>, Vec<Component>) = (
            self.root.components().collect(),
            path.components().collect(),
        );
        let common = here
            .iter()
            .zip(&there)
            .take_while(|(one, other)| one == other)
            .count();
        let back = here[common..].iter().map(|_| Component::ParentDir);
        let seen: PathBuf = back.chain(there[common..].iter().copied()).collect();
        seen.to_string_lossy().into_owned()
    }

    /// The inverse of [`Self::relative`].
    pub(crate) fn absolute(&self, relative: &str) -> PathBuf {
        without_parents(&self.root.join(relative))
    }
}

/// The path with its `..` taken out by the letter.
fn without_parents(path: &Path) -> PathBuf {
    let mut steps = PathBuf::new();
    for step in path.components() {
        match step {
            Component::ParentDir => {
                steps.pop();
            }
            Component::CurDir => {}
            step => steps.push(step),
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_go_to_the_state_and_back() {
        let folder = Folder::at(Path::new("/data/mars/sites")).unwrap();
        for (path, relative) in [
            ("/data/mars/sites/a.bsp", "a.bsp"),
            ("/data/mars/sites/../kernels/a.bsp", "../kernels/a.bsp"),
            ("/other/a.bsp", "../../../other/a.bsp"),
        ] {
            assert_eq!(folder.relative(Path::new(path)), relative);
            assert_eq!(folder.absolute(relative), without_parents(Path::new(path)));
        }
    }
}
