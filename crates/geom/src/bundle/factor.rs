//! The factor of the reduced equations, observed heights included.
//!
//! Heights have a full covariance and tie all images to each other. The equations stay sparse without them; with their
//! rows `G` in the shared unknowns and their covariance `Σ`,
//! `(S + Gᵀ Σ⁻¹ G)⁻¹ = S⁻¹ − Z K⁻¹ Zᵀ`, `Z = S⁻¹ Gᵀ`, `K = Σ + G Z`. At most a few hundred heights are observed, so `Z`
//! takes as many solutions of the sparse equations.
//!
//! # Source
//! Woodbury 1950, Inverting modified matrices.

use nalgebra::{DMatrix, DVector};

use super::reduced_heights::ReducedHeights;
use crate::{
    block_equations::{BlockCholesky, BlockMatrix, Singular},
    blocked_cholesky::BlockedCholesky,
};

/// Factorised reduced equations.
pub(super) struct Factor {
    shared: BlockCholesky,
    heights: Option<HeightFactor>,
}

/// The contribution of heights to the factor.
struct HeightFactor {
    /// `G`.
    by_shared: DMatrix<f64>,
    /// `Z`.
    solved: DMatrix<f64>,
    /// `K`.
    capacity: BlockedCholesky,
}

impl Factor {
    pub(super) fn new(
        matrix: &BlockMatrix,
        heights: Option<&ReducedHeights>,
    ) -> Result<Self, Singular> {
        let shared = BlockCholesky::new(matrix)?;
        let heights = heights.map(|heights| {
            let by_shared = heights.by_shared.clone();
            let solved = shared.solve_columns(&by_shared.transpose());
            let mut capacity = &heights.covariance_m2 + &by_shared * &solved;
            capacity = (&capacity + capacity.transpose()) * 0.5;
            let capacity = BlockedCholesky::new(capacity).ok_or_else(|| Singular {
                unknowns: Vec::new(),
            })?;
            Ok(HeightFactor {
                by_shared,
                solved,
                capacity,
            })
        });
        Ok(Self {
            shared,
            heights: heights.transpose()?,
        })
    }

    /// The solution for one right-hand side.
    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let solution = self.shared.solve(right);
        match &self.heights {
            None => solution,
            Some(heights) => {
                let pull = heights.capacity.solve(&(&heights.by_shared * &solution));
                solution - &heights.solved * pull
            }
        }
    }

    /// The inverse where `matrix` has blocks.
    pub(super) fn cofactors(&self, matrix: &BlockMatrix) -> BlockMatrix {
        let mut cofactors = self.shared.inverse(matrix);
        if let Some(heights) = &self.heights {
            let mut shares = heights.solved.transpose();
            heights.capacity.solve_lower_mut(&mut shares);
            cofactors.subtract_squares(&shares);
        }
        cofactors
    }

    /// `(S + Gᵀ Σ⁻¹ G)⁻¹ Gᵀ Σ⁻¹ = Z K⁻¹`, one column per height, and `K⁻¹`.
    pub(super) fn through_heights(&self) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        self.heights.as_ref().map(|heights| {
            let mut through = heights.solved.transpose();
            heights.capacity.solve_mut(&mut through);
            (through.transpose(), heights.capacity.inverse())
        })
    }
}
