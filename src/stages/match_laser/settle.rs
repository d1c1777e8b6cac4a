//! The place of a unit between cells by least squares: where model and laser differ least about a bias.
//!
//! A quadratic through similarities a cell apart errs by tenths of a cell on ground that is rough within a cell. Once a model lies within
//! a cell of the laser that is more than there is to find, and shots that were held out do not bear it out.

use nalgebra::{Matrix3, Vector3};

use super::{search::shifted_m, shots::Shot};
use crate::geom::height_grid::HeightGrid;

/// Steps that are tried, and the length of the last, cells.
const STEPS: usize = 12;
const STEP: f64 = 1e-3;
/// Slopes are taken over so many cells to either side.
const SIDE: f64 = 0.5;
/// A place farther from where similarity has it is another one, cells.
const FAR: f64 = 1.0;

/// The shift near `from` at which differences of `shots` are least; none where steps lead away.
pub(super) fn settled(grid: &HeightGrid, shots: &[&Shot], from: [f64; 2]) -> Option<[f64; 2]> {
    let mut shift = from;
    for _ in 0..STEPS {
        let (mut normals, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for shot in shots {
            let at =
                |row: f64, column: f64| shifted_m(grid, shot, [shift[0] + row, shift[1] + column]);
            let slope = |[row, column]: [f64; 2]| {
                Some((at(row, column)? - at(-row, -column)?) / (2.0 * SIDE))
            };
            let slopes = slope([SIDE, 0.0]).zip(slope([0.0, SIDE]));
            if let Some((here_m, (south, east))) = at(0.0, 0.0).zip(slopes) {
                let row = Vector3::new(1.0, south, east);
                normals += row * row.transpose();
                right += row * (shot.height_m - here_m);
            }
        }
        let step = normals.cholesky()?.solve(&right);
        shift = [shift[0] + step[1], shift[1] + step[2]];
        let is_near = [0, 1]
            .iter()
            .all(|axis| (shift[*axis] - from[*axis]).abs() <= FAR);
        if !is_near {
            return None;
        }
        if step[1].hypot(step[2]) < STEP {
            return Some(shift);
        }
    }
    None
}
