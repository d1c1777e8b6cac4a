//! A power with one fixed exponent, for kernels that are evaluated millions of times.

/// Nodes between two powers of two.
const NODES: usize = 512;
/// Terms of the series around a node: the next one is below 1e-16.
const TERMS: usize = 5;
/// Exponents of two in the table.
const EXPONENTS: i32 = 64;
/// Bits of the fraction of an `f64`, and the bias of its exponent.
const FRACTION_BITS: u32 = 52;
const BIAS: i32 = 1_023;

/// `x^p` of a fixed `p`, to a few units of the last place.
///
/// With `x = 2^e · m · (1 + r)`, `m` the middle of one of 512 intervals of the significand, the first two factors are table
/// entries and the last is the binomial series.
#[derive(Debug)]
pub(super) struct FractionalPower {
    exponent: f64,
    /// `2^(p e)`.
    of_exponents: [f64; 2 * EXPONENTS as usize],
    /// `1/m` and `m^p`.
    of_nodes: [[f64; 2]; NODES],
    /// Binomial coefficients.
    series: [f64; TERMS],
}

impl FractionalPower {
    pub(super) fn new(exponent: f64) -> Self {
        let mut series = [1.0; TERMS];
        for term in 1..TERMS {
            let before = (term - 1) as f64;
            series[term] = series[term - 1] * (exponent - before) / (before + 1.0);
        }
        Self {
            exponent,
            of_exponents: std::array::from_fn(|index| {
                (index as f64 - f64::from(EXPONENTS)).exp2().powf(exponent)
            }),
            of_nodes: std::array::from_fn(|index| {
                let node = 1.0 + (index as f64 + 0.5) / NODES as f64;
                [node.recip(), node.powf(exponent)]
            }),
            series,
        }
    }

    /// The power of a number that is not negative.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "eleven bits of an exponent, nine of a fraction"
    )]
    pub(super) fn of(&self, x: f64) -> f64 {
        const INDEX_BITS: u32 = NODES.ilog2();
        let bits = x.to_bits();
        let exponent = (bits >> FRACTION_BITS) as i32 - BIAS;
        let Some(of_exponent) = self.of_exponents.get((exponent + EXPONENTS) as usize) else {
            // Zero, and numbers that no distance has.
            return x.powf(self.exponent);
        };
        let fraction = bits & ((1 << FRACTION_BITS) - 1);
        let significand = f64::from_bits(fraction | (BIAS as u64) << FRACTION_BITS);
        let [inverse, of_node] = self.of_nodes[(fraction >> (FRACTION_BITS - INDEX_BITS)) as usize];
        let r = significand * inverse - 1.0;
        let series = self.series.iter().rev();
        of_exponent * of_node * series.fold(0.0, |sum, coefficient| sum * r + coefficient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_power_is_that_of_the_library(exponent in 0.1..2.0_f64, log in -60.0..60.0_f64) {
            let x = log.exp2();
            let expected = x.powf(exponent);
            let found = FractionalPower::new(exponent).of(x);
            // Rounding of three products and of the series: ten units of the last place.
            prop_assert!((found / expected - 1.0).abs() < 2e-15, "{found} {expected}");
        }
    }

    #[test]
    fn numbers_beyond_the_table_are_those_of_the_library() {
        let power = FractionalPower::new(0.7);
        assert_eq!(power.of(0.0).to_bits(), 0.0_f64.to_bits());
        for x in [1e-300, 1e30, f64::MIN_POSITIVE / 8.0] {
            assert!((power.of(x) / x.powf(0.7) - 1.0).abs() < 1e-15, "{x}");
        }
        assert!(power.of(f64::INFINITY).is_infinite() && power.of(f64::NAN).is_nan());
    }
}
