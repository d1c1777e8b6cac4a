//! Files as a worker listed them.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufRead as _, BufReader},
    path::Path,
};

use serde::Deserialize;

use crate::service::database::files::{Identity, RootKind};

/// How names of files end that are being written.
const UNFINISHED: [&str; 5] = [".part", ".partial", ".tmp", ".filepart", ".crdownload"];

#[derive(Debug, Deserialize)]
struct Listed {
    path: String,
    #[serde(flatten)]
    identity: Identity,
}

/// Files below a folder by path; those that are being transferred are left out.
///
/// # Errors
/// The list cannot be read.
pub fn read_list(
    list: &Path,
    root: &str,
    kind: RootKind,
) -> std::io::Result<BTreeMap<String, Identity>> {
    let mut files = BTreeMap::new();
    for line in BufReader::new(File::open(list)?).lines() {
        let listed: Listed = serde_json::from_str(&line?)?;
        if counts(Path::new(&listed.path), Path::new(root), kind) {
            files.insert(listed.path, listed.identity);
        }
    }
    Ok(files)
}

/// Whether a file is an input: site files lie directly in their folder, and rsync and others name unfinished files so that
/// they can be told.
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
    fn files_under_way_do_not_count() {
        let counts = |path: &str, kind| counts(Path::new(path), Path::new("/m"), kind);
        assert!(counts("/m/ck/mgs_sc_ext1.bc", RootKind::Kernels));
        for name in [".mgs_sc_ext1.bc.Xa8k2F", "mgs.bc.part", "mgs.bc.tmp", "mgs.tf~"] {
            assert!(!counts(&format!("/m/{name}"), RootKind::Kernels), "{name}");
        }
        assert!(counts("/m/gusev.toml", RootKind::Sites));
        assert!(!counts("/m/old/gusev.toml", RootKind::Sites));
        assert!(!counts("/m/gusev.geojson", RootKind::Sites));
    }
}
