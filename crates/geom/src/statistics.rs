//! Plain and robust statistics of residuals.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Factor that makes the median absolute deviation of a normal distribution its standard deviation.
pub const NORMAL_MAD: f64 = 1.4826;

/// Floor of the spread for the detection of outliers, metres: PEDR ranges and radii are whole centimetres, so half of a
/// profile may agree exactly.
const SPREAD_FLOOR_M: f64 = 0.01;

/// Number of values that a summary holds.
const HELD_MAX: usize = 1 << 17;

/// Minimum number of residuals for the correlation of neighbours.
const CORRELATED_MIN: usize = 10;

/// Critical value of the test of standardised residuals: one good observation in a thousand fails it.
///
/// # Source
/// Baarda 1968, A testing procedure for use in geodetic networks.
pub const BAARDA_LIMIT: f64 = 3.29;

/// Limits that contain 99 % of all `sqrt(weighted squares / redundancy)` when standard deviations are correct: the
/// roots of χ² over its `redundancy` degrees of freedom; `None` without redundancy.
///
/// # Source
/// Wilson & Hilferty 1931, The distribution of chi-square: within 0.01 of the exact roots from 10 degrees of freedom.
#[must_use]
pub fn unit_weight_limits(redundancy: f64) -> Option<[f64; 2]> {
    /// Standard normal quantile of 0.995.
    const QUANTILE: f64 = 2.575_829;
    let variance = 2.0 / (9.0 * redundancy);
    let root = |sense: f64| {
        let cube_root = 1.0 - variance + sense * QUANTILE * variance.sqrt();
        cube_root.max(0.0).powf(1.5)
    };
    (redundancy >= 1.0).then(|| [root(-1.0), root(1.0)])
}

/// Statistics of a column; all 0 for an empty column.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct Summary {
    /// Number of values.
    pub n: u32,
    /// Mean, in the unit of the values.
    pub mean: f64,
    /// Standard deviation with divisor n − 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub standard_deviation: f64,
    /// Median.
    pub median: f64,
    /// Normalised median absolute deviation, 1.4826 · median |v − median|.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub nmad: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl Summary {
    /// Statistics of `values`.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        let [mean, standard_deviation] = mean_and_deviation(values);
        let (median, nmad) = median_and_nmad(values);
        Self {
            n: u32::try_from(values.len()).unwrap_or(u32::MAX),
            mean,
            standard_deviation,
            median,
            nmad,
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Statistics of the values of an iterator, which is called several times instead of holding many values: the same
    /// as [`Summary::of`] bit for bit.
    #[must_use]
    pub fn over<I: Iterator<Item = f64>>(values: impl Fn() -> I) -> Self {
        let count = values().count();
        if count <= HELD_MAX {
            return Self::of(&values().collect::<Vec<_>>());
        }
        let n = count as f64;
        let mean = values().sum::<f64>() / n;
        let squares: f64 = values().map(|value| (value - mean).powi(2)).sum();
        let median = median_over(count, &values);
        let deviations = || values().map(|value| (value - median).abs());
        Self {
            n: u32::try_from(count).unwrap_or(u32::MAX),
            mean,
            standard_deviation: (squares / (n - 1.0).max(1.0)).sqrt(),
            median,
            nmad: NORMAL_MAD * median_over(count, &deviations),
            min: values().fold(f64::INFINITY, f64::min),
            max: values().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Largest distance from the median within which a value in metres is not an outlier, for `sigma` robust standard
    /// deviations.
    ///
    /// The robust standard deviation is the NMAD, at least 1 cm.
    #[must_use]
    pub fn outlier_limit_m(&self, sigma: f64) -> f64 {
        sigma * self.nmad.max(SPREAD_FLOOR_M)
    }

    /// Whether a value in metres lies farther from the median than this limit; NaN does.
    #[must_use]
    pub fn is_outlier(&self, value_m: f64, limit_m: f64) -> bool {
        // Written so that NaN counts as an outlier.
        !((value_m - self.median).abs() <= limit_m)
    }
}

/// Mean of at least one value, and their standard deviation with divisor n − 1.
#[must_use]
pub fn mean_and_deviation(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    [mean, (squares / (n - 1.0).max(1.0)).sqrt()]
}

/// The largest of `values`, `None` for an empty sequence; NaN if one of them is NaN, so that no limit is satisfied by
/// chance.
#[must_use]
pub fn largest(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    // No comparison with NaN is true: once held, it stays.
    let larger = |held: f64, next: f64| {
        if next.is_nan() || next > held {
            next
        } else {
            held
        }
    };
    values.into_iter().reduce(larger)
}

/// The middle of at least one value, the mean of both middles for an even number; their order is lost.
///
/// # Panics
/// Without a value.
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let upper = *upper;
    // Below the upper one of two middles, the lower one is the largest.
    let lower = below.iter().copied().max_by(f64::total_cmp);
    match lower {
        Some(lower) if values.len().is_multiple_of(2) => 0.5 * (lower + upper),
        _ => upper,
    }
}

/// The median of at least one value, as [`median`].
fn median_over<I: Iterator<Item = f64>>(count: usize, values: &impl Fn() -> I) -> f64 {
    let upper = ranked(count / 2, values);
    if count.is_multiple_of(2) {
        0.5 * (ranked(count / 2 - 1, values) + upper)
    } else {
        upper
    }
}

/// The value of this rank, counted from 0, among more values: its bits are found sixteen at a time.
fn ranked<I: Iterator<Item = f64>>(mut rank: usize, values: &impl Fn() -> I) -> f64 {
    const DIGIT_BITS: u32 = 16;
    const SIGN: u64 = 1 << 63;
    // Bits in the order of `f64::total_cmp`.
    let ordered = |value: f64| {
        let bits = value.to_bits();
        if bits & SIGN == 0 { bits | SIGN } else { !bits }
    };
    let mut found: u64 = 0;
    for shift in (0..64).step_by(DIGIT_BITS as usize).rev() {
        let mut counts = vec![0_usize; 1 << DIGIT_BITS];
        // All higher bits are known; at first there are none.
        let above = |bits: u64| bits.checked_shr(shift + DIGIT_BITS).unwrap_or_default();
        for bits in values()
            .map(ordered)
            .filter(|bits| above(*bits) == above(found))
        {
            #[allow(clippy::cast_possible_truncation, reason = "a digit has sixteen bits")]
            let digit = (bits >> shift) as u16;
            counts[usize::from(digit)] += 1;
        }
        let mut digit = 0;
        while digit + 1 < counts.len() && rank >= counts[digit] {
            rank -= counts[digit];
            digit += 1;
        }
        found |= (digit as u64) << shift;
    }
    f64::from_bits(if found & SIGN == 0 {
        !found
    } else {
        found ^ SIGN
    })
}

/// Median and normalised median absolute deviation of at least one value.
fn median_and_nmad(values: &[f64]) -> (f64, f64) {
    let mut rest = values.to_vec();
    let middle = median(&mut rest);
    for value in &mut rest {
        *value = (*value - middle).abs();
    }
    (middle, NORMAL_MAD * median(&mut rest))
}

/// Marks residuals in metres farther from the median than `sigma` robust standard deviations.
///
/// The robust standard deviation is the NMAD, at least 1 cm.
#[must_use]
pub fn outliers(residuals_m: &[f64], sigma: f64) -> Vec<bool> {
    if residuals_m.is_empty() {
        return Vec::new();
    }
    let summary = Summary::of(residuals_m);
    let limit_m = summary.outlier_limit_m(sigma);
    let is_outlier = |value: &f64| summary.is_outlier(*value, limit_m);
    residuals_m.iter().map(is_outlier).collect()
}

/// Blocks of residuals that count as independent of each other.
const BLOCKS: usize = 10;
/// Fewest residuals of a block.
const BLOCK_MIN: usize = 10;

/// Straight line fitted to values, usually over time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct Trend {
    /// Slope, in the unit of the values per unit of the abscissa (per second).
    pub slope: f64,
    /// Standard uncertainty of the slope, from the scatter about the line; neighbouring values may be
    /// correlated.
    pub uncertainty: f64,
}

impl Trend {
    /// Least-squares slope of `values`, in the order of their measurement, over `seconds`; `None` below
    /// three points or without extent in time.
    ///
    /// # Source
    /// Uncertainty with the effective number of residuals in place of their number: Santer et al. 2000,
    /// J. Geophys. Res. 105 (D6), 7337–7356.
    #[must_use]
    pub fn of(seconds: &[f64], values: &[f64]) -> Option<Self> {
        let n = values.len();
        if n < 3 || seconds.len() != n {
            return None;
        }
        let mean_s = seconds.iter().sum::<f64>() / n as f64;
        let mean = values.iter().sum::<f64>() / n as f64;
        let extent: f64 = seconds.iter().map(|s| (s - mean_s).powi(2)).sum();
        let product: f64 = seconds
            .iter()
            .zip(values)
            .map(|(s, value)| (s - mean_s) * (value - mean))
            .sum();
        let slope = product / extent;
        let residuals: Vec<f64> = seconds
            .iter()
            .zip(values)
            .map(|(s, value)| value - mean - slope * (s - mean_s))
            .collect();
        let rest: f64 = residuals.iter().map(|residual| residual.powi(2)).sum();
        // However strong their correlation, at least one of them is independent.
        let free = (effective_count(&residuals) - 2.0).max(1.0);
        let scores = seconds.iter().zip(&residuals);
        let scores: Vec<f64> = scores.map(|(s, rest)| (s - mean_s) * rest).collect();
        let uncertainty = (rest / (free * extent)).sqrt();
        (extent > 0.0).then(|| Self {
            slope,
            uncertainty: uncertainty.max(spread_of_blocks(&scores) / extent),
        })
    }
}

/// Standard deviation of a sum whose terms are correlated over up to a tenth of their number: from the sums of ten
/// consecutive blocks, which must be practically independent; 0 for too few terms.
///
/// Systematic residuals, such as waves of a model that does not fit, appear here.
///
/// # Source
/// Liang & Zeger 1986, Biometrika 73, 13–22, with blocks as clusters.
fn spread_of_blocks(terms: &[f64]) -> f64 {
    if terms.len() < BLOCKS * BLOCK_MIN {
        return 0.0;
    }
    let block = |index: usize| index * terms.len() / BLOCKS;
    let squares: f64 = (0..BLOCKS)
        .map(|index| {
            terms[block(index)..block(index + 1)]
                .iter()
                .sum::<f64>()
                .powi(2)
        })
        .sum();
    (squares * BLOCKS as f64 / (BLOCKS - 1) as f64).sqrt()
}

/// Effective number of independent residuals about a line: `n (1 − ρ) / (1 + ρ)`, at most `n`.
///
/// `ρ` is the correlation of neighbours. Its estimate `r` from residuals about a fitted line is too small by about
/// `(2 + 4 ρ) / n`, which is corrected.
///
/// # Source
/// Effective number: Santer et al. 2000. Bias: after Marriott & Pope 1954, Biometrika 41, 390–402, who
/// treat a fitted mean; for mean and slope together the simulation in the tests confirms it.
fn effective_count(residuals: &[f64]) -> f64 {
    let n = residuals.len() as f64;
    let squares: f64 = residuals.iter().map(|residual| residual.powi(2)).sum();
    if residuals.len() < CORRELATED_MIN || !(squares > 0.0) {
        return n;
    }
    let products: f64 = residuals.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = (n * products / squares + 2.0) / (n - 4.0);
    n * (1.0 - correlation.clamp(0.0, 1.0)) / (1.0 + correlation.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests;
