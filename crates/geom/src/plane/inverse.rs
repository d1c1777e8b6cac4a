//! The inverse of the normal matrix where the triangular factor is not 0: sufficient for the covariances of neighbours.

use nalgebra::{Complex, Matrix2};

use super::eliminate::{Step, inverse_of_triangle};

type Block = Matrix2<Complex<f64>>;

/// Cofactors of pictures by their positions in the order of elimination.
pub(super) struct Cofactors {
    rows: Vec<(Block, Vec<(usize, Block)>)>,
}

impl Cofactors {
    /// From the triangular factor, the last picture first.
    ///
    /// # Source
    /// Takahashi, Fagan & Chin 1973, Proc. 8th PICA Conference, 63–69, by blocks of a picture.
    pub(super) fn of(steps: &[Step]) -> Self {
        let mut rows: Vec<(Block, Vec<(usize, Block)>)> =
            steps.iter().map(|_| (Block::zeros(), Vec::new())).collect();
        for (place, step) in steps.iter().enumerate().rev() {
            let mut sums = vec![Block::zeros(); step.later.len()];
            for (index, (other, factor)) in step.later.iter().enumerate() {
                let (own, across) = &rows[*other];
                sums[index] += factor * own;
                let mut across = across.iter();
                for (further, (third, of_third)) in step.later.iter().enumerate().skip(index + 1) {
                    // Both lists ascend, and blocks that follow in this row follow in the row of `other` too.
                    if let Some((_, block)) = across.find(|(of, _)| of == third) {
                        sums[further] += factor * block;
                        sums[index] += of_third * block.adjoint();
                    }
                }
            }
            let back = inverse_of_triangle(&step.own);
            let across: Vec<(usize, Block)> = step
                .later
                .iter()
                .zip(&sums)
                .map(|((other, _), sum)| (*other, -back * sum))
                .collect();
            let through = step.later.iter().zip(&across);
            let rest = through.fold(back.adjoint(), |rest, ((_, factor), (_, block))| {
                rest - factor * block.adjoint()
            });
            rows[place] = (back * rest, across);
        }
        Self { rows }
    }

    /// The cofactors between two connected pictures; 0 between others.
    pub(super) fn between(&self, one: usize, two: usize) -> Block {
        if one == two {
            return self.rows[one].0;
        }
        let (first, second) = (one.min(two), one.max(two));
        let across = &self.rows[first].1;
        let found = across.binary_search_by_key(&second, |(place, _)| *place);
        let block = found.map_or_else(|_| Block::zeros(), |index| across[index].1);
        if one < two { block } else { block.adjoint() }
    }
}
