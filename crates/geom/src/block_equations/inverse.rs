//! The elements of the inverse that lie in the envelope, from the factor, without the others.

use std::sync::Arc;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::{BlockCholesky, BlockMatrix};

impl BlockCholesky {
    /// The blocks of the inverse where `like` has blocks.
    ///
    /// With `Z = S⁻¹`, `Lᵀ Z = L⁻¹` is a lower triangle: the part of `Z` to the right of a block follows from the part
    /// below it, last rows first.
    ///
    /// # Source
    /// Takahashi, Fagan & Chin 1973.
    #[must_use]
    pub fn inverse(&self, like: &BlockMatrix) -> BlockMatrix {
        let mut inverse = BlockMatrix::zeros(like.pattern());
        let envelope = self.inverse_in_envelope();
        for (column, values) in envelope.iter().enumerate() {
            let left = self.starts[self.first[column]];
            for row in self.first[column]..=column {
                let block = values.rows(self.starts[row] - left, self.size(row));
                let (above, below) = (self.order[row], self.order[column]);
                if above <= below {
                    inverse.put(above, below, &block.into_owned());
                } else {
                    inverse.put(below, above, &block.transpose());
                }
            }
        }
        inverse.scale(&self.scale);
        inverse
    }

    /// Columns of each block of the inverse, from the first row of the envelope to their own last; still scaled.
    fn inverse_in_envelope(&self) -> Vec<DMatrix<f64>> {
        let blocks = self.order.len();
        let mut inverse: Vec<DMatrix<f64>> = self
            .rows
            .iter()
            .map(|rows| DMatrix::zeros(rows.ncols(), rows.nrows()))
            .collect();
        // The last block that extends back to each.
        let mut last: Vec<usize> = (0..blocks).collect();
        for (position, first) in self.first.iter().enumerate() {
            for reached in &mut last[*first..position] {
                *reached = position;
            }
        }
        for position in (0..blocks).rev() {
            let below = self.below(position, last[position]);
            let reaching = position + 1..=last[position];
            let right: Vec<(usize, DMatrix<f64>)> = reaching
                .into_par_iter()
                .filter(|other| self.first[*other] <= position)
                .map(|other| {
                    (
                        other,
                        self.right_of((position, last[position]), other, &below, &inverse),
                    )
                })
                .collect();
            let triangle = self.triangle(position);
            let mut own = DMatrix::identity(self.size(position), self.size(position));
            triangle.solve_lower_triangular_mut(&mut own);
            for (other, block) in right {
                let from_position = self.starts[other] - self.starts[position + 1];
                let of_other = below.rows(from_position, self.size(other));
                own.gemm(-1.0, &of_other.transpose(), &block.transpose(), 1.0);
                let row = self.starts[position] - self.starts[self.first[other]];
                inverse[other]
                    .rows_mut(row, self.size(position))
                    .copy_from(&block);
            }
            triangle.tr_solve_lower_triangular_mut(&mut own);
            let symmetric = (&own + own.transpose()) * 0.5;
            let row = self.starts[position] - self.starts[self.first[position]];
            inverse[position]
                .rows_mut(row, self.size(position))
                .copy_from(&symmetric);
        }
        inverse
    }

    /// The triangle of the block at `position`.
    fn triangle(&self, position: usize) -> DMatrix<f64> {
        let size = self.size(position);
        let rows = &self.rows[position];
        rows.columns(rows.ncols() - size, size).into_owned()
    }

    /// The factor below the block at `position`, in its columns, as far as the rows of block `last`.
    fn below(&self, position: usize, last: usize) -> DMatrix<f64> {
        let from = self.starts[position + 1];
        let mut below = DMatrix::zeros(self.starts[last + 1] - from, self.size(position));
        for other in position + 1..=last {
            if self.first[other] <= position {
                let left = self.starts[self.first[other]];
                let columns = self.starts[position] - left;
                let block = self.rows[other].columns(columns, self.size(position));
                below
                    .rows_mut(self.starts[other] - from, self.size(other))
                    .copy_from(&block);
            }
        }
        below
    }

    /// The block of the inverse in the rows of `position` and the columns of `other`; no block after `last` extends
    /// back to `position`.
    fn right_of(
        &self,
        (position, last): (usize, usize),
        other: usize,
        below: &DMatrix<f64>,
        inverse: &[DMatrix<f64>],
    ) -> DMatrix<f64> {
        let (from, size) = (self.starts[position + 1], self.size(position));
        let mut sum = DMatrix::zeros(size, self.size(other));
        let length = self.starts[other + 1] - from;
        let skipped = from - self.starts[self.first[other]];
        sum.gemm(
            -1.0,
            &below.rows(0, length).transpose(),
            &inverse[other].rows(skipped, length),
            1.0,
        );
        let later = (other + 1..).zip(&inverse[other + 1..=last]);
        for (later, of_later) in later.filter(|(later, _)| self.first[*later] <= position) {
            let factor = below.rows(self.starts[later] - from, self.size(later));
            let row = self.starts[other] - self.starts[self.first[later]];
            let block = of_later.rows(row, self.size(other));
            sum.gemm(-1.0, &factor.transpose(), &block.transpose(), 1.0);
        }
        self.triangle(position)
            .tr_solve_lower_triangular_mut(&mut sum);
        sum
    }
}

impl BlockMatrix {
    /// Sets a block if the matrix has it.
    fn put(&mut self, row: usize, column: usize, block: &DMatrix<f64>) {
        if let Some(values) = self.pattern.values_of(row, column) {
            self.values[values].copy_from_slice(block.as_slice());
        }
    }

    /// Multiplies rows and columns.
    fn scale(&mut self, by: &[f64]) {
        let pattern = Arc::clone(&self.pattern);
        for column in 0..pattern.blocks() {
            for row in pattern.met(column) {
                let (rows, columns) = (pattern.columns(*row), pattern.columns(column));
                if let Some(values) = pattern.values_of(*row, column) {
                    let values = self.values[values].chunks_exact_mut(rows.len());
                    for (values, column) in values.zip(columns) {
                        for (value, row) in values.iter_mut().zip(rows.clone()) {
                            *value *= by[row] * by[column];
                        }
                    }
                }
            }
        }
    }
}
