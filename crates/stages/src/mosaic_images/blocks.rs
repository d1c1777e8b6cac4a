//! Blocks of cells of a mosaic: what overlapping orthoimages show in them.

#![allow(
    clippy::cast_possible_wrap,
    reason = "numbers of cells of a map are far below 2⁶³"
)]

use rayon::prelude::*;

use super::{
    balance::{Histogram, Overlap, Tone, balanced},
    seams::{Blocks, Set, marker},
};
use crate::{
    raster::{Raster, first_cell},
    rectify_images::Orthoimage,
};
use areograph_base::{error::Result, watch::Watch};
use areograph_geom::height_grid::HeightGrid;

/// Cells along the smallest block, and largest number of blocks.
const EDGE: usize = 4;
const BLOCKS_MAX: usize = 1 << 22;
/// Parts of a grey value in which differences count.
const PARTS: u32 = 8;

/// What is decided of a mosaic before it is written.
pub(super) struct Survey {
    pub(super) blocks: Blocks,
    /// Cells along a block.
    pub(super) edge: usize,
    /// The tone of every orthoimage.
    pub(super) tones: Vec<Tone>,
}

/// Orthoimages on the blocks of a map.
struct Grid<'a> {
    rasters: Vec<Raster<'a>>,
    first: [i64; 2],
    size: [usize; 2],
    edge: usize,
}

impl Survey {
    pub(super) fn of(
        map: &HeightGrid,
        orthoimages: &[Orthoimage],
        is_balanced: bool,
        inside_m: impl Fn(usize, [f64; 2]) -> f64 + Sync,
        watch: Watch<'_>,
    ) -> Result<Self> {
        let mut edge = EDGE;
        let blocks = |edge: usize| map.size.map(|length| length.div_ceil(edge));
        while blocks(edge)[0] * blocks(edge)[1] > BLOCKS_MAX {
            edge *= 2;
        }
        let rasters = orthoimages
            .iter()
            .map(|of| Raster::of(&of.account.map, &of.brightness));
        let grid = Grid {
            rasters: rasters.collect(),
            first: first_cell(map),
            size: blocks(edge),
            edge,
        };
        let count = orthoimages.len();
        let tones = if is_balanced {
            balanced(count, &grid.overlaps(watch)?)
        } else {
            vec![Tone::UNCHANGED; count]
        };
        let tables: Vec<[u8; 256]> = tones.iter().map(Tone::table).collect();
        let middle = 0.5 * (edge as f64 - 1.0);
        let place_rad = |[row, column]: [usize; 2]| {
            map.place_rad([row, column].map(|at| (at * edge) as f64 + middle))
        };
        let [rows, columns] = grid.size;
        let of_rows = (0..rows).into_par_iter().map(|row| {
            watch.check()?;
            let blocks = (0..columns).map(|column| {
                let block = [row, column];
                let shown = grid.shown(block);
                let distances = shown
                    .each()
                    .map(|of| (of, inside_m(usize::from(of), place_rad(block))));
                let marker = marker(&distances.collect::<Vec<_>>());
                (grid.difference(block, shown, &tables), shown, marker)
            });
            Ok(blocks.collect::<Vec<_>>())
        });
        let of_rows: Vec<Vec<(u8, Set, u8)>> = of_rows.collect::<Result<_>>()?;
        let mut blocks = Blocks {
            size: grid.size,
            differences: Vec::with_capacity(rows * columns),
            shown: Vec::with_capacity(rows * columns),
            markers: Vec::with_capacity(rows * columns),
        };
        for (difference, shown, marker) in of_rows.into_iter().flatten() {
            blocks.differences.push(difference);
            blocks.shown.push(shown);
            blocks.markers.push(marker);
        }
        Ok(Self {
            blocks,
            edge,
            tones,
        })
    }
}

impl Grid<'_> {
    /// The cells of a block.
    fn cells(&self, block: [usize; 2]) -> impl Iterator<Item = [i64; 2]> + use<> {
        let first = [0, 1].map(|axis| self.first[axis] + (block[axis] * self.edge) as i64);
        let span = move |axis: usize, edge: usize| first[axis]..first[axis] + edge as i64;
        let edge = self.edge;
        span(0, edge).flat_map(move |row| span(1, edge).map(move |column| [row, column]))
    }

    /// Sum of the brightness of an orthoimage in a block, and number of its cells.
    fn sum(&self, of: usize, block: [usize; 2]) -> [u32; 2] {
        let pixels = self.cells(block).map(|cell| self.rasters[of].at(cell));
        pixels.fold([0; 2], |[sum, count], pixel| {
            [sum + u32::from(pixel), count + u32::from(pixel > 0)]
        })
    }

    /// The orthoimages that show at least half of a block.
    fn shown(&self, block: [usize; 2]) -> Set {
        let mut shown = Set::default();
        for (number, of) in (0_u8..).zip(0..self.rasters.len()) {
            let [_, count] = self.sum(of, block);
            if 2 * count as usize >= self.edge * self.edge {
                shown.insert(number);
            }
        }
        shown
    }

    /// The largest mean difference of two of the orthoimages that show a block, in parts of a grey value, at most 255.
    #[allow(clippy::cast_possible_truncation, reason = "at most 255")]
    fn difference(&self, block: [usize; 2], shown: Set, tables: &[[u8; 256]]) -> u8 {
        let pairs = shown.each().flat_map(|one| {
            shown
                .each()
                .filter(move |other| *other > one)
                .map(move |other| [one, other])
        });
        let mean = |pair: [u8; 2]| {
            let pair = pair.map(usize::from);
            let mut sums = [0_u32; 2];
            for cell in self.cells(block) {
                let [one, other] =
                    pair.map(|of| tables[of][usize::from(self.rasters[of].at(cell))]);
                if one > 0 && other > 0 {
                    sums = [sums[0] + u32::from(one.abs_diff(other)), sums[1] + 1];
                }
            }
            (PARTS * sums[0] / sums[1].max(1)).min(255) as u8
        };
        pairs.map(mean).max().unwrap_or_default()
    }

    /// Brightness of every pair of orthoimages in the blocks that both show completely.
    fn overlaps(&self, watch: Watch<'_>) -> Result<Vec<Overlap>> {
        let [rows, columns] = self.size;
        let all = u32::try_from(self.edge * self.edge).unwrap_or(u32::MAX);
        let count = self.rasters.len();
        let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| [one, other]));
        let pairs: Vec<[usize; 2]> = pairs.collect();
        let overlap = |of: &[usize; 2]| {
            let mut brightness = [Histogram::new(), Histogram::new()];
            for row in 0..rows {
                watch.check()?;
                for column in 0..columns {
                    let sums = of.map(|of| self.sum(of, [row, column]));
                    if sums.iter().all(|[_, count]| *count == all) {
                        for (histogram, [sum, count]) in brightness.iter_mut().zip(sums) {
                            histogram.add(sum, count);
                        }
                    }
                }
            }
            Ok(Overlap {
                of: *of,
                brightness,
            })
        };
        pairs.par_iter().map(overlap).collect()
    }
}
