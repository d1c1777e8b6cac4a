//! Symmetric equations of many unknowns in blocks, most of which do not occur together.
//!
//! Images that share no point have no block between them. In an order that keeps neighbours together
//! (`ordering`) the factor fills nothing but an envelope about the diagonal (`factor`), and the part of the
//! inverse that covariances need lies in the same envelope (`inverse`). For `n` images whose envelope is `b` wide,
//! with `m` unknowns each, memory is `n b m²`, the factor costs `n b² m³` and the inverse twice that.
//!
//! # Source
//! George & Liu 1981, Computer Solution of Large Sparse Positive Definite Systems (envelope, reverse Cuthill–McKee);
//! Takahashi, Fagan & Chin 1973 (elements of the inverse from the factor).

mod factor;
mod inverse;
mod ordering;
#[cfg(test)]
mod tests;

use std::{ops::Range, sync::Arc};

use nalgebra::{DMatrix, DMatrixView};

pub use factor::{BlockCholesky, Singular};

/// Pattern of the blocks of unknowns that occur together.
#[derive(Debug, PartialEq, Eq)]
pub struct BlockPattern {
    /// Columns of each block.
    columns: Vec<Range<usize>>,
    /// For each block, the preceding blocks that it meets, ascending, and itself last.
    met: Vec<Vec<usize>>,
    /// Index at which the values of each of these begin.
    starts: Vec<Vec<usize>>,
    /// Number of values.
    len: usize,
}

impl BlockPattern {
    /// The pattern of adjacent blocks in `columns`; each of `cliques` lists, ascending, blocks that occur together.
    pub fn of<'a>(
        columns: Vec<Range<usize>>,
        cliques: impl Iterator<Item = &'a [usize]>,
    ) -> Arc<Self> {
        let mut met: Vec<Vec<usize>> = (0..columns.len()).map(|block| vec![block]).collect();
        for clique in cliques {
            for (index, block) in clique.iter().enumerate() {
                for before in &clique[..index] {
                    if let Err(at) = met[*block].binary_search(before) {
                        met[*block].insert(at, *before);
                    }
                }
            }
        }
        let mut len = 0;
        let starts = met.iter().zip(&columns).map(|(met, own)| {
            let starts = met.iter().map(|other| {
                let start = len;
                len += columns[*other].len() * own.len();
                start
            });
            starts.collect()
        });
        let starts = starts.collect();
        Arc::new(Self {
            columns,
            met,
            starts,
            len,
        })
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.columns.len()
    }

    /// Number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.columns.last().map_or(0, |columns| columns.end)
    }

    /// Columns of a block.
    #[must_use]
    pub fn columns(&self, block: usize) -> Range<usize> {
        self.columns[block].clone()
    }

    /// The blocks before `block` that it meets, ascending, and itself last.
    #[must_use]
    pub fn met(&self, block: usize) -> &[usize] {
        &self.met[block]
    }

    /// The block of a column.
    fn block_of(&self, column: usize) -> usize {
        self.columns.partition_point(|of| of.end <= column)
    }

    /// Range of the values of the block in the rows of `row` and the columns of `column`, which is not before `row`.
    fn values_of(&self, row: usize, column: usize) -> Option<Range<usize>> {
        let at = self.met[column].binary_search(&row).ok()?;
        let start = self.starts[column][at];
        Some(start..start + self.columns[row].len() * self.columns[column].len())
    }
}

/// A symmetric matrix in blocks: those on and above the diagonal, each column by column.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockMatrix {
    pattern: Arc<BlockPattern>,
    values: Vec<f64>,
}

impl BlockMatrix {
    /// A matrix of zeros.
    #[must_use]
    pub fn zeros(pattern: &Arc<BlockPattern>) -> Self {
        Self {
            values: vec![0.0; pattern.len],
            pattern: Arc::clone(pattern),
        }
    }

    /// Its pattern.
    #[must_use]
    pub fn pattern(&self) -> &Arc<BlockPattern> {
        &self.pattern
    }

    /// The block in the rows of `row` and the columns of `column`, which is not before it; `None` where they do not
    /// meet.
    #[must_use]
    pub fn block(&self, row: usize, column: usize) -> Option<DMatrixView<'_, f64>> {
        let values = &self.values[self.pattern.values_of(row, column)?];
        let (rows, columns) = (
            self.pattern.columns[row].len(),
            self.pattern.columns[column].len(),
        );
        Some(DMatrixView::from_slice(values, rows, columns))
    }

    /// One element; `None` where its blocks do not meet.
    #[must_use]
    pub fn element(&self, row: usize, column: usize) -> Option<f64> {
        let (row, column) = (row.min(column), row.max(column));
        let blocks = (self.pattern.block_of(row), self.pattern.block_of(column));
        let block = self.block(blocks.0, blocks.1)?;
        Some(
            block[(
                row - self.pattern.columns[blocks.0].start,
                column - self.pattern.columns[blocks.1].start,
            )],
        )
    }

    /// Adds to an element and to the one that mirrors it; blocks that do not meet have none.
    pub fn add_to_element(&mut self, row: usize, column: usize, value: f64) {
        let (row, column) = (row.min(column), row.max(column));
        let [upper, right] = [row, column].map(|of| self.pattern.block_of(of));
        let [rows, columns] = [upper, right].map(|of| self.pattern.columns(of));
        if let Some(values) = self.pattern.values_of(upper, right) {
            let at = |row: usize, column: usize| {
                values.start + (column - columns.start) * rows.len() + (row - rows.start)
            };
            self.values[at(row, column)] += value;
            if upper == right && row != column {
                self.values[at(column, row)] += value;
            }
        }
    }

    /// Elements on the diagonal.
    #[must_use]
    pub fn diagonal(&self) -> Vec<f64> {
        let blocks = (0..self.pattern.blocks()).filter_map(|block| self.block(block, block));
        blocks
            .flat_map(|block| block.diagonal().iter().copied().collect::<Vec<_>>())
            .collect()
    }

    /// Adds a symmetric matrix in the columns of `blocks`, ascending, which occur together.
    ///
    /// `local` may have more rows and columns than these.
    pub fn add(&mut self, blocks: &[usize], local: &DMatrix<f64>) {
        self.visit(blocks, |values, (row, column), (rows, columns)| {
            for (own, from) in values
                .chunks_exact_mut(rows)
                .zip(local.view((row, column), (rows, columns)).column_iter())
            {
                for (own, from) in own.iter_mut().zip(from.iter()) {
                    *own += from;
                }
            }
        });
    }

    /// Subtracts `rowsᵀ rows` where the matrix has blocks.
    pub fn subtract_squares(&mut self, rows: &DMatrix<f64>) {
        let pattern = Arc::clone(&self.pattern);
        for right in 0..pattern.blocks() {
            let of_right = pattern.columns(right);
            for left in pattern.met(right) {
                let of_left = pattern.columns(*left);
                let transposed = rows.columns(of_left.start, of_left.len()).transpose();
                let product = transposed * rows.columns(of_right.start, of_right.len());
                if let Some(values) = pattern.values_of(*left, right) {
                    for (value, product) in self.values[values].iter_mut().zip(product.iter()) {
                        *value -= product;
                    }
                }
            }
        }
    }

    /// The symmetric matrix in the columns of `blocks`, ascending, which occur together.
    #[must_use]
    pub fn local(&self, blocks: &[usize]) -> DMatrix<f64> {
        let width = blocks
            .iter()
            .map(|block| self.pattern.columns[*block].len());
        let width = width.sum();
        let mut local = DMatrix::zeros(width, width);
        let mut column = 0;
        for (index, right) in blocks.iter().enumerate() {
            let mut row = 0;
            for left in &blocks[..=index] {
                if let Some(block) = self.block(*left, *right) {
                    local
                        .view_mut((row, column), block.shape())
                        .copy_from(&block);
                }
                row += self.pattern.columns[*left].len();
            }
            column += self.pattern.columns[*right].len();
        }
        local.fill_lower_triangle_with_upper_triangle();
        local
    }

    /// Calls `look` with the values of each pair of `blocks`, its position in the matrix of these blocks only, and its
    /// shape.
    fn visit(
        &mut self,
        blocks: &[usize],
        mut look: impl FnMut(&mut [f64], (usize, usize), (usize, usize)),
    ) {
        let Self { pattern, values } = self;
        let mut column = 0;
        for (index, right) in blocks.iter().enumerate() {
            let mut row = 0;
            for left in &blocks[..=index] {
                let shape = (pattern.columns[*left].len(), pattern.columns[*right].len());
                if let Some(of) = pattern.values_of(*left, *right) {
                    look(&mut values[of], (row, column), shape);
                }
                row += shape.0;
            }
            column += pattern.columns[*right].len();
        }
    }
}
