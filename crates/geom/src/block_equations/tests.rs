//! Sparse against dense solutions, and the unknowns that a singular system names.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::{BlockCholesky, BlockMatrix, BlockPattern};

/// Rounding of some hundred unknowns: relative to the largest element.
const ROUNDING: f64 = 1e-12;

/// A ring of blocks of unlike sizes with one that meets them all, and one that meets none.
fn ring() -> (BlockMatrix, DMatrix<f64>) {
    let sizes = [3, 5, 1, 4, 2, 6, 3, 2, 4];
    let mut columns = Vec::new();
    let mut end = 0;
    for size in sizes {
        columns.push(end..end + size);
        end += size;
    }
    let cliques: Vec<Vec<usize>> = (0..7)
        .map(|block| {
            let mut clique = vec![block, (block + 2) % 7, 7];
            clique.sort_unstable();
            clique
        })
        .collect();
    let pattern = BlockPattern::of(columns, cliques.iter().map(Vec::as_slice));
    let mut sparse = BlockMatrix::zeros(&pattern);
    let mut dense = DMatrix::zeros(end, end);
    // Rows like those of points: irregular numbers in the columns of a clique.
    let mut number = 0.7_f64;
    for clique in &cliques {
        let of: Vec<usize> = clique
            .iter()
            .flat_map(|block| pattern.columns(*block))
            .collect();
        let rows = DMatrix::from_fn(5, of.len(), |_, _| {
            number = (number * 997.0 + 0.123).fract();
            number - 0.5
        });
        let sums = rows.tr_mul(&rows);
        sparse.add(clique, &sums);
        for (row, of_row) in of.iter().enumerate() {
            for (column, of_column) in of.iter().enumerate() {
                dense[(*of_row, *of_column)] += sums[(row, column)];
            }
        }
    }
    for column in 0..end {
        // Units far apart, as metres and radians are.
        let weight = 0.3 + column as f64;
        sparse.add_to_element(column, column, weight);
        dense[(column, column)] += weight;
    }
    (sparse, dense)
}

#[test]
fn a_sparse_system_is_solved_like_a_dense_one() {
    let (sparse, dense) = ring();
    let factor = BlockCholesky::new(&sparse).unwrap();
    let right = DVector::from_fn(dense.nrows(), |row, _| (row as f64).sin());
    let expected = dense.clone().cholesky().unwrap().solve(&right);
    let found = factor.solve(&right);
    assert!((&found - &expected).amax() < ROUNDING * expected.amax());
    let many = DMatrix::from_fn(dense.nrows(), 71, |row, column| {
        ((row * 71 + column) as f64).cos()
    });
    let expected = dense.clone().cholesky().unwrap().solve(&many);
    assert!((factor.solve_columns(&many) - &expected).amax() < ROUNDING * expected.amax());
}

#[test]
fn blocks_of_the_inverse_equal_those_of_the_dense_one() {
    let (sparse, dense) = ring();
    let inverse = BlockCholesky::new(&sparse).unwrap().inverse(&sparse);
    let expected = dense.cholesky().unwrap().inverse();
    let mut blocks = 0;
    for column in 0..expected.ncols() {
        for row in 0..expected.nrows() {
            if let Some(found) = inverse.element(row, column) {
                blocks += 1;
                assert!((found - expected[(row, column)]).abs() < ROUNDING * expected.amax());
            }
        }
    }
    assert!(blocks > 300 && blocks < expected.len(), "{blocks}");
    let local = inverse.local(&[0, 2, 7]);
    let of: Vec<usize> = (0..3).chain(8..9).chain(24..26).collect();
    for (row, of_row) in of.iter().enumerate() {
        for (column, of_column) in of.iter().enumerate() {
            let difference = local[(row, column)] - expected[(*of_row, *of_column)];
            assert!(difference.abs() < ROUNDING * expected.amax());
        }
    }
}

/// Numbers that the factor of such a pattern holds.
fn stored(columns: Vec<std::ops::Range<usize>>, cliques: &[Vec<usize>]) -> usize {
    let pattern = BlockPattern::of(columns, cliques.iter().map(Vec::as_slice));
    let mut matrix = BlockMatrix::zeros(&pattern);
    for column in 0..pattern.unknowns() {
        matrix.add_to_element(column, column, 1.0);
    }
    let factor = BlockCholesky::new(&matrix).unwrap();
    factor.rows.iter().map(DMatrix::len).sum()
}

#[test]
fn a_chain_of_many_blocks_has_a_narrow_envelope() {
    // Blocks that meet their neighbour, numbered at random.
    let count = 101;
    let place = |block: usize| block * 37 % count;
    let cliques: Vec<Vec<usize>> = (1..count)
        .map(|block| {
            let mut pair = vec![place(block - 1), place(block)];
            pair.sort_unstable();
            pair
        })
        .collect();
    let columns = (0..count).map(|block| 2 * block..2 * block + 2).collect();
    let stored = stored(columns, &cliques);
    // The pairs of 2 × 2 and the diagonal, no more.
    assert_eq!(stored, 4 * (2 * count - 1));
}

#[test]
fn a_block_that_all_others_meet_is_a_row_at_the_end_of_the_envelope() {
    // A chain, and in its midst a single unknown that occurs with every block.
    let (count, shared) = (101, 40);
    let cliques: Vec<Vec<usize>> = (1..count)
        .filter(|block| ![shared, shared + 1].contains(block))
        .map(|block| {
            let mut clique = vec![block - 1, block, shared];
            clique.sort_unstable();
            clique
        })
        .collect();
    let mut columns = Vec::new();
    let mut first = 0;
    for block in 0..count {
        let width = if block == shared { 1 } else { 2 };
        columns.push(first..first + width);
        first += width;
    }
    let stored = stored(columns, &cliques);
    // Two chains of 40 and 60 blocks with pairs and diagonals of 2 × 2, and one row of all unknowns.
    assert_eq!(stored, 4 * (2 * 40 - 1 + 2 * 60 - 1) + 2 * 100 + 1);
}

fn of_one_block(matrix: &DMatrix<f64>) -> BlockMatrix {
    let columns = 0..matrix.ncols();
    let pattern = BlockPattern::of(vec![columns], std::iter::empty());
    let mut blocks = BlockMatrix::zeros(&pattern);
    blocks.add(&[0], matrix);
    blocks
}

#[test]
fn badly_scaled_equations_are_solved() {
    // Two unknowns in units twelve powers of ten apart.
    let matrix = DMatrix::from_row_slice(2, 2, &[4e12, 1.0, 1.0, 1e-12]);
    let truth = DVector::from_column_slice(&[3e-6, 2e6]);
    let blocks = of_one_block(&matrix);
    let factor = BlockCholesky::new(&blocks).unwrap();
    let solution = factor.solve(&(&matrix * &truth));
    for index in 0..2 {
        assert!((solution[index] / truth[index] - 1.0).abs() < 1e-14); // rounding
    }
    let identity = &matrix * factor.inverse(&blocks).local(&[0]);
    assert!((identity[(0, 0)] - 1.0).abs() < 1e-14 && (identity[(1, 1)] - 1.0).abs() < 1e-14);
}

#[test]
fn the_unknowns_of_a_singular_system_are_named() {
    // The first and the third unknown occur only as their sum: in one block, and in two.
    let matrix = DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 2.0, 0.0, 1.0, 0.0, 2.0, 0.0, 2.0]);
    let named = |matrix: &BlockMatrix| {
        let mut unknowns = BlockCholesky::new(matrix).unwrap_err().unknowns;
        unknowns.sort_unstable();
        unknowns
    };
    assert_eq!(named(&of_one_block(&matrix)), [0, 2]);
    let pair: &[usize] = &[0, 1];
    let pattern: Arc<BlockPattern> = BlockPattern::of(vec![0..2, 2..3], std::iter::once(pair));
    let mut blocks = BlockMatrix::zeros(&pattern);
    blocks.add(pair, &matrix);
    assert_eq!(named(&blocks), [0, 2]);
    let untouched = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]);
    assert_eq!(named(&of_one_block(&untouched)), [1]);
    let broken = DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, f64::NAN, 1.0]);
    assert!(BlockCholesky::new(&of_one_block(&broken)).is_err());
}
