//! Reduced normal equations: each point's coordinates are eliminated, the shared unknowns are left.
//!
//! An orthogonal transformation of a point's rows leaves its three coordinates in the first three of
//! them. The squares of the other rows sum up to the Schur complement `U − W V⁻¹ Wᵀ`; nothing is
//! subtracted, so nothing is lost to cancellation.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{
    layout::Layout,
    point_rows::{PointRows, add_multiple},
    reduced_heights::ReducedHeights,
    unknowns::State,
};
use crate::geom::pushbroom::{ExteriorOrientation, Unseen};

/// Parts in which points are summed: fixed, so that the sums do not depend on the number of threads.
const PARTS: usize = 16;

/// Reduced normal equations at a state.
#[derive(Clone)]
pub(super) struct Reduced {
    /// Lower triangle.
    pub(super) matrix: DMatrix<f64>,
    pub(super) right: DVector<f64>,
    /// The sum that is made small.
    pub(super) cost: f64,
    /// Heights, where they are observed; matrix, right side and sum contain them.
    pub(super) heights: Option<ReducedHeights>,
}

/// Where an iteration has come to.
pub(super) struct Settled {
    pub(super) state: State,
    pub(super) reduced: Reduced,
}

impl Reduced {
    fn zeros(columns: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(columns, columns),
            right: DVector::zeros(columns),
            cost: 0.0,
            heights: None,
        }
    }

    /// Adds the rows of a point after [`PointRows::eliminate`].
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
                rows.eliminate();
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
    if let Some(heights) = &layout.heights {
        let heights = ReducedHeights::of(layout, heights, state)?;
        let (matrix, right, cost) = heights.equations();
        sum.matrix += matrix;
        sum.right += right;
        sum.cost += cost;
        sum.heights = Some(heights);
    }
    Ok(sum)
}
