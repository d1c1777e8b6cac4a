//! File lists from a worker.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, BufRead as _, BufReader},
    path::{Path, PathBuf},
};

use crate::{
    database::files::{RootKind, path_text},
    worker::protocol::Listed,
};
use areograph_store::files::Identity;

/// Suffixes of unfinished files.
const UNFINISHED: [&str; 5] = [".part", ".partial", ".tmp", ".filepart", ".crdownload"];

/// Files below a folder by path; those in transfer are left out.
///
/// # Errors
/// The reason for which the list is incomplete, as text.
pub fn read_list(
    list: &Path,
    root: &Path,
    kind: RootKind,
) -> Result<BTreeMap<String, Identity>, String> {
    let mut files = BTreeMap::new();
    let mut whole = false;
    let file = File::open(list).map_err(|error| error.to_string())?;
    for line in BufReader::new(file).lines() {
        let line = line.map_err(|error| error.to_string())?;
        match serde_json::from_str(&line).map_err(|error| error.to_string())? {
            Listed::File { path, identity } => {
                if counts(&path, root, kind) {
                    let path = path_text(&path).map_err(|error| error.to_string())?;
                    files.insert(path.to_owned(), identity);
                }
            }
            // A file that cannot be examined counts as missing; many of them make the folder unavailable.
            Listed::Unreadable { path, problem } => {
                tracing::warn!("{}: {problem}", path.display());
            }
            Listed::Root { problem, .. } => {
                whole = true;
                if let Some(problem) = problem {
                    return Err(problem);
                }
            }
        }
    }
    if whole {
        return Ok(files);
    }
    Err("the file list of the folder is incomplete".to_owned())
}

/// Site files of a folder, in order.
///
/// # Errors
/// The folder cannot be listed.
pub fn site_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let paths = fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut files = paths.collect::<io::Result<Vec<_>>>()?;
    files.retain(|path| counts(path, folder, RootKind::Sites) && path.is_file());
    files.sort();
    Ok(files)
}

/// Whether a file is an input: site files are directly in their folder, and rsync and others give unfinished files
/// recognisable names.
fn counts(path: &Path, root: &Path, kind: RootKind) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let unfinished = name.starts_with('.')
        || name.ends_with('~')
        || UNFINISHED.iter().any(|ending| name.ends_with(ending));
    if unfinished {
        return false;
    }
    kind != RootKind::Sites || (path.parent() == Some(root) && name.ends_with(".toml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn site_files_are_those_of_polls() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.toml", "a.toml", ".c.toml", "d.toml~", "d.geojson"] {
            File::create(folder.path().join(name)).map(drop).unwrap();
        }
        fs::create_dir(folder.path().join("e.toml")).unwrap();
        let expected = ["a.toml", "b.toml"].map(|name| folder.path().join(name));
        assert_eq!(site_files(folder.path()).unwrap(), expected);
        assert!(site_files(&folder.path().join("none")).is_err());
    }

    #[test]
    fn files_under_way_do_not_count() {
        let counts = |path: &str, kind| counts(Path::new(path), Path::new("/m"), kind);
        assert!(counts("/m/ck/mgs_sc_ext1.bc", RootKind::Kernels));
        for name in [
            ".mgs_sc_ext1.bc.Xa8k2F",
            "mgs.bc.part",
            "mgs.bc.tmp",
            "mgs.tf~",
        ] {
            assert!(!counts(&format!("/m/{name}"), RootKind::Kernels), "{name}");
        }
        assert!(counts("/m/gusev.toml", RootKind::Sites));
        assert!(!counts("/m/old/gusev.toml", RootKind::Sites));
        assert!(!counts("/m/gusev.geojson", RootKind::Sites));
    }
}
