//! Configured folders of inputs, and paths below them.

use std::path::{Component, Path, PathBuf};

use crate::database::{
    Stored,
    files::{RootKind, is_below, path_text},
};
use areograph_config::ServiceInputs;

/// A folder of inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder {
    /// Its path in the database.
    pub path: String,
    /// Kind of its files.
    pub kind: RootKind,
}

/// The folders of a configuration; one that is named twice has the kind of its first entry.
///
/// # Errors
/// A path is not UTF-8.
pub fn folders(inputs: &ServiceInputs) -> Stored<Vec<Folder>> {
    let kinds = [
        (&inputs.sites, RootKind::Sites),
        (&inputs.kernels, RootKind::Kernels),
        (&inputs.data, RootKind::Data),
    ];
    let mut found: Vec<Folder> = Vec::new();
    for (paths, kind) in kinds {
        for path in paths {
            let path = path_text(&plain(path))?.to_owned();
            if found.iter().all(|folder| folder.path != path) {
                found.push(Folder { path, kind });
            }
        }
    }
    Ok(found)
}

/// A path without `.` and `..`; links are not resolved.
#[must_use]
pub fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
}

/// A file that a site reads, under its path in the folder lists: links may lead there by another way.
#[must_use]
pub fn as_listed(folders: &[Folder], path: &Path) -> Option<String> {
    let below_any = |path: &Path| {
        let text = path.to_str()?;
        let below = folders.iter().any(|folder| is_below(text, &folder.path));
        below.then(|| text.to_owned())
    };
    below_any(&plain(path)).or_else(|| {
        let real = path.canonicalize().ok()?;
        folders.iter().find_map(|folder| {
            let root = Path::new(&folder.path).canonicalize().ok()?;
            let rest = real.strip_prefix(root).ok()?;
            below_any(&Path::new(&folder.path).join(rest))
        })
    })
}

/// The role of a file in a site: `site`, `kernel` or `data`.
#[must_use]
pub fn role(folders: &[Folder], path: &str) -> &'static str {
    let folder = folders.iter().find(|folder| is_below(path, &folder.path));
    match folder.map(|folder| folder.kind) {
        Some(RootKind::Sites) => "site",
        Some(RootKind::Kernels) => "kernel",
        Some(RootKind::Data) | None => "data",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_one_path_however_it_is_reached() {
        let folder = tempfile::tempdir().unwrap();
        let real = folder.path().join("mirror");
        std::fs::create_dir_all(real.join("ck")).unwrap();
        std::fs::File::create(real.join("ck/mgs.bc")).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&real, &link).unwrap();
        let folders = [Folder {
            path: real.to_str().unwrap().to_owned(),
            kind: RootKind::Kernels,
        }];
        let expected = real.join("ck/mgs.bc").to_str().unwrap().to_owned();
        for way in [
            real.join("ck/mgs.bc"),
            folder.path().join("sites/../mirror/./ck/mgs.bc"),
            link.join("ck/mgs.bc"),
        ] {
            assert_eq!(as_listed(&folders, &way), Some(expected.clone()), "{way:?}");
        }
        assert_eq!(as_listed(&folders, Path::new("/elsewhere/mgs.bc")), None);
        assert_eq!(role(&folders, &expected), "kernel");
    }
}
