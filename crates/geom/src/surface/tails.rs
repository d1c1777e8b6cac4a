//! Tails of the errors of a surface: intervals that contain the ground with a stated probability.
//!
//! Errors follow Student's distribution with three degrees of freedom, scaled so that one standard deviation as stated
//! contains 68.27 %, as of a normal distribution. Craters that no profile crossed make its tails long: of withheld real
//! profiles of MOLA one in a hundred deviates by more than four standard deviations.

use std::f64::consts::PI;

/// Stated standard deviations in units of Student's scale: the half-width that contains 68.27 %.
const SIGMA: f64 = 1.196_881_354;

/// Probability that an error lies within `sigmas` stated standard deviations.
#[must_use]
pub fn probability(sigmas: f64) -> f64 {
    // The distribution with three degrees of freedom has a closed form.
    let x = sigmas * SIGMA / 3.0_f64.sqrt();
    2.0 / PI * (x / (1.0 + x * x) + x.atan())
}

/// Half-width of the interval that contains the error with this probability, in stated standard deviations.
///
/// Finite for probabilities below 1.
#[must_use]
pub fn half_width(probability_wanted: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while probability(high) < probability_wanted && high < 1e12 {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if probability(middle) < probability_wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Logarithm of the density of an error, with the constant ½ ln 2π of the normal distribution added: for the normal
/// distribution it would be −½ z² − ln σ.
#[must_use]
pub fn log_likelihood(error_m: f64, sigma_m: f64) -> f64 {
    let scale_m = sigma_m / SIGMA;
    let z = error_m / scale_m;
    0.5 * (2.0 * PI).ln() + (2.0 / (PI * 3.0_f64.sqrt())).ln()
        - 2.0 * (1.0 + z * z / 3.0).ln()
        - scale_m.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_students_distribution() {
        // Tables of Student's t with three degrees of freedom: 3.182 for 95 %, 5.841 for 99 %.
        for (probability_wanted, expected) in [(0.95, 3.182_446), (0.99, 5.840_909)] {
            let width = half_width(probability_wanted) * SIGMA;
            assert!((width - expected).abs() < 1e-5, "{width} {expected}");
        }
        assert!((probability(1.0) - 0.682_689_5).abs() < 1e-6);
        assert!((half_width(0.682_689_5) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn the_density_is_the_derivative_of_the_probability() {
        for error_m in [0.1, 1.0, 4.0] {
            let (sigma_m, step_m) = (2.0, 1e-4);
            let within = |error_m: f64| 0.5 * probability(error_m / sigma_m);
            let density = (within(error_m + step_m) - within(error_m - step_m)) / (2.0 * step_m);
            let stated = log_likelihood(error_m, sigma_m) - 0.5 * (2.0 * PI).ln();
            // Central differences: 1e-8 relative.
            assert!((density.ln() - stated).abs() < 1e-6, "{error_m}");
        }
    }
}
