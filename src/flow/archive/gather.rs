//! The results of files, combined: in time order, and every shot once.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use super::checker::Results;
use crate::{
    error::{Cause, Error},
    files::{Identity, file_name},
    pds::archive::{Copies, Seen, Span},
    stages::check_archive::{ArchiveProfile, CheckedFile, FileCopy, FileFailure},
};

/// Results of files.
pub(super) struct Gathered {
    /// Files in the order of their first shots.
    pub(super) files: Vec<CheckedFile>,
    /// Copies of other files.
    pub(super) copies: Vec<FileCopy>,
    /// Reasons why files are left out.
    pub(super) failures: Vec<Error>,
}

/// A file whose shots another file contains as well.
#[derive(Debug, thiserror::Error, Cause)]
#[error("contains shots of orbit {orbit} that {} also contains; this file is not used", .other.display())]
#[cause(Input: "name only one of the two files, or move one of them away: every shot counts once, and areograph cannot \
    decide which version of an orbit is meant")]
struct SharedShots {
    orbit: u32,
    other: PathBuf,
}

/// Combines results of files; of files that share shots, the first by its path is kept.
pub(super) fn gather(
    paths: &[PathBuf],
    identities: &BTreeMap<usize, Identity>,
    results: Results,
    mut failures: Vec<Error>,
) -> Gathered {
    let mut files: Vec<CheckedFile> = Vec::new();
    for (file, result) in results {
        match result {
            Ok(found) => files.push(CheckedFile {
                path: paths[file].clone(),
                identity: identities[&file],
                found,
            }),
            Err(failure) => failures.push(failure),
        }
    }
    let copies = without_copies(&mut files);
    failures.extend(without_rivals(&mut files));
    tell_apart(&mut files);
    let first_s = |file: &CheckedFile| {
        let first = file.found.profiles.first();
        first.map_or(f64::INFINITY, |profile| profile.start_et_s)
    };
    files.sort_by(|a, b| first_s(a).total_cmp(&first_s(b)));
    Gathered {
        files,
        copies,
        failures,
    }
}

/// Removes files with the bytes of an earlier file, read alike.
fn without_copies(files: &mut Vec<CheckedFile>) -> Vec<FileCopy> {
    let paths: Vec<PathBuf> = files.iter().map(|file| file.path.clone()).collect();
    let mut by_content = Copies::default();
    let mut copies = Vec::new();
    let mut index = 0..;
    files.retain(|CheckedFile { path, found, .. }| {
        let index = index.next().unwrap_or_default();
        let datum = found.datum;
        let original = datum.and_then(|datum| by_content.original_of(index, &found.blake3, datum));
        copies.extend(original.map(|original| FileCopy {
            file: path.display().to_string(),
            of: paths[original].display().to_string(),
        }));
        original.is_none()
    });
    copies
}

/// Removes files with shots that an earlier file contains as well.
fn without_rivals(files: &mut Vec<CheckedFile>) -> Vec<Error> {
    let paths: Vec<PathBuf> = files.iter().map(|file| file.path.clone()).collect();
    let mut seen = Seen::default();
    let mut failures = Vec::new();
    let mut index = 0..;
    files.retain(|CheckedFile { path, found, .. }| {
        let shared = enter(&mut seen, index.next().unwrap_or_default(), &found.profiles);
        failures.extend(shared.map(|(orbit, other)| {
            let other = paths[other].clone();
            Error::from(SharedShots { orbit, other }).in_file(path)
        }));
        shared.is_none()
    });
    failures
}

/// Enters the shots of a file, unless an earlier file contains some of them: the orbit of the first such profile, and
/// that file.
fn enter(seen: &mut Seen, file: usize, profiles: &[ArchiveProfile]) -> Option<(u32, usize)> {
    let spans: Vec<(u32, Span)> = profiles
        .iter()
        .flat_map(|profile| {
            let spans = profile.spans_et_s.iter();
            spans.map(|[first_s, last_s]| {
                let [first_s, last_s] = [*first_s, *last_s];
                let span = Span {
                    file,
                    first_s,
                    last_s,
                };
                (profile.orbit, span)
            })
        })
        .collect();
    let shared = (spans.iter()).find_map(|(orbit, span)| Some((*orbit, seen.holder(span)?)));
    if shared.is_none() {
        for (_, span) in spans {
            seen.add(span);
        }
    }
    shared
}

/// Files of equal names in several folders are distinguished by their paths.
fn tell_apart(files: &mut [CheckedFile]) {
    let mut seen = BTreeSet::new();
    let names = files.iter().map(|file| file_name(&file.path));
    let twice: BTreeSet<String> = names.filter(|name| !seen.insert(name.clone())).collect();
    for file in files {
        if twice.contains(&file.found.file) {
            let path = file.path.display().to_string();
            for profile in &mut file.found.profiles {
                profile.file.clone_from(&path);
            }
            file.found.file = path;
        }
    }
}

/// A failure in the form of products.
pub(super) fn file_failure(failure: &Error) -> FileFailure {
    FileFailure {
        file: failure.file.as_deref().map(file_name).unwrap_or_default(),
        why: failure.cause.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_testing::shot_cases::CASES;

    use crate::pds::archive::spans;

    #[test]
    fn a_file_with_shots_of_an_earlier_one_is_left_out() {
        for case in CASES {
            let mut seen = Seen::default();
            let mut files = 0..case.files.len();
            let shared = files.find_map(|file| {
                let spans = spans(file, case.tags_s(file));
                let profile = ArchiveProfile {
                    spans_et_s: spans.iter().map(|of| [of.first_s, of.last_s]).collect(),
                    ..ArchiveProfile::default()
                };
                let (_, other) = enter(&mut seen, file, &[profile])?;
                Some([other, file])
            });
            assert_eq!(shared, case.shared, "{}", case.name);
        }
    }
}
