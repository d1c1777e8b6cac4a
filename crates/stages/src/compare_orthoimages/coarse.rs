//! Places searched from coarse cells to fine ones, where one window of fine cells would be large.
//!
//! At every level, a square of as many cells as at full size is searched; it covers more ground, so that a peak that is distinct in
//! coarse cells is more significant. The first level covers the complete window, the following ones the surroundings of the peak.

use super::{DISTINCT, EDGE, HALF, ROOM};
use crate::raster::{Raster, Reduced};
use areograph_geom::imaging::search;

/// Widest window that is searched at once, cells to either side.
const AT_ONCE: u32 = 2 * ROOM;
/// Cells of a level along a cell of the next coarser one.
const STEP: u32 = 4;
/// Cells to either side of a peak of the coarser level: one of its cells, and the width of a peak.
pub(super) const NEAR: u32 = STEP + 2;

/// Two orthoimages in coarser and coarser cells.
pub(super) struct Levels {
    /// Edge of a cell, cells of the orthoimages, and both orthoimages; the coarsest last.
    each: Vec<(u32, [Reduced; 2])>,
}

impl Levels {
    /// Levels down to a window of `reach` cells that is searched at once; empty if it is at full size.
    pub(super) fn of(orthoimages: [&Raster<'_>; 2], reach: u32) -> Self {
        let mut each = Vec::new();
        let mut factor = 1;
        while reach > factor * AT_ONCE {
            factor *= STEP;
            each.push((factor, orthoimages.map(|of| of.reduced(factor))));
        }
        Self { each }
    }

    /// Edges of the cells of the levels, cells of the orthoimages.
    #[cfg(test)]
    pub(super) fn edges(&self) -> Vec<u32> {
        self.each.iter().map(|(edge, _)| *edge).collect()
    }

    /// The shift of a place within `reach` of the shift `by`, within [`NEAR`]; `None` where no level decides: a square that is
    /// not complete, or no distinct peak.
    pub(super) fn near(&self, middle: [i64; 2], by: [i64; 2], reach: u32) -> Option<[i64; 2]> {
        let (coarsest, _) = self.each.last()?;
        // A cell more, because the shift is not a number of coarse cells.
        let mut cells = reach.div_ceil(*coarsest) + 1;
        let mut near = by;
        for (factor, [one, other]) in self.each.iter().rev() {
            let step = i64::from(*factor);
            let template =
                one.square(middle.map(|at| at.div_euclid(step) - i64::from(HALF)), EDGE)?;
            let there = [0, 1].map(|axis| (middle[axis] + near[axis]).div_euclid(step));
            let corner = there.map(|at| at - i64::from(HALF + cells));
            let area = other.square(corner, EDGE + 2 * cells)?;
            let peak = search(&template, &area)?;
            let inside = 1..2 * cells as usize;
            let is_found = peak.at.iter().all(|at| inside.contains(at))
                && peak.correlation - peak.second >= DISTINCT;
            if !is_found {
                return None;
            }
            near = [0, 1]
                .map(|axis| (corner[axis] + peak.at[axis] as i64 - template.first[axis]) * step);
            cells = NEAR;
        }
        Some(near)
    }
}
