//! Shots that the site's files hold twice: a copy of a file is read once, versions of one orbit are refused.

use std::{collections::BTreeMap, path::PathBuf};

use crate::{
    error::{Cause, Error, Kind, Result},
    footprints::{AsRead, Footprints, SourceFile},
    time::Et,
};

/// Half the time between two shots of the laser, seconds: shots of two files that lie nearer to each
/// other are one shot, even if a later version of the file moved its time tag.
const SAME_SHOT_S: f64 = 0.05;

/// Two files with the same shots, of which neither is a copy of the other.
#[derive(Debug, thiserror::Error)]
#[error(
    "holds {shots} shot(s) in the windows that {other} holds as well, the first in record {record} \
     (there in record {other_record}, orbit {orbit}) at {at}"
)]
struct SharedShots {
    shots: u64,
    other: String,
    record: u32,
    other_record: u32,
    orbit: u32,
    at: Et,
}

impl Cause for SharedShots {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "name only one of the two in pedr.files: every shot counts once, and only you can say which \
         version of an orbit is meant"
            .to_owned()
    }
}

/// The earliest file by the hash of its bytes.
#[derive(Default)]
pub(super) struct Copies(BTreeMap<String, usize>);

impl Copies {
    /// The file, counted from 0, that file `index` is a copy of: equal bytes, understood alike.
    pub(super) fn original_of(
        &mut self,
        index: usize,
        source: &SourceFile,
        earlier: &[SourceFile],
    ) -> Option<usize> {
        let first = *self.0.entry(source.blake3.clone()).or_insert(index);
        earlier
            .get(first)
            .is_some_and(|original| original.datum == source.datum)
            .then_some(first)
    }
}

/// Makes sure that no two files hold the same shot; `paths` are those that `file` counts into.
///
/// # Errors
/// The two files whose common shot is the earliest.
pub(super) fn require_distinct(footprints: &Footprints<AsRead>, paths: &[PathBuf]) -> Result<()> {
    let tag_s = |row: usize| footprints.et_tag_s[row];
    let mut rows: Vec<usize> = (0..footprints.len()).collect();
    // Files come in order of time, so that there is little to sort; equal times stay in their order.
    rows.sort_by(|a, b| tag_s(*a).total_cmp(&tag_s(*b)));
    let files = |pair: &[usize]| {
        let (one, other) = (footprints.file[pair[0]], footprints.file[pair[1]]);
        (one.min(other), one.max(other))
    };
    let mut shared = rows.windows(2).filter(|pair| {
        footprints.file[pair[0]] != footprints.file[pair[1]]
            && tag_s(pair[1]) - tag_s(pair[0]) <= SAME_SHOT_S
    });
    let Some(first) = shared.next() else {
        return Ok(());
    };
    let others = shared.filter(|pair| files(pair) == files(first)).count();
    let (earlier, later) = if footprints.file[first[0]] < footprints.file[first[1]] {
        (first[0], first[1])
    } else {
        (first[1], first[0])
    };
    let path = |row: usize| &paths[usize::from(footprints.file[row])];
    let error = SharedShots {
        shots: others as u64 + 1,
        other: path(earlier).display().to_string(),
        record: footprints.record[later],
        other_record: footprints.record[earlier],
        orbit: footprints.orbit[later],
        at: Et::from_seconds(tag_s(later)),
    };
    Err(Error::from(error).in_file(path(later)))
}
