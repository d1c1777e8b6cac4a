//! A file that is being written; it receives its name once it is complete.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::outputs::require_replaceable;
use areograph_base::error::{IoError, Locate, Result};

/// Prefix of the names of incomplete files.
pub const TEMPORARY: &str = ".partial-";

/// A file under a temporary name in its final folder; it is removed when dropped, unless it is finished.
#[derive(Debug)]
pub struct StagedFile {
    path: PathBuf,
    temporary: NamedTempFile,
}

impl StagedFile {
    /// Creates the file `path`, and its folder if it is missing.
    ///
    /// # Errors
    /// The folder cannot be created or written; another kind of entry has this name.
    pub fn create(path: &Path) -> Result<Self> {
        require_replaceable(path)?;
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        fs::create_dir_all(folder)
            .map_err(IoError::on("create the folder"))
            .in_file(folder)?;
        let temporary = tempfile::Builder::new()
            .prefix(TEMPORARY)
            .tempfile_in(folder)
            .map_err(IoError::on("create a file"))
            .in_file(folder)?;
        Ok(Self {
            path: path.to_owned(),
            temporary,
        })
    }

    /// Its final path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A handle to write it.
    ///
    /// # Errors
    /// The system has no more handles.
    pub fn writer(&self) -> Result<File> {
        let handle = self.temporary.as_file().try_clone();
        handle.map_err(IoError::on("create")).in_file(&self.path)
    }

    /// A handle to read the written content from its beginning.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn reader(&self) -> Result<File> {
        let handle = File::open(self.temporary.path());
        handle.map_err(IoError::on("read")).in_file(&self.path)
    }

    /// Flushes the file to the disk, makes it readable for everyone with access to the folder, and gives it its name.
    ///
    /// # Errors
    /// The disk is full or refuses; an existing file of this name is then unchanged.
    pub fn finish(self) -> Result<()> {
        let file = self.temporary.as_file();
        let synced = file.sync_all().map_err(IoError::on("write"));
        synced.in_file(&self.path)?;
        let readable = make_readable(file).map_err(IoError::on("set permissions of"));
        readable.in_file(&self.path)?;
        self.temporary
            .persist(&self.path)
            .map_err(|error| IoError::on("rename into place")(error.error))
            .in_file(&self.path)?;
        Ok(())
    }
}

/// Temporary files are private; products are readable for everyone with access to the folder.
#[cfg(unix)]
fn make_readable(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_file: &File) -> std::io::Result<()> {
    Ok(())
}
