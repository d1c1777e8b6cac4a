//! Elimination of each point's coordinates, which leaves equations in the shared unknowns only.
//!
//! An orthogonal transformation of a point's rows leaves its three coordinates in the first three of
//! them. The squares of the other rows sum up to the Schur complement `U − W V⁻¹ Wᵀ`; nothing is
//! subtracted, so nothing is lost to cancellation.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use super::{
    layout::{Layout, PointRows},
    unknowns::State,
};
use crate::geom::pushbroom::{ExteriorOrientation, Unseen};

/// Parts in which points are summed: fixed, so that the sums do not depend on the number of threads.
const PARTS: usize = 16;

/// Transforms at least three rows so that the point is left in the first three, and gives its triangle `R`.
///
/// `by_point` is used up; all else is transformed in place.
///
/// # Source
/// Householder 1958, Unitary triangularization of a nonsymmetric matrix.
pub(super) fn triangulate(rows: &mut PointRows) -> Matrix3<f64> {
    let PointRows {
        by_point,
        beside,
        width,
        sums,
        ..
    } = rows;
    let mut triangle = Matrix3::zeros();
    for axis in 0..3 {
        let (above, below) = by_point.split_at_mut(axis);
        let length = below
            .iter()
            .map(|row| row[axis].powi(2))
            .sum::<f64>()
            .sqrt();
        for (row, entry) in above.iter().enumerate() {
            triangle[(row, axis)] = entry[axis];
        }
        if length == 0.0 {
            continue;
        }
        // The mirror's normal takes the place of the column; its first entry is made large, not small.
        let pivot = below[0][axis];
        let image = -length.copysign(pivot);
        below[0][axis] = pivot - image;
        triangle[(axis, axis)] = image;
        let share = 1.0 / (length * (length + pivot.abs()));
        for later in axis + 1..3 {
            let along: f64 = below.iter().map(|row| row[axis] * row[later]).sum();
            for row in &mut *below {
                row[later] -= share * along * row[axis];
            }
        }
        sums.clear();
        sums.resize(*width, 0.0);
        let beside = &mut beside[axis * *width..];
        for (normal, row) in below.iter().zip(beside.chunks_exact(*width)) {
            add_multiple(sums, normal[axis], row);
        }
        for (normal, row) in below.iter().zip(beside.chunks_exact_mut(*width)) {
            add_multiple(row, -share * normal[axis], sums);
        }
    }
    triangle
}

/// Adds `factor · from` to `to`.
fn add_multiple(to: &mut [f64], factor: f64, from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * from;
    }
}

/// Step of the point that goes with a step of the shared unknowns.
pub(super) fn point_step_m(rows: &mut PointRows, shared: &DVector<f64>) -> Option<Vector3<f64>> {
    // What the shared unknowns leave of the misclosures; from here on a row is nothing but that.
    for row in 0..rows.weights.len() {
        let at = row * rows.width;
        let known: f64 = rows
            .runs
            .iter()
            .map(|run| {
                let partials = &rows.beside[at + run.first..][..run.columns.len()];
                let steps = &shared.as_slice()[run.columns.clone()];
                partials.iter().zip(steps).map(|(a, b)| a * b).sum::<f64>()
            })
            .sum();
        rows.beside[row] = rows.beside[at + rows.width - 1] - known;
    }
    rows.width = 1;
    let triangle = triangulate(rows);
    triangle.solve_upper_triangular(&Vector3::from_column_slice(&rows.beside[..3]))
}

/// Reduced normal equations at a state.
#[derive(Clone)]
pub(super) struct Reduced {
    /// Lower triangle.
    pub(super) matrix: DMatrix<f64>,
    pub(super) right: DVector<f64>,
    /// The sum that is made small.
    pub(super) cost: f64,
}

impl Reduced {
    fn zeros(columns: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(columns, columns),
            right: DVector::zeros(columns),
            cost: 0.0,
        }
    }

    /// Adds the rows of a point after [`triangulate`].
    fn add(&mut self, rows: &PointRows) {
        self.cost += rows.cost;
        let columns = self.right.len();
        let matrix = self.matrix.as_mut_slice();
        for row in rows.beside.chunks_exact(rows.width).skip(3) {
            let misclosure = row[rows.width - 1];
            for (index, run) in rows.runs.iter().enumerate() {
                for (place, column) in (run.first..).zip(run.columns.clone()) {
                    let partial = row[place];
                    self.right[column] += partial * misclosure;
                    let sums = &mut matrix[column * columns..(column + 1) * columns];
                    let below = run.first + run.columns.len();
                    add_multiple(&mut sums[column..], partial, &row[place..below]);
                    for other in &rows.runs[index + 1..] {
                        let partials = &row[other.first..][..other.columns.len()];
                        add_multiple(&mut sums[other.columns.clone()], partial, partials);
                    }
                }
            }
        }
    }
}

/// Sums up the points of `active` and the initial values of the shared unknowns.
pub(super) fn reduce<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    active: &[usize],
) -> Result<Reduced, Unseen> {
    let columns = layout.columns.len();
    let part_len = active.len().div_ceil(PARTS).max(1);
    let parts: Vec<Reduced> = active
        .par_chunks(part_len)
        .map(|points| {
            let mut part = Reduced::zeros(columns);
            let mut rows = PointRows::default();
            for point in points {
                layout.fill(&mut rows, state, *point)?;
                triangulate(&mut rows);
                part.add(&rows);
            }
            Ok(part)
        })
        .collect::<Result<_, Unseen>>()?;
    let mut sum = Reduced::zeros(columns);
    for part in parts {
        sum.matrix += part.matrix;
        sum.right += part.right;
        sum.cost += part.cost;
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        // Infinite standard deviations weigh nothing.
        let weight = sigma.powi(-2);
        let correction = state.corrections[column];
        sum.matrix[(column, column)] += weight;
        sum.right[column] -= weight * correction;
        sum.cost += weight * correction * correction;
    }
    Ok(sum)
}
