//! Mean of observations that share errors in groups, or their slope over a given factor, with a standard deviation that
//! requires no a priori standard deviations of the observations.
//!
//! Every group enters as one observation, whatever its size: groups of unequal size with equal weights of their
//! observations have fewer degrees of freedom than groups, and a decision by their number is wrong too often.
//!
//! # Source
//! M-estimate: Huber and Ronchetti 2009, *Robust Statistics*, sections 6.3 and 7.6. Standard deviation by the jackknife:
//! MacKinnon and White 1985, *Journal of Econometrics* 29, 305–325. Quantiles of Student's distribution: Wallace 1959, *Annals of Mathematical
//! Statistics* 30, 1121–1130.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{robust::RobustWeight, statistics::Summary};

/// Groups from which on observations far from the others lose weight: with fewer groups, the data do not show which
/// observations these are.
pub const ROBUST_GROUPS_MIN: usize = 8;
/// Groups from which on a value is compared with zero.
pub const DECIDED_GROUPS_MIN: usize = 4;
/// A value is reported as different from zero at the significance level of three standard deviations of a normal distribution.
const SIGMAS: f64 = 3.0;
/// Maximum number of iterations; ten suffice.
const ITERATIONS_MAX: usize = 100;
/// Steps below this number of standard deviations end the iteration.
const STEP_MIN: f64 = 1e-9;
/// Largest share of one group in the estimate: of a slope, a single group may have all of it.
const SHARE_MAX: f64 = 1.0 - 1e-6;
/// Least robust standard deviation as a share of the largest value: rounding of equal values.
const SCATTER_SHARE_MIN: f64 = 1e-12;

/// An observation `value = factor · estimate + error`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The observed value.
    pub value: f64,
    /// 1 for a mean; for a slope, the abscissa.
    pub factor: f64,
    /// Observations of one group may share errors; groups are independent.
    pub group: usize,
}

/// A mean or a slope, in the unit of value over factor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct RobustMean {
    /// Observations.
    pub n: u32,
    /// Independent groups of observations.
    pub groups: u32,
    /// The estimate from one mean or slope of each group: from 8 groups on, groups far from the others lose weight (Huber).
    pub value: f64,
    /// Its standard deviation, from the scatter between the groups; missing for a single group.
    #[serde(default, skip_serializing_if = "areograph_base::stored::is_left_out")]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub sigma: Option<f64>,
    /// Number of standard deviations beyond which the estimate is reported as different from zero: 3 for many groups, more for
    /// a few (Student's distribution, two-sided significance level 0.27 %, one degree of freedom fewer than groups that keep
    /// their full weight); missing with fewer than 4 groups, for which no decision is reported.
    #[serde(default, skip_serializing_if = "areograph_base::stored::is_left_out")]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub limit_sigmas: Option<f64>,
}

impl RobustMean {
    /// The estimate from observations with finite values; those without a factor are not used. `None` without any.
    #[must_use]
    pub fn of(observations: &[Observation]) -> Option<Self> {
        let used: Vec<Observation> = observations
            .iter()
            .filter(|of| of.value.is_finite() && of.factor.is_finite() && of.factor.abs() > 0.0)
            .copied()
            .collect();
        if used.is_empty() {
            return None;
        }
        let each = of_groups(&used);
        let groups = each.len();
        let (value, scatter) = if groups < ROBUST_GROUPS_MIN {
            (least_squares(&each, |_| 1.0), f64::INFINITY)
        } else {
            huber(&each)
        };
        // Residuals beyond the limit count as the limit, and do not respond to the estimate.
        let limit = RobustWeight::HUBER_LIMIT * scatter;
        let residual = |of: &Observation| of.value - of.factor * value;
        let within = || each.iter().filter(|of| residual(of).abs() <= limit);
        let normal: f64 = within().map(|of| of.factor.powi(2)).sum();
        // Groups beyond the limit say nothing about the scatter of the others.
        let free = (within().count().max(2) - 1) as f64;
        let squares: f64 = each
            .iter()
            .map(|of| {
                // The estimate follows each group by its share, and the residual is smaller by it.
                let own = of.factor.powi(2);
                let is_beyond = residual(of).abs() > limit;
                let others = if is_beyond { normal } else { normal - own };
                let share = (own / (others + own)).min(SHARE_MAX);
                (of.factor * residual(of).clamp(-limit, limit) / (1.0 - share)).powi(2)
            })
            .sum();
        let sigma = (groups > 1).then(|| (squares * free / (free + 1.0)).sqrt() / normal);
        let is_decided = groups >= DECIDED_GROUPS_MIN;
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        Some(Self {
            n: count(used.len()),
            groups: count(groups),
            value,
            sigma,
            limit_sigmas: is_decided.then(|| limit_sigmas(free)),
        })
    }

    /// Whether the estimate is reported as different from zero; `None` where the groups are too few for a decision.
    #[must_use]
    pub fn differs_from_zero(&self) -> Option<bool> {
        Some(self.value.abs() > self.limit_sigmas? * self.sigma?)
    }
}

/// Quantile of Student's distribution with so many degrees of freedom, for the probability of [`SIGMAS`].
///
/// # Accuracy
/// Within 1.5 % of the exact quantile from 5 degrees of freedom, and above it for fewer.
fn limit_sigmas(freedom: f64) -> f64 {
    let normal = SIGMAS * (8.0 * freedom + 3.0) / (8.0 * freedom + 1.0);
    (freedom * (normal.powi(2) / freedom).exp_m1()).sqrt()
}

/// One observation for each group, with the slope of the group and the root mean square of its factors: a group of equal
/// factors is its mean.
fn of_groups(used: &[Observation]) -> Vec<Observation> {
    let mut sums: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for of in used {
        let [count, above, below] = sums.entry(of.group).or_default();
        *count += 1.0;
        *above += of.factor * of.value;
        *below += of.factor.powi(2);
    }
    let of_group = |(group, [count, above, below]): (usize, [f64; 3])| {
        let factor = (below / count).sqrt();
        Observation {
            value: factor * above / below,
            factor,
            group,
        }
    };
    sums.into_iter().map(of_group).collect()
}

fn least_squares(used: &[Observation], weight: impl Fn(&Observation) -> f64) -> f64 {
    let (mut above, mut below) = (0.0, 0.0);
    for of in used {
        let weight = weight(of);
        above += weight * of.factor * of.value;
        below += weight * of.factor.powi(2);
    }
    above / below
}

/// Huber's estimate from the weighted median, and the robust standard deviation about the median.
fn huber(used: &[Observation]) -> (f64, f64) {
    let mut value = weighted_median(used);
    let residuals: Vec<f64> = used.iter().map(|of| of.value - of.factor * value).collect();
    let size = used.iter().map(|of| of.value.abs()).fold(0.0, f64::max);
    let scatter = nmad_about_zero(&residuals).max(SCATTER_SHARE_MIN * size);
    if scatter <= 0.0 {
        return (value, scatter);
    }
    let function = RobustWeight::Huber {
        limit: RobustWeight::HUBER_LIMIT,
    };
    for _ in 0..ITERATIONS_MAX {
        let next = least_squares(used, |of| {
            function.factor((of.value - of.factor * value) / scatter)
        });
        let step = (next - value).abs();
        value = next;
        if step * used[0].factor.abs() < STEP_MIN * scatter {
            break;
        }
    }
    (value, scatter)
}

/// 1.4826 times the median size.
fn nmad_about_zero(residuals: &[f64]) -> f64 {
    let sizes: Vec<f64> = residuals
        .iter()
        .flat_map(|of| [-of.abs(), of.abs()])
        .collect();
    Summary::of(&sizes).nmad
}

/// The median of value over factor, weighted by the size of the factors: the estimate with the least sum of residuals.
fn weighted_median(used: &[Observation]) -> f64 {
    let mut ratios: Vec<(f64, f64)> = used
        .iter()
        .map(|of| (of.value / of.factor, of.factor.abs()))
        .collect();
    ratios.sort_by(|one, other| one.0.total_cmp(&other.0));
    let half = 0.5 * ratios.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    for (place, (ratio, weight)) in ratios.iter().enumerate() {
        sum += weight;
        if sum > half {
            return *ratio;
        }
        // Exactly half below: the middle of both neighbours.
        if sum >= half
            && let Some((next, _)) = ratios.get(place + 1)
        {
            return f64::midpoint(*ratio, *next);
        }
    }
    ratios.last().map_or(0.0, |(ratio, _)| *ratio)
}

#[cfg(test)]
mod tests;
