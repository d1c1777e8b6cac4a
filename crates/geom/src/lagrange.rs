//! Interpolation between uniform nodes as in camera models of the Community Sensor Model.

use nalgebra::SVector;

/// Maximum number of nodes for one value.
const NODES_MAX: usize = 8;

/// The value at `at` of the polynomial through up to eight nodes around it; `at` counts nodes from 0.
///
/// Eight nodes are used inside the table, and six, four, two towards its ends, where fewer lie on one side; beyond the
/// ends the last two nodes are extrapolated. Fewer than two nodes give the only value, or zeros.
///
/// # Source
/// `lagrangeInterp` of `usgscsm` (order 8 for positions and quaternions of line scanners).
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a table position: not negative after max, far below 2^52"
)]
pub fn lagrange<const N: usize>(values: &[SVector<f64, N>], at: f64) -> SVector<f64, N> {
    if values.len() < 2 {
        return values.first().copied().unwrap_or_else(SVector::zeros);
    }
    let before = (at.max(0.0) as usize).min(values.len() - 2);
    let half = (before + 1)
        .min(values.len() - 1 - before)
        .min(NODES_MAX / 2);
    let first = before + 1 - half;
    let nodes = &values[first..first + 2 * half];
    let at = at - first as f64;
    let mut sum = SVector::zeros();
    for (j, node) in nodes.iter().enumerate() {
        let weight: f64 = (0..nodes.len())
            .filter(|k| *k != j)
            .map(|k| (at - k as f64) / (j as f64 - k as f64))
            .product();
        sum += node * weight;
    }
    sum
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector1;

    use super::*;

    fn power(exponent: i32) -> Vec<Vector1<f64>> {
        (0..12)
            .map(|node| Vector1::new((f64::from(node) - 5.0).powi(exponent)))
            .collect()
    }

    #[test]
    fn polynomials_come_back_to_the_degree_that_the_nodes_hold() {
        for (at, degree) in [
            (5.3, 7),
            (3.4, 7),
            (2.5, 5),
            (8.7, 5),
            (1.5, 3),
            (0.4, 1),
            (10.9, 1),
        ] {
            let exact = |exponent| (at - 5.0_f64).powi(exponent);
            let found = |exponent| lagrange(&power(exponent), at)[0];
            // Relative rounding of eight products.
            assert!((found(degree) - exact(degree)).abs() <= 1e-12 * exact(degree).abs().max(1.0));
            assert!((found(degree + 1) - exact(degree + 1)).abs() > 1e-3);
        }
    }

    #[test]
    fn beyond_the_table_the_last_two_nodes_go_on() {
        assert!((lagrange(&power(1), -2.0)[0] + 7.0).abs() < 1e-12); // rounding
        assert!((lagrange(&power(1), 14.0)[0] - 9.0).abs() < 1e-12);
        assert!((lagrange(&[Vector1::new(3.0)], 14.0)[0] - 3.0).abs() < 1e-15);
    }
}
