//! Similarity of two series of heights.

use serde::{Deserialize, Serialize};

/// A measure of the similarity of the heights of a terrain model and of a laser.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Similarity {
    /// Concordance: 1 only for equal heights.
    Ccc,
    /// Correlation: 1 for heights that differ by a constant and a factor.
    Pearson,
    /// Concordance of heights whose means are made equal.
    CccBiasRemoved,
}

impl Similarity {
    /// Its name on the command line and in products.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ccc => "ccc",
            Self::Pearson => "pearson",
            Self::CccBiasRemoved => "ccc_bias_removed",
        }
    }
}

/// Population moments of two series of the same length.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    count: f64,
    sums: [f64; 2],
    squares: [f64; 2],
    products: f64,
}

impl Moments {
    /// Adds a pair of numbers, which should be relative to about their means: sums of squares lose digits otherwise.
    pub fn add(&mut self, model: f64, laser: f64) {
        self.count += 1.0;
        self.sums[0] += model;
        self.sums[1] += laser;
        self.squares[0] += model * model;
        self.squares[1] += laser * laser;
        self.products += model * laser;
    }

    /// Pairs taken.
    #[must_use]
    pub const fn count(&self) -> f64 {
        self.count
    }

    /// Mean of the first series minus mean of the second.
    #[must_use]
    pub fn bias(&self) -> f64 {
        (self.sums[0] - self.sums[1]) / self.count
    }

    /// Population variances of both.
    #[must_use]
    pub fn variances(&self) -> [f64; 2] {
        [0, 1].map(|of: usize| {
            let mean = self.sums[of] / self.count;
            (self.squares[of] / self.count - mean * mean).max(0.0)
        })
    }

    /// Their similarity; `None` where a series is flat and the measure has no value.
    ///
    /// # Source
    /// Li et al. 2023, eq. 18: `ρ_c = 2 cov / (σ² + σ² + (μ − μ)²)`, never above the correlation in size.
    #[must_use]
    pub fn similarity(&self, measure: Similarity) -> Option<f64> {
        let [model, laser] = self.variances();
        let covariance =
            self.products / self.count - self.sums[0] * self.sums[1] / (self.count * self.count);
        let bias = self.bias();
        let over = match measure {
            Similarity::Ccc => 0.5 * (model + laser + bias * bias),
            Similarity::Pearson => (model * laser).sqrt(),
            Similarity::CccBiasRemoved => 0.5 * (model + laser),
        };
        // Written so that empty series have no value either.
        (over > 1e-9).then(|| covariance / over)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn moments(pairs: impl IntoIterator<Item = (f64, f64)>) -> Moments {
        let mut moments = Moments::default();
        for (model, laser) in pairs {
            moments.add(model, laser);
        }
        moments
    }

    /// Heights with mean 0 and variance 2/3 · 100².
    const LASER: [f64; 6] = [-100.0, 100.0, 0.0, 100.0, -100.0, 0.0];

    fn ccc(of: impl Fn(f64) -> f64) -> f64 {
        let pairs = LASER.map(|laser| (of(laser), laser));
        moments(pairs)
            .similarity(Similarity::Ccc)
            .unwrap_or(f64::NAN)
    }

    #[test]
    fn concordance_has_its_identities() {
        let variance = 2e4 / 3.0;
        let [bias, factor] = [80.0, 0.6];
        assert!((ccc(|laser| laser) - 1.0).abs() < 1e-12); // rounding, as below
        let expected = 1.0 / (1.0 + bias * bias / (2.0 * variance));
        assert!((ccc(|laser| laser + bias) - expected).abs() < 1e-12);
        let expected = 2.0 * factor / (1.0 + factor * factor);
        assert!((ccc(|laser| laser * factor) - expected).abs() < 1e-12);
        assert!((ccc(|laser| -laser) + 1.0).abs() < 1e-12);
    }

    #[test]
    fn flat_series_have_no_value() {
        let flat = moments(LASER.map(|_| (5.0, 5.0)));
        let one_flat = moments(LASER.map(|laser| (5.0, laser)));
        assert_eq!(flat.similarity(Similarity::Ccc), None);
        assert_eq!(flat.similarity(Similarity::Pearson), None);
        assert_eq!(one_flat.similarity(Similarity::Pearson), None);
        assert_eq!(one_flat.similarity(Similarity::Ccc), Some(0.0));
        assert_eq!(Moments::default().similarity(Similarity::Ccc), None);
    }

    proptest! {
        #[test]
        fn concordance_is_never_above_correlation(
            pairs in prop::collection::vec((-2e3..2e3_f64, -2e3..2e3_f64), 3..40)
        ) {
            let moments = moments(pairs);
            let of = |measure| moments.similarity(measure).unwrap_or(0.0);
            let correlation = of(Similarity::Pearson);
            // Rounding of sums of squares.
            prop_assert!(of(Similarity::Ccc).abs() <= correlation.abs() + 1e-9);
            prop_assert!(of(Similarity::CccBiasRemoved).abs() <= correlation.abs() + 1e-9);
        }
    }
}
