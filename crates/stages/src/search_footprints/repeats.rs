//! Shots that two of the site's files hold: versions of one orbit are refused.

use std::path::PathBuf;

use areograph_base::{
    error::{Cause, Error, Result},
    footprints::{AsRead, Footprints},
    time::Et,
};
use areograph_pds::archive::Seen;

/// Two files with the same shots, of which neither is a copy of the other.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "contains {shots} shot(s) in the windows that {other} also contains, the first in record {record} (record \
     {other_record} in the other file, orbit {orbit}) at {at}"
)]
#[cause(Input: "name only one of the two files in pedr.files: every shot counts once, and areograph cannot decide \
    which version of an orbit is intended")]
struct SharedShots {
    shots: usize,
    other: String,
    record: u32,
    other_record: u32,
    orbit: u32,
    at: Et,
}

/// Makes sure that no two files hold the same shot; `file` is an index into `paths`.
///
/// # Errors
/// The two files whose common shot is the earliest.
pub(super) fn require_distinct(footprints: &Footprints<AsRead>, paths: &[PathBuf]) -> Result<()> {
    let (tags_s, files) = (&footprints.et_tag_s, &footprints.file);
    let mut seen = Seen::default();
    let shared: Vec<(usize, usize)> = (0..footprints.len())
        .filter_map(|row| Some((row, seen.take(usize::from(files.at(row)), tags_s.at(row))?)))
        .collect();
    let earliest = (shared.iter()).min_by(|(a, _), (b, _)| tags_s.at(*a).total_cmp(&tags_s.at(*b)));
    let Some((row, other)) = earliest.copied() else {
        return Ok(());
    };
    let is_of_both =
        |(of, with): &&(usize, usize)| files.at(*of) == files.at(row) && *with == other;
    let apart_s = |of: &usize| (tags_s.at(*of) - tags_s.at(row)).abs();
    let others = (0..footprints.len()).filter(|of| usize::from(files.at(*of)) == other);
    let other_row = others.min_by(|a, b| apart_s(a).total_cmp(&apart_s(b)));
    let error = SharedShots {
        shots: shared.iter().filter(is_of_both).count(),
        other: paths[other].display().to_string(),
        record: footprints.record.at(row),
        other_record: footprints.record.at(other_row.unwrap_or(row)),
        orbit: footprints.orbit.at(row),
        at: Et::from_seconds(tags_s.at(row)),
    };
    Err(Error::from(error).in_file(&paths[usize::from(files.at(row))]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_testing::shot_cases::{CASES, path};

    #[test]
    fn files_with_the_same_shots_are_refused() {
        for case in CASES {
            let paths: Vec<PathBuf> = (0..case.files.len()).map(path).collect();
            let mut footprints = Footprints::new(Vec::new());
            for file in 0..case.files.len() {
                footprints.append(case.footprints(file));
            }
            let refused = require_distinct(&footprints, &paths).err();
            let named = refused.map(|error| (error.file.clone(), error.cause.to_string()));
            case.judge(named, &paths);
        }
    }
}
