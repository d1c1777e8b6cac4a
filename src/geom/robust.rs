//! Weight functions of robust estimation.

use serde::{Deserialize, Serialize};

/// How the weight of an observation falls with its normalised residual `z = v/σ`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RobustWeight {
    /// `1` up to the limit, then `limit/|z|`.
    Huber {
        /// Normalised residual from which the weight falls; 1.345 keeps 95 % efficiency.
        limit: f64,
    },
    /// `1 / (1 + (z/limit)²)`.
    Cauchy {
        /// Normalised residual with half the weight; 2.385 keeps 95 % efficiency.
        limit: f64,
    },
}

impl RobustWeight {
    /// Huber's function with 95 % efficiency for normal errors.
    pub const HUBER: Self = Self::Huber { limit: 1.345 };
    /// Cauchy's function with 95 % efficiency for normal errors.
    pub const CAUCHY: Self = Self::Cauchy { limit: 2.385 };

    /// Factor of the weight, `0..=1`, at the normalised residual `z`.
    #[must_use]
    pub fn factor(self, z: f64) -> f64 {
        match self {
            Self::Huber { limit } if z.abs() <= limit => 1.0,
            Self::Huber { limit } => limit / z.abs(),
            Self::Cauchy { limit } => 1.0 / (1.0 + (z / limit).powi(2)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_with_the_residual() {
        for (function, at_limit, at_ten) in [
            (RobustWeight::HUBER, 1.0, 0.1345),
            (
                RobustWeight::CAUCHY,
                1.0 / (1.0 + (1.345_f64 / 2.385).powi(2)),
                0.05382,
            ),
        ] {
            assert!((function.factor(0.0) - 1.0).abs() < 1e-15);
            assert!((function.factor(-1.345) - at_limit).abs() < 1e-15);
            assert!((function.factor(10.0) - at_ten).abs() < 1e-5); // five printed digits
        }
    }
}
