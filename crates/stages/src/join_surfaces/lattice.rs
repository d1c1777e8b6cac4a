//! Cells of one grid over the terrain models of several pairs.

use super::JoinError;
use crate::map_surface::SurfaceModel;
use areograph_base::units::wrap_pi;
use areograph_geom::height_grid::HeightGrid;

/// Maximum number of cells, as of a single model.
const CELLS_MAX: usize = 1 << 24;
/// Largest distance of cells that belong to one lattice, cells.
const SAME_CELLS: f64 = 1e-3;

/// A grid over all models, without heights.
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    pub(super) grid: HeightGrid,
    pub(super) parallel_rad: f64,
}

/// Heights and standard deviations of a model in the cells of a lattice.
pub(super) struct OnLattice {
    /// First row and column, and numbers of them.
    first: [usize; 2],
    size: [usize; 2],
    heights_m: Vec<f32>,
    sigmas_m: Vec<f32>,
}

impl Lattice {
    /// The cells of the first of `models`, as far as all of them reach.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of cells that is compared with a limit; casts saturate"
    )]
    pub(super) fn over(models: &[&SurfaceModel]) -> Result<Self, JoinError> {
        let [first, ..] = models else {
            return Err(JoinError::Nothing);
        };
        let base = &first.heights;
        let mut ends = [[0.0_f64, 0.0], [0.0, 0.0]];
        for model in models {
            let grid = &model.heights;
            let corners = [[0.0, 0.0], grid.size.map(|of| of as f64 - 1.0)];
            for corner in corners {
                let [longitude_rad, latitude_rad] = grid.place_rad(corner);
                let east_rad = wrap_pi(longitude_rad - base.first_rad[0]);
                let cell = [
                    (base.first_rad[1] - latitude_rad) / base.cell_rad[1],
                    east_rad / base.cell_rad[0],
                ];
                for axis in [0, 1] {
                    ends[axis][0] = ends[axis][0].min((cell[axis] + SAME_CELLS).floor());
                    ends[axis][1] = ends[axis][1].max((cell[axis] - SAME_CELLS).ceil());
                }
            }
        }
        let size = ends.map(|[low, high]| (high - low) as usize + 1);
        let cells = size[0].saturating_mul(size[1]);
        if cells > CELLS_MAX {
            return Err(JoinError::TooLarge { cells });
        }
        Ok(Self {
            grid: HeightGrid {
                size,
                first_rad: [
                    base.first_rad[0] + ends[1][0] * base.cell_rad[0],
                    base.first_rad[1] - ends[0][0] * base.cell_rad[1],
                ],
                heights_m: Vec::new(),
                ..*base
            },
            parallel_rad: first.parallel_rad,
        })
    }

    /// A model in these cells: its own numbers where its cells are among them, else heights between its cells and the
    /// nearest standard deviation.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "cells of grids that exist; heights keep millimetre precision"
    )]
    pub(super) fn take(&self, model: &SurfaceModel) -> OnLattice {
        let (own, grid) = (&model.heights, &self.grid);
        let begin = grid.cell_of(own.first_rad[0], own.first_rad[1]);
        let ratio = [1, 0].map(|axis| own.cell_rad[axis] / grid.cell_rad[axis]);
        let count = own.size.map(|of| of as f64);
        let is_same = [0, 1].iter().all(|axis| {
            let end = begin[*axis] + (count[*axis] - 1.0) * ratio[*axis];
            [begin[*axis], end]
                .iter()
                .all(|at| (at - at.round()).abs() < SAME_CELLS)
                && ((ratio[*axis] - 1.0) * count[*axis]).abs() < SAME_CELLS
        });
        if is_same {
            return OnLattice {
                first: begin.map(|at| at.round().max(0.0) as usize),
                size: own.size,
                heights_m: own.heights_m.clone(),
                sigmas_m: model.sigmas_m.clone(),
            };
        }
        let first = begin.map(|at| at.floor().max(0.0) as usize);
        let size = [0, 1].map(|axis| {
            let end = (begin[axis] + count[axis] * ratio[axis]).ceil() as usize;
            end.clamp(first[axis], grid.size[axis]) - first[axis]
        });
        let cells = (0..size[0] * size[1]).map(|at| {
            let cell = [first[0] + at / size[1], first[1] + at % size[1]];
            let [longitude_rad, latitude_rad] = grid.place_rad(cell.map(|of| of as f64));
            let there = own.cell_of(longitude_rad, latitude_rad);
            let nearest = there.map(|of| of.round().max(0.0) as usize);
            let sigma_m = model.sigmas_m.get(nearest[0] * own.size[1] + nearest[1]);
            own.height_m(there)
                .zip(sigma_m)
                .map_or([f32::NAN; 2], |(height_m, sigma_m)| {
                    [height_m as f32, *sigma_m]
                })
        });
        let (heights_m, sigmas_m) = cells.map(|[height_m, sigma_m]| (height_m, sigma_m)).unzip();
        OnLattice {
            first,
            size,
            heights_m,
            sigmas_m,
        }
    }
}

impl OnLattice {
    /// Height and standard deviation in a cell of the lattice, metres.
    pub(super) fn at(&self, [row, column]: [usize; 2]) -> Option<[f64; 2]> {
        let row = row.checked_sub(self.first[0])?;
        let column = column.checked_sub(self.first[1])?;
        if row >= self.size[0] || column >= self.size[1] {
            return None;
        }
        let at = row * self.size[1] + column;
        let numbers = [self.heights_m[at], self.sigmas_m[at]].map(f64::from);
        numbers.iter().all(|of| !of.is_nan()).then_some(numbers)
    }
}
