//! Folders and files that only the user of the service may read: hashes of tokens, references of sessions, logs.

use std::{
    fs::{self, DirBuilder, File},
    io,
    os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _},
    path::Path,
};

/// Modes of a private folder and of a private file.
const FOLDER: u32 = 0o700;
const FILE: u32 = 0o600;

/// Creates a private folder; folders above it get the usual mode. An existing folder keeps its own.
///
/// # Errors
/// The folder cannot be created.
pub fn create_folder(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    if let Some(above) = path.parent() {
        fs::create_dir_all(above)?;
    }
    match DirBuilder::new().mode(FOLDER).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        created => created,
    }
}

/// Creates an empty private file. An existing file is unchanged. Returns whether the file is new.
///
/// # Errors
/// The file cannot be created.
pub fn create_file(path: &Path) -> io::Result<bool> {
    let created = File::options()
        .write(true)
        .create_new(true)
        .mode(FILE)
        .open(path);
    match created {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn what_is_private_is_so_from_its_creation_and_what_exists_is_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let state = folder.path().join("above/state");
        create_folder(&state).unwrap();
        assert_eq!(mode(&state), 0o700);
        let file = state.join("file");
        assert!(create_file(&file).unwrap());
        assert_eq!(mode(&file), 0o600);
        for path in [&state, &file] {
            fs::set_permissions(path, fs::Permissions::from_mode(0o750)).unwrap();
        }
        create_folder(&state).unwrap();
        assert!(!create_file(&file).unwrap());
        assert_eq!([mode(&state), mode(&file)], [0o750, 0o750]);
    }
}
