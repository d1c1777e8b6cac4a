//! Heights of points above a surface, observed to be 0 with a full covariance.
//!
//! Points are still eliminated one by one. With the triangle `R` that remains of their own rows, the change of a height
//! by the point is `u = R⁻ᵀ ∂h/∂P`; the variance that the rays leave in it is `u·u`, and the shared unknowns see it
//! through `G = −uᵀC`, `C` their part of the transformed rows. The heights are then observations of the shared unknowns
//! with the covariance `Σ` = surface covariance + jitter + diag(u·u), and afterwards observations of the points.
//!
//! # Source
//! The partitioned inverse (Woodbury 1950) of normal equations with additional observations of the points.

use nalgebra::{DMatrix, DVector, Vector3};

use super::{
    HeightResidual,
    control::CommonNoise,
    heights::Heights,
    jitter,
    layout::{Layout, Linearised},
    point_rows::PointRows,
};
use crate::{
    blocked_cholesky::BlockedCholesky,
    pushbroom::{ExteriorOrientation, Unseen},
};

/// Covariance of heights by errors that measurements of neighbouring points have in common, m²; `turned` as in
/// [`ReducedHeights`]. The variances of the rays stay as they are: an upper bound.
fn common_m2(
    common: &CommonNoise,
    places_m: &[Vector3<f64>],
    turned: &[Vector3<f64>],
) -> DMatrix<f64> {
    DMatrix::from_fn(turned.len(), turned.len(), |row, column| {
        let apart_m = (places_m[row] - places_m[column]).norm();
        let by_rays_m2 = turned[row].norm() * turned[column].norm();
        common.share * by_rays_m2 * (-apart_m / common.reach_m).exp()
    })
}

/// Heights in terms of the shared unknowns.
#[derive(Clone)]
pub(super) struct ReducedHeights {
    /// The misclosure of each height after its rays, metres, and its change by the shared unknowns.
    pub(super) misclosures_m: DVector<f64>,
    pub(super) by_shared: DMatrix<f64>,
    /// Variance that the rays of each point leave in its height when orientations are known, m².
    pub(super) ray_variances_m2: DVector<f64>,
    /// Current height differences, metres.
    differences_m: DVector<f64>,
    /// `u` of each point, and the motion of the point with its height.
    pub(super) turned: Vec<Vector3<f64>>,
    moves: Vec<Vector3<f64>>,
    /// Covariance of surface, jitter and rays together, `Σ`, m².
    pub(super) covariance_m2: DMatrix<f64>,
    factor: BlockedCholesky,
    /// Covariance of the observed heights: surface, robust weights and jitter, m², and its factor.
    observed_m2: DMatrix<f64>,
    of_surface: BlockedCholesky,
}

impl ReducedHeights {
    /// Reduces the heights; jitter and common noise count where they determine planimetry.
    pub(super) fn of<M: ExteriorOrientation>(
        layout: &Layout<'_, M>,
        heights: &Heights,
        at: &Linearised,
        is_for_plan: bool,
    ) -> Result<Self, Unseen> {
        let (count, columns) = (heights.points.len(), layout.columns.len());
        let mut misclosures_m = DVector::zeros(count);
        let mut by_shared = DMatrix::zeros(count, columns);
        let mut differences_m = DVector::zeros(count);
        let (mut turned, mut moves) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut rows = PointRows::default();
        for (index, point) in heights.points.iter().enumerate() {
            layout.fill(&mut rows, at, *point)?;
            let triangle = rows.eliminate();
            let (difference_m, by_point) = heights.difference_m(&at.state, index);
            let u = triangle
                .tr_solve_upper_triangular(&by_point)
                .ok_or(Unseen::BehindCamera)?;
            let step = triangle
                .solve_upper_triangular(&u)
                .ok_or(Unseen::BehindCamera)?;
            differences_m[index] = difference_m;
            misclosures_m[index] = difference_m;
            for (axis, share) in u.iter().enumerate() {
                let row = rows.row(axis);
                misclosures_m[index] += share * row[rows.width - 1];
                for (column, partial) in rows.columns().zip(row) {
                    by_shared[(index, column)] -= share * partial;
                }
            }
            for (column, by_shift) in heights.by_shared(index) {
                by_shared[(index, column)] -= by_shift;
            }
            turned.push(u);
            moves.push(step);
        }
        let mut covariance_m2 = heights.covariance_m2();
        let control = layout.network.heights.as_ref();
        let jitter = control.and_then(|control| control.jitter.as_ref());
        if let Some(jitter) = jitter.filter(|_| is_for_plan) {
            covariance_m2 += jitter::covariance_m2(layout, jitter, &heights.points, &by_shared);
        }
        let common = control.and_then(|control| control.common_noise.as_ref());
        if let Some(common) = common.filter(|_| is_for_plan) {
            // Where the surface was evaluated: a covariance that changes with every step has no minimum to converge to.
            covariance_m2 += common_m2(common, heights.places_m(), &turned);
        }
        let ray_variances_m2 =
            DVector::from_iterator(count, turned.iter().map(Vector3::norm_squared));
        let with_rays_m2 = &covariance_m2 + DMatrix::from_diagonal(&ray_variances_m2);
        // An invalid covariance comes from points without a finite position.
        let factor = BlockedCholesky::new(with_rays_m2.clone()).ok_or(Unseen::BehindCamera)?;
        let of_surface = BlockedCholesky::new(covariance_m2.clone()).ok_or(Unseen::BehindCamera)?;
        Ok(Self {
            misclosures_m,
            by_shared,
            ray_variances_m2,
            differences_m,
            turned,
            moves,
            covariance_m2: with_rays_m2,
            factor,
            observed_m2: covariance_m2,
            of_surface,
        })
    }

    /// The contribution of the heights to the right-hand side of the shared unknowns' normal equations.
    pub(super) fn right(&self) -> DVector<f64> {
        -self
            .by_shared
            .tr_mul(&self.factor.solve(&self.misclosures_m))
    }

    /// `Σ⁻¹G`.
    pub(super) fn weighted(&self) -> DMatrix<f64> {
        let mut weighted = self.by_shared.clone();
        self.factor.solve_mut(&mut weighted);
        weighted
    }

    /// `Σ⁻¹`.
    pub(super) fn weights(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }

    /// Shift of each point by its height, in addition to its rays, with a step of the shared unknowns.
    pub(super) fn moves_m(&self, shared: &DVector<f64>) -> Vec<Vector3<f64>> {
        let pull = self
            .factor
            .solve(&(&self.misclosures_m + &self.by_shared * shared));
        let moves = self.moves.iter().zip(&pull);
        moves.map(|(step, pull)| -step * *pull).collect()
    }

    /// Residuals of the heights, `left` being `Σ⁻¹ − Σ⁻¹ G Q Gᵀ Σ⁻¹`, `Q` the cofactors of the shared unknowns.
    ///
    /// Redundancy numbers are the diagonal of the covariance of the observed heights times `left`. With correlated observations
    /// a single number may lie outside `0..=1`; only their sum is meaningful.
    pub(super) fn residuals(&self, heights: &Heights, left: &DMatrix<f64>) -> Vec<HeightResidual> {
        let redundancies: Vec<f64> = left
            .column_iter()
            .zip(self.observed_m2.column_iter())
            .map(|(left, observed_m2)| left.dot(&observed_m2))
            .collect();
        (0..heights.points.len())
            .map(|index| {
                let variance_m2 = heights.surface.covariance_m2[(index, index)];
                let ray_m2 = self.ray_variances_m2[index];
                HeightResidual {
                    point: heights.points[index],
                    above_m: self.differences_m[index],
                    surface_sigma_m: variance_m2.sqrt(),
                    ray_sigma_m: ray_m2.sqrt(),
                    nearest_shot_m: heights.surface.nearest_m[index],
                    weight_factor: (variance_m2 + ray_m2)
                        / (variance_m2 + ray_m2 + heights.inflation_m2[index]),
                    redundancy: redundancies[index],
                }
            })
            .collect()
    }

    /// Residuals of the heights times the inverse of their covariance: `C⁻¹ d`.
    pub(super) fn weighted_differences(&self) -> DVector<f64> {
        self.of_surface.solve(&self.differences_m)
    }

    /// Weighted sum of squared residuals of the heights.
    pub(super) fn weighted_squares(&self) -> f64 {
        self.differences_m
            .dot(&self.of_surface.solve(&self.differences_m))
    }
}
