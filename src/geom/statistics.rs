//! Statistics of residuals, classical and robust.
//!
//! Every function takes finite values and answers `None` when there are too few of them or one is not
//! finite, so that no result is ever `NaN`.

/// Standard deviations of a normal distribution per median absolute deviation, `1/Φ⁻¹(3/4)`.
const NORMAL_PER_MAD: f64 = 1.482_602_218_505_602;

/// Statistics of one sample, in its unit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Statistics {
    /// Number of values.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation with `n − 1`; 0 for a single value.
    pub standard_deviation: f64,
    /// Median; the mean of the two middle values when their number is even.
    pub median: f64,
    /// Normalised median absolute deviation, `1.4826 · median |x − median|`.
    pub nmad: f64,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
}

impl Statistics {
    /// Statistics of `values`; `None` when there are none or one is not finite.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = finite(values)?.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let count = sorted.len();
        let mean = mean(&sorted);
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let median = median_of_sorted(&sorted);
        let mut deviations: Vec<f64> = values.iter().map(|value| (value - median).abs()).collect();
        deviations.sort_by(f64::total_cmp);
        Some(Self {
            count,
            mean,
            standard_deviation: (squares / count.saturating_sub(1).max(1) as f64).sqrt(),
            median,
            nmad: NORMAL_PER_MAD * median_of_sorted(&deviations),
            min,
            max,
        })
    }

    /// Whether `value` lies more than `factor` robust standard deviations from the median.
    ///
    /// * `nmad_floor` – least robust standard deviation that counts, in the unit of the sample: values
    ///   rounded to steps of `q` scatter by `q/√12` even when more than half of them are equal
    #[must_use]
    pub fn is_outlier(&self, value: f64, factor: f64, nmad_floor: f64) -> bool {
        (value - self.median).abs() > factor * self.nmad.max(nmad_floor)
    }
}

/// A straight line through points by least squares.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinearTrend {
    /// Slope, units of y per unit of x.
    pub slope: f64,
    /// Standard deviation of the slope from the residuals with `n − 2`.
    pub slope_sigma: f64,
    /// Value at the mean of x.
    pub centre: f64,
}

impl LinearTrend {
    /// The line through points `(x[i], y[i])`.
    ///
    /// `None` for fewer than three points, unequal lengths, values that are not finite, or an `x` that
    /// does not vary.
    #[must_use]
    pub fn fit(x: &[f64], y: &[f64]) -> Option<Self> {
        if x.len() != y.len() || x.len() < 3 {
            return None;
        }
        let (mean_x, centre) = (mean(finite(x)?), mean(finite(y)?));
        let pairs = || x.iter().zip(y).map(|(x, y)| (x - mean_x, y - centre));
        let spread: f64 = pairs().map(|(x, _)| x * x).sum();
        if spread <= 0.0 {
            return None;
        }
        let slope = pairs().map(|(x, y)| x * y).sum::<f64>() / spread;
        let residuals: f64 = pairs().map(|(x, y)| (y - slope * x).powi(2)).sum();
        let slope_sigma = (residuals / (x.len() - 2) as f64 / spread).sqrt();
        Some(Self {
            slope,
            slope_sigma,
            centre,
        })
    }
}

fn finite(values: &[f64]) -> Option<&[f64]> {
    values
        .iter()
        .all(|value| value.is_finite())
        .then_some(values)
}

/// Mean of a sample that is not empty: a first mean, then the mean of what it leaves, which saves the
/// digits that a long sum of large values loses.
fn mean(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let first = values.iter().sum::<f64>() / count;
    first + values.iter().map(|value| value - first).sum::<f64>() / count
}

/// Median of an ordered sample that is not empty.
fn median_of_sorted(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    if sorted.len().is_multiple_of(2) {
        0.5 * (sorted[middle - 1] + sorted[middle])
    } else {
        sorted[middle]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Fifteen digits: these are sums of a handful of small numbers.
    fn assert_close(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() < 1e-14 * expected.abs().max(1.0),
            "{found} instead of {expected}"
        );
    }

    #[test]
    fn statistics_of_a_sample_worked_by_hand() {
        let statistics = Statistics::of(&[4.0, 1.0, 2.0, 100.0, 3.0]).unwrap();
        assert_eq!(statistics.count, 5);
        assert_close(statistics.mean, 22.0);
        // Squares 18² + 21² + 20² + 78² + 19² = 7610, over 4.
        assert_close(statistics.standard_deviation, 1_902.5_f64.sqrt());
        assert_close(statistics.median, 3.0);
        // Deviations 1, 2, 1, 97, 0: median 1.
        assert_close(statistics.nmad, 1.482_602_218_505_602);
        assert_close(statistics.min, 1.0);
        assert_close(statistics.max, 100.0);
        assert!(statistics.is_outlier(100.0, 3.0, 0.0) && !statistics.is_outlier(4.0, 3.0, 0.0));
        let even = Statistics::of(&[1.0, 2.0, 4.0, 9.0]).unwrap();
        assert_close(even.median, 3.0);
        assert_close(even.nmad, 1.482_602_218_505_602 * 1.5); // deviations 2, 1, 1, 6
    }

    #[test]
    fn a_floor_keeps_quantised_samples_from_being_all_outliers() {
        let values = [0.50, 0.50, 0.50, 0.50, 0.51, 0.50];
        let statistics = Statistics::of(&values).unwrap();
        assert_close(statistics.nmad, 0.0);
        assert!(statistics.is_outlier(0.51, 3.0, 0.0));
        assert!(!statistics.is_outlier(0.51, 4.0, 0.01 / 12_f64.sqrt()));
        assert!(statistics.is_outlier(0.53, 4.0, 0.01 / 12_f64.sqrt()));
    }

    #[test]
    fn too_few_or_not_finite_values_have_no_statistics() {
        assert_eq!(Statistics::of(&[]), None);
        assert_eq!(Statistics::of(&[1.0, f64::NAN]), None);
        assert_eq!(Statistics::of(&[f64::INFINITY]), None);
        assert_close(Statistics::of(&[7.0]).unwrap().standard_deviation, 0.0);
        assert_eq!(LinearTrend::fit(&[0.0, 1.0], &[0.0, 1.0]), None);
        assert_eq!(LinearTrend::fit(&[2.0; 4], &[0.0, 1.0, 2.0, 3.0]), None);
        assert_eq!(
            LinearTrend::fit(&[0.0, 1.0, 2.0], &[0.0, f64::NAN, 1.0]),
            None
        );
        assert_eq!(LinearTrend::fit(&[0.0, 1.0, 2.0], &[0.0, 1.0]), None);
    }

    #[test]
    fn a_trend_worked_by_hand() {
        let trend = LinearTrend::fit(&[0.0, 1.0, 2.0, 3.0], &[1.0, 1.0, 3.0, 3.0]).unwrap();
        // Deviations of x ∓1.5, ∓0.5, of y ∓1: Sxx 5, Sxy 4; residuals 0.2, −0.6, 0.6, −0.2, squares 0.8.
        assert_close(trend.slope, 0.8);
        assert_close(trend.slope_sigma, (0.8_f64 / 2.0 / 5.0).sqrt());
        assert_close(trend.centre, 2.0);
    }

    proptest! {
        #[test]
        fn a_shift_moves_the_location_and_keeps_the_scatter(
            values in proptest::collection::vec(-100.0..100.0_f64, 3..40), shift in -1e6..1e6_f64,
        ) {
            let shifted: Vec<f64> = values.iter().map(|value| value + shift).collect();
            let (a, b) = (Statistics::of(&values).unwrap(), Statistics::of(&shifted).unwrap());
            // 1e6 has 1e-10 of rounding in each value.
            prop_assert!((b.mean - a.mean - shift).abs() < 1e-9);
            prop_assert!((b.median - a.median - shift).abs() < 1e-9);
            prop_assert!((b.nmad - a.nmad).abs() < 1e-8);
            prop_assert!((b.standard_deviation - a.standard_deviation).abs() < 1e-8);
            prop_assert!(a.min <= a.median && a.median <= a.max);
        }

        #[test]
        fn a_straight_line_is_found_again(
            slope in -10.0..10.0_f64, offset in -10.0..10.0_f64, count in 3..50_u32,
        ) {
            let x: Vec<f64> = (0..count).map(f64::from).collect();
            let y: Vec<f64> = x.iter().map(|x| offset + slope * x).collect();
            let trend = LinearTrend::fit(&x, &y).unwrap();
            prop_assert!((trend.slope - slope).abs() < 1e-11); // rounding of values up to 500
            prop_assert!(trend.slope_sigma < 1e-11);
        }
    }
}
