//! Brightness of orthoimages on one grid of cells, whose rows and columns count from 0° E 0° N.

#![allow(
    clippy::cast_possible_wrap,
    reason = "numbers of cells of a map are far below 2⁶³"
)]

use areograph_geom::{height_grid::HeightGrid, imaging::Patch};

/// Brightness on cells; 0 where there is none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Raster<'a> {
    /// Row and column of its first cell, southwards and eastwards.
    pub(crate) first: [i64; 2],
    /// Rows and columns.
    pub(crate) size: [usize; 2],
    pub(crate) pixels: &'a [u8],
}

/// Mean brightness on larger cells, NaN where most of the small ones have none.
#[derive(Debug)]
pub(crate) struct Reduced {
    first: [i64; 2],
    size: [usize; 2],
    values: Vec<f32>,
}

/// Row and column of the first cell of a map whose edges lie at whole cells.
#[allow(
    clippy::cast_possible_truncation,
    reason = "numbers of cells around a body are far below 2⁶³"
)]
pub(crate) fn first_cell(map: &HeightGrid) -> [i64; 2] {
    let [longitude_rad, latitude_rad] = map.first_rad;
    let [width_rad, height_rad] = map.cell_rad;
    [-latitude_rad / height_rad, longitude_rad / width_rad]
        .map(|middle| (middle - 0.5).round() as i64)
}

impl<'a> Raster<'a> {
    pub(crate) fn of(map: &HeightGrid, pixels: &'a [u8]) -> Self {
        Self {
            first: first_cell(map),
            size: map.size,
            pixels,
        }
    }

    /// Index of a cell.
    fn index(&self, cell: [i64; 2]) -> Option<usize> {
        let [row, column] = [0, 1].map(|axis| {
            let at = usize::try_from(cell[axis] - self.first[axis]).ok();
            at.filter(|at| *at < self.size[axis])
        });
        Some(row? * self.size[1] + column?)
    }

    /// Brightness of a cell; 0 where there is none.
    pub(crate) fn at(&self, cell: [i64; 2]) -> u8 {
        self.index(cell).map_or(0, |at| self.pixels[at])
    }

    /// Whether all cells of a square have a brightness.
    pub(crate) fn is_filled(&self, first: [i64; 2], edge: u32) -> bool {
        let last = first.map(|at| at + i64::from(edge) - 1);
        let Some((start, _)) = self.index(first).zip(self.index(last)) else {
            return false;
        };
        let edge = edge as usize;
        (0..edge).all(|row| !self.pixels[start + row * self.size[1]..][..edge].contains(&0))
    }

    /// A square; `None` where one of its cells has no brightness.
    pub(crate) fn square(&self, first: [i64; 2], edge: u32) -> Option<Patch> {
        if !self.is_filled(first, edge) {
            return None;
        }
        let start = self.index(first)?;
        let edge = edge as usize;
        let mut values = Vec::with_capacity(edge * edge);
        for row in 0..edge {
            let pixels = &self.pixels[start + row * self.size[1]..][..edge];
            values.extend(pixels.iter().copied().map(f32::from));
        }
        Some(Patch {
            first,
            size: [edge; 2],
            values,
        })
    }

    /// Means of `factor` by `factor` cells.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "few cells, none of them before the first"
    )]
    pub(crate) fn reduced(&self, factor: u32) -> Reduced {
        let step = i64::from(factor);
        let first = self.first.map(|at| at.div_euclid(step));
        let last = [0, 1].map(|axis| self.first[axis] + self.size[axis] as i64 - 1);
        let size = [0, 1].map(|axis| (last[axis].div_euclid(step) - first[axis] + 1) as usize);
        let mut sums = vec![[0_u32; 2]; size[0] * size[1]];
        for (row, pixels) in self.pixels.chunks_exact(self.size[1]).enumerate() {
            let down = ((self.first[0] + row as i64).div_euclid(step) - first[0]) as usize;
            for (column, pixel) in pixels.iter().enumerate() {
                let across = (self.first[1] + column as i64).div_euclid(step) - first[1];
                let [sum, count] = &mut sums[down * size[1] + across as usize];
                *sum += u32::from(*pixel);
                *count += u32::from(*pixel > 0);
            }
        }
        let least = (factor * factor).div_ceil(2);
        let mean = |[sum, count]: &[u32; 2]| {
            if *count < least {
                f32::NAN
            } else {
                *sum as f32 / *count as f32
            }
        };
        Reduced {
            first,
            size,
            values: sums.iter().map(mean).collect(),
        }
    }
}

impl Reduced {
    /// A square, its place in cells of this size; `None` where one of its cells has no brightness.
    pub(crate) fn square(&self, first: [i64; 2], edge: u32) -> Option<Patch> {
        let edge = edge as usize;
        let [top, left] = [0, 1].map(|axis| {
            let at = usize::try_from(first[axis] - self.first[axis]).ok();
            at.filter(|at| at + edge <= self.size[axis])
        });
        let (top, left) = (top?, left?);
        let rows = top..top + edge;
        let values = rows.flat_map(|row| &self.values[row * self.size[1] + left..][..edge]);
        let values: Vec<f32> = values.copied().collect();
        let is_filled = values.iter().all(|value| !value.is_nan());
        is_filled.then_some(Patch {
            first,
            size: [edge; 2],
            values,
        })
    }

    /// Number of cells with a brightness.
    pub(crate) fn known(&self) -> usize {
        self.values.iter().filter(|of| !of.is_nan()).count()
    }

    /// Number of cells that both have when `other` is shifted back by `by`, and the correlation of their brightness.
    pub(crate) fn correlation(&self, other: &Self, by: [i64; 2]) -> (usize, f64) {
        let offset = [0, 1].map(|axis| self.first[axis] + by[axis] - other.first[axis]);
        let columns = other.size[1] as i64;
        let mut sums = [0.0_f64; 5];
        let mut count = 0_usize;
        for (row, values) in self.values.chunks_exact(self.size[1]).enumerate() {
            let there = usize::try_from(row as i64 + offset[0]).ok();
            let Some(there) = there.filter(|there| *there < other.size[0]) else {
                continue;
            };
            let others = &other.values[there * other.size[1]..][..other.size[1]];
            for (column, here) in values.iter().enumerate() {
                let at = column as i64 + offset[1];
                if !(0..columns).contains(&at) {
                    continue;
                }
                let there = usize::try_from(at).map_or(f32::NAN, |at| others[at]);
                if here.is_nan() || there.is_nan() {
                    continue;
                }
                let [here, there] = [*here, there].map(f64::from);
                count += 1;
                let terms = [here, there, here * here, there * there, here * there];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    *sum += term;
                }
            }
        }
        let [a, b, aa, bb, ab] = sums.map(|sum| sum / count.max(1) as f64);
        let variances = [aa - a * a, bb - b * b];
        // Squares of grey values: below, an image without contrast correlates with nothing.
        if variances.iter().any(|of| *of < 1e-6) {
            return (count, 0.0);
        }
        (count, (ab - a * b) / (variances[0] * variances[1]).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_and_means_count_cells_of_the_body() {
        // Rows 3 and 4, columns −2 to 1.
        let raster = Raster {
            first: [3, -2],
            size: [2, 4],
            pixels: &[1, 2, 3, 4, 5, 0, 7, 8],
        };
        assert_eq!(raster.at([4, 0]), 7);
        assert_eq!([raster.at([4, -1]), raster.at([5, 0])], [0, 0]);
        let square = raster.square([3, 0], 2).unwrap();
        assert_eq!(square.values, [3.0, 4.0, 7.0, 8.0]);
        assert!(raster.square([3, -2], 2).is_none() && raster.square([3, 1], 2).is_none());
        assert!(raster.is_filled([3, 0], 2) && !raster.is_filled([3, -2], 2));
        assert!(!raster.is_filled([2, 0], 2) && !raster.is_filled([3, 1], 2));
        // Rows 2 and 3, and 4 and 5: each has half of its cells or fewer.
        let reduced = raster.reduced(2);
        assert_eq!((reduced.first, reduced.size), ([1, -1], [2, 2]));
        assert_eq!(reduced.values[..2], [1.5, 3.5]);
        assert!(reduced.values[2].is_nan());
        assert_eq!(reduced.known(), 3);
        let square = reduced.square([1, -1], 1).unwrap();
        assert_eq!((square.first, square.values), ([1, -1], vec![1.5]));
        assert!(reduced.square([1, -1], 2).is_none() && reduced.square([1, 0], 2).is_none());
    }
}
