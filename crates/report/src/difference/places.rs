//! Positions on the ground in both runs, for maps of movements.

use std::{collections::BTreeMap, path::Path};

use nalgebra::Vector3;

use areograph_base::error::Result;
use areograph_products::read::read_adjusted_ties;

/// A place in the first run and in the second, IAU 2000, metres.
pub type Moved = [Vector3<f64>; 2];

/// Number of places kept per kind.
const KEPT: usize = 400;

/// At most `KEPT` of `moved`, evenly chosen in order.
pub(super) fn some_of(moved: impl ExactSizeIterator<Item = Moved>) -> Vec<Moved> {
    let step = moved.len().div_ceil(KEPT).max(1);
    moved.step_by(step).collect()
}

/// Adjusted tie points of both runs, by their identifiers; empty if a run has none.
pub(super) fn ties(a: &Path, b: &Path) -> Result<Vec<Moved>> {
    let file = "ties.parquet";
    let files = [a, b].map(|folder| folder.join(file));
    if !files.iter().all(|file| file.is_file()) {
        return Ok(Vec::new());
    }
    let [first, second] = [&files[0], &files[1]].map(|file| read_adjusted_ties(file));
    let second: BTreeMap<String, Vector3<f64>> = second?.into_iter().collect();
    let both = first?
        .into_iter()
        .filter_map(|(tie, from)| Some([from, *second.get(&tie)?]));
    let both: Vec<Moved> = both.collect();
    Ok(some_of(both.into_iter()))
}
