//! Weight functions of robust estimation.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Decrease of the weight of an observation with the normalised residual `z = v/σ`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(tag = "function", rename_all = "snake_case")]
pub enum RobustWeight {
    /// `1` up to the limit, then `limit/|z|`.
    Huber {
        /// Normalised residual above which the weight decreases.
        #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
        limit: f64,
    },
    /// `1 / (1 + (z/limit)²)`.
    Cauchy {
        /// Normalised residual at which the weight is one half.
        #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
        limit: f64,
    },
}

impl RobustWeight {
    /// Limit of Huber's function that keeps 95 % efficiency for normal errors.
    pub const HUBER_LIMIT: f64 = 1.345;
    /// Limit of Cauchy's function that keeps 95 % efficiency for normal errors.
    pub const CAUCHY_LIMIT: f64 = 2.385;

    /// Factor of the weight, `0..=1`, at the normalised residual `z`.
    #[must_use]
    pub fn factor(self, z: f64) -> f64 {
        match self {
            Self::Huber { limit } if z.abs() <= limit => 1.0,
            Self::Huber { limit } => limit / z.abs(),
            Self::Cauchy { limit } => 1.0 / (1.0 + (z / limit).powi(2)),
        }
    }

    /// Loss function whose sum these weights minimise; `z²/2` near zero.
    #[must_use]
    pub fn cost(self, z: f64) -> f64 {
        match self {
            Self::Huber { limit } if z.abs() <= limit => 0.5 * z * z,
            Self::Huber { limit } => limit * (z.abs() - 0.5 * limit),
            Self::Cauchy { limit } => 0.5 * limit * limit * (z / limit).powi(2).ln_1p(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_with_the_residual() {
        for (function, at_limit, at_ten) in [
            (RobustWeight::Huber { limit: 1.345 }, 1.0, 0.1345),
            (
                RobustWeight::Cauchy { limit: 2.385 },
                1.0 / (1.0 + (1.345_f64 / 2.385).powi(2)),
                0.05382,
            ),
        ] {
            assert!((function.factor(0.0) - 1.0).abs() < 1e-15);
            assert!((function.factor(-1.345) - at_limit).abs() < 1e-15);
            assert!((function.factor(10.0) - at_ten).abs() < 1e-5); // five published digits
            for z in [0.5, 1.3, 1.4, 10.0] {
                // The weight is the slope of the cost over z.
                let slope = (function.cost(z + 1e-5) - function.cost(z - 1e-5)) / 2e-5;
                assert!((slope / z - function.factor(z)).abs() < 1e-9, "{z}");
            }
        }
    }
}
