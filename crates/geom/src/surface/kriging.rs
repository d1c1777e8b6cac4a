//! Ordinary kriging in plan.

use nalgebra::{DMatrix, DVector, Vector2};
use rayon::prelude::*;

use super::{
    Placed, SharedErrors, Variogram, blocked_cholesky::BlockedCholesky, shot::PROFILE_PLAN_M,
};

/// The kriging equations of some shots, factorised.
#[derive(Debug, Clone)]
pub(super) struct Kriging {
    pub(super) shots: Vec<Placed>,
    pub(super) variogram: Variogram,
    /// A variance above the variance of any two points: with it the equations are positive definite, and as weights sum
    /// up to 1 it has no effect.
    sill_m2: f64,
    factor: BlockedCholesky,
    /// The equations' solution for ones, and its sum.
    of_ones: DVector<f64>,
    /// Mean height, and the contribution of each shot to the height of a point by its covariance with it.
    mean_m: f64,
    strengths: DVector<f64>,
}

/// Weights of shots, one column per point, with the multiplier that keeps their sum at 1.
pub(super) struct Weights {
    /// Variogram between shots and points, m².
    between_m2: DMatrix<f64>,
    of_shots: DMatrix<f64>,
    multipliers: DVector<f64>,
}

#[cfg(test)]
impl Weights {
    pub(super) const fn of_shots(&self) -> &DMatrix<f64> {
        &self.of_shots
    }
}

impl Kriging {
    /// The noise of a shot has `shot_sigma_m`, the radial error that the shots of a profile share `profile_sigma_m`.
    ///
    /// A shot of a profile with a larger error in plan has the height of ground at that distance δ: an additional variance 2 γ(δ).
    /// Errors of neighbouring shots are in truth correlated; independent noise is an approximation. Without it, kriging
    /// continues the difference from a neighbouring profile as a slope, to where no shots are.
    ///
    /// `None` when a number is not finite.
    pub(super) fn new(
        shots: Vec<Placed>,
        variogram: Variogram,
        shot_sigma_m: f64,
        profile_sigma_m: f64,
    ) -> Option<Self> {
        let first = shots.first()?.plan_m;
        let reach_m = shots.iter().map(|shot| (shot.plan_m - first).norm());
        let sill_m2 = 2.0 * variogram.at(2.0 * reach_m.fold(1.0, f64::max));
        let covariance_m2 = |row: usize, column: usize| {
            let mut noise_m2 = 0.0;
            if shots[row].profile == shots[column].profile {
                let shared = shots[row].shared.radial * shots[column].shared.radial;
                noise_m2 += profile_sigma_m.powi(2) * shared;
            }
            if row == column {
                noise_m2 +=
                    shot_sigma_m.powi(2) + 2.0 * variogram.at(shots[row].shared.farther_m());
            }
            sill_m2 - variogram.between(&shots[row].plan_m, &shots[column].plan_m) + noise_m2
        };
        let mut matrix = DMatrix::zeros(shots.len(), shots.len());
        let columns = matrix.as_mut_slice().par_chunks_mut(shots.len());
        columns.enumerate().for_each(|(column, values)| {
            // The lower triangle.
            for (row, value) in values.iter_mut().enumerate().skip(column) {
                *value = covariance_m2(row, column);
            }
        });
        let factor = BlockedCholesky::new(matrix)?;
        let of_ones = factor.solve(&DVector::repeat(shots.len(), 1.0));
        let heights_m = DVector::from_iterator(shots.len(), shots.iter().map(|shot| shot.height_m));
        let mean_m = of_ones.dot(&heights_m) / of_ones.sum();
        let strengths = factor.solve(&heights_m.add_scalar(-mean_m));
        mean_m.is_finite().then_some(Self {
            shots,
            variogram,
            sill_m2,
            factor,
            of_ones,
            mean_m,
            strengths,
        })
    }

    /// Height of the surface at a point, metres.
    pub(super) fn height_m(&self, place: &Vector2<f64>) -> f64 {
        let shots = self.shots.iter().zip(&self.strengths);
        let above_m = shots.map(|(shot, strength)| strength * self.covariance(shot, place));
        self.mean_m + above_m.sum::<f64>()
    }

    /// Distance of the nearest shot, metres.
    pub(super) fn nearest_m(&self, place: &Vector2<f64>) -> f64 {
        let distances_m = self.shots.iter().map(|shot| (shot.plan_m - place).norm());
        distances_m.fold(f64::INFINITY, f64::min)
    }

    fn covariance(&self, shot: &Placed, place: &Vector2<f64>) -> f64 {
        self.sill_m2 - self.variogram.between(&shot.plan_m, place)
    }

    pub(super) fn weights(&self, places: &[Vector2<f64>]) -> Weights {
        let mut between_m2 = DMatrix::zeros(self.shots.len(), places.len());
        let columns = between_m2.as_mut_slice().par_chunks_mut(self.shots.len());
        columns.zip(places).for_each(|(column, place)| {
            for (value, shot) in column.iter_mut().zip(&self.shots) {
                *value = self.variogram.between(&shot.plan_m, place);
            }
        });
        let mut of_shots = between_m2.map(|variogram_m2| self.sill_m2 - variogram_m2);
        self.factor.solve_mut(&mut of_shots);
        let multipliers = DVector::from_iterator(
            places.len(),
            of_shots
                .column_iter()
                .map(|weights| (weights.sum() - 1.0) / self.of_ones.sum()),
        );
        of_shots -= &self.of_ones * multipliers.transpose();
        Weights {
            between_m2,
            of_shots,
            multipliers,
        }
    }

    /// Covariance of surface minus ground between all `places`, m², with the errors that shots of a profile share.
    ///
    /// By the equations of the weights, `Γwⱼ − Nwⱼ = γⱼ + μⱼ` with the covariance `N` of the errors of the shots, three
    /// of the five terms of `−γᵢⱼ + wᵢᵀγⱼ + wⱼᵀγᵢ − wᵢᵀΓwⱼ + wᵢᵀNwⱼ` are one.
    pub(super) fn covariance_m2(&self, places: &[Vector2<f64>], weights: &Weights) -> DMatrix<f64> {
        // `tr_mul` takes seven times as long.
        let mut covariance = weights.between_m2.transpose() * &weights.of_shots;
        for (column, place) in places.iter().enumerate() {
            for (row, other) in places.iter().enumerate() {
                covariance[(row, column)] -=
                    self.variogram.between(place, other) + weights.multipliers[column];
            }
        }
        // Rounding leaves it slightly asymmetric.
        0.5 * (&covariance + covariance.transpose())
    }

    /// Sums of the weights of each profile, times the factor of the radial errors that its shots share, one row per profile.
    pub(super) fn radial_of_profiles(&self, weights: &Weights) -> DMatrix<f64> {
        self.weights_of_profiles(weights, |shared| shared.radial)
    }

    /// Sums of the weights of each profile, times the part of the errors in plan by which they exceed a profile at
    /// nadir of known attitude.
    pub(super) fn farther_of_profiles(&self, weights: &Weights) -> DMatrix<f64> {
        self.weights_of_profiles(weights, |shared| shared.farther_m() / PROFILE_PLAN_M)
    }

    /// Sums of the weights of each profile, one row per profile.
    pub(super) fn sums_of_profiles(&self, weights: &Weights) -> DMatrix<f64> {
        self.weights_of_profiles(weights, |_shared| 1.0)
    }

    /// Largest factors of the errors that shots of a profile share.
    pub(super) fn shared_of(&self, profile: usize) -> SharedErrors {
        let shots = self.shots.iter().filter(|shot| shot.profile == profile);
        shots.fold(SharedErrors::LEAST, |largest, shot| {
            largest.or_larger(&shot.shared)
        })
    }

    fn weights_of_profiles(
        &self,
        weights: &Weights,
        factor: impl Fn(&SharedErrors) -> f64,
    ) -> DMatrix<f64> {
        let profiles = self.shots.iter().map(|shot| shot.profile + 1).max();
        let places = weights.of_shots.ncols();
        let mut sums = DMatrix::zeros(profiles.unwrap_or_default(), places);
        for (shot, row) in self.shots.iter().zip(weights.of_shots.row_iter()) {
            let mut sum = sums.row_mut(shot.profile);
            sum += row * factor(&shot.shared);
        }
        sums
    }
}
