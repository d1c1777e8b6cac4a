//! Output files of a command, checked against its inputs and against each other.

use std::{
    fs,
    os::unix::fs::MetadataExt as _,
    path::{Component, Path, PathBuf, absolute},
};

use areograph_base::error::{Cause, Locate, Result};

/// Identity of a file, independent of its names.
#[derive(Debug, PartialEq, Eq)]
enum Place {
    /// Device and inode.
    Node(u64, u64),
    /// The future path of a file that does not exist yet.
    Path(PathBuf),
}

impl Place {
    fn of(path: &Path) -> Self {
        if let Ok(metadata) = fs::metadata(path) {
            return Self::Node(metadata.dev(), metadata.ino());
        }
        let whole = absolute(path).unwrap_or_else(|_| path.to_owned());
        let folder = whole.parent().and_then(|folder| folder.canonicalize().ok());
        Self::Path(match (folder, whole.file_name()) {
            (Some(folder), Some(name)) => folder.join(name),
            _ => whole,
        })
    }
}

/// A file that would be overwritten.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration: "give the output file a different name or folder")]
enum Overwritten {
    #[error("would be written over the input {0}; expected a different file")]
    Input(PathBuf),
    #[error("would be written twice, also as {0}; expected a different file for each output")]
    Output(PathBuf),
}

/// Ensures that no file of `outputs` is one of `inputs` or another output, under any name or link. Files that do not
/// exist are compared by their paths.
///
/// # Errors
/// A conflict, of kind configuration; both files are named.
pub fn require_apart<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<()> {
    let inputs: Vec<(&Path, Place)> = inputs
        .into_iter()
        .map(|path| (path, Place::of(path)))
        .collect();
    let mut earlier: Vec<(&Path, Place)> = Vec::new();
    for output in outputs {
        let place = Place::of(output);
        let same = |(_, other): &&(&Path, Place)| *other == place;
        if let Some((input, _)) = inputs.iter().find(same) {
            return Err(Overwritten::Input((*input).to_owned())).in_file(output);
        }
        if let Some((other, _)) = earlier.iter().find(same) {
            return Err(Overwritten::Output((*other).to_owned())).in_file(output);
        }
        earlier.push((output, place));
    }
    Ok(())
}

/// A path without links, `.` and `..`; parts that do not exist yet remain as they are written.
#[must_use]
pub fn real_path(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() {
        Path::new(".")
    } else {
        path
    };
    let whole = absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut missing = Vec::new();
    for existing in whole.ancestors() {
        if let Ok(real) = existing.canonicalize() {
            return missing.into_iter().rev().fold(real, |mut path, part| {
                match part {
                    Component::ParentDir => drop(path.pop()),
                    part => path.push(part),
                }
                path
            });
        }
        missing.extend(existing.components().next_back());
    }
    whole
}

/// Whether one of two folders is or holds the other, under any name or link.
#[must_use]
pub fn overlap(one: &Path, other: &Path) -> bool {
    let (one, other) = (real_path(one), real_path(other));
    one.starts_with(&other) || other.starts_with(&one)
}

/// An entry that a file would replace.
#[derive(Debug, thiserror::Error, Cause)]
#[error("is {0}; expected a file or a new path")]
#[cause(Configuration: "name a file in a folder: a file is written under a temporary name and then renamed, which \
    would replace the existing entry")]
struct NotAFile(&'static str);

/// Ensures that `path` is free or a regular file.
///
/// # Errors
/// `path` is a link, a folder, a device, a pipe or a socket.
pub(super) fn require_replaceable(path: &Path) -> Result<()> {
    use std::os::unix::fs::FileTypeExt as _;
    let found = match fs::symlink_metadata(path) {
        Ok(metadata) => metadata.file_type(),
        // The writer of the file reports problems of its folder.
        Err(_) => return Ok(()),
    };
    let what = match found {
        found if found.is_file() => return Ok(()),
        found if found.is_symlink() => "a link",
        found if found.is_dir() => "a folder",
        found if found.is_fifo() => "a pipe",
        found if found.is_socket() => "a socket",
        _ => "a device",
    };
    Err(NotAFile(what)).in_file(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_overlap_under_every_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir_all(path("kernels/spk")).unwrap();
        std::os::unix::fs::symlink(path("kernels"), path("linked")).unwrap();
        assert!(overlap(
            &path("kernels"),
            &path("kernels/spk/../new/products")
        ));
        assert!(overlap(&path("linked/new"), &path("kernels")));
        assert!(overlap(&path("kernels"), &path(".")));
        assert!(!overlap(&path("kernels"), &path("kernels.new")));
        assert!(!overlap(&path("kernels/spk"), &path("linked/spk/../new")));
    }
}
