//! Image coordinates of the samples of a tile: exact at nodes, interpolated between them.

use std::ops::Range;

use nalgebra::{Matrix2, Vector2};

use super::{Field, Ground};
use crate::image_view::View;

/// Samples from node to node. Over as many pixels an orientation bends by less than a thousandth of one.
const STEP: usize = 16;
/// Least height to either side of the middle at which nodes are computed, metres.
const HEIGHTS_MIN_M: f64 = 60.0;

/// Some cells, and the samples of the ground that matching them needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Tile {
    /// Rows and columns of cells.
    pub(crate) cells: [Range<usize>; 2],
    /// First sample along both axes, counted from the first of the first cell, and their numbers.
    pub(crate) first: [i64; 2],
    pub(crate) size: [usize; 2],
}

impl Tile {
    /// Tiles over `size` cells, each of at most `edge` cells along an edge, with `margin` samples around them.
    pub(crate) fn all(size: [usize; 2], edge: usize, per_cell: usize, margin: usize) -> Vec<Self> {
        let spans = size.map(|length| {
            let starts = (0..length).step_by(edge);
            starts.map(move |start| start..(start + edge).min(length))
        });
        let [rows, columns] = spans;
        let columns: Vec<Range<usize>> = columns.collect();
        let tile = |rows: Range<usize>, columns: Range<usize>| {
            let cells = [rows, columns];
            let signed = |of: usize| i64::try_from(of).unwrap_or(i64::MAX);
            Self {
                first: [0, 1].map(|axis| signed(cells[axis].start * per_cell) - signed(margin)),
                size: [0, 1].map(|axis| cells[axis].len() * per_cell + 2 * margin),
                cells,
            }
        };
        rows.flat_map(|rows| {
            let of_row = columns
                .iter()
                .map(|columns| tile(rows.clone(), columns.clone()));
            of_row.collect::<Vec<_>>()
        })
        .collect()
    }

    /// Row and column of cells of a sample, 0 in the middle of the first cell.
    pub(crate) fn cell_of(&self, [line, sample]: [usize; 2], per_cell: usize) -> [f64; 2] {
        let of = |axis: usize, at: usize| {
            (self.first[axis] as f64 + at as f64 + 0.5) / per_cell as f64 - 0.5
        };
        [of(0, line), of(1, sample)]
    }

    /// A field at all samples.
    pub(crate) fn sampled(&self, field: &Field, per_cell: usize) -> Vec<f32> {
        let mut sampled = Vec::with_capacity(self.size[0] * self.size[1]);
        for line in 0..self.size[0] {
            for sample in 0..self.size[1] {
                let [row, column] = self.cell_of([line, sample], per_cell);
                sampled.push(field.between(row, column));
            }
        }
        sampled
    }

    /// Every cell with its row-by-row number in a grid of `columns`, and the sample in its middle.
    pub(crate) fn middles(
        &self,
        per_cell: usize,
        columns: usize,
    ) -> impl Iterator<Item = (usize, [usize; 2])> + '_ {
        let margin = [0, 1].map(|axis| (self.size[axis] - self.cells[axis].len() * per_cell) / 2);
        let middle =
            move |axis: usize, at: usize| margin[axis] + at * per_cell + (per_cell - 1) / 2;
        let [rows, columns_here] = &self.cells;
        rows.clone().enumerate().flat_map(move |(down, row)| {
            columns_here
                .clone()
                .enumerate()
                .map(move |(right, column)| {
                    (row * columns + column, [middle(0, down), middle(1, right)])
                })
        })
    }
}

/// Lines and samples of an image, at its level, of every sample of a tile: three powers of the height above the middle.
pub(crate) struct Sight {
    middle_m: f64,
    powers: Vec<[Vector2<f64>; 3]>,
    /// Lines and samples of the image at the level.
    size_px: Vector2<f64>,
    /// Pixels of the image for a sample of the ground along each axis.
    pub(crate) px_per_sample: Matrix2<f64>,
    /// Displacement in the image for a metre of height, samples of the ground.
    pub(crate) shift_per_m: Vector2<f64>,
}

impl Sight {
    /// `None` where the orientation gives no place for the middle of the tile.
    pub(crate) fn of(
        view: &View<'_>,
        scale: f64,
        (ground, per_cell): (&Ground, usize),
        tile: &Tile,
        heights_m: &[f32],
    ) -> Option<Self> {
        let ends = heights_m.iter().fold([f64::MAX, f64::MIN], |ends, height| {
            let height_m = f64::from(*height);
            [ends[0].min(height_m), ends[1].max(height_m)]
        });
        let middle_m = 0.5 * (ends[0] + ends[1]);
        let half_m = HEIGHTS_MIN_M.max(0.5 * (ends[1] - ends[0]));
        let node = |at: [usize; 2]| -> Option<[Vector2<f64>; 3]> {
            let cell = tile.cell_of(at, per_cell);
            let place = |height_m: f64| {
                let place_m = ground.place_m(cell, height_m);
                view.place(&place_m).map(|place| place / scale)
            };
            let [low, here, high] = [
                place(middle_m - half_m)?,
                place(middle_m)?,
                place(middle_m + half_m)?,
            ];
            Some([
                here,
                (high - low) / (2.0 * half_m),
                (high + low - 2.0 * here) / (2.0 * half_m * half_m),
            ])
        };
        let counts = tile.size.map(|length| length.div_ceil(STEP) + 1);
        let nowhere = [Vector2::repeat(f64::NAN); 3];
        let nodes: Vec<[Vector2<f64>; 3]> = (0..counts[0])
            .flat_map(|down| (0..counts[1]).map(move |right| [down * STEP, right * STEP]))
            .map(|at| node(at).unwrap_or(nowhere))
            .collect();
        let middle = tile.size.map(|length| length / 2);
        let [here, below, beside] = [
            node(middle)?,
            node([middle[0] + STEP, middle[1]])?,
            node([middle[0], middle[1] + STEP])?,
        ];
        let step = STEP as f64;
        let px_per_sample =
            Matrix2::from_columns(&[(below[0] - here[0]) / step, (beside[0] - here[0]) / step]);
        Some(Self {
            middle_m,
            powers: between(&nodes, counts, tile.size),
            size_px: view.size_px() / scale,
            shift_per_m: px_per_sample.try_inverse()? * here[1],
            px_per_sample,
        })
    }

    /// Line and sample of the image for a sample of the tile at a height.
    pub(crate) fn place_px(&self, at: usize, height_m: f64) -> Vector2<f64> {
        let [here, first, second] = self.powers[at];
        let above_m = height_m - self.middle_m;
        here + above_m * (first + above_m * second)
    }

    /// Lines and samples that hold all samples of the tile up to `reach_m` above and below these heights, and `room_px` around.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "negative numbers become 0"
    )]
    pub(crate) fn spans_px(
        &self,
        heights_m: &[f32],
        reach_m: f64,
        room_px: f64,
    ) -> [Range<usize>; 2] {
        let (mut low, mut high) = (Vector2::repeat(f64::MAX), Vector2::repeat(f64::MIN));
        for (at, height_m) in heights_m.iter().enumerate() {
            for above_m in [-reach_m, reach_m] {
                let place = self.place_px(at, f64::from(*height_m) + above_m);
                // NaN changes nothing.
                low = low.zip_map(&place, f64::min);
                high = high.zip_map(&place, f64::max);
            }
        }
        [0, 1].map(|axis| {
            let start = (low[axis] - room_px).max(0.0) as usize;
            start..((high[axis] + room_px).max(0.0) as usize).max(start)
        })
    }

    /// Distance of a sample from the nearest edge of the image, pixels of its level; below 0 beyond, and where there is no place.
    pub(crate) fn edge_px(&self, at: usize, height_m: f64) -> f64 {
        let place = self.place_px(at, height_m);
        let behind = self.size_px - place;
        let nearest = place.x.min(place.y).min(behind.x).min(behind.y);
        if nearest.is_nan() || place.iter().any(|of| of.is_nan()) {
            return -1.0;
        }
        nearest
    }
}

/// Values of all samples, interpolated between nodes.
fn between(
    nodes: &[[Vector2<f64>; 3]],
    counts: [usize; 2],
    size: [usize; 2],
) -> Vec<[Vector2<f64>; 3]> {
    let mixed = |one: &[Vector2<f64>; 3], other: &[Vector2<f64>; 3], share: f64| {
        [0, 1, 2].map(|power| one[power] + share * (other[power] - one[power]))
    };
    let mut samples = Vec::with_capacity(size[0] * size[1]);
    for line in 0..size[0] {
        let (node, down) = (line / STEP, (line % STEP) as f64 / STEP as f64);
        let rows = [node, node + 1].map(|row| &nodes[row * counts[1]..(row + 1) * counts[1]]);
        let across = rows[0].iter().zip(rows[1]);
        let row: Vec<_> = across.map(|(one, other)| mixed(one, other, down)).collect();
        for sample in 0..size[1] {
            let (node, right) = (sample / STEP, (sample % STEP) as f64 / STEP as f64);
            samples.push(mixed(&row[node], &row[node + 1], right));
        }
    }
    samples
}
