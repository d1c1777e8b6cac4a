//! Rejection of stray cells of a level, and the surface through the others.

use rayon::prelude::*;

use super::{Cell, Found};
use crate::ground::Field;
use areograph_base::ties::Unmatched;

/// Half the edge of the square of neighbours of a cell.
const HALF: usize = 2;
/// Smallest share of the found neighbours that must be near.
///
/// # Source
/// Square, share and distance as Ames Stereo Pipeline filters by (rm-half-kernel 5, rm-min-matches 60, rm-threshold 3), in a
/// square as large on the ground.
const NEAR_SHARE_MIN: f64 = 0.6;
/// Largest difference of near heights, samples of parallax.
const NEAR: f64 = 3.0;
/// Minimum number of found neighbours.
const NEIGHBOURS_MIN: usize = 4;

/// Leaves out cells that most of their neighbours contradict; `sample_m` is the height of one sample of parallax.
pub(super) fn without_strays(cells: &[Cell], size: [usize; 2], sample_m: f64) -> Vec<Cell> {
    let [rows, columns] = size;
    let judged = cells.par_iter().enumerate().map(|(at, cell)| {
        let Some(Ok(found)) = cell else {
            return *cell;
        };
        let span = |at: usize, length: usize| at.saturating_sub(HALF)..(at + HALF + 1).min(length);
        let (mut near, mut all) = (0_usize, 0_usize);
        for row in span(at / columns, rows) {
            for column in span(at % columns, columns) {
                let neighbour = row * columns + column;
                if let Some(Ok(other)) = &cells[neighbour]
                    && neighbour != at
                {
                    all += 1;
                    let apart_m = (other.height_m - found.height_m).abs();
                    near += usize::from(apart_m <= NEAR * sample_m);
                }
            }
        }
        let stays = all >= NEIGHBOURS_MIN && near as f64 >= NEAR_SHARE_MIN * all as f64;
        if stays {
            *cell
        } else {
            Some(Err(Unmatched::Alone))
        }
    });
    judged.collect()
}

/// A number of the cells that were found as a field without holes, smoothed over squares of `2 half + 1` cells; `before` where
/// none was found.
#[allow(
    clippy::cast_possible_truncation,
    reason = "planetary heights keep millimetre precision"
)]
pub(super) fn field(
    cells: &[Cell],
    before: &Field,
    half: usize,
    of: impl Fn(&Found) -> f64,
) -> Field {
    if !cells.iter().any(|cell| matches!(cell, Some(Ok(_)))) {
        return before.clone();
    }
    let size = before.size;
    let value = |cell: &Cell| match cell {
        Some(Ok(found)) => of(found) as f32,
        _ => f32::NAN,
    };
    let values = cells.iter().map(value).collect();
    Field { size, values }.filled().smoothed(half)
}
