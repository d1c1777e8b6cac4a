//! Reduced normal equations: each point's coordinates are eliminated, the shared unknowns remain.
//!
//! An orthogonal transformation of a point's rows confines its three coordinates to the first three of them. The
//! squares of the other rows sum up to the Schur complement `U − W V⁻¹ Wᵀ`; nothing is subtracted, so there is no
//! cancellation. Images that share no point have no block in it.

use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;

use super::{
    groups::{Group, PointGroups},
    layout::{Layout, Linearised},
    point_rows::PointRows,
    reduced_heights::ReducedHeights,
};
use crate::{
    block_equations::BlockMatrix,
    pushbroom::{ExteriorOrientation, Unseen},
};

/// Groups summed in parallel before they are added to the whole, one after the other: a memory bound.
const TOGETHER: usize = 64;
/// Numbers of a group's rows that are multiplied together: as many as a processor's cache holds.
const ROWS_TOGETHER: usize = 16_384;

/// Reduced normal equations at a state.
pub(super) struct Reduced {
    /// Without the heights.
    pub(super) matrix: BlockMatrix,
    /// With them, as the sum.
    pub(super) right: DVector<f64>,
    /// The minimised sum.
    pub(super) cost: f64,
    /// Heights, where they are observed.
    pub(super) heights: Option<ReducedHeights>,
}

/// State of an iteration.
pub(super) struct Settled {
    pub(super) at: Linearised,
    pub(super) reduced: Reduced,
}

/// Sums of products of a group's rows.
struct GroupSums {
    /// In the unknowns of the group, and last the misclosures.
    products: DMatrix<f64>,
    cost: f64,
}

impl GroupSums {
    fn of<M: ExteriorOrientation>(
        layout: &Layout<'_, M>,
        at: &Linearised,
        group: &Group,
    ) -> Result<Self, Unseen> {
        let blocks = group.blocks.iter();
        let width = 1 + blocks
            .map(|block| layout.columns.blocks[*block].len())
            .sum::<usize>();
        let mut sums = Self {
            products: DMatrix::zeros(width, width),
            cost: 0.0,
        };
        let mut rows = PointRows::default();
        let mut left = Vec::new();
        for point in &group.points {
            layout.fill(&mut rows, at, *point)?;
            rows.eliminate();
            sums.cost += rows.cost;
            left.extend_from_slice(&rows.beside[3 * width..]);
            if left.len() > ROWS_TOGETHER {
                sums.add(&mut left);
            }
        }
        sums.add(&mut left);
        Ok(sums)
    }

    /// Adds the products of `rows`, one after the other, and empties them.
    fn add(&mut self, rows: &mut Vec<f64>) {
        let width = self.products.nrows();
        let transposed = DMatrixView::from_slice(rows, width, rows.len() / width);
        self.products
            .gemm(1.0, &transposed, &transposed.transpose(), 1.0);
        rows.clear();
    }
}

/// The reduced equations of the points in `groups`.
pub(super) fn reduce<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    at: &Linearised,
    groups: &PointGroups,
) -> Result<Reduced, Unseen> {
    let mut sum = Reduced {
        matrix: BlockMatrix::zeros(&groups.pattern),
        right: DVector::zeros(layout.columns.len()),
        cost: 0.0,
        heights: None,
    };
    for groups in groups.groups.chunks(TOGETHER) {
        let sums: Vec<GroupSums> = groups
            .par_iter()
            .map(|group| GroupSums::of(layout, at, group))
            .collect::<Result<_, Unseen>>()?;
        for (group, sums) in groups.iter().zip(&sums) {
            sum.add(layout, group, sums);
        }
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        // Infinite standard deviations have no weight.
        let weight = sigma.powi(-2);
        let off = layout.columns.off_prior(&at.state.corrections, column);
        let terms = layout.columns.prior_terms(column);
        for (row, factor) in terms.clone() {
            sum.right[row] -= weight * factor * off;
            let from_row = terms.clone().filter(|(other, _)| *other <= row);
            for (other, of_other) in from_row {
                sum.matrix
                    .add_to_element(other, row, weight * factor * of_other);
            }
        }
        sum.cost += weight * off * off;
    }
    if let Some(heights) = &layout.heights {
        let heights = ReducedHeights::of(layout, heights, at, heights.surface.relief.is_some())?;
        sum.right += heights.right();
        sum.cost += heights.weighted_squares();
        sum.heights = Some(heights);
    }
    Ok(sum)
}

impl Reduced {
    fn add<M>(&mut self, layout: &Layout<'_, M>, group: &Group, sums: &GroupSums) {
        self.cost += sums.cost;
        self.matrix.add(&group.blocks, &sums.products);
        let columns = group.blocks.iter();
        let columns = columns.flat_map(|block| layout.columns.blocks[*block].clone());
        let misclosures = sums.products.column(sums.products.ncols() - 1);
        for (column, product) in columns.zip(&misclosures) {
            self.right[column] += product;
        }
    }
}
