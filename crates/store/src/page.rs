//! Pages that a command writes to a path of the user: beside products, never over them.

use std::{
    fs::{self, FileType},
    io::ErrorKind,
    path::{Path, PathBuf},
};

use super::{
    atomic,
    files::{Mark, MarkAt, require_own},
    publish::{JOURNAL, read_manifest},
};
use areograph_base::error::{Cause, IoError, Locate, Result};

/// File of the page over all sites, in the folder that holds the sites' folders.
pub const SITES_PAGE: &str = "index.html";

/// Pages of areograph: pages of products, differences and comparisons end with the same line.
pub const PAGE: Mark = Mark {
    what: "a page that areograph wrote",
    at: MarkAt::Tail("<footer>Made by areograph ", 200),
};

/// Reasons why a page must not be written to a path.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
pub enum PageError {
    /// It would replace something other than a file.
    #[error("is {found}; a page can replace only a regular file")]
    #[cause("name a file for --page, in a folder that exists")]
    NotAFile {
        /// The existing entry.
        found: &'static str,
    },
    /// The next run, and every check of the products, would find a foreign file.
    #[error("belongs to the products in {}", .folder.display())]
    #[cause("name a file outside the folders of products for --page")]
    Product {
        /// A site's folder, or the one that holds the sites' folders.
        folder: PathBuf,
    },
}

/// A path to which a page may be written.
#[derive(Debug)]
pub struct PagePath(PathBuf);

impl PagePath {
    /// Checks the path before the work whose result the page will show.
    ///
    /// # Errors
    /// [`PageError`] for anything but a regular file, and for products; a file that is not a page of areograph;
    /// [`IoError`] if its folder cannot be found.
    pub fn new(path: &Path) -> Result<Self> {
        check(path).in_file(path)?;
        Ok(Self(path.to_owned()))
    }

    /// Writes the page completely or not at all.
    ///
    /// # Errors
    /// As [`Self::new`], if the path has changed meanwhile; [`IoError`] if the system refuses to write.
    pub fn write(&self, page: &str) -> Result<()> {
        check(&self.0).in_file(&self.0)?;
        atomic::replace(&self.0, page.as_bytes(), PAGE)
    }
}

fn check(path: &Path) -> Result<()> {
    match fs::symlink_metadata(path) {
        Ok(found) if !found.is_file() => {
            let found = kind_of(found.file_type());
            return Err(PageError::NotAFile { found }.into());
        }
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(IoError::on("look at")(error).into());
        }
        _ => {}
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let folder = fs::canonicalize(folder)
        .map_err(IoError::on("find the folder"))
        .in_file(folder)?;
    let over_all_sites = path.ends_with(SITES_PAGE) && holds_sites(&folder);
    let product_of = folder.ancestors().find(|folder| is_published(folder));
    match product_of.or(over_all_sites.then_some(&*folder)) {
        Some(folder) => Err(PageError::Product {
            folder: folder.to_owned(),
        }
        .into()),
        None => require_own(path, &PAGE),
    }
}

/// Whether products were published, or are being published, into the folder.
fn is_published(folder: &Path) -> bool {
    folder.join(JOURNAL).exists() || read_manifest(folder).is_some()
}

fn holds_sites(folder: &Path) -> bool {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.into_iter().any(|entry| is_published(&entry.path()))
}

#[cfg(unix)]
fn kind_of(found: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if found.is_dir() {
        "a folder"
    } else if found.is_symlink() {
        "a symbolic link"
    } else if found.is_fifo() {
        "a pipe"
    } else if found.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn kind_of(found: FileType) -> &'static str {
    if found.is_dir() {
        "a folder"
    } else {
        "not a regular file"
    }
}
