//! Random numbers of the service; tests set them.

/// Random numbers from 0 up to 1.
#[derive(Debug, Clone, Copy, Default)]
pub struct Random {
    /// The number, if not from the system.
    always: Option<f64>,
}

impl Random {
    /// A constant number.
    #[must_use]
    pub const fn always(number: f64) -> Self {
        Self {
            always: Some(number),
        }
    }

    /// A uniformly distributed number from 0 to below 1.
    #[must_use]
    pub fn unit(self) -> f64 {
        self.always.unwrap_or_else(|| {
            // Without random numbers from the system retries are merely not spread.
            let bits = getrandom::u32().unwrap_or_default();
            f64::from(bits) / 2_f64.powi(32)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_spread_over_the_unit_interval() {
        let drawn: Vec<f64> = (0..1000).map(|_| Random::default().unit()).collect();
        assert!(drawn.iter().all(|number| (0.0..1.0).contains(number)));
        // Standard deviation of the mean of 1000 uniform numbers: 0.009.
        let mean = drawn.iter().sum::<f64>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.09, "{mean}");
    }
}
