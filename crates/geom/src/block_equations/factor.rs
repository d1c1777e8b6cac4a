//! Cholesky's factor within an envelope, of the matrix scaled to unit diagonal.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::{BlockMatrix, ordering::order};

/// Smallest pivot of the scaled matrix: the share of an unknown's own information that remains once all others are
/// known. Rounding of a few hundred unknowns leaves about 1e-14.
const PIVOT_MIN: f64 = 1e-12;
/// Unknowns that a message names.
const NAMED_MAX: usize = 4;
/// An unknown with less than this share of the weakest combination is not named.
const NAMED_SHARE: f64 = 0.1;
/// Right-hand sides solved together; larger sets are divided among the threads.
const TOGETHER: usize = 32;

/// Unknowns that the observations do not separate, or do not involve.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Singular {
    /// Indices of the unknowns in the weakest combination, the strongest first, four at most.
    pub unknowns: Vec<usize>,
}

/// The factor `L` of a symmetric positive definite matrix `S = L Lᵀ`, in blocks.
///
/// "Rows" are rows of the matrix in the order of the factor.
#[derive(Debug, Clone)]
pub struct BlockCholesky {
    /// First row of each block in the order of the factor, and the number of all.
    pub(super) starts: Vec<usize>,
    /// The first block that the rows of each block extend back to.
    pub(super) first: Vec<usize>,
    /// Rows of each block, from the first column that they extend back to, to their own last.
    pub(super) rows: Vec<DMatrix<f64>>,
    /// The block at each position, and its first column in the matrix.
    pub(super) order: Vec<usize>,
    pub(super) columns: Vec<usize>,
    /// `1/√diagonal` of the matrix, by its columns.
    pub(super) scale: Vec<f64>,
}

impl BlockCholesky {
    /// Factorises `matrix`.
    ///
    /// # Errors
    /// The matrix is not positive definite to working precision.
    pub fn new(matrix: &BlockMatrix) -> Result<Self, Singular> {
        let scale: Vec<f64> = matrix
            .diagonal()
            .iter()
            .map(|of| of.sqrt().recip())
            .collect();
        let untouched: Vec<usize> = (0..scale.len())
            .filter(|index| !scale[*index].is_finite())
            .take(NAMED_MAX)
            .collect();
        if !untouched.is_empty() {
            return Err(Singular {
                unknowns: untouched,
            });
        }
        let mut factor = Self::laid_out(matrix, scale);
        for position in 0..factor.order.len() {
            let rows = factor.rows_of(matrix, position)?;
            factor.rows.push(rows);
        }
        Ok(factor)
    }

    /// The envelope, still empty.
    fn laid_out(matrix: &BlockMatrix, scale: Vec<f64>) -> Self {
        let pattern = matrix.pattern();
        let order = order(pattern);
        let mut position = vec![0; order.len()];
        for (at, block) in order.iter().enumerate() {
            position[*block] = at;
        }
        let mut first: Vec<usize> = (0..order.len()).collect();
        for block in 0..order.len() {
            for other in pattern.met(block) {
                let (one, other) = (position[block], position[*other]);
                let (before, after) = (one.min(other), one.max(other));
                first[after] = first[after].min(before);
            }
        }
        let mut starts = vec![0];
        for block in &order {
            starts.push(starts[starts.len() - 1] + pattern.columns(*block).len());
        }
        let columns = order.iter().map(|block| pattern.columns(*block).start);
        Self {
            columns: columns.collect(),
            rows: Vec::with_capacity(order.len()),
            starts,
            first,
            order,
            scale,
        }
    }

    /// Unknowns of the block at a position.
    pub(super) fn size(&self, position: usize) -> usize {
        self.starts[position + 1] - self.starts[position]
    }

    /// The scaled block of the matrix between two positions.
    fn scaled(&self, matrix: &BlockMatrix, row: usize, column: usize) -> Option<DMatrix<f64>> {
        let (above, below) = (self.order[row], self.order[column]);
        let mut block = if above <= below {
            matrix.block(above, below)?.into_owned()
        } else {
            matrix.block(below, above)?.transpose()
        };
        if row == column {
            block.fill_lower_triangle_with_upper_triangle();
        }
        for (at, mut values) in block.column_iter_mut().enumerate() {
            let of_column = self.scale[self.columns[column] + at];
            for (value, of_row) in values.iter_mut().zip(&self.scale[self.columns[row]..]) {
                *value *= of_row * of_column;
            }
        }
        Some(block)
    }

    /// The rows of the block at `position`, all before it known.
    fn rows_of(&self, matrix: &BlockMatrix, position: usize) -> Result<DMatrix<f64>, Singular> {
        let (first, size) = (self.first[position], self.size(position));
        let left = self.starts[first];
        // Stored transposed while it grows, so that the known part is a matrix of full rows.
        let mut grown = DMatrix::zeros(self.starts[position + 1] - left, size);
        for before in first..position {
            let mut block = self
                .scaled(matrix, before, position)
                .unwrap_or_else(|| DMatrix::zeros(self.size(before), size));
            let shared = self.starts[first.max(self.first[before])];
            let length = self.starts[before] - shared;
            let rows = &self.rows[before];
            let of_before = self.starts[self.first[before]];
            if length > 0 {
                block.gemm(
                    -1.0,
                    &rows.columns(shared - of_before, length),
                    &grown.rows(shared - left, length),
                    1.0,
                );
            }
            let own = rows.columns(self.starts[before] - of_before, self.size(before));
            own.solve_lower_triangular_mut(&mut block);
            grown
                .rows_mut(self.starts[before] - left, self.size(before))
                .copy_from(&block);
        }
        let known = grown.rows(0, self.starts[position] - left);
        let mut own = self
            .scaled(matrix, position, position)
            .unwrap_or_else(|| DMatrix::zeros(size, size));
        own.gemm(-1.0, &known.transpose(), &known, 1.0);
        let pivots = Cholesky::new(own.clone());
        let pivots = pivots.filter(|factor| {
            let diagonal = factor.l_dirty().diagonal();
            diagonal.iter().all(|pivot| pivot * pivot > PIVOT_MIN)
        });
        let Some(pivots) = pivots else {
            return Err(self.weakest_combination(position, &known.into_owned(), own));
        };
        let mut rows = DMatrix::zeros(size, grown.nrows());
        rows.columns_mut(0, known.nrows())
            .copy_from(&known.transpose());
        rows.columns_mut(known.nrows(), size).copy_from(&pivots.l());
        Ok(rows)
    }

    /// The combination that changes the equations up to `position` least; `own` is the block left there once all before
    /// are known.
    fn weakest_combination(
        &self,
        position: usize,
        known: &DMatrix<f64>,
        own: DMatrix<f64>,
    ) -> Singular {
        if own.iter().any(|value| !value.is_finite()) {
            return Singular {
                unknowns: Vec::new(),
            };
        }
        let eigen = SymmetricEigen::new(own);
        let weakest = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let mut vector = DMatrix::zeros(self.starts[position + 1], 1);
        let left = self.starts[self.first[position]];
        vector
            .rows_mut(left, known.nrows())
            .copy_from(&(known * weakest * -1.0));
        self.solve_back(&mut vector, position);
        vector
            .rows_mut(self.starts[position], weakest.len())
            .copy_from(&weakest);
        let largest = vector.amax();
        let mut unknowns: Vec<(usize, f64)> = (0..=position)
            .flat_map(|at| (self.starts[at]..self.starts[at + 1]).zip(self.columns[at]..))
            .map(|(row, column)| (column, vector[row].abs()))
            .filter(|(_, share)| *share > NAMED_SHARE * largest)
            .collect();
        unknowns.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        unknowns.truncate(NAMED_MAX);
        Singular {
            unknowns: unknowns.into_iter().map(|(column, _)| column).collect(),
        }
    }

    /// `Lᵀ⁻¹` of the first `positions` blocks times the rows of `vectors`.
    fn solve_back(&self, vectors: &mut DMatrix<f64>, positions: usize) {
        for position in (0..positions).rev() {
            let (left, start) = (self.starts[self.first[position]], self.starts[position]);
            let (size, rows) = (self.size(position), &self.rows[position]);
            let mut own = vectors.rows(start, size).into_owned();
            let triangle = rows.columns(start - left, size);
            triangle.tr_solve_lower_triangular_mut(&mut own);
            vectors.rows_mut(start, size).copy_from(&own);
            if left < start {
                let before = rows.columns(0, start - left).transpose();
                vectors
                    .rows_mut(left, start - left)
                    .gemm(-1.0, &before, &own, 1.0);
            }
        }
    }

    /// `L⁻¹` times the rows of `vectors`.
    fn solve_forth(&self, vectors: &mut DMatrix<f64>) {
        for (position, rows) in self.rows.iter().enumerate() {
            let (left, start) = (self.starts[self.first[position]], self.starts[position]);
            let size = self.size(position);
            let mut own = vectors.rows(start, size).into_owned();
            if left < start {
                let before = rows.columns(0, start - left);
                own.gemm(-1.0, &before, &vectors.rows(left, start - left), 1.0);
            }
            rows.columns(start - left, size)
                .solve_lower_triangular_mut(&mut own);
            vectors.rows_mut(start, size).copy_from(&own);
        }
    }

    /// The solution of `S x = right`.
    #[must_use]
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let right = DMatrix::from_column_slice(right.len(), 1, right.as_slice());
        DVector::from_column_slice(self.solve_part(&right).as_slice())
    }

    /// The solutions of `S X = right`, column by column.
    #[must_use]
    pub fn solve_columns(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let parts: Vec<usize> = (0..right.ncols()).step_by(TOGETHER).collect();
        let parts: Vec<DMatrix<f64>> = parts
            .into_par_iter()
            .map(|from| {
                let count = TOGETHER.min(right.ncols() - from);
                self.solve_part(&right.columns(from, count).into_owned())
            })
            .collect();
        let mut solution = DMatrix::zeros(right.nrows(), right.ncols());
        for (index, part) in parts.iter().enumerate() {
            let mut columns = solution.columns_mut(index * TOGETHER, part.ncols());
            columns.copy_from(part);
        }
        solution
    }

    fn solve_part(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let mut ordered = DMatrix::zeros(right.nrows(), right.ncols());
        for (row, column) in self.places() {
            let scaled = right.row(column) * self.scale[column];
            ordered.row_mut(row).copy_from(&scaled);
        }
        self.solve_forth(&mut ordered);
        self.solve_back(&mut ordered, self.order.len());
        let mut solution = DMatrix::zeros(right.nrows(), right.ncols());
        for (row, column) in self.places() {
            let scaled = ordered.row(row) * self.scale[column];
            solution.row_mut(column).copy_from(&scaled);
        }
        solution
    }

    /// Each row of the factor and its column in the matrix.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.order.len())
            .flat_map(|at| (self.starts[at]..self.starts[at + 1]).zip(self.columns[at]..))
    }
}
