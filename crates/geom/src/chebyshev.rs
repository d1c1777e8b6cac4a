//! Chebyshev polynomials of a vector that depends on time.

use std::f64::consts::PI;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use areograph_base::time::{Et, Interval};

/// Degree of every polynomial.
const DEGREE: usize = 12;
/// Samples of a fit: the roots of the next Chebyshev polynomial.
const NODES: usize = DEGREE + 1;
/// Outermost point at which a polynomial is checked, as a share of half its length.
const CHECK_END: f64 = 1.0 - 1e-6;
/// Fraction of the golden ratio: its multiples spread evenly and never meet the nodes.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A polynomial of degree 12 in time for each of three components, over a closed interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChebyshevVector {
    interval: Interval,
    coefficients: [[f64; 3]; NODES],
}

impl ChebyshevVector {
    /// Interpolates `sample` at the 13 Chebyshev nodes of `interval`, which all lie inside it.
    ///
    /// # Errors
    /// The first error of `sample`.
    /// # Source
    /// Press et al., Numerical Recipes, section 5.8: discrete orthogonality of the polynomials.
    pub fn interpolate<E>(
        interval: Interval,
        mut sample: impl FnMut(Et) -> Result<Vector3<f64>, E>,
    ) -> Result<Self, E> {
        let mut coefficients = [[0.0; 3]; NODES];
        for node in 0..NODES {
            let angle_rad = PI * (node as f64 + 0.5) / NODES as f64;
            let value = sample(instant_at(interval, angle_rad.cos()))?;
            for (order, coefficient) in coefficients.iter_mut().enumerate() {
                let share = if order == 0 { 1.0 } else { 2.0 } / NODES as f64;
                let weight = share * (order as f64 * angle_rad).cos();
                for axis in 0..3 {
                    coefficient[axis] += weight * value[axis];
                }
            }
        }
        Ok(Self {
            interval,
            coefficients,
        })
    }

    /// The interval of the polynomial.
    #[must_use]
    pub const fn interval(&self) -> Interval {
        self.interval
    }

    /// Instants at which an interpolation is tested: halfway between nodes, where it is worst, and evenly spread.
    pub fn check_instants(&self) -> impl Iterator<Item = Et> + use<> {
        let interval = self.interval;
        let extremes = (0..=NODES).map(|k| (PI * k as f64 / NODES as f64).cos());
        let spread = (1..=NODES).map(|k| 2.0 * (k as f64 * GOLDEN).fract() - 1.0);
        extremes
            .chain(spread)
            .map(move |x| instant_at(interval, x * CHECK_END))
    }

    /// Value at `et`, in the units of the samples.
    #[must_use]
    pub fn value(&self, et: Et) -> Vector3<f64> {
        let x = self.argument(et);
        let (mut next, mut after) = (Vector3::zeros(), Vector3::zeros());
        for coefficient in self.coefficients[1..].iter().rev() {
            (next, after) = (Vector3::from(*coefficient) + 2.0 * x * next - after, next);
        }
        Vector3::from(self.coefficients[0]) + x * next - after
    }

    /// Derivative at `et`, per second; zero when the interval has no length.
    ///
    /// # Source
    /// Clenshaw's recurrence of [`Self::value`], differentiated.
    #[must_use]
    pub fn derivative(&self, et: Et) -> Vector3<f64> {
        let half_s = 0.5 * self.interval.duration_s();
        if half_s <= 0.0 {
            return Vector3::zeros();
        }
        let x = self.argument(et);
        let (mut next, mut after) = (Vector3::zeros(), Vector3::zeros());
        let (mut slope, mut slope_after) = (Vector3::zeros(), Vector3::zeros());
        for coefficient in self.coefficients[1..].iter().rev() {
            (slope, slope_after) = (2.0 * next + 2.0 * x * slope - slope_after, slope);
            (next, after) = (Vector3::from(*coefficient) + 2.0 * x * next - after, next);
        }
        (next + x * slope - slope_after) / half_s
    }

    /// Time as -1 at the start to 1 at the stop.
    fn argument(&self, et: Et) -> f64 {
        let half_s = 0.5 * self.interval.duration_s();
        if half_s <= 0.0 {
            return 0.0;
        }
        (et.since(self.interval.start) - half_s) / half_s
    }
}

fn instant_at(interval: Interval, x: f64) -> Et {
    interval.start.plus(0.5 * interval.duration_s() * (1.0 + x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn fit(interval: Interval, f: impl Fn(f64) -> Vector3<f64>) -> ChebyshevVector {
        ChebyshevVector::interpolate(interval, |et| Ok::<_, Infallible>(f(et.seconds()))).unwrap()
    }

    #[test]
    fn a_polynomial_and_its_derivative_are_met_exactly() {
        let interval = Interval::new(Et::from_seconds(100.0), Et::from_seconds(104.0));
        let piece = fit(interval, |t| {
            let u = t - 100.0;
            Vector3::new(u.powi(12) / 4.0_f64.powi(12), u * u, 7.0)
        });
        for et in piece.check_instants() {
            let u = et.seconds() - 100.0;
            let value = Vector3::new((u / 4.0).powi(12), u * u, 7.0);
            let slope = Vector3::new(3.0 * (u / 4.0).powi(11), 2.0 * u, 0.0);
            assert!((piece.value(et) - value).norm() < 1e-12); // rounding of sums of order 10
            assert!((piece.derivative(et) - slope).norm() < 1e-10); // degree² times as much
        }
    }

    #[test]
    fn an_interval_without_length_holds_its_value() {
        let instant = Et::from_seconds(5.0);
        let piece = fit(Interval::new(instant, instant), |t| {
            Vector3::new(t, 0.0, 1.0)
        });
        assert!((piece.value(instant) - Vector3::new(5.0, 0.0, 1.0)).norm() < 1e-12);
        assert!(piece.derivative(instant).norm() < 1e-12);
    }

    #[test]
    fn checks_stay_inside_and_off_the_nodes() {
        let interval = Interval::new(Et::from_seconds(-1.0), Et::from_seconds(1.0));
        let mut nodes = Vec::new();
        let piece = ChebyshevVector::interpolate(interval, |et| {
            nodes.push(et.seconds());
            Ok::<_, Infallible>(Vector3::zeros())
        })
        .unwrap();
        for check in piece.check_instants() {
            assert!(interval.contains(check));
            assert!(
                nodes
                    .iter()
                    .all(|node| (node - check.seconds()).abs() > 1e-3)
            );
        }
    }
}
