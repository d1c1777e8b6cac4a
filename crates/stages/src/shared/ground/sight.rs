//! Image coordinates of the samples of a tile: exact at nodes, interpolated between them.

use std::ops::Range;

use nalgebra::{Matrix2, Vector2};

use super::{
    Ground,
    field::{Between, Field},
};
use crate::image_view::View;

/// Samples from node to node. Over as many pixels an orientation bends by less than a thousandth of one.
const STEP: usize = 16;
/// Samples behind a node.
const AT: [f32; STEP] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];
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
            Self::over([rows, columns], per_cell, margin)
        };
        rows.flat_map(|rows| {
            let of_row = columns
                .iter()
                .map(|columns| tile(rows.clone(), columns.clone()));
            of_row.collect::<Vec<_>>()
        })
        .collect()
    }

    /// The tile of these rows and columns of cells, with `margin` samples around them.
    pub(crate) fn over(cells: [Range<usize>; 2], per_cell: usize, margin: usize) -> Self {
        let signed = |of: usize| i64::try_from(of).unwrap_or(i64::MAX);
        Self {
            first: [0, 1].map(|axis| signed(cells[axis].start * per_cell) - signed(margin)),
            size: [0, 1].map(|axis| cells[axis].len() * per_cell + 2 * margin),
            cells,
        }
    }

    /// Row and column of cells of a sample, 0 in the middle of the first cell.
    pub(crate) fn cell_of(&self, [line, sample]: [usize; 2], per_cell: usize) -> [f64; 2] {
        let of = |axis: usize, at: usize| {
            (self.first[axis] as f64 + at as f64 + 0.5) / per_cell as f64 - 0.5
        };
        [of(0, line), of(1, sample)]
    }

    /// The samples of a line among all samples.
    pub(crate) const fn line(&self, line: usize) -> Range<usize> {
        line * self.size[1]..(line + 1) * self.size[1]
    }

    /// A field at all samples.
    pub(crate) fn sampled(&self, field: &Field, per_cell: usize) -> Vec<f32> {
        let [rows, columns] = [0, 1].map(|axis| {
            let samples = (0..self.size[axis]).map(|at| {
                let cell = self.cell_of([at; 2], per_cell)[axis];
                Between::of(cell, field.size[axis])
            });
            samples.collect::<Vec<Between>>()
        });
        let mut sampled = Vec::with_capacity(self.size[0] * self.size[1]);
        let mut mixed = vec![0.0; field.size[1]];
        for row in &rows {
            row.row_of(field, &columns, &mut mixed);
            sampled.extend(columns.iter().map(|column| column.of_row(&mixed)));
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

/// Lines and samples of an image, at its level, of every sample of a tile: at nodes three powers of the height above the
/// middle.
pub(crate) struct Sight {
    middle_m: f64,
    nodes: Vec<Powers>,
    /// Nodes in a row of them.
    columns: usize,
    /// Lines and samples of the image at the level.
    pub(crate) size_px: Vector2<f64>,
    /// Pixels of the image for a sample of the ground along each axis.
    pub(crate) px_per_sample: Matrix2<f64>,
    /// Displacement in the image for a metre of height, samples of the ground.
    pub(crate) shift_per_m: Vector2<f64>,
}

/// Line and sample at the middle height, and their changes with the height and its square.
type Powers = [Vector2<f64>; 3];

impl Sight {
    /// Over the range of these heights and `reach_m` beyond it; `None` where the orientation gives no place for the middle of
    /// the tile.
    pub(crate) fn of(
        view: &View<'_>,
        scale: f64,
        (ground, per_cell): (&Ground, usize),
        tile: &Tile,
        (heights_m, reach_m): (&[f32], f64),
    ) -> Option<Self> {
        let ends_m = heights_m.iter().copied().fold(NOTHING, stretched);
        let [low_m, high_m] = ends_m.map(f64::from);
        let middle_m = 0.5 * (low_m + high_m);
        let half_m = HEIGHTS_MIN_M.max(0.5 * (high_m - low_m) + reach_m);
        let node = |at: [usize; 2]| -> Option<Powers> {
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
        let nodes = (0..counts[0])
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
            nodes,
            columns: counts[1],
            size_px: view.size_px() / scale,
            shift_per_m: px_per_sample.try_inverse()? * here[1],
            px_per_sample,
        })
    }

    /// Line and sample of the image for a sample of the tile at a height.
    fn place_px(&self, [line, sample]: [usize; 2], height_m: f64) -> Vector2<f64> {
        let node = |right: usize| self.between_rows(line, sample / STEP + right);
        place(
            &mixed(&node(0), &node(1), share(sample)),
            height_m - self.middle_m,
        )
    }

    /// A node between rows of nodes.
    fn between_rows(&self, line: usize, column: usize) -> Powers {
        let above = line / STEP * self.columns + column;
        mixed(
            &self.nodes[above],
            &self.nodes[above + self.columns],
            share(line),
        )
    }

    /// Lines and samples of the image for the samples of a line of the tile, `above_m` above their heights, from the middle
    /// of the pixel `first` on.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a tile shows few pixels and little height"
    )]
    pub(crate) fn places_px(
        &self,
        line: usize,
        (heights_m, above_m): (&[f32], f64),
        first: [i64; 2],
        [lines, samples]: [&mut [f32]; 2],
    ) {
        let from = Vector2::from_fn(|axis, _| first[axis] as f64 + 0.5);
        let below_m = (self.middle_m - above_m) as f32;
        let pieces = heights_m.chunks(STEP).enumerate();
        let pieces = pieces.zip(lines.chunks_mut(STEP).zip(samples.chunks_mut(STEP)));
        for ((column, heights_m), (lines, samples)) in pieces {
            let mut ends = [column, column + 1].map(|column| self.between_rows(line, column));
            for end in &mut ends {
                end[0] -= from;
            }
            for (axis, places) in [lines, samples].into_iter().enumerate() {
                let start = ends[0].map(|power| power[axis] as f32);
                let step: [f32; 3] = std::array::from_fn(|power| {
                    ((ends[1][power][axis] - ends[0][power][axis]) / STEP as f64) as f32
                });
                let known = heights_m.iter().zip(&AT);
                for (place, (height_m, at)) in places.iter_mut().zip(known) {
                    let above_m = height_m - below_m;
                    let here = start[0] + at * step[0];
                    let first = start[1] + at * step[1];
                    let second = start[2] + at * step[2];
                    *place = here + above_m * (first + above_m * second);
                }
            }
        }
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
        tile: &Tile,
    ) -> [Range<usize>; 2] {
        let (mut low, mut high) = (Vector2::repeat(f64::MAX), Vector2::repeat(f64::MIN));
        let width = tile.size[1];
        for (row, band) in heights_m.chunks(STEP * width).enumerate() {
            let mut of_samples = vec![NOTHING; width];
            for line in band.chunks_exact(width) {
                for (ends, height_m) in of_samples.iter_mut().zip(line) {
                    *ends = stretched(*ends, *height_m);
                }
            }
            for (column, of_samples) in of_samples.chunks(STEP).enumerate() {
                let [least_m, most_m] = of_samples.iter().fold(NOTHING, |ends, of_sample| {
                    stretched(stretched(ends, of_sample[0]), of_sample[1])
                });
                if least_m > most_m {
                    continue;
                }
                let [least_m, most_m] = [least_m, most_m].map(f64::from);
                let first = row * self.columns + column;
                let corners = [
                    first,
                    first + 1,
                    first + self.columns,
                    first + self.columns + 1,
                ];
                for corner in corners {
                    for height_m in [least_m - reach_m, most_m + reach_m] {
                        let place = place(&self.nodes[corner], height_m - self.middle_m);
                        // NaN changes nothing.
                        low = low.zip_map(&place, f64::min);
                        high = high.zip_map(&place, f64::max);
                    }
                }
            }
        }
        [0, 1].map(|axis| {
            let start = (low[axis] - room_px).max(0.0) as usize;
            start..((high[axis] + room_px).max(0.0) as usize).max(start)
        })
    }

    /// Distance of a sample from the nearest edge of the image, pixels of its level; below 0 beyond, and where there is no place.
    pub(crate) fn edge_px(&self, at: [usize; 2], height_m: f64) -> f64 {
        let place = self.place_px(at, height_m);
        let behind = self.size_px - place;
        let nearest = place.x.min(place.y).min(behind.x).min(behind.y);
        if nearest.is_nan() || place.iter().any(|of| of.is_nan()) {
            return -1.0;
        }
        nearest
    }
}

/// Ends of no numbers.
const NOTHING: [f32; 2] = [f32::MAX, f32::MIN];

/// Least and largest number with another one, which NaN does not change.
fn stretched([low, high]: [f32; 2], number: f32) -> [f32; 2] {
    [
        if number < low { number } else { low },
        if number > high { number } else { high },
    ]
}

/// Share of the way from one node to the next.
fn share(at: usize) -> f64 {
    (at % STEP) as f64 / STEP as f64
}

fn mixed(one: &Powers, other: &Powers, share: f64) -> Powers {
    [0, 1, 2].map(|power| one[power] + share * (other[power] - one[power]))
}

fn place([here, first, second]: &Powers, above_m: f64) -> Vector2<f64> {
    here + above_m * (first + above_m * second)
}
