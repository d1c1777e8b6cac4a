//! Calibrations of one camera in several orbits: whether the lines of the camera have changed since the calibration in use, and
//! their drift.
//!
//! A calibration contains the mean error of its orbit. Shifts and rotations of the spacecraft change the lines in common, or as
//! a radial error does; they are part of the covariance with their a priori size. Differences between lines are known far
//! better than common parts. An orbit disagrees with the calibration in use if one parameter, or all together, differ by more
//! than chance explains.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

#[cfg(test)]
mod tests;

use super::looks::LookParameter;
use crate::statistics::median;

/// Limit of one normalised change. Of an unchanged camera with two lines, one calibration in 12,000 exceeds it in one of its
/// twelve parameters.
pub const ONE_SIGMAS: f64 = 4.5;
/// Limit of all changes together, as a standard normal deviate: one unchanged camera in 10,000 exceeds it.
pub const TOGETHER_SIGMAS: f64 = 3.72;
/// Smallest change in pixels that requires a new calibration: the residual of tie points that a calibration leaves.
///
/// # Source
/// Li et al. 2023, Table 5: 0.28 and 0.30 pixels.
pub const RELEVANT_PX: f64 = 0.3;
/// Smallest number of calibrations whose scatter about a drift is tested: second differences of three leave one number for each
/// direction, and one change would decide it alone.
const SCATTER_MIN: usize = 5;
/// Smallest number of calibrations that determine a drift.
const DRIFT_MIN: usize = 3;
/// Median of the square of a standard normal deviate.
const MEDIAN_SQUARE: f64 = 0.454_936;
/// Smallest share of the variance that is due to the calibrations, for a direction to show their scatter.
const SHOWN_SHARE: f64 = 0.5;

/// The lines of the camera in one orbit.
#[derive(Debug, Clone, PartialEq)]
pub struct OrbitLooks {
    /// Middle of the images, ET seconds.
    pub et_s: f64,
    /// Changes of the parameters from the laboratory, line by line, tangents.
    pub changes: DVector<f64>,
    /// Their covariance from measurements.
    pub covariance: DMatrix<f64>,
    /// Their standard deviations from errors of the orbit: a column for each independent error.
    pub orbit: DMatrix<f64>,
}

/// What a parameter of the series refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lines {
    /// The mean of all lines.
    Common,
    /// A line relative to the first one, by their indices.
    Relative(usize),
}

/// A number with its standard deviation, tangents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl Estimate {
    /// The number in standard deviations.
    #[must_use]
    pub fn sigmas(self) -> f64 {
        self.value / self.sigma
    }
}

/// Agreement of an orbit with the calibration in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Agreement {
    /// No significant change.
    Agrees,
    /// A significant change of all parameters together, or one smaller than [`RELEVANT_PX`]: no parameter by itself shows a larger one.
    Changed,
    /// A significant change that requires a new calibration.
    Recalibrate,
}

/// An orbit compared with the calibration in use.
#[derive(Debug, Clone, PartialEq)]
pub struct OrbitChange {
    /// Changes from the calibration in use, in the order of [`parameters`].
    pub changes: Vec<Estimate>,
    /// All changes together, as a standard normal deviate.
    pub together_sigmas: f64,
    /// The decision.
    pub agreement: Agreement,
}

/// Drift of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Tangents per second.
    pub rate: Estimate,
    /// Change from the calibration in use to the last orbit, along the drift.
    pub until_last: Estimate,
    /// Seconds after the calibration in use at which the change reaches [`RELEVANT_PX`]; `None` for a drift that is not
    /// significant.
    pub relevant_after_s: Option<f64>,
}

/// The result.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Factor of all standard deviations from measurement, at least 1: observed over expected scatter about a drift. `None`
    /// where orbits are too few to test it; the factor is then 1.
    pub scatter: Option<f64>,
    /// Every orbit in the order of the input; that of the calibration in use agrees with itself.
    pub orbits: Vec<OrbitChange>,
    /// Drift of every parameter; empty where orbits are too few.
    pub drifts: Vec<Drift>,
}

/// The parameters of a series of `lines` lines, in order.
#[must_use]
pub fn parameters(lines: usize) -> Vec<(Lines, LookParameter)> {
    let of = (0..lines).map(|line| match line {
        0 => Lines::Common,
        _ => Lines::Relative(line),
    });
    of.flat_map(|lines| LookParameter::ALL.map(|parameter| (lines, parameter)))
        .collect()
}

/// From parameters of lines to common and relative ones.
fn common_and_relative(lines: usize) -> DMatrix<f64> {
    let of = LookParameter::ALL.len();
    let mut matrix = DMatrix::zeros(lines * of, lines * of);
    for parameter in 0..of {
        for line in 0..lines {
            matrix[(parameter, line * of + parameter)] = (lines as f64).recip();
            if line > 0 {
                let row = line * of + parameter;
                matrix[(row, row)] = 1.0;
                matrix[(row, parameter)] = -1.0;
            }
        }
    }
    matrix
}

/// Compares orbits with that of the calibration in use.
///
/// * `in_use` – index of the calibration in use
/// * `pixel` – tangent of a pixel
///
/// `None` for covariances that are not positive definite.
#[must_use]
pub fn compare_orbits(orbits: &[OrbitLooks], in_use: usize, pixel: f64) -> Option<Series> {
    let lines = orbits[in_use].changes.len() / LookParameter::ALL.len();
    let to = common_and_relative(lines);
    let of = orbits.iter().map(|orbit| OrbitLooks {
        et_s: orbit.et_s,
        changes: &to * &orbit.changes,
        covariance: &to * &orbit.covariance * to.transpose(),
        orbit: &to * &orbit.orbit,
    });
    let of: Vec<OrbitLooks> = of.collect();
    let scatter = scatter(&of);
    let variance = scatter.unwrap_or(1.0).powi(2);
    let compared = of.iter().enumerate().map(|(index, orbit)| {
        if index == in_use {
            return Some(unchanged(orbit.changes.len()));
        }
        compared(orbit, &of[in_use], variance, pixel)
    });
    Some(Series {
        scatter,
        orbits: compared.collect::<Option<Vec<_>>>()?,
        drifts: drifts(&of, in_use, variance, pixel),
    })
}

fn unchanged(parameters: usize) -> OrbitChange {
    let none = Estimate {
        value: 0.0,
        sigma: 0.0,
    };
    OrbitChange {
        changes: vec![none; parameters],
        together_sigmas: 0.0,
        agreement: Agreement::Agrees,
    }
}

fn compared(
    orbit: &OrbitLooks,
    in_use: &OrbitLooks,
    variance: f64,
    pixel: f64,
) -> Option<OrbitChange> {
    let change = &orbit.changes - &in_use.changes;
    let covariance = (&orbit.covariance + &in_use.covariance) * variance
        + &orbit.orbit * orbit.orbit.transpose()
        + &in_use.orbit * in_use.orbit.transpose();
    let square = change.dot(&Cholesky::new(covariance.clone())?.solve(&change));
    let together_sigmas = normal_of_chi_square(square, change.len());
    let changes = change.iter().enumerate().map(|(index, value)| Estimate {
        value: *value,
        sigma: covariance[(index, index)].sqrt(),
    });
    let changes: Vec<Estimate> = changes.collect();
    let mut large = changes.iter().filter(|of| of.sigmas().abs() > ONE_SIGMAS);
    let is_relevant = large.clone().any(|of| of.value.abs() > RELEVANT_PX * pixel);
    let agreement = if is_relevant {
        Agreement::Recalibrate
    } else if large.next().is_some() || together_sigmas > TOGETHER_SIGMAS {
        Agreement::Changed
    } else {
        Agreement::Agrees
    };
    Some(OrbitChange {
        changes,
        together_sigmas,
        agreement,
    })
}

/// The standard normal deviate that is exceeded as often as this χ².
///
/// # Source
/// Wilson & Hilferty 1931, The distribution of chi-square.
fn normal_of_chi_square(square: f64, freedom: usize) -> f64 {
    let freedom = freedom as f64;
    let variance = 2.0 / (9.0 * freedom);
    ((square / freedom).cbrt() - 1.0 + variance) / variance.sqrt()
}

/// Observed over expected scatter of the calibrations, at least 1, from differences of every orbit from the line between its
/// neighbours in time: a drift does not change them, and one sudden change appears in two of them. `None` where orbits are too
/// few.
fn scatter(orbits: &[OrbitLooks]) -> Option<f64> {
    if orbits.len() < SCATTER_MIN {
        return None;
    }
    let mut by_time: Vec<&OrbitLooks> = orbits.iter().collect();
    by_time.sort_by(|a, b| a.et_s.total_cmp(&b.et_s));
    let mut squares = Vec::new();
    for three in by_time.windows(3) {
        let [before, here, after] = three else {
            continue;
        };
        let share = (here.et_s - before.et_s) / (after.et_s - before.et_s);
        let weights = [share - 1.0, 1.0, -share];
        if !share.is_finite() {
            continue;
        }
        let zero = DVector::zeros(here.changes.len());
        let none = DMatrix::zeros(zero.len(), zero.len());
        let with = || three.iter().zip(weights);
        let difference = with().fold(zero, |sum, (of, weight)| sum + &of.changes * weight);
        let measured = with().fold(none.clone(), |sum, (of, weight)| {
            sum + &of.covariance * (weight * weight)
        });
        let orbit = with().fold(none, |sum, (of, weight)| {
            sum + &of.orbit * of.orbit.transpose() * (weight * weight)
        });
        squares.extend(normalised(&difference, &measured, &orbit).unwrap_or_default());
    }
    if squares.is_empty() {
        return None;
    }
    Some((median(&mut squares) / MEDIAN_SQUARE).sqrt().max(1.0))
}

/// Squares of a difference over its variance, in the directions in which measurement determines the variance.
fn normalised(
    difference: &DVector<f64>,
    measured: &DMatrix<f64>,
    orbit: &DMatrix<f64>,
) -> Option<Vec<f64>> {
    let whole = Cholesky::new(measured + orbit)?;
    let lower = whole.l();
    let whitened = lower.solve_lower_triangular(difference)?;
    let half = lower.solve_lower_triangular(measured)?;
    let share = lower.solve_lower_triangular(&half.transpose())?;
    let shares = SymmetricEigen::new(0.5 * (&share + share.transpose()));
    let along = shares.eigenvectors.tr_mul(&whitened);
    let directions = along.iter().zip(shares.eigenvalues.iter());
    let shown = directions.filter(|(_, share)| **share > SHOWN_SHARE);
    Some(shown.map(|(along, _)| along * along).collect())
}

/// Drift of every parameter, by weighted regression of each on time.
fn drifts(orbits: &[OrbitLooks], in_use: usize, variance: f64, pixel: f64) -> Vec<Drift> {
    let from_s = orbits[in_use].et_s;
    let after_s: Vec<f64> = orbits.iter().map(|of| of.et_s - from_s).collect();
    let last_s = after_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let first_s = after_s.iter().copied().fold(f64::INFINITY, f64::min);
    if orbits.len() < DRIFT_MIN || !(last_s > first_s) {
        return Vec::new();
    }
    let drift = |parameter: usize| {
        let weights = orbits.iter().map(|of| {
            let by_orbit = of.orbit.row(parameter).norm_squared();
            (of.covariance[(parameter, parameter)] * variance + by_orbit).recip()
        });
        let weights: Vec<f64> = weights.collect();
        let whole: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(usize) -> f64| {
            let sum: f64 = (0..orbits.len()).map(|at| weights[at] * of(at)).sum();
            sum / whole
        };
        let mean_s = mean(&|at| after_s[at]);
        let mean_value = mean(&|at| orbits[at].changes[parameter]);
        let square = whole * mean(&|at| (after_s[at] - mean_s).powi(2));
        let product = whole
            * mean(&|at| (after_s[at] - mean_s) * (orbits[at].changes[parameter] - mean_value));
        let rate = Estimate {
            value: product / square,
            sigma: square.recip().sqrt(),
        };
        let until_last = Estimate {
            value: rate.value * last_s,
            sigma: rate.sigma * last_s.abs(),
        };
        let relevant_after_s =
            (rate.sigmas().abs() > ONE_SIGMAS).then(|| RELEVANT_PX * pixel / rate.value.abs());
        Drift {
            rate,
            until_last,
            relevant_after_s,
        }
    };
    (0..orbits[in_use].changes.len()).map(drift).collect()
}
