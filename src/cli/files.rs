//! Files that a command line names: by their paths, by folders, or by globs.

use std::path::{Path, PathBuf};

use crate::{
    config::{DEPTH_MAX, PEDR_ENDINGS, SHOT_TABLE_ENDINGS, TIE_ENDINGS, files_in},
    error::{Cause, IoError, Locate as _, Result},
};

/// A kind of files.
pub(super) struct FileKind {
    /// What such a file is.
    what: &'static str,
    /// Endings of the files in a folder that are named by it, in upper or lower case.
    endings: &'static [&'static str],
    /// Whether a folder also names files in the folders below it.
    below: bool,
}

/// Site files, and others that describe a flow.
pub(super) const CONFIGURATIONS: FileKind = FileKind {
    what: "configuration file",
    endings: &["toml"],
    below: false,
};
/// Files of the laser.
pub(super) const PEDR_FILES: FileKind = FileKind {
    what: "PEDR file",
    endings: PEDR_ENDINGS,
    below: true,
};
/// Tables of the Orbital Data Explorer.
pub(super) const SHOT_TABLES: FileKind = FileKind {
    what: "table of shots",
    endings: SHOT_TABLE_ENDINGS,
    below: true,
};
/// Labels apart from images.
pub(super) const LABELS: FileKind = FileKind {
    what: "label",
    endings: &["lbl"],
    below: false,
};
/// Image files, with or without labels.
pub(super) const IMAGES: FileKind = FileKind {
    what: "image file",
    endings: &["imq", "img", "cub", "tif", "tiff", "png"],
    below: false,
};
/// Tie points.
pub(super) const TIES: FileKind = FileKind {
    what: "tie point file",
    endings: TIE_ENDINGS,
    below: true,
};

/// Reasons why a path names no file.
#[derive(Debug, thiserror::Error, Cause)]
enum NoFiles {
    #[error("the folder contains no {what} (*.{})", .endings.join(", *."))]
    #[cause(Input: "name another folder, or the files")]
    Folder {
        what: &'static str,
        endings: &'static [&'static str],
    },
    #[error("the glob matches no {0}")]
    #[cause(Input: "check the path")]
    Glob(&'static str),
    #[error("malformed glob: {0}")]
    #[cause(Configuration: "write *, ? or [..], or name the files")]
    Malformed(glob::PatternError),
}

/// The files that these paths name, in the order of the paths, those of a folder or of a glob sorted. A path that
/// does not exist is kept: opening it reports the reason.
///
/// # Errors
/// A folder or a glob without such a file; a folder that cannot be listed.
pub(super) fn expand(paths: &[PathBuf], kind: &FileKind) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            files.extend(in_folder(path, kind).in_file(path)?);
        } else if !path.exists() && path.to_string_lossy().contains(['*', '?', '[']) {
            files.extend(matched(path, kind).in_file(path)?);
        } else {
            files.push(path.clone());
        }
    }
    Ok(files)
}

/// Ensures that every path is a file or folder.
///
/// # Errors
/// A path that does not exist.
pub(super) fn exist(paths: &[PathBuf]) -> Result<()> {
    paths.iter().try_for_each(|path| {
        std::fs::metadata(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        Ok(())
    })
}

fn in_folder(folder: &Path, kind: &FileKind) -> Result<Vec<PathBuf>> {
    let depth = if kind.below { DEPTH_MAX } else { 0 };
    let files = files_in(folder, kind.endings, depth).map_err(IoError::on("list"))?;
    if files.is_empty() {
        return Err(NoFiles::Folder {
            what: kind.what,
            endings: kind.endings,
        }
        .into());
    }
    Ok(files)
}

/// The files that a glob matches, sorted.
fn matched(pattern: &Path, kind: &FileKind) -> Result<Vec<PathBuf>> {
    let found = glob::glob(&pattern.to_string_lossy()).map_err(NoFiles::Malformed)?;
    let mut files = Vec::new();
    for entry in found {
        let path = entry.map_err(|error| IoError::on("list")(error.into()))?;
        if path.is_file() {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(NoFiles::Glob(kind.what).into());
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_globs_stand_for_their_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("year[1]")).unwrap();
        for name in ["b.B", "a.b", "a.lbl", "year[1]/c.b"] {
            std::fs::File::create(path(name)).unwrap();
        }
        let named = |paths: &[PathBuf], kind| {
            let files = expand(paths, kind).map_err(|failure| failure.to_string())?;
            let below = files.iter().map(|file| file.strip_prefix(folder.path()));
            Ok::<_, String>(
                below
                    .map(|file| file.unwrap().display().to_string())
                    .collect::<Vec<_>>()
                    .join(" "),
            )
        };
        let all = named(&[folder.path().to_owned()], &PEDR_FILES);
        assert_eq!(all.unwrap(), "a.b b.B year[1]/c.b");
        assert_eq!(named(&[path("*.b")], &PEDR_FILES).unwrap(), "a.b");
        // A name with the letters of a glob.
        assert_eq!(
            named(&[path("year[1]/c.b")], &PEDR_FILES).unwrap(),
            "year[1]/c.b"
        );
        // A file that does not exist is kept.
        assert_eq!(named(&[path("d.b")], &PEDR_FILES).unwrap(), "d.b");
        for (wrong, expected) in [
            ("year[1]", "the folder contains no label (*.lbl)"),
            ("*.txt", "the glob matches no label"),
            ("***", "malformed glob"),
        ] {
            let failure = named(&[path(wrong)], &LABELS).unwrap_err();
            assert!(failure.contains(expected), "{failure}");
        }
    }
}
