//! The position of a unit between cells by least squares: the shift at which model and laser differ least about a bias,
//! and its precision.
//!
//! A quadratic through similarities a cell apart errs by tenths of a cell on ground that is rough within a cell.
//! Standard deviations come from leaving out one shot after the other, as errors of the model vary with position.
//!
//! # Source
//! Leaving out: MacKinnon & White 1985, *Some heteroskedasticity-consistent covariance matrix estimators*, HC3, which is the jackknife of
//! a linear model.

use nalgebra::{Matrix3, Vector3};

use super::{search::shifted_m, shots::Shot};
use areograph_geom::height_grid::HeightGrid;

/// Maximum number of steps, and the length of the last, cells.
const STEPS: usize = 30;
const STEP: f64 = 1e-3;
/// Slopes are taken over this many cells to either side.
const SIDE: f64 = 0.5;
/// Largest distance from the position by similarity, cells.
const FAR: f64 = 1.0;
/// Leverage of a shot above which this shot determines the position: the others do not.
const LEVERAGE_MAX: f64 = 0.9;

/// Position of a unit by least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Settled {
    /// Rows (southwards) and columns (eastwards), cells.
    pub(super) shift: [f64; 2],
    /// Standard deviations of these, cells.
    pub(super) sigma_cells: [f64; 2],
    /// Standard deviation of the bias, metres.
    pub(super) sigma_bias_m: f64,
}

/// Reasons why least squares give no position for a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Unsettled {
    /// Steps diverge, or do not end.
    #[error("least squares found no position within one cell of its best shift")]
    NotFound,
    /// Without one of the shots the position would not be determined.
    #[error("its position depends on one shot")]
    OneShot,
}

/// Differences of model and laser about a shift: normal equations of bias and shift, and the row and residual of every
/// shot.
struct Linear {
    normals: Matrix3<f64>,
    right: Vector3<f64>,
    shots: Vec<(Vector3<f64>, f64)>,
}

impl Linear {
    fn at(grid: &HeightGrid, shots: &[&Shot], shift: [f64; 2]) -> Self {
        let (mut normals, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let mut rows = Vec::with_capacity(shots.len());
        for shot in shots {
            let at =
                |row: f64, column: f64| shifted_m(grid, shot, [shift[0] + row, shift[1] + column]);
            let slope = |[row, column]: [f64; 2]| {
                Some((at(row, column)? - at(-row, -column)?) / (2.0 * SIDE))
            };
            let slopes = slope([SIDE, 0.0]).zip(slope([0.0, SIDE]));
            if let Some((here_m, (south, east))) = at(0.0, 0.0).zip(slopes) {
                let row = Vector3::new(1.0, south, east);
                let missed_m = shot.height_m - here_m;
                normals += row * row.transpose();
                right += row * missed_m;
                rows.push((row, missed_m));
            }
        }
        Self {
            normals,
            right,
            shots: rows,
        }
    }

    /// Standard deviations of bias and shift by leaving out one shot after the other.
    fn sigmas(&self) -> Result<[f64; 3], Unsettled> {
        let inverse = self.normals.try_inverse().ok_or(Unsettled::NotFound)?;
        let solved = inverse * self.right;
        let mut covariance = Matrix3::zeros();
        for (row, missed_m) in &self.shots {
            let leverage = row.dot(&(inverse * row));
            if !(leverage < LEVERAGE_MAX) {
                return Err(Unsettled::OneShot);
            }
            let moved = inverse * row * ((missed_m - row.dot(&solved)) / (1.0 - leverage));
            covariance += moved * moved.transpose();
        }
        Ok([0, 1, 2].map(|axis| covariance[(axis, axis)].sqrt()))
    }
}

/// The shift near `from`, rows and columns, at which differences of `shots` are least, with its standard deviations.
///
/// # Errors
/// [`Unsettled`].
pub(super) fn settled(
    grid: &HeightGrid,
    shots: &[&Shot],
    from: [f64; 2],
) -> Result<Settled, Unsettled> {
    let mut shift = from;
    let (mut damping, mut last) = (1.0, [0.0; 2]);
    for _ in 0..STEPS {
        let linear = Linear::at(grid, shots, shift);
        let solved = linear.normals.cholesky().ok_or(Unsettled::NotFound)?;
        let step = solved.solve(&linear.right);
        let step = [step[1], step[2]];
        // On ground that is rough within a cell, full steps may oscillate indefinitely.
        if step[0] * last[0] + step[1] * last[1] < 0.0 {
            damping *= 0.5;
        }
        last = step;
        shift = [0, 1].map(|axis| shift[axis] + damping * step[axis]);
        let is_near = [0, 1]
            .iter()
            .all(|axis| (shift[*axis] - from[*axis]).abs() <= FAR);
        if !is_near {
            return Err(Unsettled::NotFound);
        }
        if damping * step[0].hypot(step[1]) < STEP {
            let [sigma_bias_m, south, east] = Linear::at(grid, shots, shift).sigmas()?;
            return Ok(Settled {
                shift,
                // A damped step may end short of the full step, which adds to the standard deviation.
                sigma_cells: [south.hypot(step[0]), east.hypot(step[1])],
                sigma_bias_m,
            });
        }
    }
    Err(Unsettled::NotFound)
}
