//! Globs resolved to files.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use toml::Spanned;

use super::super::problems::Review;

/// Footprint columns count files in 16 bits.
const FILES_MAX: usize = 65_535;
/// Folders and file name of a glob that may hold wildcards: an archive is `volume/folder/file`.
const WILD_PARTS_MAX: usize = 3;

/// All files that the globs match, sorted by path; a file reached twice is taken once.
pub(super) fn found_files(
    key: &str,
    globs: &Spanned<Vec<Spanned<String>>>,
    review: &mut Review<'_>,
) -> Vec<PathBuf> {
    review.not_empty(key, globs);
    let mut by_identity: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    for written in globs.get_ref() {
        match matches(&review.resolve(""), written.get_ref()) {
            Err(expected) => review.refuse(written.span(), key, expected),
            Ok(paths) => {
                for path in paths {
                    let identity = path.canonicalize().unwrap_or_else(|_| path.clone());
                    by_identity.entry(identity).or_insert(path);
                }
            }
        }
    }
    if by_identity.len() > FILES_MAX {
        review.problem(
            Some(globs.span()),
            format!(
                "{key} match {} files; expected at most {FILES_MAX} for one site",
                by_identity.len()
            ),
        );
    }
    let mut files: Vec<PathBuf> = by_identity.into_values().collect();
    files.sort();
    files
}

/// Files that one glob matches below `folder`, or what was expected of it.
fn matches(folder: &Path, glob: &str) -> Result<Vec<PathBuf>, String> {
    // `**` and long rows of wildcards could walk a whole disk.
    let wild_parts = glob
        .split('/')
        .filter(|part| part.contains(['*', '?', '[']))
        .count();
    if glob.contains("**") || wild_parts > WILD_PARTS_MAX {
        return Err(format!(
            "a glob without `**` and with wildcards in at most {WILD_PARTS_MAX} of its parts"
        ));
    }
    let invalid =
        |error: glob::PatternError| format!("a glob: {} at character {}", error.msg, error.pos + 1);
    // Checked alone first, so that the position counts in what was written.
    glob::Pattern::new(glob).map_err(invalid)?;
    let pattern = if Path::new(glob).is_absolute() {
        glob.to_owned()
    } else {
        let folder = glob::Pattern::escape(&folder.to_string_lossy());
        Path::new(&folder).join(glob).to_string_lossy().into_owned()
    };
    let found = glob::glob(&pattern).map_err(invalid)?;
    let mut files = Vec::new();
    for entry in found.take(FILES_MAX + 1) {
        let path = entry.map_err(|error| {
            format!(
                "folders that can be read: {}: {}",
                error.path().display(),
                error.error()
            )
        })?;
        if path.is_file() {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(format!(
            "a glob that matches a file; {pattern} matches none"
        ));
    }
    Ok(files)
}
