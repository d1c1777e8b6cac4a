//! The results of files, put together: in the order of time, and every shot once.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use super::checker::Results;
use crate::{
    error::{Cause, Error, Kind},
    files::{Identity, file_name},
    stages::check_archive::{ArchiveProfile, CheckedFile, FileCopy, FileFailure},
};

/// Half the time between two shots, seconds: shots of two files nearer to each other are one shot.
const SAME_SHOT_S: f64 = 0.05;

/// What files gave.
pub(super) struct Gathered {
    /// Files in the order of their first shots.
    pub(super) files: Vec<CheckedFile>,
    /// Copies of other files.
    pub(super) copies: Vec<FileCopy>,
    /// Why files are left out.
    pub(super) failures: Vec<Error>,
}

/// A file whose shots another one holds as well.
#[derive(Debug, thiserror::Error)]
#[error("holds shots of orbit {orbit} that {} holds as well; its shots do not count", .other.display())]
struct SharedShots {
    orbit: u32,
    other: PathBuf,
}

impl Cause for SharedShots {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "name only one of the two, or move the other one away: every shot counts once, and only you can say which version of \
         an orbit is meant"
            .to_owned()
    }
}

/// Puts results of files together; of files that share shots the first by its path stays.
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

/// Takes out files with the bytes of an earlier one, understood alike.
fn without_copies(files: &mut Vec<CheckedFile>) -> Vec<FileCopy> {
    let mut by_content: BTreeMap<_, PathBuf> = BTreeMap::new();
    let mut copies = Vec::new();
    files.retain(|file| {
        let content = (file.found.blake3.clone(), file.found.datum);
        match by_content.get(&content) {
            None => {
                by_content.insert(content, file.path.clone());
                true
            }
            Some(original) => {
                copies.push(FileCopy {
                    file: file.path.display().to_string(),
                    of: original.display().to_string(),
                });
                false
            }
        }
    });
    copies
}

/// Takes out files with profiles in the time of profiles of an earlier one.
fn without_rivals(files: &mut Vec<CheckedFile>) -> Vec<Error> {
    let overlaps = overlaps(files);
    let mut out: BTreeMap<usize, Error> = BTreeMap::new();
    for ((file, earlier), orbit) in overlaps {
        if !out.contains_key(&earlier) && !out.contains_key(&file) {
            let other = files[earlier].path.clone();
            let failure = Error::from(SharedShots { orbit, other });
            out.insert(file, failure.in_file(&files[file].path));
        }
    }
    let mut index = 0..;
    files.retain(|_| index.next().is_some_and(|index| !out.contains_key(&index)));
    out.into_values().collect()
}

/// Every file with an earlier one whose profiles overlap with its own, and the orbit of its first profile that does.
fn overlaps(files: &[CheckedFile]) -> BTreeMap<(usize, usize), u32> {
    let mut all: Vec<(usize, &ArchiveProfile)> = Vec::new();
    for (index, file) in files.iter().enumerate() {
        all.extend(file.found.profiles.iter().map(|profile| (index, profile)));
    }
    all.sort_by(|(_, a), (_, b)| a.tags_et_s[0].total_cmp(&b.tags_et_s[0]));
    let mut overlaps = BTreeMap::new();
    let mut open: Vec<(usize, &ArchiveProfile)> = Vec::new();
    for (file, profile) in all {
        open.retain(|(_, of)| profile.tags_et_s[0] < of.tags_et_s[1] + SAME_SHOT_S);
        for (other, of) in open.iter().filter(|(other, _)| *other != file) {
            let (later, orbit) = if file > *other {
                (file, profile.orbit)
            } else {
                (*other, of.orbit)
            };
            overlaps.entry((later, file.min(*other))).or_insert(orbit);
        }
        open.push((file, profile));
    }
    overlaps
}

/// Files of equal names in several folders are told apart by their paths.
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

/// A failure as products tell it.
pub(super) fn file_failure(failure: &Error) -> FileFailure {
    FileFailure {
        file: failure.file.as_deref().map(file_name).unwrap_or_default(),
        why: failure.cause.to_string(),
    }
}
