//! Paths: existing files and folders, and globs resolved to files.

use std::{
    collections::BTreeMap,
    fmt, fs, io,
    path::{Component, Path, PathBuf},
};

use areograph_base::error::{Error, IoError, Locate as _};
use rustix::fs::{Access, access};
use toml::Value;

use super::{
    declare::{Form, Found, ValueKind},
    problems::{Review, shortened},
};

/// Footprint columns count files in 16 bits.
const FILES_MAX: usize = 65_535;
/// Deepest folder below a named one in which files are found.
pub const DEPTH_MAX: usize = 16;
/// Endings of PEDR files.
pub const PEDR_ENDINGS: &[&str] = &["b"];
/// Endings of tables of shots.
pub const SHOT_TABLE_ENDINGS: &[&str] = &["csv", "tab"];
/// Endings of files of tie points.
pub const TIE_ENDINGS: &[&str] = &["csv", "net", "pvl"];
/// Folders and file name of a glob that may hold wildcards: an archive is `volume/folder/file`.
const WILD_PARTS_MAX: usize = 3;

/// A path of the expected kind, relative to the configuration's folder.
pub(super) struct Place {
    kind: ValueKind,
    suits: fn(&Path) -> bool,
}

/// The path of an existing file.
pub(super) const FILE: Place = Place {
    kind: ValueKind::File,
    suits: Path::is_file,
};
/// The path of an existing folder.
pub(super) const FOLDER: Place = Place {
    kind: ValueKind::Folder,
    suits: Path::is_dir,
};
/// The path of a folder that may be temporarily absent, such as a mirror that is not mounted.
pub(super) const MIRROR: Place = Place {
    kind: ValueKind::Mirror,
    suits: |path| path.metadata().map_or(true, |found| found.is_dir()),
};

impl Form for Place {
    type Value = PathBuf;

    fn kind(&self) -> ValueKind {
        self.kind.clone()
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<PathBuf> {
        let Some(written) = found.value.get_ref().as_str() else {
            found.refuse(review, &self.kind);
            return None;
        };
        let path = review.resolve(written);
        if written.is_empty() {
            found.refuse(
                review,
                format!("{}; an empty string is not a path", self.kind),
            );
        } else if !(self.suits)(&path) {
            if review.may_lack(&path) {
                return Some(path);
            }
            let (span, there) = (found.value.span(), what_is_at(&path));
            let expected = format!("{}; {} is {there}", self.kind, path.display());
            let absent = path
                .metadata()
                .is_err_and(|error| error.kind() == io::ErrorKind::NotFound);
            if absent {
                review.refuse_absent(span, &found.key, expected);
            } else {
                review.refuse(span, &found.key, expected);
            }
        } else if !review.admit(&path, found.value.span(), &found.key) {
            return None;
        }
        // Also a path that leads nowhere, so that its duplicates are reported as well.
        Some(path)
    }

    fn written(&self, value: &PathBuf) -> Value {
        Value::from(value.to_string_lossy().into_owned())
    }
}

/// Kind of the entry at a path, for messages.
fn what_is_at(path: &Path) -> &'static str {
    match path.metadata() {
        Ok(found) if found.is_dir() => "a folder",
        Ok(found) if found.is_file() => "a file",
        Ok(_) => "neither a file nor a folder",
        Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => "not readable",
        Err(_) => "missing",
    }
}

/// All files that the globs match, and files with these endings in and below folders, sorted by path; a file reached twice
/// is taken once.
pub(super) struct Globs(pub(super) &'static [&'static str]);

impl Form for Globs {
    type Value = Vec<PathBuf>;

    fn kind(&self) -> ValueKind {
        ValueKind::List {
            expected: "at least one entry".to_owned(),
            of: Box::new(ValueKind::Glob),
            count: None,
            empty: false,
            distinct: false,
        }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<Vec<PathBuf>> {
        let globs = found.value.get_ref().as_array();
        let Some(globs) = globs.filter(|globs| !globs.is_empty()) else {
            found.refuse(review, self.kind());
            return None;
        };
        let mut by_identity: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
        for written in globs {
            let matched = match written.get_ref().as_str() {
                Some(glob) => matches(&review.resolve(""), glob, self.0),
                None => Err(Unmatched::Other(ValueKind::Glob.to_string())),
            };
            match matched {
                Err(Unmatched::Absent(pattern)) if review.may_lack(&pattern) => {
                    by_identity.insert(pattern.clone(), pattern);
                }
                Err(absent @ Unmatched::Absent(_)) => {
                    review.refuse_absent(written.span(), &found.key, absent);
                }
                Err(expected) => review.refuse(written.span(), &found.key, expected),
                Ok(paths) => {
                    let span = written.span();
                    for path in paths {
                        if !review.admit(&path, span.clone(), &found.key) {
                            break;
                        }
                        // Access is tested without opening: a file that did not change is not opened.
                        if let Err(error) = access(&path, Access::READ_OK) {
                            let error = io::Error::from(error);
                            let expected = format!("readable files; {}: {error}", path.display());
                            review.refuse(span, &found.key, expected);
                            break;
                        }
                        let identity = path.canonicalize().unwrap_or_else(|_| path.clone());
                        by_identity.entry(identity).or_insert(path);
                    }
                }
            }
        }
        if by_identity.len() > FILES_MAX {
            review.problem(
                Some(found.value.span()),
                format!(
                    "{} match {} files; expected at most {FILES_MAX} for one site",
                    found.key,
                    by_identity.len()
                ),
            );
        }
        let mut files: Vec<PathBuf> = by_identity.into_values().collect();
        files.sort();
        Some(files)
    }

    fn written(&self, value: &Vec<PathBuf>) -> Value {
        let paths = value.iter().map(|path| FILE.written(path));
        Value::Array(paths.collect())
    }
}

/// Reasons why a glob gives no files.
enum Unmatched {
    /// No file matches this pattern.
    Absent(PathBuf),
    /// The expectation.
    Other(String),
}

impl From<String> for Unmatched {
    fn from(expected: String) -> Self {
        Self::Other(expected)
    }
}

impl fmt::Display for Unmatched {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Absent(pattern) => {
                let pattern = pattern.display();
                write!(
                    formatter,
                    "a file, a folder or a matching glob; {pattern} matches no file"
                )
            }
            Self::Other(expected) => formatter.write_str(expected),
        }
    }
}

/// A glob that counts from `folder`, whose own name has no wildcards.
pub(super) fn below(folder: &Path, glob: &str) -> String {
    if Path::new(glob).is_absolute() {
        return glob.to_owned();
    }
    let (folder, glob) = shortened(folder, Path::new(glob));
    let folder = glob::Pattern::escape(&folder.to_string_lossy());
    Path::new(&folder).join(glob).to_string_lossy().into_owned()
}

/// Files that one glob matches below `folder`, or what was expected of it.
///
/// * `endings` – of the files that a folder stands for
fn matches(folder: &Path, glob: &str, endings: &[&str]) -> Result<Vec<PathBuf>, Unmatched> {
    // `**` and long rows of wildcards could walk an entire disk.
    let wild_parts = glob
        .split('/')
        .filter(|part| part.contains(['*', '?', '[']))
        .count();
    if glob.contains("**") || wild_parts > WILD_PARTS_MAX {
        return Err(Unmatched::Other(format!(
            "a glob without `**` and with wildcards in at most {WILD_PARTS_MAX} of its parts"
        )));
    }
    let invalid =
        |error: glob::PatternError| format!("a glob: {} at character {}", error.msg, error.pos + 1);
    // Checked separately first, so that the position refers to the written text.
    glob::Pattern::new(glob).map_err(invalid)?;
    let written = below(folder, glob);
    if glob.is_empty() {
        let expected = format!("{}; an empty string is not a path", ValueKind::Glob);
        return Err(Unmatched::Other(expected));
    }
    if folder.join(glob).is_dir() {
        let (folder, glob) = shortened(folder, Path::new(glob));
        return in_folder(&folder.join(glob), endings);
    }
    let found = glob::glob(&written).map_err(invalid)?;
    let mut files = Vec::new();
    for entry in found.take(FILES_MAX + 1) {
        let path = entry.map_err(|error| {
            format!(
                "readable folders; {}: {}",
                error.path().display(),
                error.error()
            )
        })?;
        match path.metadata() {
            Ok(found) if found.is_file() => files.push(path),
            Ok(_) => {}
            // A skipped file would remain undetected.
            Err(error) => {
                return Err(Unmatched::Other(format!(
                    "existing files; {} cannot be accessed: {error}",
                    path.display()
                )));
            }
        }
    }
    if files.is_empty() {
        return Err(Unmatched::Absent(written.into()));
    }
    Ok(files)
}

/// The files of a folder with these endings.
fn in_folder(folder: &Path, endings: &[&str]) -> Result<Vec<PathBuf>, Unmatched> {
    let files = files_in(folder, endings, DEPTH_MAX)
        .map_err(|error| format!("a readable folder; {}: {error}", folder.display()))?;
    if files.is_empty() {
        let expected = format!("a folder that contains files *.{}", endings.join(", *."));
        return Err(Unmatched::Other(expected));
    }
    Ok(files)
}

/// The files with these endings, in upper or lower case, in a folder and in the folders below it, sorted. Links to folders
/// are not followed.
///
/// * `depth` – levels of folders below this one
///
/// # Errors
/// A folder that cannot be listed.
pub fn files_in(folder: &Path, endings: &[&str], depth: usize) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            if depth > 0 {
                files.extend(files_in(&path, endings, depth - 1)?);
            }
            continue;
        }
        let ending = path.extension().unwrap_or_default();
        let is_one = endings.iter().any(|one| ending.eq_ignore_ascii_case(one));
        if is_one && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// An absolute path without `.` and `..`, which lead nowhere after a wildcard or before a folder exists.
///
/// # Errors
/// The current folder cannot be found.
pub fn absolute(path: &Path) -> Result<PathBuf, Error> {
    let path = std::path::absolute(path)
        .map_err(IoError::on("find"))
        .in_file(path)?;
    Ok(without_parents(&path))
}

/// An absolute path without links, as far as it exists: `..` below a link leads elsewhere than the path as written.
///
/// # Errors
/// The current folder cannot be found.
pub fn real(path: &Path) -> Result<PathBuf, Error> {
    let path = absolute(path)?;
    for existing in path.ancestors() {
        if let (Ok(real), Ok(below)) = (existing.canonicalize(), path.strip_prefix(existing)) {
            return Ok(real.join(below));
        }
    }
    Ok(path)
}

/// An absolute path without `.` and `..`, links not followed.
#[must_use]
pub(super) fn without_parents(path: &Path) -> PathBuf {
    let mut steps = PathBuf::new();
    for step in path.components() {
        match step {
            Component::ParentDir => {
                steps.pop();
            }
            step => steps.push(step),
        }
    }
    steps
}

/// `path` relative to `folder`, both absolute; unchanged if they share only the root.
#[must_use]
pub fn seen_from(folder: &Path, path: &Path) -> PathBuf {
    let (here, there): (Vec<Component>, Vec<Component>) =
        (folder.components().collect(), path.components().collect());
    let common = here
        .iter()
        .zip(&there)
        .take_while(|(one, other)| one == other)
        .count();
    if common <= 1 {
        return path.to_owned();
    }
    let back = here[common..].iter().map(|_| Component::ParentDir);
    back.chain(there[common..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_seen_from_the_folder_of_the_file() {
        let seen = |folder: &str, path: &str| seen_from(Path::new(folder), Path::new(path));
        assert_eq!(
            seen("/home/a/sites", "/home/a/pedr/*.b"),
            Path::new("../pedr/*.b")
        );
        assert_eq!(seen("/home/a", "/home/a/k.tm"), Path::new("k.tm"));
        assert_eq!(seen("/home/a/b/c", "/home/d"), Path::new("../../../d"));
        assert_eq!(seen("/home/a", "/data/mola"), Path::new("/data/mola"));
        assert_eq!(
            absolute(Path::new("/a/b/../c/./d")).unwrap(),
            Path::new("/a/c/d")
        );
    }
}
