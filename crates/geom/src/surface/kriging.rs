//! Ordinary kriging in plan.

use nalgebra::{DMatrix, DVector, Vector2};
use rayon::prelude::*;

use super::{Placed, SharedErrors, Variogram};
use crate::blocked_cholesky::{BlockedCholesky, add_square};

/// Fewest places of a task: a smaller one costs less than its start.
const PLACES_MIN: usize = 64;
/// Fewest profiles for which a product of matrices is faster than products of their columns.
const PROFILES_MIN: usize = 8;

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
    sum_of_ones: f64,
    /// Mean height, and the contribution of each shot to the height of a point by its covariance with it.
    mean_m: f64,
    strengths: DVector<f64>,
}

/// The ground at some places, or weighted sums of it, in terms of the shots: one column per place.
pub(super) struct Relation {
    /// Covariance of the ground between shots and places, m².
    covariance_m2: DMatrix<f64>,
    /// Multipliers that keep the sums of the weights of the shots at the sums of the weights of the places.
    multipliers: DVector<f64>,
}

impl Relation {
    /// The same of sums over each of `parts` equal parts of the places, one after the other.
    pub(super) fn summed_in(self, parts: usize, summed: impl Fn(Self) -> Self) -> Self {
        let places = self.multipliers.len() / parts;
        let part = |index: usize| {
            let first = index * places;
            summed(Self {
                covariance_m2: self.covariance_m2.columns(first, places).into_owned(),
                multipliers: self.multipliers.rows(first, places).into_owned(),
            })
        };
        let parts: Vec<Self> = (0..parts).map(part).collect();
        let columns = parts
            .iter()
            .flat_map(|part| part.covariance_m2.column_iter());
        Self {
            covariance_m2: DMatrix::from_columns(&columns.collect::<Vec<_>>()),
            multipliers: DVector::from_iterator(
                parts.iter().map(|part| part.multipliers.len()).sum(),
                parts
                    .iter()
                    .flat_map(|part| part.multipliers.iter().copied()),
            ),
        }
    }

    /// The weighted sum of the places.
    pub(super) fn summed(&self, of_places: &DVector<f64>) -> Self {
        let covariance_m2 = &self.covariance_m2 * of_places;
        Self {
            covariance_m2: DMatrix::from_column_slice(
                covariance_m2.len(),
                1,
                covariance_m2.as_slice(),
            ),
            multipliers: DVector::from_element(1, self.multipliers.dot(of_places)),
        }
    }
}

/// Sums of factors of the shots of each profile times their weights, whatever the place.
#[derive(Debug, Clone)]
pub(super) struct ProfileSums {
    /// The equations' solutions for the factors, one column per profile.
    solved: DMatrix<f64>,
    of_ones: DVector<f64>,
}

impl ProfileSums {
    /// The sums at places, one row per profile.
    pub(super) fn at(&self, relation: &Relation) -> DMatrix<f64> {
        let mut sums = if self.solved.ncols() < PROFILES_MIN {
            self.solved.tr_mul(&relation.covariance_m2)
        } else {
            self.solved.transpose() * &relation.covariance_m2
        };
        sums.ger(-1.0, &self.of_ones, &relation.multipliers, 1.0);
        sums
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
        let sum_of_ones = of_ones.sum();
        let mean_m = of_ones.dot(&heights_m) / sum_of_ones;
        let strengths = factor.solve(&heights_m.add_scalar(-mean_m));
        mean_m.is_finite().then_some(Self {
            shots,
            variogram,
            sill_m2,
            factor,
            of_ones,
            sum_of_ones,
            mean_m,
            strengths,
        })
    }

    /// Height of the surface at a point, metres.
    pub(super) fn height_m(&self, place: &Vector2<f64>) -> f64 {
        let shots = self.shots.iter().zip(&self.strengths);
        let above_m =
            shots.map(|(shot, strength)| strength * self.covariance_m2(&shot.plan_m, place));
        self.mean_m + above_m.sum::<f64>()
    }

    /// Distance of the nearest shot, metres.
    pub(super) fn nearest_m(&self, place: &Vector2<f64>) -> f64 {
        let squares_m2 = self
            .shots
            .iter()
            .map(|shot| (shot.plan_m - place).norm_squared());
        squares_m2.fold(f64::INFINITY, f64::min).sqrt()
    }

    fn covariance_m2(&self, one: &Vector2<f64>, other: &Vector2<f64>) -> f64 {
        self.sill_m2 - self.variogram.between(one, other)
    }

    /// The ground at `places`.
    pub(super) fn at(&self, places: &[Vector2<f64>]) -> Relation {
        let mut covariance_m2 = DMatrix::zeros(self.shots.len(), places.len());
        let columns = covariance_m2
            .as_mut_slice()
            .par_chunks_mut(self.shots.len());
        let columns = columns.zip(places).with_min_len(PLACES_MIN);
        columns.for_each(|(column, place)| {
            for (value, shot) in column.iter_mut().zip(&self.shots) {
                *value = self.covariance_m2(&shot.plan_m, place);
            }
        });
        let multipliers = (covariance_m2.tr_mul(&self.of_ones)).add_scalar(-1.0) / self.sum_of_ones;
        Relation {
            covariance_m2,
            multipliers,
        }
    }

    /// Heights of the surface, metres.
    pub(super) fn heights_m(&self, relation: &Relation) -> Vec<f64> {
        let heights_m = relation.covariance_m2.tr_mul(&self.strengths);
        heights_m.add_scalar(self.mean_m).as_slice().to_vec()
    }

    /// Adds to the lower triangle of `sum` the covariance of surface minus ground between places, m², without the
    /// covariance of the ground itself.
    ///
    /// With the factor `K = L Lᵀ` of the equations, the covariances `c` between shots and a place, its multiplier `μ` and
    /// weights `w = K⁻¹ (c − μ 1)`, the last three terms of `C − wᵢᵀcⱼ − wⱼᵀcᵢ + wᵢᵀK wⱼ` are
    /// `−(L⁻¹cᵢ)ᵀ L⁻¹cⱼ + μᵢ μⱼ 1ᵀK⁻¹1`.
    pub(super) fn add_errors_m2(&self, sum: &mut DMatrix<f64>, relation: Relation) {
        let Relation {
            mut covariance_m2,
            multipliers,
        } = relation;
        self.factor.solve_lower_mut(&mut covariance_m2);
        add_square(sum, -1.0, &covariance_m2);
        sum.ger(self.sum_of_ones, &multipliers, &multipliers, 1.0);
    }

    /// The diagonal of [`Self::add_errors_m2`].
    pub(super) fn variances_m2(&self, relation: Relation) -> DVector<f64> {
        let Relation {
            mut covariance_m2,
            multipliers,
        } = relation;
        self.factor.solve_lower_mut(&mut covariance_m2);
        let columns = covariance_m2.column_iter().zip(&multipliers);
        let variances_m2 = columns.map(|(column, multiplier)| {
            self.sum_of_ones * multiplier * multiplier - column.norm_squared()
        });
        DVector::from_iterator(multipliers.len(), variances_m2)
    }

    /// Variance of the ground at a place, m²: the constant that the sums of the weights remove from all errors.
    pub(super) const fn ground_m2(&self) -> f64 {
        self.sill_m2
    }

    /// Covariance of the ground between all `places`, m²: the lower triangle.
    pub(super) fn between_m2(&self, places: &[Vector2<f64>]) -> DMatrix<f64> {
        let mut covariance_m2 = DMatrix::zeros(places.len(), places.len());
        let columns = covariance_m2
            .as_mut_slice()
            .par_chunks_mut(places.len().max(1));
        columns.enumerate().for_each(|(index, column)| {
            let others = column.iter_mut().zip(places).skip(index);
            for (value, other) in others {
                *value = self.covariance_m2(&places[index], other);
            }
        });
        covariance_m2
    }

    /// Variance of a weighted sum of the ground at `places`, m².
    pub(super) fn variance_of_sum_m2(
        &self,
        places: &[Vector2<f64>],
        of_places: &DVector<f64>,
    ) -> f64 {
        let with_later = |(index, place): (usize, &Vector2<f64>)| {
            let later = places.iter().zip(of_places).skip(index + 1);
            let covariances_m2 =
                later.map(|(other, weight)| weight * self.covariance_m2(place, other));
            let own_m2 = of_places[index] * self.sill_m2;
            of_places[index] * (own_m2 + 2.0 * covariances_m2.sum::<f64>())
        };
        // Added in order: the same bits with any number of threads.
        let of_each: Vec<f64> = places.par_iter().enumerate().map(with_later).collect();
        of_each.iter().sum()
    }

    /// Profiles that shots of the surface belong to, by their indices, ascending.
    pub(super) fn profiles(&self) -> Vec<usize> {
        let mut profiles: Vec<usize> = self.shots.iter().map(|shot| shot.profile).collect();
        profiles.sort_unstable();
        profiles.dedup();
        profiles
    }

    /// Sums of the weights of each profile, times a factor of the errors that its shots share.
    pub(super) fn sums_of_profiles(&self, factor: impl Fn(&SharedErrors) -> f64) -> ProfileSums {
        let profiles = self.profiles();
        let mut solved = DMatrix::zeros(self.shots.len(), profiles.len());
        for (row, shot) in self.shots.iter().enumerate() {
            // Every shot has its profile in the list.
            let of = profiles.partition_point(|profile| *profile < shot.profile);
            solved[(row, of)] = factor(&shot.shared);
        }
        let of_ones = solved.tr_mul(&self.of_ones);
        self.factor.solve_mut(&mut solved);
        ProfileSums { solved, of_ones }
    }

    /// Largest factors of the errors that shots of a profile share.
    pub(super) fn shared_of(&self, profile: usize) -> SharedErrors {
        let shots = self.shots.iter().filter(|shot| shot.profile == profile);
        shots.fold(SharedErrors::LEAST, |largest, shot| {
            largest.or_larger(&shot.shared)
        })
    }
}
