//! Profiles that do not belong to those that they cross.

use std::collections::{BTreeMap, BTreeSet};

use super::Crossover;
use crate::statistics::{NORMAL_MAD, median};

/// Fewest crossovers, with as many other profiles, by which a profile is left out.
const EVIDENCE_MIN: usize = 3;
/// A profile that lies farther from all others than this many standard deviations is left out.
const LEFT_OUT_SIGMAS: f64 = 5.0;
/// A misplaced profile has the heights of other ground at its crossovers. It is rejected if its misfit exceeds 1 by this many standard
/// deviations of a misfit by chance, and exceeds the minimum, which allows for the shift that its own crossovers share.
const MISFIT_SIGMAS: f64 = 4.5;
const MISFIT_MIN: f64 = 2.0;
/// Standard deviation of the misfit of one normal difference; of `n` it is this over √n: `1.4826 / (2 · 2φ(0.6745))`.
const OF_MISFIT: f64 = 1.166;

/// Degrees of freedom of Student's distribution for the weights of crossovers.
const FREEDOM: f64 = 4.0;

/// A priori standard deviations of the shift of a profile, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePriors {
    /// Along the radius.
    pub radial_sigma_m: f64,
    /// In plan, on each axis.
    pub plan_sigma_m: f64,
}

/// A profile that does not belong to the others: at its crossovers it lies above or below all of them by one constant, or it is
/// misplaced and has the heights of other ground.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Its index.
    pub profile: usize,
    /// Profiles that it crosses, ascending; those that were left out before it are not among them.
    pub others: Vec<usize>,
    /// Crossovers with them.
    pub crossovers: usize,
    /// Height of the profile above the others, metres.
    pub above_m: f64,
    /// Standard deviation of `above_m`, metres.
    pub sigma_m: f64,
    /// Robust root mean square of the height differences at its crossovers, each divided by its standard deviation,
    /// which includes the uncertainty of the shifts of both profiles.
    pub misfit: f64,
}

impl LeftOut {
    /// Whether it lies above or below the others by one constant; otherwise it is misplaced.
    #[must_use]
    pub fn is_above(&self) -> bool {
        self.above_m.abs() > LEFT_OUT_SIGMAS * self.sigma_m
    }

    /// How far it is from belonging: above 1 it does not.
    fn excess(&self) -> f64 {
        let of_height = self.above_m.abs() / self.sigma_m / LEFT_OUT_SIGMAS;
        let by_chance = OF_MISFIT / (self.crossovers as f64).sqrt();
        let misfit_max = (1.0 + MISFIT_SIGMAS * by_chance).max(MISFIT_MIN);
        of_height.max(self.misfit / misfit_max)
    }
}

/// The profile that belongs least, if it does not belong.
pub(super) fn worst(crossovers: &[Crossover], priors: &ProfilePriors) -> Option<LeftOut> {
    let mut by_profile: BTreeMap<usize, Vec<Difference>> = BTreeMap::new();
    for crossover in crossovers {
        let [first, second] = crossover.profiles;
        let [own, others] = crossover.shared;
        for (profile, other, sign, of_other) in
            [(first, second, 1.0, others), (second, first, -1.0, own)]
        {
            // The other profile has a shift as well.
            let shift_m = priors.radial_sigma_m * of_other.radial;
            let variance_m2 = crossover.sigma_m.powi(2) + shift_m.powi(2);
            let plan_m = priors.plan_sigma_m * own.plan.hypot(others.plan);
            let own_m = priors.radial_sigma_m * if sign > 0.0 { own } else { others }.radial;
            by_profile.entry(profile).or_default().push(Difference {
                other,
                value_m: sign * crossover.difference_m,
                variance_m2,
                with_shifts_m2: variance_m2
                    + own_m.powi(2)
                    + 2.0 * (crossover.slope_along * plan_m).powi(2),
            });
        }
    }
    let all = by_profile.iter().filter_map(|(profile, crossovers)| {
        let others: BTreeSet<usize> = crossovers.iter().map(|of| of.other).collect();
        let (above_m, sigma_m) = robust_mean(crossovers);
        // Unknown attitude explains a shift, but does not make its profile useful.
        let sigma_m = sigma_m.hypot(priors.radial_sigma_m);
        (others.len() >= EVIDENCE_MIN).then(|| LeftOut {
            profile: *profile,
            others: others.into_iter().collect(),
            crossovers: crossovers.len(),
            above_m,
            sigma_m,
            misfit: misfit(crossovers),
        })
    });
    // Of equal ones the first.
    let worst = all.reduce(|worst, of| {
        if of.excess() > worst.excess() {
            of
        } else {
            worst
        }
    })?;
    (worst.excess() > 1.0).then_some(worst)
}

/// A crossover from the view of one of its profiles.
struct Difference {
    /// Index of the other profile.
    other: usize,
    /// Height above it, metres.
    value_m: f64,
    /// Variance by noise, interpolation and the radial shift of the other profile, m².
    variance_m2: f64,
    /// The same with the radial shift of the profile itself, and shifts of both in plan on ground with the slope along them in all
    /// directions.
    with_shifts_m2: f64,
}

/// Robust root mean square of differences, in their standard deviations.
fn misfit(differences: &[Difference]) -> f64 {
    let sizes = differences
        .iter()
        .map(|of| of.value_m.abs() / of.with_shifts_m2.sqrt());
    NORMAL_MAD * median(&mut sizes.collect::<Vec<_>>())
}

/// Mean of differences by Student's distribution, with its standard deviation: as large as their scatter, if that
/// exceeds their variances.
fn robust_mean(differences: &[Difference]) -> (f64, f64) {
    let mut values_m: Vec<f64> = differences.iter().map(|of| of.value_m).collect();
    let mut mean_m = median(&mut values_m);
    let mut weights = 0.0;
    for _ in 0..10 {
        let mut sum = 0.0;
        weights = 0.0;
        for Difference {
            value_m,
            variance_m2,
            ..
        } in differences
        {
            let weight = student_weight((value_m - mean_m).powi(2) / variance_m2) / variance_m2;
            weights += weight;
            sum += weight * value_m;
        }
        mean_m = sum / weights;
    }
    let deviations = differences
        .iter()
        .map(|of| (of.value_m - mean_m).abs() / of.variance_m2.sqrt());
    let scatter = NORMAL_MAD * median(&mut deviations.collect::<Vec<_>>());
    (mean_m, scatter.max(1.0) / f64::sqrt(weights))
}

pub(super) fn student_weight(square: f64) -> f64 {
    ((FREEDOM + 1.0) / (FREEDOM + square)).min(1.0)
}
