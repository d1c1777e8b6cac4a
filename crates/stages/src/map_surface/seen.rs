//! The part of a tile that both images show, and its places in both.

use std::ops::Range;

use rayon::prelude::*;

use super::{level::Level, sums::HALF};
use crate::ground::{Field, Sight, Tile};

/// Samples of the ground along the edge of a tile: a thread holds some megabytes of both images.
const TILE: usize = 240;
/// Margin around a tile: half of the compared square, and a sample for slopes.
const MARGIN: usize = HALF + 2;
/// From one to the next of the cells that show whether an image shows some of them.
const APART: usize = 4;

/// Cells that both images may show, and their places in both.
pub(super) struct Seen {
    pub(super) tile: Tile,
    pub(super) sights: [Sight; 2],
}

/// Number of tiles of a level.
pub(super) fn tiles(level: &Level<'_>) -> usize {
    all(level).len()
}

fn all(level: &Level<'_>) -> Vec<Tile> {
    let edge = (TILE / level.per_cell).max(1);
    Tile::all(level.ground.size, edge, level.per_cell, MARGIN)
}

/// The parts of all tiles of a level that both images may show if the ground is within `reach_m` of these
/// heights.
pub(super) fn seen(level: &Level<'_>, heights_m: &Field, reach_m: f64) -> Vec<Seen> {
    let seen = all(level).into_par_iter().filter_map(|tile| {
        let one = near(level, 0, &tile.cells, heights_m, reach_m)?;
        let other = near(level, 1, &tile.cells, heights_m, reach_m)?;
        let cells = [0, 1]
            .map(|axis| one[axis].start.max(other[axis].start)..one[axis].end.min(other[axis].end));
        if cells.iter().any(Range::is_empty) {
            return None;
        }
        let tile = Tile::over(cells, level.per_cell, MARGIN);
        let known_m = tile.sampled(heights_m, level.per_cell);
        let sight = |at: usize| {
            let cells = (&level.ground, level.per_cell);
            let heights_m = (&known_m[..], reach_m);
            Sight::of(level.views[at], level.scale(at), cells, &tile, heights_m)
        };
        let sights = [sight(0)?, sight(1)?];
        Some(Seen { tile, sights })
    });
    seen.collect()
}

/// The smallest rows and columns with all cells that an image may show; `None` if it shows none of them.
fn near(
    level: &Level<'_>,
    image: usize,
    [rows, columns]: &[Range<usize>; 2],
    heights_m: &Field,
    reach_m: f64,
) -> Option<[Range<usize>; 2]> {
    let view = level.views[image];
    let place_above = |[row, column]: [usize; 2], above_m: f64| {
        let [last_row, last_column] = heights_m.size.map(|size| size - 1);
        let known = row.min(last_row) * heights_m.size[1] + column.min(last_column);
        let height_m = f64::from(heights_m.values[known]) + above_m;
        view.place(&level.ground.place_m([row as f64, column as f64], height_m))
    };
    let place = |at| place_above(at, 0.0);
    let middle = [rows, columns].map(|cells| cells.start + cells.len() / 2);
    let here = place(middle)?;
    let down_px = place([middle[0] + APART, middle[1]])? - here;
    let right_px = place([middle[0], middle[1] + APART])? - here;
    let moved_px = place_above(middle, reach_m)? - here;
    // A cell is closer than the first two terms to the one that stands for it, and a height moves it by the last.
    let room_px = down_px.norm() + right_px.norm() + moved_px.norm();
    let size_px = view.size_px();
    let mut near: Option<[Range<usize>; 2]> = None;
    for row in rows.clone().step_by(APART) {
        for column in columns.clone().step_by(APART) {
            let Some(place) = place([row, column]) else {
                continue;
            };
            let behind = size_px - place;
            let edge_px = place.x.min(place.y).min(behind.x).min(behind.y);
            if edge_px < -room_px {
                continue;
            }
            let here =
                [(row, rows), (column, columns)].map(|(at, cells)| at..(at + APART).min(cells.end));
            near = Some(match near {
                None => here,
                Some(near) => [0, 1].map(|axis| {
                    near[axis].start.min(here[axis].start)..near[axis].end.max(here[axis].end)
                }),
            });
        }
    }
    near
}
