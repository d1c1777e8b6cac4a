//! `[pedr]`: globs resolved to files, datum, filters.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use toml::Spanned;

use crate::{frames::MarsDatum, units::RADIANS_PER_DEGREE};

use super::{
    super::{
        problems::Review,
        raw::{RawFilter, RawPedr},
        site::{DatumChoice, PedrConfig, ShotFilter},
    },
    values::Accept,
};

/// Footprint columns count files in 16 bits.
const FILES_MAX: usize = 65_535;
/// Folders and file name of a glob that may hold wildcards: an archive is `volume/folder/file`.
const WILD_PARTS_MAX: usize = 3;

const DATUMS: [(&str, DatumChoice); 4] = [
    ("auto", DatumChoice::Auto),
    ("iau1991", DatumChoice::Stated(MarsDatum::Iau1991)),
    ("iau1994", DatumChoice::Stated(MarsDatum::Iau1994)),
    ("iau2000", DatumChoice::Stated(MarsDatum::Iau2000)),
];

pub(super) fn pedr(raw: Option<Spanned<RawPedr>>, review: &mut Review<'_>) -> PedrConfig {
    let table = raw.as_ref().map(Spanned::span);
    let raw = raw.map(Spanned::into_inner).unwrap_or_default();
    if table.is_some() && raw.files.is_none() {
        review.missing(
            table,
            "pedr.files",
            "paths or globs of PEDR files (or no table pedr at all)",
        );
    }
    PedrConfig {
        files: raw
            .files
            .map(|globs| found_files(&globs, review))
            .unwrap_or_default(),
        datum: review
            .word("pedr.datum", raw.datum.as_ref(), &DATUMS)
            .unwrap_or(DatumChoice::Auto),
        filter: filter(&raw.filter.unwrap_or_default(), review),
    }
}

/// All files that the globs match, sorted by path; a file reached twice is taken once.
fn found_files(globs: &Spanned<Vec<Spanned<String>>>, review: &mut Review<'_>) -> Vec<PathBuf> {
    review.not_empty("pedr.files", globs);
    let mut by_identity: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    for written in globs.get_ref() {
        match matches(&review.resolve(""), written.get_ref()) {
            Err(expected) => review.refuse(written.span(), "pedr.files", expected),
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
                "pedr.files match {} files; expected at most {FILES_MAX} for one site",
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

fn filter(raw: &RawFilter, review: &mut Review<'_>) -> ShotFilter {
    ShotFilter {
        classes: review.whole_list(
            "pedr.filter.classes",
            raw.classes.as_ref(),
            (i16::MIN, i16::MAX),
            &[1],
        ),
        channels: review.whole_list(
            "pedr.filter.channels",
            raw.channels.as_ref(),
            (1, 4),
            &[1, 2, 3, 4],
        ),
        // Flags 2 and 3 say that the footprint assumes nadir pointing: off nadir it can be
        // 100 km from where the laser struck.
        attitude_flags: review.whole_list(
            "pedr.filter.attitude_flags",
            raw.attitude_flags.as_ref(),
            (u16::MIN, u16::MAX),
            &[0, 1],
        ),
        off_nadir_max_rad: RADIANS_PER_DEGREE
            * review.number(
                "pedr.filter.off_nadir_max_deg",
                &raw.off_nadir_max_deg,
                Accept::AboveTo(0.0, 90.0),
                90.0,
            ),
    }
}
