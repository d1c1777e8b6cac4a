//! Images of one pass, whose orbit and attitude err alike: their a priori values are correlated.
//!
//! With the factor `C = G D Gᵀ` of the covariance `C` of their constant unknowns `c`, `G` lower with ones on its diagonal, the
//! elements of `G⁻¹ c` are independent with variances `D`: each unknown has an expected value that follows those before it.
//!
//! # Source
//! Golub and Van Loan, Matrix Computations, section 4.1.2.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Constant unknowns of an image: three positions and three rotations.
pub(super) const CONSTANTS: usize = 6;

/// Images of one pass.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonPass {
    /// Indices of two or more images, each of one pass only.
    pub images: Vec<usize>,
    /// A priori covariance of their constant unknowns, metres and radians: X, Y, Z and the rotations about the camera's x, y
    /// and z axis, one image after the other. Variances of unknowns that are fixed or free are not used; the others replace
    /// the standard deviations of the images.
    pub covariance: DMatrix<f64>,
}

/// An unknown whose expected value follows those before it.
pub(super) struct Following {
    /// Standard deviation of its difference from this value.
    pub(super) sigma: f64,
    /// The unknowns that it follows, by their place among those before it, with the factor of each.
    pub(super) of: Vec<(usize, f64)>,
}

impl CommonPass {
    /// The covariance of some constant unknowns, by their indices, divided by their standard deviations, and these.
    fn correlations(&self, of: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
        let sigmas: Vec<f64> = of
            .iter()
            .map(|at| self.covariance[(*at, *at)].sqrt())
            .collect();
        let correlations = DMatrix::from_fn(of.len(), of.len(), |row, column| {
            self.covariance[(of[row], of[column])] / (sigmas[row] * sigmas[column])
        });
        (correlations, sigmas)
    }

    fn factor(&self, of: &[usize]) -> Option<(Cholesky<f64, Dyn>, Vec<f64>)> {
        let (correlations, sigmas) = self.correlations(of);
        Some((Cholesky::new(correlations)?, sigmas))
    }

    /// What some of the constant unknowns follow, in their order; nothing if they have no factor, which the check refuses.
    pub(super) fn following(&self, of: &[usize]) -> Vec<Following> {
        let Some((factor, sigmas)) = self.factor(of) else {
            return Vec::new();
        };
        let factor = factor.unpack();
        let mut inverse = DMatrix::identity(of.len(), of.len());
        factor.solve_lower_triangular_mut(&mut inverse);
        let following = |row: usize| {
            let before = (0..row).filter_map(|column| {
                let share = -inverse[(row, column)] / inverse[(row, row)];
                (share != 0.0).then(|| (column, share * sigmas[row] / sigmas[column]))
            });
            Following {
                sigma: sigmas[row] * factor[(row, row)],
                of: before.collect(),
            }
        };
        (0..of.len()).map(following).collect()
    }

    /// The smallest eigenvalue of the correlations of some constant unknowns where these have no factor; NaN if their number
    /// differs from that of the images.
    pub(super) fn without_factor(&self, used: impl Fn(usize, usize) -> bool) -> Option<f64> {
        let size = CONSTANTS * self.images.len();
        if self.covariance.shape() != (size, size) {
            return Some(f64::NAN);
        }
        let is_used = |at: &usize| used(self.images[at / CONSTANTS], at % CONSTANTS);
        let of: Vec<usize> = (0..size).filter(is_used).collect();
        let (correlations, _) = self.correlations(&of);
        let least = || correlations.clone().symmetric_eigenvalues().min();
        self.factor(&of).is_none().then(least)
    }
}
