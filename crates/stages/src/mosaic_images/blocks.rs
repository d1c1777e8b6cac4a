//! Blocks of cells of a mosaic: what overlapping orthoimages show in them.

use rayon::prelude::*;

use super::{
    balance::{Histogram, Overlap, Tone, balanced},
    seams::{Blocks, Set, marker},
    tile::MapTile,
};
use crate::{raster::first_cell, rectify_images::Orthoimage};
use areograph_base::{
    column::{TILE, spans},
    error::Result,
    watch::Watch,
};
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
    orthoimages: &'a [Orthoimage],
    map: &'a HeightGrid,
    /// First cell of the map.
    first: [i64; 2],
    edge: usize,
}

/// What is known of a block: the difference of the orthoimages that show it, these, and the one that keeps it.
type OfBlock = (u8, Set, u8);

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
        let grid = Grid {
            orthoimages,
            map,
            first: first_cell(map),
            edge,
        };
        let count = orthoimages.len();
        let tones = if is_balanced {
            balanced(count, &grid.overlaps(watch)?)
        } else {
            vec![Tone::UNCHANGED; count]
        };
        let tables: Vec<[u8; 256]> = tones.iter().map(Tone::table).collect();
        let size = blocks(edge);
        let mut blocks = Blocks {
            size,
            differences: Vec::with_capacity(size[0] * size[1]),
            shown: Vec::with_capacity(size[0] * size[1]),
            markers: Vec::with_capacity(size[0] * size[1]),
        };
        let across = map.size[1].div_ceil(TILE);
        for row_of_tiles in spans(map.size).chunks(across) {
            let tiles = row_of_tiles.par_iter().map(|span| {
                watch.check()?;
                let tile = MapTile::of(orthoimages, grid.first, span.clone());
                Ok(grid.surveyed(&tile, &tables, &inside_m))
            });
            let tiles: Vec<Vec<OfBlock>> = tiles.collect::<Result<_>>()?;
            let rows = row_of_tiles[0][0].len().div_ceil(edge);
            for row in 0..rows {
                let of_row = tiles.iter().flat_map(|of| {
                    let columns = of.len() / rows;
                    &of[row * columns..][..columns]
                });
                for (difference, shown, marker) in of_row {
                    blocks.differences.push(*difference);
                    blocks.shown.push(*shown);
                    blocks.markers.push(*marker);
                }
            }
        }
        Ok(Self {
            blocks,
            edge,
            tones,
        })
    }
}

impl Grid<'_> {
    /// The blocks of a tile, row by row.
    fn surveyed(
        &self,
        tile: &MapTile,
        tables: &[[u8; 256]],
        inside_m: impl Fn(usize, [f64; 2]) -> f64,
    ) -> Vec<OfBlock> {
        let edge = self.edge;
        let middle = 0.5 * (edge as f64 - 1.0);
        let place_rad = |block: [usize; 2]| {
            let cell = [0, 1].map(|axis| tile.span[axis].start + block[axis] * edge);
            self.map.place_rad(cell.map(|at| at as f64 + middle))
        };
        let [rows, columns] = tile.blocks(edge);
        let blocks = (0..rows).flat_map(|row| (0..columns).map(move |column| [row, column]));
        let of_block = |block: [usize; 2]| {
            let shown = self.shown(tile, block);
            let distances = shown
                .each()
                .map(|of| (of, inside_m(usize::from(of), place_rad(block))));
            let marker = marker(&distances.collect::<Vec<_>>());
            (self.difference(tile, block, shown, tables), shown, marker)
        };
        blocks.map(of_block).collect()
    }

    /// The orthoimages that show at least half of a block.
    fn shown(&self, tile: &MapTile, block: [usize; 2]) -> Set {
        let mut shown = Set::default();
        for (number, of) in (0_u8..).zip(0..self.orthoimages.len()) {
            let [_, count] = tile.sum(of, block, self.edge);
            if 2 * count as usize >= self.edge * self.edge {
                shown.insert(number);
            }
        }
        shown
    }

    /// The largest mean difference of two of the orthoimages that show a block, in parts of a grey value, at most 255.
    #[allow(clippy::cast_possible_truncation, reason = "at most 255")]
    fn difference(
        &self,
        tile: &MapTile,
        block: [usize; 2],
        shown: Set,
        tables: &[[u8; 256]],
    ) -> u8 {
        let pairs = shown.each().flat_map(|one| {
            shown
                .each()
                .filter(move |other| *other > one)
                .map(move |other| [one, other])
        });
        let mean = |pair: [u8; 2]| {
            let pair = pair.map(usize::from);
            let mut sums = [0_u32; 2];
            for cell in tile.block(block, self.edge) {
                let [one, other] = pair.map(|of| tables[of][usize::from(tile.at(of, cell))]);
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
        let all = u32::try_from(self.edge * self.edge).unwrap_or(u32::MAX);
        let count = self.orthoimages.len();
        let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| [one, other]));
        let pairs: Vec<[usize; 2]> = pairs.collect();
        let spans = spans(self.map.size);
        let overlap = |of: &[usize; 2]| {
            let mut brightness = [Histogram::new(), Histogram::new()];
            let both = of.map(|of| &self.orthoimages[of]);
            for span in &spans {
                watch.check()?;
                let tile = MapTile::of(both, self.first, span.clone());
                if tile.pixels.iter().any(Option::is_none) {
                    continue;
                }
                let [rows, columns] = tile.blocks(self.edge);
                for row in 0..rows {
                    for column in 0..columns {
                        let sums = [0, 1].map(|of| tile.sum(of, [row, column], self.edge));
                        if sums.iter().all(|[_, count]| *count == all) {
                            for (histogram, [sum, count]) in brightness.iter_mut().zip(sums) {
                                histogram.add(sum, count);
                            }
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
