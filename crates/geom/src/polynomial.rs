//! Polynomials fitted by unweighted least squares.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A polynomial in `x`, its coefficients from the constant upwards.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Polynomial {
    coefficients: Vec<f64>,
}

/// A polynomial with its residuals at the samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The polynomial.
    pub polynomial: Polynomial,
    /// Sample minus polynomial, in the order and unit of the samples.
    pub residuals: Vec<f64>,
    /// `sqrt(Σ v² / n)`: divided by the number of samples, as Shan et al. 2005 do (their Table 4).
    pub rmse: f64,
}

impl Polynomial {
    /// The polynomial with these coefficients, constant first.
    #[must_use]
    pub const fn new(coefficients: Vec<f64>) -> Self {
        Self { coefficients }
    }

    /// Coefficients, constant first.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Value at `x`.
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        self.coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, coefficient| sum * x + coefficient)
    }

    /// Fits a polynomial of degree `order` to samples `y` at `x`.
    ///
    /// The fit runs in `u = x / max|x|`, where its matrix has a condition number near 10; with
    /// monomials in image lines it would be of order 1e15. `None` when there are fewer samples than
    /// coefficients, when lengths differ, or when the abscissae do not separate the coefficients.
    #[must_use]
    pub fn fit(x: &[f64], y: &[f64], order: usize) -> Option<Fit> {
        let half_width = x.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        if x.len() != y.len() || x.len() <= order || !(half_width > 0.0 && half_width.is_finite()) {
            return None;
        }
        let design = DMatrix::from_fn(x.len(), order + 1, |row, power| {
            (x[row] / half_width).powi(i32::try_from(power).unwrap_or(i32::MAX))
        });
        let decomposition = design.qr();
        let projected = decomposition.q().tr_mul(&DVector::from_column_slice(y));
        let mut scaled = decomposition.r().solve_upper_triangular(&projected)?;
        let mut factor = 1.0;
        for coefficient in scaled.iter_mut() {
            *coefficient *= factor;
            factor /= half_width;
        }
        let polynomial = Self::new(scaled.iter().copied().collect());
        let residuals: Vec<f64> = x
            .iter()
            .zip(y)
            .map(|(x, y)| y - polynomial.value(*x))
            .collect();
        let rmse = root_mean_square(&residuals);
        rmse.is_finite().then_some(Fit {
            polynomial,
            residuals,
            rmse,
        })
    }
}

/// `sqrt(Σ v² / n)`; 0 for no values.
#[must_use]
pub fn root_mean_square(values: &[f64]) -> f64 {
    let sum: f64 = values.iter().map(|value| value * value).sum();
    (sum / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_exact_quadratic_comes_back(
            a0 in -4e6..4e6_f64, a1 in -10.0..10.0_f64, a2 in -1e-4..1e-4_f64, lines in 100_u32..12_000,
        ) {
            let truth = Polynomial::new(vec![a0, a1, a2]);
            let x: Vec<f64> = (0..=30).map(|k| f64::from(lines) * (f64::from(k) / 30.0 - 0.5)).collect();
            let y: Vec<f64> = x.iter().map(|x| truth.value(*x)).collect();
            let fit = Polynomial::fit(&x, &y, 2).unwrap();
            // Rounding of values near 4e6 m: a few nanometres.
            prop_assert!(fit.rmse < 5e-9, "{} m", fit.rmse);
            for (x, y) in x.iter().zip(&y) {
                prop_assert!((fit.polynomial.value(*x) - y).abs() < 2e-8);
            }
        }
    }

    #[test]
    fn rmse_divides_by_the_number_of_samples() {
        // u² over 31 equispaced points has standard deviation 0.31752 about its mean (s_31).
        let x: Vec<f64> = (0..=30).map(|k| f64::from(k) / 15.0 - 1.0).collect();
        let y: Vec<f64> = x.iter().map(|x| x * x).collect();
        let fit = Polynomial::fit(&x, &y, 1).unwrap();
        assert!((fit.rmse - 0.31752).abs() < 5e-6); // five published digits
    }

    #[test]
    fn hopeless_samples_give_none() {
        assert!(Polynomial::fit(&[1.0, 2.0], &[1.0, 2.0], 2).is_none());
        assert!(Polynomial::fit(&[0.0, 0.0, 0.0], &[1.0, 2.0, 3.0], 1).is_none());
        assert!(Polynomial::fit(&[1.0, 2.0, 3.0], &[1.0, f64::NAN, 3.0], 1).is_none());
        assert!(Polynomial::fit(&[2.0, 2.0, 2.0], &[1.0, 2.0, 3.0], 1).is_none());
    }
}
