//! What the orthoimages of a mosaic show in a tile of its map: all that memory contains of them.

#![allow(
    clippy::cast_possible_wrap,
    reason = "numbers of cells of a map are far below 2⁶³"
)]

use std::ops::Range;

use crate::{raster::first_cell, rectify_images::Orthoimage};

/// Brightness of orthoimages in a tile of the map.
pub(super) struct MapTile {
    /// Rows and columns of the map.
    pub(super) span: [Range<usize>; 2],
    /// Of every orthoimage, row by row, 0 where there is none; `None` for one without a cell in the tile.
    pub(super) pixels: Vec<Option<Vec<u8>>>,
}

impl MapTile {
    /// These rows and columns of a map with this first cell, which contains all of the orthoimages.
    pub(super) fn of<'a>(
        orthoimages: impl IntoIterator<Item = &'a Orthoimage>,
        first: [i64; 2],
        span: [Range<usize>; 2],
    ) -> Self {
        let pixels = orthoimages.into_iter().map(|of| pixels(of, first, &span));
        Self {
            pixels: pixels.collect(),
            span,
        }
    }

    /// Brightness of an orthoimage in a cell, counted row by row in the tile.
    pub(super) fn at(&self, of: usize, cell: usize) -> u8 {
        self.pixels[of].as_ref().map_or(0, |pixels| pixels[cell])
    }

    /// Rows and columns of blocks of this edge.
    pub(super) fn blocks(&self, edge: usize) -> [usize; 2] {
        [0, 1].map(|axis| self.span[axis].len().div_ceil(edge))
    }

    /// The cells of a block, counted row by row in the tile; those beyond the map are left out.
    pub(super) fn block(
        &self,
        [row, column]: [usize; 2],
        edge: usize,
    ) -> impl Iterator<Item = usize> + use<> {
        let [rows, columns] = [0, 1].map(|axis| self.span[axis].len());
        let across = column * edge..columns.min((column + 1) * edge);
        let down = row * edge..rows.min((row + 1) * edge);
        down.flat_map(move |row| across.clone().map(move |column| row * columns + column))
    }

    /// Sum of the brightness of an orthoimage in a block, and number of its cells.
    pub(super) fn sum(&self, of: usize, block: [usize; 2], edge: usize) -> [u32; 2] {
        let Some(pixels) = &self.pixels[of] else {
            return [0; 2];
        };
        let cells = self.block(block, edge).map(|cell| pixels[cell]);
        cells.fold([0; 2], |[sum, count], pixel| {
            [sum + u32::from(pixel), count + u32::from(pixel > 0)]
        })
    }
}

/// Brightness of an orthoimage in these rows and columns of a map.
fn pixels(of: &Orthoimage, first: [i64; 2], span: &[Range<usize>; 2]) -> Option<Vec<u8>> {
    let start = first_cell(&of.account.map);
    // First cell and end of the orthoimage on the map, and what the tile has of it.
    let own = |axis: usize| {
        let begin = usize::try_from(start[axis] - first[axis]).unwrap_or(0);
        let end = begin + of.account.map.size[axis];
        let common = span[axis].start.max(begin)..span[axis].end.min(end);
        (begin, common)
    };
    let ([top, left], [rows, columns]) = {
        let ((top, rows), (left, columns)) = (own(0), own(1));
        ([top, left], [rows, columns])
    };
    if rows.is_empty() || columns.is_empty() {
        return None;
    }
    let of_rows = rows.start - top..rows.end - top;
    let of_columns = columns.start - left..columns.end - left;
    let found = of.brightness.filled_window(&of_rows, &of_columns)?;
    if rows == span[0] && columns == span[1] {
        return Some(found);
    }
    let width = span[1].len();
    let mut pixels = vec![0; span[0].len() * width];
    for (row, found) in rows.zip(found.chunks_exact(columns.len())) {
        let at = (row - span[0].start) * width + columns.start - span[1].start;
        pixels[at..][..found.len()].copy_from_slice(found);
    }
    Some(pixels)
}
