//! Cholesky factor of a large dense matrix, in blocks.

use nalgebra::{Cholesky, DMatrix, DMatrixView, DMatrixViewMut, DVector};
use rayon::prelude::*;

/// Rows and columns of a block: nearly all work is in products of matrices, which nalgebra computes faster than it solves
/// triangular equations.
const BLOCK: usize = 64;
/// Right-hand sides that one task solves: with fewer, products of matrices take as long to arrange the factor as to multiply.
const COLUMNS: usize = 256;
/// Least operations of a task, about a millisecond: to give a smaller one to another thread takes as long as to do it.
const TASK_OPERATIONS: usize = 1 << 25;

/// Pieces of a task, from the operations of one.
const fn pieces_of_a_task(operations: usize) -> usize {
    TASK_OPERATIONS / (operations + 1) + 1
}

/// `L` of `A = L Lᵀ`. The same bits with any number of threads.
///
/// # Source
/// Golub and Van Loan, Matrix Computations, sections 3.1.4 and 4.2.6.
#[derive(Debug, Clone)]
pub(crate) struct BlockedCholesky {
    /// Its lower triangle is the factor.
    l: DMatrix<f64>,
    /// Inverses of the blocks of its diagonal.
    inverses: Vec<DMatrix<f64>>,
}

impl BlockedCholesky {
    /// The factor of a symmetric matrix, whose lower triangle is read; `None` where it is not positive definite.
    pub(crate) fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let rows = matrix.nrows();
        let mut inverses = Vec::with_capacity(rows.div_ceil(BLOCK));
        for start in (0..rows).step_by(BLOCK) {
            let size = BLOCK.min(rows - start);
            let rest = start + size;
            let block = matrix.view((start, start), (size, size)).into_owned();
            let factor = Cholesky::new(block)?.unpack();
            let mut inverse = DMatrix::identity(size, size);
            factor.solve_lower_triangular_mut(&mut inverse);
            matrix
                .view_mut((start, start), (size, size))
                .copy_from(&factor);
            let below = matrix.view((rest, start), (rows - rest, size)) * inverse.transpose();
            matrix
                .view_mut((rest, start), (rows - rest, size))
                .copy_from(&below);
            inverses.push(inverse);
            let columns = matrix.as_mut_slice()[rest * rows..]
                .par_chunks_mut(BLOCK * rows)
                .with_min_len(pieces_of_a_task(2 * BLOCK * BLOCK * (rows - rest)));
            columns.enumerate().for_each(|(index, columns)| {
                let first = index * BLOCK;
                let width = columns.len() / rows;
                let of_columns = below.rows(first, width).transpose();
                let from = rest + first;
                DMatrixViewMut::from_slice(columns, rows, width)
                    .rows_mut(from, rows - from)
                    .gemm(-1.0, &below.rows(first, rows - from), &of_columns, 1.0);
            });
        }
        Some(Self {
            l: matrix,
            inverses,
        })
    }

    /// Solves `A x = b` for every column of `b`, in its place.
    pub(crate) fn solve_mut(&self, b: &mut DMatrix<f64>) {
        in_pieces(b, |mut columns| {
            self.solve_lower(&mut columns);
            self.solve_upper(&mut columns);
        });
    }

    /// Solves `L y = b` for every column of `b`, in its place: `yᵀ y` is `bᵀ A⁻¹ b`.
    pub(crate) fn solve_lower_mut(&self, b: &mut DMatrix<f64>) {
        in_pieces(b, |mut columns| self.solve_lower(&mut columns));
    }

    /// The solution of `A x = b`.
    pub(crate) fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let mut solution = b.clone();
        let rows = solution.len();
        let mut column = DMatrixViewMut::from_slice(solution.as_mut_slice(), rows, 1);
        self.solve_lower(&mut column);
        self.solve_upper(&mut column);
        solution
    }

    /// The inverse of `A`.
    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        let rows = self.l.nrows();
        let mut inverse = DMatrix::identity(rows, rows);
        self.solve_mut(&mut inverse);
        inverse
    }

    fn blocks(&self) -> impl DoubleEndedIterator<Item = (usize, &DMatrix<f64>)> {
        self.inverses
            .iter()
            .enumerate()
            .map(|(block, inverse)| (block * BLOCK, inverse))
    }

    fn solve_lower(&self, b: &mut DMatrixViewMut<'_, f64>) {
        let rows = b.nrows();
        for (start, inverse) in self.blocks() {
            let rest = start + inverse.nrows();
            let (mut block, mut below) = b.rows_range_pair_mut(start..rest, rest..rows);
            let solved = inverse * &block;
            block.copy_from(&solved);
            let factors = self.l.view((rest, start), (rows - rest, rest - start));
            below.gemm(-1.0, &factors, &solved, 1.0);
        }
    }

    fn solve_upper(&self, b: &mut DMatrixViewMut<'_, f64>) {
        for (start, inverse) in self.blocks().rev() {
            let size = inverse.nrows();
            let (mut above, mut block) = b.rows_range_pair_mut(0..start, start..start + size);
            let solved = inverse.transpose() * &block;
            block.copy_from(&solved);
            let factors: DMatrixView<'_, f64> = self.l.view((start, 0), (size, start));
            above.gemm(-1.0, &factors.transpose(), &solved, 1.0);
        }
    }
}

/// Works on the columns of `b`, some at a time, on all threads.
fn in_pieces(b: &mut DMatrix<f64>, work: impl Fn(DMatrixViewMut<'_, f64>) + Sync) {
    let rows = b.nrows();
    let pieces = b
        .as_mut_slice()
        .par_chunks_mut(COLUMNS * rows.max(1))
        .with_min_len(pieces_of_a_task(COLUMNS * rows * rows));
    pieces.for_each(|columns| {
        let width = columns.len() / rows;
        work(DMatrixViewMut::from_slice(columns, rows, width));
    });
}

/// Adds `factor · rowsᵀ rows` to the lower triangle of `sum`, whose other elements are then undefined.
pub(crate) fn add_square(sum: &mut DMatrix<f64>, factor: f64, rows: &DMatrix<f64>) {
    let size = sum.nrows();
    if size == 0 || rows.nrows() == 0 {
        return;
    }
    // `tr_mul` takes seven times as long as a product with the transpose.
    let transposed = rows.transpose();
    let columns = sum
        .as_mut_slice()
        .par_chunks_mut(BLOCK * size)
        .with_min_len(pieces_of_a_task(2 * BLOCK * size * rows.nrows()));
    columns.enumerate().for_each(|(index, columns)| {
        let first = index * BLOCK;
        let width = columns.len() / size;
        DMatrixViewMut::from_slice(columns, size, width)
            .rows_mut(first, size - first)
            .gemm(
                factor,
                &transposed.rows(first, size - first),
                &rows.columns(first, width),
                1.0,
            );
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_solve_as_the_whole() {
        // One row, one block, a block and a row, several blocks with a remainder; right-hand sides for one task and two.
        for (rows, columns) in [(1, 1), (64, 7), (65, 64), (200, 65)] {
            let root = DMatrix::from_fn(rows, rows, |row, column| {
                ((row * 31 + column * 17) % 23) as f64 - 11.0
            });
            let matrix = &root * root.transpose() + DMatrix::identity(rows, rows) * 50.0;
            let right =
                DMatrix::from_fn(rows, columns, |row, column| (1 + row + 3 * column) as f64);
            let factor = BlockedCholesky::new(matrix.clone()).unwrap();
            let mut solution = right.clone();
            factor.solve_mut(&mut solution);
            // Condition about 1e4 times rounding.
            let error = (&matrix * solution - &right).amax() / right.amax();
            assert!(error < 1e-10, "{rows}: {error}");
            let inverse = factor.inverse();
            assert!((&matrix * &inverse - DMatrix::identity(rows, rows)).amax() < 1e-10);
            // Half a solution gives the square of a whole one.
            let mut half = right.clone();
            factor.solve_lower_mut(&mut half);
            let mut square = DMatrix::zeros(columns, columns);
            add_square(&mut square, 2.0, &half);
            let whole = 2.0 * right.transpose() * inverse * &right;
            let error = (square - &whole).lower_triangle().amax() / whole.amax();
            assert!(error < 1e-10, "{rows}: {error}");
            let only = right.column(0).into_owned();
            let error = (&matrix * factor.solve(&only) - &only).amax() / right.amax();
            assert!(error < 1e-10, "{rows}: {error}");
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        for wrong in [-1.0, 0.0, f64::NAN] {
            let mut matrix = DMatrix::identity(130, 130);
            matrix[(100, 100)] = wrong;
            assert!(BlockedCholesky::new(matrix).is_none(), "{wrong}");
        }
    }
}
