//! Heights of the surface at places, with the covariance of their errors, with each standard deviation alone, or their mean.
//!
//! Errors between all places have a matrix as large as the square of their number. A standard deviation of one place,
//! or of a mean, is computed without it.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix3xX, Vector2, Vector3};
use rayon::prelude::*;

use super::{
    GRADIENT_STEP_M, LaserSurface, PlanShifts, SurfaceOptions,
    kriging::{Kriging, ProfileSums, Relation},
    plan_shifts::COMMON_M,
    shot::PROFILE_PLAN_M,
};
use crate::blocked_cholesky::add_square;
use areograph_base::body::Body;

/// Places that a task predicts together.
const TOGETHER: usize = 64;

/// Heights of the surface at given points, above the ellipsoid along the radius.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceHeights {
    /// Heights, metres.
    pub heights_m: Vec<f64>,
    /// Slopes towards east and north, metres per metre.
    pub slopes: Vec<Vector2<f64>>,
    /// Planimetric distance of the nearest shot, metres.
    pub nearest_m: Vec<f64>,
    /// Covariance of the errors of the heights, m²: one standard deviation contains 68 % of them; see
    /// [`tails`](super::tails).
    pub covariance_m2: DMatrix<f64>,
    /// Covariance without the effect of planimetric errors on a slope, m².
    pub without_plan_m2: DMatrix<f64>,
    /// Effect of one standard deviation of the radial error of each profile, metres: one row per profile, one column per point.
    /// Both covariances contain these errors.
    pub radial_m: DMatrix<f64>,
    /// The body whose ellipsoid they refer to.
    pub body: Body,
    /// Planimetric information, where relief determines planimetry.
    pub relief: Option<Relief>,
}

/// Height of the surface at one point, above the ellipsoid along the radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceHeight {
    /// Height, metres.
    pub height_m: f64,
    /// Its standard deviation, metres, as in the covariance of [`SurfaceHeights`].
    pub sigma_m: f64,
    /// Slope towards east and north, metres per metre.
    pub slope: Vector2<f64>,
    /// Planimetric distance of the nearest shot, metres.
    pub nearest_m: f64,
}

/// Mean height of the surface at several points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanHeight {
    /// Mean, metres.
    pub height_m: f64,
    /// Variance of the mean by the covariance of [`SurfaceHeights`], m².
    pub variance_m2: f64,
}

/// The information of heights over relief about planimetry.
#[derive(Debug, Clone, PartialEq)]
pub struct Relief {
    /// Change of each height with its position, metres per metre, Mars-fixed.
    pub by_place: Vec<Vector3<f64>>,
    /// The possible shift of each profile of the surface, one entry per profile.
    pub profiles: Vec<ProfileOnRelief>,
    /// Covariance of these shifts in east, north and height, m²: three rows per profile.
    pub covariance_m2: DMatrix<f64>,
    /// The part of it that all profiles have in common, on each axis in plan, m².
    pub common_plan_m2: f64,
}

/// Dependence of heights of the surface on the shift of one of its profiles.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileOnRelief {
    /// Index of the profile.
    pub profile: usize,
    /// Change of measured minus predicted heights when the profile is recorded farther to the east, to the north and
    /// higher than its true position: one row per point.
    pub by_shift: Matrix3xX<f64>,
    /// Shift to the east and north that was removed from its shots, metres.
    pub removed_m: Vector2<f64>,
}

impl SurfaceHeights {
    /// Standard deviation of the height at `index`, metres.
    #[must_use]
    pub fn sigma_m(&self, index: usize) -> f64 {
        self.covariance_m2[(index, index)].sqrt()
    }
}

/// Weights of the profiles of a surface, times the factors of the errors that their shots share.
#[derive(Debug, Clone)]
pub(super) struct OfProfiles {
    radial: ProfileSums,
    /// Times the part of the errors in plan by which they exceed a profile at nadir of known attitude; `None` where no
    /// profile exceeds it.
    farther: Option<ProfileSums>,
    /// Where relief determines planimetry.
    on_relief: Option<Shifts>,
}

/// Possible shifts of the profiles of a surface.
#[derive(Debug, Clone)]
struct Shifts {
    /// Weights of the profiles.
    sums: ProfileSums,
    profiles: Vec<usize>,
    /// Shift that was removed from the shots of each profile, east and north, metres.
    removed_m: Vec<Vector2<f64>>,
    /// Standard deviation of the radial shift of each profile, metres.
    radial_m: Vec<f64>,
    /// Covariance of the remaining shifts in plan, m², two rows per profile, and its lower triangular factor.
    plan_m2: DMatrix<f64>,
    plan_factor: DMatrix<f64>,
    /// Variance on an axis in plan that all of them have in common, m²; 0 for independent shifts.
    common_plan_m2: f64,
}

impl Shifts {
    fn new(kriging: &Kriging, options: &SurfaceOptions, known: Option<&PlanShifts>) -> Self {
        let profiles = kriging.profiles();
        let plan_m =
            |profile: usize| kriging.shared_of(profile).plan * options.profile_plan_sigma_m;
        let shift_m =
            |profile: &usize| known.map_or_else(Vector2::zeros, |known| known.shift_m(*profile));
        let radial = profiles.iter().map(|of| kriging.shared_of(*of).radial);
        let independent = || {
            let variances = profiles.iter().flat_map(|of| [plan_m(*of).powi(2); 2]);
            DMatrix::from_diagonal(&DVector::from_iterator(2 * profiles.len(), variances))
        };
        let plan_m2 =
            known.map_or_else(independent, |known| known.covariance_m2(&profiles, plan_m));
        // Rounding may leave no factor of shifts that are known almost exactly: a square millimetre is above rounding.
        let with_rounding = || {
            let square_mm = DMatrix::from_diagonal_element(plan_m2.nrows(), plan_m2.ncols(), 1e-6);
            Cholesky::new(&plan_m2 + square_mm)
        };
        let factor = Cholesky::new(plan_m2.clone()).or_else(with_rounding);
        // Only a covariance that is not a number has no factor; it remains so.
        let plan_factor = factor.map_or_else(|| plan_m2.clone(), Cholesky::unpack);
        Self {
            sums: kriging.sums_of_profiles(|_shared| 1.0),
            removed_m: profiles.iter().map(shift_m).collect(),
            radial_m: radial.map(|of| of * options.profile_sigma_m).collect(),
            plan_m2,
            plan_factor,
            common_plan_m2: known.map_or(0.0, |_| COMMON_M.powi(2)),
            profiles,
        }
    }

    /// Effects on heights of shifts in plan of one metre, one row per axis of each profile.
    fn in_plan(&self, sighted: &Sighted) -> DMatrix<f64> {
        let shares = self.sums.at(&sighted.relation);
        DMatrix::from_fn(2 * shares.nrows(), shares.ncols(), |row, place| {
            shares[(row / 2, place)] * sighted.slopes[place][row % 2]
        })
    }

    fn relief(&self, sighted: &Sighted, by_place: Vec<Vector3<f64>>) -> Relief {
        let shares = self.sums.at(&sighted.relation);
        let slopes = &sighted.slopes;
        let by_shift = |row: usize| {
            Matrix3xX::from_fn(slopes.len(), |axis, place| {
                let shift = if axis < 2 { slopes[place][axis] } else { -1.0 };
                shares[(row, place)] * shift
            })
        };
        let profiles = self.profiles.iter().zip(&self.removed_m).enumerate();
        let covariance_m2 = DMatrix::from_fn(
            3 * self.profiles.len(),
            3 * self.profiles.len(),
            |row, column| match (row % 3, column % 3) {
                (2, 2) if row == column => self.radial_m[row / 3].powi(2),
                (2, _) | (_, 2) => 0.0,
                (axis, other) => self.plan_m2[(2 * (row / 3) + axis, 2 * (column / 3) + other)],
            },
        );
        Relief {
            by_place,
            profiles: profiles
                .map(|(row, (profile, removed_m))| ProfileOnRelief {
                    profile: *profile,
                    by_shift: by_shift(row),
                    removed_m: *removed_m,
                })
                .collect(),
            covariance_m2,
            common_plan_m2: self.common_plan_m2,
        }
    }
}

impl OfProfiles {
    pub(super) fn new(
        kriging: &Kriging,
        options: &SurfaceOptions,
        shifts: Option<&PlanShifts>,
    ) -> Self {
        let uses_relief = options.uses_relief;
        let mut shots = kriging.shots.iter();
        let is_farther = shots.any(|shot| shot.shared.farther_m() > 0.0);
        let farther = || kriging.sums_of_profiles(|shared| shared.farther_m() / PROFILE_PLAN_M);
        Self {
            radial: kriging.sums_of_profiles(|shared| shared.radial),
            farther: (is_farther && !uses_relief).then(farther),
            on_relief: uses_relief.then(|| Shifts::new(kriging, options, shifts)),
        }
    }
}

/// The surface at some places.
struct Sighted {
    relation: Relation,
    heights_m: Vec<f64>,
    slopes: Vec<Vector2<f64>>,
    /// Effect of one standard deviation of the radial error of each profile, metres: one row per profile.
    radial_m: DMatrix<f64>,
}

impl LaserSurface {
    /// Heights of the surface at `places_m`, with the covariance of their errors.
    #[must_use]
    pub fn predict(&self, places_m: &[Vector3<f64>]) -> SurfaceHeights {
        let at: Vec<Vector2<f64>> = places_m.iter().map(|place| self.plan.of(place)).collect();
        let sighted = self.sighted(&at);
        let mut covariance_m2 = self.errors_m2(&at);
        add_square(&mut covariance_m2, 1.0, &sighted.radial_m);
        covariance_m2.fill_upper_triangle_with_lower_triangle();
        let without_plan_m2 = covariance_m2.clone();
        add_square(&mut covariance_m2, 1.0, &self.in_plan_m(&sighted));
        covariance_m2.fill_upper_triangle_with_lower_triangle();
        let relief = self.of_profiles.on_relief.as_ref().map(|shifts| {
            let by_place = places_m.iter().zip(&sighted.slopes);
            let by_place = by_place.map(|(place, slope)| self.plan.by_place(place, slope));
            shifts.relief(&sighted, by_place.collect())
        });
        SurfaceHeights {
            body: self.options.body,
            without_plan_m2,
            relief,
            heights_m: sighted.heights_m,
            nearest_m: at
                .par_iter()
                .map(|place| self.kriging.nearest_m(place))
                .collect(),
            slopes: sighted.slopes,
            radial_m: sighted.radial_m,
            covariance_m2,
        }
    }

    /// The height of the surface at each of `places_m`: as [`Self::predict`], without the covariance between places.
    #[must_use]
    pub fn predict_each(&self, places_m: &[Vector3<f64>]) -> Vec<PlaceHeight> {
        let places = places_m.par_chunks(TOGETHER);
        places.flat_map_iter(|of| self.predict_some(of)).collect()
    }

    fn predict_some(&self, places_m: &[Vector3<f64>]) -> Vec<PlaceHeight> {
        let at: Vec<Vector2<f64>> = places_m.iter().map(|place| self.plan.of(place)).collect();
        let sighted = self.sighted(&at);
        let mut variances_m2 = self.variances_m2(&at, |relation| relation);
        for (variance_m2, place) in variances_m2.iter_mut().zip(&at) {
            let share = self.roughness.share(place);
            *variance_m2 = (*variance_m2 + self.kriging.ground_m2()) * share * share;
        }
        let in_plan_m = self.in_plan_m(&sighted);
        let place = |index: usize| {
            let shared_m2 = sighted.radial_m.column(index).norm_squared()
                + in_plan_m.column(index).norm_squared();
            PlaceHeight {
                height_m: sighted.heights_m[index],
                sigma_m: (variances_m2[index] + shared_m2).sqrt(),
                slope: sighted.slopes[index],
                nearest_m: self.kriging.nearest_m(&at[index]),
            }
        };
        (0..at.len()).map(place).collect()
    }

    /// The mean of the heights of the surface at `places_m`, at least one: as [`Self::predict`], without the covariance
    /// between places.
    #[must_use]
    pub fn predict_mean(&self, places_m: &[Vector3<f64>]) -> MeanHeight {
        let at: Vec<Vector2<f64>> = places_m.iter().map(|place| self.plan.of(place)).collect();
        let sighted = self.sighted(&at);
        let weight = (places_m.len() as f64).recip();
        let shares = at.iter().map(|place| weight * self.roughness.share(place));
        let shares = DVector::from_iterator(at.len(), shares);
        let of_ground_m2 = self.kriging.variance_of_sum_m2(&at, &shares);
        let of_shots_m2 = self.variances_m2(&at, |relation| relation.summed(&shares));
        let shared_m2 = [&sighted.radial_m, &self.in_plan_m(&sighted)]
            .map(|of| (weight * of.column_sum()).norm_squared());
        MeanHeight {
            height_m: weight * sighted.heights_m.iter().sum::<f64>(),
            variance_m2: of_ground_m2 + of_shots_m2[0] + shared_m2.iter().sum::<f64>(),
        }
    }

    /// Distance in plan between the shots and the nearest of `places_m`, metres.
    pub(super) fn nearest_m(&self, places_m: &[Vector3<f64>]) -> f64 {
        let places = places_m.iter().map(|place| self.plan.of(place));
        let distances_m = places.map(|place| self.kriging.nearest_m(&place));
        distances_m.fold(f64::INFINITY, f64::min)
    }

    fn sighted(&self, at: &[Vector2<f64>]) -> Sighted {
        let relation = self.kriging.at(at);
        Sighted {
            heights_m: self.kriging.heights_m(&relation),
            slopes: at.par_iter().map(|place| self.slope(place)).collect(),
            radial_m: self.radial_m(&relation),
            relation,
        }
    }

    /// Effects on heights of independent errors in plan on each axis, of one standard deviation, metres: two rows per
    /// error.
    fn in_plan_m(&self, sighted: &Sighted) -> DMatrix<f64> {
        let slopes = &sighted.slopes;
        let shifts_m = match (&self.of_profiles.on_relief, &self.of_profiles.farther) {
            (Some(shifts), _) => return shifts.plan_factor.tr_mul(&shifts.in_plan(sighted)),
            // Profiles that are farther from their place than others, each by itself: the part of the shift that all shots of a
            // profile share. The noise of these shots contains the same shift as independent errors.
            (None, Some(farther)) => {
                let farther_m = farther.at(&sighted.relation) * PROFILE_PLAN_M;
                farther_m.insert_row(0, self.options.plan_sigma_m)
            }
            (None, None) => DMatrix::from_element(1, slopes.len(), self.options.plan_sigma_m),
        };
        DMatrix::from_fn(2 * shifts_m.nrows(), slopes.len(), |row, place| {
            shifts_m[(row / 2, place)] * slopes[place][row % 2]
        })
    }

    /// The possible true positions: a planimetric error moves a point away from a profile, where the ground is known, as
    /// well as towards one.
    fn around(&self, at: &[Vector2<f64>]) -> Vec<Vec<Vector2<f64>>> {
        let shift_m = std::f64::consts::SQRT_2 * self.options.plan_sigma_m;
        if shift_m <= 0.0 {
            return vec![at.to_vec()];
        }
        let shifts = [
            Vector2::new(shift_m, 0.0),
            Vector2::new(-shift_m, 0.0),
            Vector2::new(0.0, shift_m),
            Vector2::new(0.0, -shift_m),
        ];
        let moved = |shift: Vector2<f64>| at.iter().map(|place| place + shift).collect();
        shifts.into_iter().map(moved).collect()
    }

    /// Covariance of the errors of the surface at the possible true positions, without errors that shots of a profile
    /// share: the lower triangle.
    fn errors_m2(&self, at: &[Vector2<f64>]) -> DMatrix<f64> {
        let mut covariance_m2 = DMatrix::zeros(at.len(), at.len());
        let around = self.around(at);
        for places in &around {
            let relation = self.kriging.at(places);
            let radial_m = self.radial_m(&relation);
            self.kriging.add_errors_m2(&mut covariance_m2, relation);
            add_square(&mut covariance_m2, -1.0, &radial_m);
        }
        covariance_m2 /= around.len() as f64;
        // A shift of all places leaves the covariance of the ground between them.
        covariance_m2 += self.kriging.between_m2(at);
        // Rougher ground deviates more from the same interpolation.
        let shares: Vec<f64> = at.iter().map(|place| self.roughness.share(place)).collect();
        for (column, of_column) in shares.iter().enumerate() {
            for (row, of_row) in shares.iter().enumerate() {
                covariance_m2[(row, column)] *= of_row * of_column;
            }
        }
        covariance_m2
    }

    /// Variances as on the diagonal of [`Self::errors_m2`], without the variance of the ground and the share of the
    /// roughness, of the places or of their sums.
    fn variances_m2(
        &self,
        at: &[Vector2<f64>],
        summed: impl Fn(Relation) -> Relation,
    ) -> DVector<f64> {
        let around = self.around(at);
        let count = around.len();
        // All positions are solved together: the factor of the equations is arranged for a product once.
        let together = self.kriging.at(&around.concat());
        let relation = together.summed_in(count, summed);
        let radial_m = self.radial_m(&relation);
        let mut variances_m2 = self.kriging.variances_m2(relation);
        for (variance_m2, of_profiles_m) in variances_m2.iter_mut().zip(radial_m.column_iter()) {
            *variance_m2 = (*variance_m2 - of_profiles_m.norm_squared()) / count as f64;
        }
        let places = variances_m2.len() / count;
        let of_positions = variances_m2.as_slice().chunks(places.max(1));
        of_positions.map(DVector::from_column_slice).sum()
    }

    fn radial_m(&self, relation: &Relation) -> DMatrix<f64> {
        self.of_profiles.radial.at(relation) * self.options.profile_sigma_m
    }

    fn slope(&self, place: &Vector2<f64>) -> Vector2<f64> {
        let along = |step: Vector2<f64>| {
            let [after_m, before_m] =
                [place + step, place - step].map(|place| self.kriging.height_m(&place));
            (after_m - before_m) / (2.0 * GRADIENT_STEP_M)
        };
        Vector2::new(
            along(Vector2::new(GRADIENT_STEP_M, 0.0)),
            along(Vector2::new(0.0, GRADIENT_STEP_M)),
        )
    }
}
