//! The PEDR files in and below folders.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::error::{Error, IoError, Locate as _};

/// Files of which a search of folders is made: `paths` in the order of their names, and what could not be looked into.
#[derive(Debug, Default)]
pub struct Listing {
    /// PEDR files.
    pub paths: Vec<PathBuf>,
    /// Folders that the system refuses to list, links that lead nowhere.
    pub failures: Vec<Error>,
}

impl Listing {
    /// The files with the ending `.b`, in upper or lower case, in and below `folder`; links to folders are not followed.
    #[must_use]
    pub fn below(folder: &Path) -> Self {
        let mut listing = Self::default();
        listing.add(folder);
        listing.paths.sort();
        listing
    }

    fn add(&mut self, folder: &Path) {
        let entries = fs::read_dir(folder).map_err(IoError::on("list"));
        let entries = match entries.in_file(folder) {
            Ok(entries) => entries,
            Err(failure) => return self.failures.push(failure),
        };
        for entry in entries {
            let entry = match entry.map_err(IoError::on("list")).in_file(folder) {
                Ok(entry) => entry,
                Err(failure) => {
                    self.failures.push(failure);
                    continue;
                }
            };
            let path = entry.path();
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                self.add(&path);
            } else if is_named_pedr(&path) {
                match fs::metadata(&path)
                    .map_err(IoError::on("open"))
                    .in_file(&path)
                {
                    Ok(metadata) if metadata.is_dir() => {}
                    Ok(_) => self.paths.push(path),
                    Err(failure) => self.failures.push(failure),
                }
            }
        }
    }
}

fn is_named_pedr(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("b"))
}
