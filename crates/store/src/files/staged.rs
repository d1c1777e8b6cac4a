//! A file that is being written; it receives its name once it is complete.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::{
    outputs::require_replaceable,
    own::{Mark, MarkAt, enlist, require_own},
    partial::file_in,
};
use areograph_base::error::{IoError, Locate, Result};

/// A file under a temporary name in its final folder; it is removed when dropped, unless it is finished.
#[derive(Debug)]
pub struct StagedFile {
    path: PathBuf,
    /// Mark by which an earlier file under its name is recognised; `None` in folders of areograph itself.
    mark: Option<Mark>,
    temporary: NamedTempFile,
}

impl StagedFile {
    /// Creates the file `path`, and its folder if it is missing, in a folder whose files all belong to areograph.
    ///
    /// # Errors
    /// The folder cannot be created or written; a different kind of entry has this name.
    pub fn create(path: &Path) -> Result<Self> {
        require_replaceable(path)?;
        Self::staged(path, None)
    }

    /// Creates a file at a path of the user, where an existing file is replaced only if it has this mark.
    ///
    /// # Errors
    /// As [`Self::create`] and [`require_own`].
    pub fn replacing(path: &Path, mark: Mark) -> Result<Self> {
        require_own(path, &mark)?;
        Self::staged(path, Some(mark))
    }

    fn staged(path: &Path, mark: Option<Mark>) -> Result<Self> {
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        fs::create_dir_all(folder)
            .map_err(IoError::on("create the folder"))
            .in_file(folder)?;
        let temporary = file_in(folder)
            .map_err(IoError::on("create a file"))
            .in_file(folder)?;
        Ok(Self {
            path: path.to_owned(),
            mark,
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
    /// The disk is full or refuses, or a foreign file has received the name meanwhile; an existing file of this name is
    /// then unchanged.
    pub fn finish(self) -> Result<()> {
        let synced = self.temporary.as_file().sync_all();
        synced.map_err(IoError::on("write")).in_file(&self.path)?;
        self.finish_unflushed()
    }

    /// As [`Self::finish`], but leaves it to the system when the content reaches the disk: after a power failure, the
    /// file may be incomplete under its name. Only for files whose readers verify a hash of the content.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn finish_unflushed(self) -> Result<()> {
        let file = self.temporary.as_file();
        let readable = make_readable(file).map_err(IoError::on("set permissions of"));
        readable.in_file(&self.path)?;
        if let Some(mark) = &self.mark {
            require_own(&self.path, mark)?;
            if matches!(mark.at, MarkAt::List) {
                // Before it has its name: a killed command leaves no file that the next one does not know.
                enlist(&self.reader()?, &self.path)?;
            }
        }
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
