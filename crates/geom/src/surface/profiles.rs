//! Errors that the shots of a profile share, from crossovers: its shift, and whether it belongs.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};

use super::{
    Crossover, PlanShifts, SharedErrors,
    left_out::{LeftOut, ProfilePriors, student_weight, worst},
};

/// Weight of the a priori standard deviation in the estimated one, in profiles.
const PRIOR_PROFILES: f64 = 3.0;
/// Steps of the estimate; it changes by less than 1 % after half of them.
const STEPS: usize = 40;
/// A shift counts in the estimate by at most this many standard deviations.
const SHIFT_MAX_SIGMAS: f64 = 3.0;

/// The shift of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileShift {
    /// Its index.
    pub profile: usize,
    /// Its crossovers with profiles that are not left out.
    pub crossovers: usize,
    /// Offset of the record to the east, to the north and above its true position, metres.
    pub shift_m: Vector3<f64>,
    /// Covariance of this offset, m².
    pub covariance_m2: Matrix3<f64>,
}

/// The profiles of a site, compared with each other.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileNet {
    /// Profiles that do not belong, the worst first.
    pub left_out: Vec<LeftOut>,
    /// Standard deviation of the radial shift of the other profiles, from crossovers and a priori value, metres.
    pub radial_sigma_m: f64,
}

impl ProfileNet {
    /// Finds the profiles that do not belong, one after the other, and estimates the shifts of the others.
    ///
    /// The estimate uses expectation and maximisation for a variance component (Dempster et al. 1977).
    #[must_use]
    pub fn of(crossovers: &[Crossover], priors: &ProfilePriors) -> Self {
        let mut used: Vec<Crossover> = crossovers.to_vec();
        let mut left_out = Vec::new();
        while let Some(worst) = worst(&used, priors) {
            used.retain(|crossover| !crossover.profiles.contains(&worst.profile));
            left_out.push(worst);
        }
        Self {
            left_out,
            radial_sigma_m: radial_sigma_m(&used, priors.radial_sigma_m),
        }
    }

    /// The crossovers of profiles that are not left out.
    #[must_use]
    pub fn belonging(&self, crossovers: &[Crossover]) -> Vec<Crossover> {
        let left_out: BTreeSet<usize> = self.left_out.iter().map(|of| of.profile).collect();
        let belongs = |crossover: &&Crossover| {
            let mut profiles = crossover.profiles.iter();
            !profiles.any(|profile| left_out.contains(profile))
        };
        crossovers.iter().filter(belongs).copied().collect()
    }

    /// Shifts of all profiles with crossovers that are not left out.
    ///
    /// Where ground slopes, a shift in plan changes the height. Empty when a number is not finite.
    ///
    /// * `plan_sigma_m` – a priori standard deviation of a shift in plan on an axis, metres
    #[must_use]
    pub fn shifts(&self, crossovers: &[Crossover], plan_sigma_m: f64) -> Vec<ProfileShift> {
        let used = self.belonging(crossovers);
        let Some(net) = self.solved(&used, plan_sigma_m) else {
            return Vec::new();
        };
        let covariance_m2 = net.covariance_m2();
        let shift = |(index, (profile, crossovers)): (usize, (&usize, &usize))| ProfileShift {
            profile: *profile,
            crossovers: *crossovers,
            shift_m: net.shifts.fixed_rows::<3>(3 * index).into_owned(),
            covariance_m2: covariance_m2
                .fixed_view::<3, 3>(3 * index, 3 * index)
                .into_owned(),
        };
        net.profiles.iter().enumerate().map(shift).collect()
    }

    /// The same shifts in plan, all together; `None` without crossovers, or when a number is not finite.
    #[must_use]
    pub fn plan_shifts(&self, crossovers: &[Crossover], plan_sigma_m: f64) -> Option<PlanShifts> {
        let used = self.belonging(crossovers);
        let net = self.solved(&used, plan_sigma_m)?;
        let covariance_m2 = net.covariance_m2();
        let profiles: Vec<usize> = net.profiles.keys().copied().collect();
        let in_plan = |row: usize| 3 * (row / 2) + row % 2;
        let rows = 2 * profiles.len();
        Some(PlanShifts::new(
            profiles,
            DVector::from_fn(rows, |row, _| net.shifts[in_plan(row)]),
            DMatrix::from_fn(rows, rows, |row, column| {
                covariance_m2[(in_plan(row), in_plan(column))]
            }),
        ))
    }

    /// The normal equations of the shifts in plan and along the radius, with robust weights.
    fn solved<'a>(&self, used: &'a [Crossover], plan_sigma_m: f64) -> Option<Net<'a>> {
        let sigmas_m = [plan_sigma_m, plan_sigma_m, self.radial_sigma_m];
        let mut net = Net::new(used, &sigmas_m);
        (!used.is_empty() && (0..4).all(|_| net.step(&sigmas_m))).then_some(net)
    }
}

fn radial_sigma_m(crossovers: &[Crossover], prior_m: f64) -> f64 {
    if crossovers.is_empty() || prior_m == 0.0 {
        return prior_m;
    }
    let mut sigma_m = prior_m;
    let mut net = Net::new(crossovers, &[sigma_m]);
    for _ in 0..STEPS {
        if !net.step(&[sigma_m]) {
            return prior_m;
        }
        let limit_m2 = (SHIFT_MAX_SIGMAS * sigma_m).powi(2);
        let shifts = net.shifts.iter().zip(&net.shared);
        let shifts =
            shifts.map(|(shift_m, shared)| (shift_m / shared.radial).powi(2).min(limit_m2));
        let squares_m2 = shifts.sum::<f64>() + net.variances_m2().sum::<f64>();
        let profiles = net.profiles.len() as f64;
        let prior_m2 = PRIOR_PROFILES * prior_m.powi(2);
        sigma_m = ((squares_m2 + prior_m2) / (profiles + PRIOR_PROFILES)).sqrt();
    }
    sigma_m
}

/// Normal equations of the shifts of profiles.
struct Net<'a> {
    crossovers: &'a [Crossover],
    /// Each with the number of its crossovers.
    profiles: BTreeMap<usize, usize>,
    /// Factors of the errors that the shots of each profile share.
    shared: Vec<SharedErrors>,
    /// Indices of the profiles of each crossover.
    columns: Vec<[usize; 2]>,
    /// Robust weights.
    weights: Vec<f64>,
    /// Unknowns of a profile: its radial shift, or east, north and radial.
    unknowns: usize,
    shifts: DVector<f64>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl<'a> Net<'a> {
    fn new(crossovers: &'a [Crossover], sigmas_m: &[f64]) -> Self {
        let mut profiles = BTreeMap::new();
        for profile in crossovers.iter().flat_map(|crossover| crossover.profiles) {
            *profiles.entry(profile).or_default() += 1;
        }
        let index: BTreeMap<usize, usize> = profiles.keys().copied().zip(0..).collect();
        let columns = crossovers
            .iter()
            .map(|crossover| crossover.profiles.map(|profile| index[&profile]));
        let columns: Vec<[usize; 2]> = columns.collect();
        let mut shared = vec![SharedErrors::LEAST; profiles.len()];
        for (crossover, columns) in crossovers.iter().zip(&columns) {
            for (column, of) in columns.iter().zip(crossover.shared) {
                shared[*column] = shared[*column].or_larger(&of);
            }
        }
        Self {
            shared,
            columns,
            weights: vec![1.0; crossovers.len()],
            unknowns: sigmas_m.len(),
            shifts: DVector::zeros(sigmas_m.len() * profiles.len()),
            factor: None,
            profiles,
            crossovers,
        }
    }

    /// Change of a difference with each unknown of the first profile; of the second it has the opposite sign.
    fn by_shift(&self, crossover: &Crossover) -> Vec<f64> {
        let slope = crossover.slope;
        if self.unknowns == 1 {
            vec![1.0]
        } else {
            vec![-slope.x, -slope.y, 1.0]
        }
    }

    /// Variance of a difference by everything that the unknowns do not describe, m².
    fn variance_m2(&self, crossover: &Crossover) -> f64 {
        let beyond_slope_m = if self.unknowns == 1 {
            0.0
        } else {
            crossover.beyond_slope_m
        };
        crossover.sigma_m.powi(2) + beyond_slope_m.powi(2)
    }

    /// Solves for the shifts, and weighs the crossovers by their residuals; false when a number is not finite.
    fn step(&mut self, sigmas_m: &[f64]) -> bool {
        let unknowns = self.shifts.len();
        let mut normal = DMatrix::zeros(unknowns, unknowns);
        let mut right = DVector::zeros(unknowns);
        for index in 0..unknowns {
            let shared = &self.shared[index / self.unknowns];
            let unknown = index % self.unknowns;
            // The last unknown of a profile is its radial shift.
            let is_radial = unknown + 1 == self.unknowns;
            let shared = if is_radial {
                shared.radial
            } else {
                shared.plan
            };
            let sigma_m = sigmas_m[unknown] * shared;
            normal[(index, index)] = sigma_m.powi(-2);
        }
        for ((crossover, columns), weight) in
            self.crossovers.iter().zip(&self.columns).zip(&self.weights)
        {
            let weight = weight / self.variance_m2(crossover);
            let row = self.row(crossover, *columns);
            for (column, value) in &row {
                right[*column] += weight * value * crossover.difference_m;
                for (other, factor) in &row {
                    normal[(*column, *other)] += weight * value * factor;
                }
            }
        }
        let Some(factor) = Cholesky::new(normal) else {
            return false;
        };
        self.shifts = factor.solve(&right);
        self.factor = Some(factor);
        for (index, crossover) in self.crossovers.iter().enumerate() {
            let row = self.row(crossover, self.columns[index]);
            let by_shifts = row
                .iter()
                .map(|(column, value)| value * self.shifts[*column]);
            let left_m = crossover.difference_m - by_shifts.sum::<f64>();
            self.weights[index] = student_weight(left_m.powi(2) / self.variance_m2(crossover));
        }
        self.shifts.iter().all(|shift_m| shift_m.is_finite())
    }

    fn row(&self, crossover: &Crossover, columns: [usize; 2]) -> Vec<(usize, f64)> {
        let by_shift = self.by_shift(crossover);
        let of_profile = |(column, sign): (usize, f64)| {
            let values = by_shift.iter().enumerate();
            values
                .map(move |(unknown, value)| (self.unknowns * column + unknown, sign * value))
                .collect::<Vec<_>>()
        };
        let [first, second] = columns;
        let mut row = of_profile((first, 1.0));
        row.extend(of_profile((second, -1.0)));
        row
    }

    /// Variances of the shifts of a profile of known attitude; with one unknown a profile.
    fn variances_m2(&self) -> impl Iterator<Item = f64> {
        let variances_m2 = self.covariance_m2().diagonal();
        let shared = self.shared.clone().into_iter();
        shared
            .enumerate()
            .map(move |(index, shared)| variances_m2[index] / shared.radial.powi(2))
    }

    fn covariance_m2(&self) -> DMatrix<f64> {
        let unknowns = self.shifts.len();
        self.factor
            .as_ref()
            .map_or_else(|| DMatrix::zeros(unknowns, unknowns), Cholesky::inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{
        SurfaceOptions, crossovers,
        invented_profiles::{SLOPE, crossing, over_waves},
    };

    const PRIORS: ProfilePriors = ProfilePriors {
        radial_sigma_m: 1.0,
        plan_sigma_m: 70.0,
    };

    #[test]
    fn a_crossover_has_the_difference_the_place_and_the_slope_of_the_ground() {
        let found = crossovers(&crossing(&[0.0, 5.0], 0.0), &SurfaceOptions::default());
        let [only] = found.as_slice() else {
            panic!("{found:?}");
        };
        assert_eq!(only.profiles, [0, 1]);
        // Metres: the ground is straight; the map bends it by centimetres.
        assert!((only.difference_m + 5.0).abs() < 0.02, "{only:?}");
        assert!(
            (only.slope - nalgebra::Vector2::new(0.0, SLOPE)).norm() < 1e-3,
            "{only:?}"
        );
        // Profiles through the origin; two pairs of shots of 1 m, at any share of their distance.
        assert!(
            only.place_m.z.abs() < 50.0 && only.place_m.y.abs() < 50.0,
            "{only:?}"
        );
        assert!((1.0..1.6).contains(&only.sigma_m), "{only:?}");
    }

    #[test]
    fn a_profile_that_lies_above_all_others_is_left_out_and_only_that() {
        let mut shifts_m = [0.3, -0.2, 0.1, 0.4, -0.3, 0.0, 0.2, -0.4];
        shifts_m[3] += 25.0;
        let found = crossovers(&crossing(&shifts_m, 800.0), &SurfaceOptions::default());
        let net = ProfileNet::of(&found, &PRIORS);
        let [only] = net.left_out.as_slice() else {
            panic!("{:?}", net.left_out);
        };
        assert_eq!(
            (only.profile, only.others.as_slice()),
            (3, &[0, 2, 4, 6][..])
        );
        assert!((only.above_m - 25.4).abs() < 0.5, "{only:?}");
        assert!(net.radial_sigma_m < 1.0, "{}", net.radial_sigma_m);
        let shifts = net.shifts(&found, PRIORS.plan_sigma_m);
        assert_eq!(shifts.len(), 7);
        for shift in &shifts {
            let sigma_m = shift.covariance_m2[(2, 2)].sqrt();
            let error_m = shift.shift_m.z - shifts_m[shift.profile];
            // Three crossovers or more of 1.2 m, with as many unknown partners.
            assert!(error_m.abs() < 3.0 * sigma_m && sigma_m < 1.0, "{shift:?}");
        }
    }

    /// Shifts of ten profiles of which the fourth is recorded this far to the east, metres.
    fn one_aside(aside_m: f64) -> [[f64; 2]; 10] {
        let mut shifts_m = [[0.0; 2]; 10];
        shifts_m[3][0] = aside_m;
        shifts_m
    }

    #[test]
    fn a_misplaced_profile_is_left_out_and_only_that() {
        for (aside_m, expected) in [(1_200.0, Some(3)), (70.0, None)] {
            let found = crossovers(&over_waves(&one_aside(aside_m)), &SurfaceOptions::default());
            let net = ProfileNet::of(&found, &PRIORS);
            let left_out: Vec<usize> = net.left_out.iter().map(|of| of.profile).collect();
            assert_eq!(
                left_out,
                expected.into_iter().collect::<Vec<_>>(),
                "{aside_m}"
            );
            if let [only] = net.left_out.as_slice() {
                assert!(!only.is_above() && only.misfit > 4.0, "{only:?}");
            }
        }
    }

    #[test]
    fn two_profiles_cannot_show_which_of_them_is_wrong() {
        let found = crossovers(&crossing(&[0.0, 16.0], 0.0), &SurfaceOptions::default());
        let net = ProfileNet::of(&found, &PRIORS);
        assert!(net.left_out.is_empty());
        // Each is shifted by more than was known beforehand.
        assert!(net.radial_sigma_m > 1.0, "{}", net.radial_sigma_m);
        assert!(
            ProfileNet::of(&[], &PRIORS)
                .shifts(&[], PRIORS.plan_sigma_m)
                .is_empty()
        );
    }
}
