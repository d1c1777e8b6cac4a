//! Movement of footprints.

use std::{cmp::Ordering, collections::BTreeMap, path::Path};

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

use super::{
    movement::{Component, ROUNDING, Size},
    places::{Moved, some_of},
};
use areograph_base::error::Result;
use areograph_products::read::{FootprintRows, read_footprints};

/// Footprints of both runs, matched by file, orbit, record and shot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct FootprintsDifference {
    /// Number of footprints common to both runs.
    pub matched: usize,
    /// Number of footprints only in the first run.
    pub only_in_a: usize,
    /// Number of footprints only in the second run.
    pub only_in_b: usize,
    /// Movement of the footprints in both runs; missing if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub movement: Option<FootprintsMovement>,
}

/// Movement of the footprints that are in both runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FootprintsMovement {
    /// Number of footprints that moved by more than rounding.
    pub moved: usize,
    /// Distance between the positions in both runs, with raw radii.
    pub distance_m: Size,
    /// Change of the height above the areoid, after the crossover correction.
    pub topography_m: Component,
    /// Change of the corrected shot time.
    pub time_s: Component,
    /// Shot whose footprint moved farthest; missing if none moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub farthest: Option<ShotName>,
    /// A sample of the shots.
    #[serde(skip)]
    pub places: Vec<Moved>,
}

/// Which shot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ShotName {
    /// PEDR file.
    pub source_file: String,
    /// Orbit.
    pub orbit: u32,
    /// Record in the file, counted from 1.
    #[schemars(range(min = 1))]
    pub record: u32,
    /// Shot in the frame.
    #[schemars(range(min = 1, max = 20))]
    pub shot: u32,
}

impl FootprintsDifference {
    /// Whether a footprint moved, or is in one run only.
    #[must_use]
    pub fn moved(&self) -> bool {
        let moved = |movement: &FootprintsMovement| {
            movement.moved > 0 || movement.topography_m.moved() || movement.time_s.moved()
        };
        self.only_in_a + self.only_in_b > 0 || self.movement.as_ref().is_some_and(moved)
    }
}

/// Reads and compares the footprints in two folders.
pub(super) fn between(a: &Path, b: &Path) -> Result<FootprintsDifference> {
    const FILE: &str = "footprints.parquet";
    let (a, b) = (
        read_footprints(&a.join(FILE))?,
        read_footprints(&b.join(FILE))?,
    );
    Ok(difference(&a, &b))
}

/// Row of `a` and row of `b`.
type Pair = (usize, usize);

fn difference(a: &FootprintRows, b: &FootprintRows) -> FootprintsDifference {
    let pairs = matched(a, b);
    FootprintsDifference {
        matched: pairs.len(),
        only_in_a: a.len() - pairs.len(),
        only_in_b: b.len() - pairs.len(),
        movement: movement(a, b, &pairs),
    }
}

fn movement(a: &FootprintRows, b: &FootprintRows, pairs: &[Pair]) -> Option<FootprintsMovement> {
    let distance_m = |(first, second): &Pair| {
        (Vector3::from(b.xyz_m[*second]) - Vector3::from(a.xyz_m[*first])).norm()
    };
    let change = |a: &[f64], b: &[f64]| {
        Component::of(pairs.iter().map(|(first, second)| b[*second] - a[*first]))
    };
    // The first of several equal movements.
    let (mut farthest, mut farthest_m) = (None, ROUNDING);
    for pair in pairs {
        if distance_m(pair) > farthest_m {
            (farthest, farthest_m) = (Some(pair.0), distance_m(pair));
        }
    }
    pairs.first()?;
    Some(FootprintsMovement {
        moved: pairs
            .iter()
            .filter(|pair| distance_m(pair) > ROUNDING)
            .count(),
        distance_m: Size::of(pairs.iter().map(distance_m)),
        topography_m: change(&a.topography_m, &b.topography_m),
        time_s: change(&a.et_s, &b.et_s),
        farthest: farthest.map(|row| shot_name(a, row)),
        places: some_of(pairs.iter().map(|(first, second)| {
            [
                Vector3::from(a.xyz_m[*first]),
                Vector3::from(b.xyz_m[*second]),
            ]
        })),
    })
}

fn shot_name(rows: &FootprintRows, row: usize) -> ShotName {
    ShotName {
        source_file: rows.files[rows.file[row] as usize].clone(),
        orbit: rows.orbit[row],
        record: rows.record[row],
        shot: rows.shot[row],
    }
}

/// Place of the file's name among all names, orbit, record, shot.
type Identity = (usize, u32, u32, u32);

/// Rows of shots in both; shots shared by two files of one name are paired in order.
fn matched(a: &FootprintRows, b: &FootprintRows) -> Vec<Pair> {
    let names: BTreeMap<&str, usize> = a
        .files
        .iter()
        .chain(&b.files)
        .map(|name| (&**name, 0))
        .collect();
    let places: BTreeMap<&str, usize> = names.into_keys().zip(0..).collect();
    let (a, b) = (ordered(a, &places), ordered(b, &places));
    let (mut first, mut second) = (a.iter().peekable(), b.iter().peekable());
    let mut pairs = Vec::new();
    while let (Some((identity_a, row_a)), Some((identity_b, row_b))) = (first.peek(), second.peek())
    {
        let order = identity_a.cmp(identity_b);
        if order == Ordering::Equal {
            pairs.push((*row_a, *row_b));
        }
        if order != Ordering::Greater {
            first.next();
        }
        if order != Ordering::Less {
            second.next();
        }
    }
    pairs
}

/// Identities with their rows, in order.
fn ordered(rows: &FootprintRows, places: &BTreeMap<&str, usize>) -> Vec<(Identity, usize)> {
    let file_places: Vec<usize> = rows.files.iter().map(|name| places[&**name]).collect();
    let mut identities: Vec<(Identity, usize)> = (0..rows.len())
        .map(|row| {
            let file = file_places[rows.file[row] as usize];
            (
                (file, rows.orbit[row], rows.record[row], rows.shot[row]),
                row,
            )
        })
        .collect();
    identities.sort_unstable();
    identities
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of (file, record, x); every shot is the third of orbit 7.
    fn rows(files: &[&str], shots: &[(u32, u32, f64)]) -> FootprintRows {
        let n = shots.len();
        FootprintRows {
            files: files.iter().map(|name| (*name).to_owned()).collect(),
            file: shots.iter().map(|shot| shot.0).collect(),
            orbit: vec![7; n],
            record: shots.iter().map(|shot| shot.1).collect(),
            shot: vec![3; n],
            et_s: vec![0.0; n],
            xyz_m: shots.iter().map(|shot| [shot.2, 0.0, 0.0]).collect(),
            topography_m: shots.iter().map(|shot| shot.2 / 2.0).collect(),
        }
    }

    #[test]
    fn shots_are_matched_by_what_they_are_and_not_by_row() {
        let a = rows(
            &["k.b", "l.b"],
            &[(0, 11, 1.0), (1, 11, 2.0), (1, 12, 3.0), (1, 14, 9.0)],
        );
        let b = rows(
            &["l.b", "k.b"],
            &[(0, 12, 3.5), (0, 13, 7.0), (1, 11, 1.0), (0, 11, 2.0)],
        );
        let found = difference(&a, &b);
        assert_eq!((found.matched, found.only_in_a, found.only_in_b), (3, 1, 1));
        let movement = found.movement.unwrap();
        assert_eq!(movement.moved, 1);
        assert!((movement.distance_m.max - 0.5).abs() < 1e-12); // metres, exact in binary
        assert!((movement.distance_m.mean - 0.5 / 3.0).abs() < 1e-12);
        assert!((movement.topography_m.mean - 0.25 / 3.0).abs() < 1e-12);
        let farthest = movement.farthest.unwrap();
        assert_eq!((&*farthest.source_file, farthest.record), ("l.b", 12));
    }

    #[test]
    fn two_files_of_one_name_keep_their_order() {
        let a = rows(&["k.b"], &[(0, 11, 1.0), (0, 11, 5.0)]);
        let found = difference(&a, &a);
        assert_eq!(found.matched, 2);
        assert!(!found.moved());
        let none = difference(&rows(&[], &[]), &rows(&[], &[]));
        assert_eq!(none, FootprintsDifference::default());
    }
}
