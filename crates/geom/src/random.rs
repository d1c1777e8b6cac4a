//! Reproducible random numbers: the same seed gives the same numbers on every machine.

/// One step of the `SplitMix64` generator's output function.
///
/// # Source
/// Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
#[must_use]
pub const fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A number in `0 <= x < 1` from the upper 53 bits of `bits`.
#[must_use]
pub fn unit_of(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// A normal number, of mean 0 and standard deviation 1, from two numbers in `0 <= x < 1`, by Box and Muller.
#[must_use]
pub fn normal_of(first: f64, second: f64) -> f64 {
    // 1 − x, so that the logarithm is finite.
    let radius = (-2.0 * (1.0 - first).ln()).sqrt();
    radius * (std::f64::consts::TAU * second).cos()
}

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream of `seed` for one `purpose`; other purposes have independent streams.
    #[must_use]
    pub fn new(seed: u64, purpose: &str) -> Self {
        let state = purpose
            .bytes()
            .fold(mix(seed), |state, byte| mix(state ^ u64::from(byte)));
        Self { state }
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.state = mix(self.state);
        self.state
    }

    /// The next number in `low <= x < high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * unit_of(self.bits())
    }

    /// The next number between `low` and `high`, evenly spread in its logarithm.
    pub fn between_log(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// The next normal number, of mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        let first = self.between(0.0, 1.0);
        normal_of(first, self.between(0.0, 1.0))
    }

    /// The next direction, evenly spread over the sphere.
    pub fn direction(&mut self) -> nalgebra::Vector3<f64> {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = self.between(0.0, std::f64::consts::TAU).sin_cos();
        let equatorial = (1.0 - z * z).sqrt();
        nalgebra::Vector3::new(equatorial * cos, equatorial * sin, z)
    }
}
