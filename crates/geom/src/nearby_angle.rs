//! Sine and cosine of many angles close to each other, by short series instead of trigonometric functions.

/// Largest difference from the known angle, radians: the first terms that the series omit are then below 1e-17.
const NEAR_RAD: f64 = 0.01;

/// An angle whose sine and cosine are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearbyAngle {
    rad: f64,
    sin: f64,
    cos: f64,
}

impl NearbyAngle {
    /// The angle `rad`, radians.
    #[must_use]
    pub fn new(rad: f64) -> Self {
        let (sin, cos) = rad.sin_cos();
        Self { rad, sin, cos }
    }

    /// Sine and cosine of `rad`, radians, within rounding; fast if it is close to this angle.
    #[must_use]
    pub fn sin_cos(&self, rad: f64) -> (f64, f64) {
        let late = rad - self.rad;
        // Written so that NaN does not count as close.
        if !(late.abs() <= NEAR_RAD) {
            return rad.sin_cos();
        }
        let square = late * late;
        let late_sin = late * (1.0 - square * (1.0 / 6.0) * (1.0 - square * (1.0 / 20.0)));
        // One minus the cosine.
        let short = 0.5 * square * (1.0 - square * (1.0 / 12.0) * (1.0 - square * (1.0 / 30.0)));
        (
            self.sin + (self.cos * late_sin - self.sin * short),
            self.cos - (self.sin * late_sin + self.cos * short),
        )
    }
}

impl Default for NearbyAngle {
    fn default() -> Self {
        Self::new(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_near_and_far_have_their_sine_and_cosine() {
        for rad in [-3.1, -1.6, -0.3, 0.0, 0.7, 1.57, 3.0, 6.2] {
            let known = NearbyAngle::new(rad);
            for late in [0.0, 1e-9, -1e-4, 3e-3, -0.01, 0.0101, 2.0] {
                let (sin, cos) = known.sin_cos(rad + late);
                let expected = (rad + late).sin_cos();
                // Rounding of numbers up to 1.
                assert!((sin - expected.0).abs() <= 3e-16 && (cos - expected.1).abs() <= 3e-16);
            }
        }
        assert!(NearbyAngle::default().sin_cos(f64::NAN).0.is_nan());
    }
}
