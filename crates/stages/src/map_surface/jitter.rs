//! Errors of heights that the match of a single cell does not show: jitter of the images, and the size of the compared
//! square.
//!
//! Along the parallax, a shift by jitter is a height. Across it no height moves the images, so that the scatter of the
//! shifts there shows the jitter; it has the same size on both axes, as attitude errors of a camera have.
//!
//! A height belongs to a square, not to its middle. For ground whose structure function is `D(r) = D(l) (r/l)^{2H}`, the
//! mean over a square of edge `w` departs from the middle with the variance `D(w) c(H)`,
//! `c = E|x|^{2H} − ½ E|x − y|^{2H}` over points `x`, `y` of a unit square about 0. The model itself shows `D` over two and
//! four squares, where it is not smoothed.
//!
//! # Source
//! The variance of a point about the mean of an area follows block kriging (Journel & Huijbregts 1978, Mining
//! Geostatistics, II.D), with the variogram `D/2`.

use super::{Cell, Found};
use areograph_geom::statistics::Summary;

/// Pairs of cells that a structure function requires at least.
const PAIRS_MIN: usize = 100;
/// Exponents `2H` of natural ground.
const EXPONENTS: std::ops::RangeInclusive<f64> = 0.6..=1.9;
/// Exponent where the model is too small to show it.
const EXPONENT: f64 = 1.4;
/// Points on an edge of the unit square in numerical means.
const POINTS: usize = 12;

/// Standard deviations of such errors, metres of height.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct JitterAndSmoothing {
    /// By jitter of the images against each other.
    pub(super) jitter_m: f64,
    /// By the size of the compared square.
    pub(super) smoothing_m: f64,
}

/// Sizes of a model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Cells of a row.
    pub(super) columns: usize,
    /// Cells on the edge of the compared square.
    pub(super) compared_cells: f64,
    /// Metres of height for a sample of parallax.
    pub(super) height_of_sample_m: f64,
}

impl JitterAndSmoothing {
    /// The errors of `cells`, row by row.
    pub(super) fn of(cells: &[Cell], sizes: Sizes) -> Self {
        let found: Vec<&Found> = cells.iter().flatten().flatten().collect();
        let count = found.len().max(1) as f64;
        let matching_m2 = found.iter().map(|cell| cell.sigma_m.powi(2)).sum::<f64>() / count;
        let aside: Vec<f64> = found.iter().map(|cell| cell.aside).collect();
        // The robust spread: a false match is no jitter.
        let spread_m = Summary::of(&aside).nmad * sizes.height_of_sample_m;
        let jitter_m2 = (spread_m * spread_m - matching_m2).max(0.0);
        let noise_m2 = 2.0 * (matching_m2 + jitter_m2);
        Self {
            jitter_m: jitter_m2.sqrt(),
            smoothing_m: smoothing_m2(cells, sizes, noise_m2).sqrt(),
        }
    }

    /// Their sum with the standard deviation of a match, metres.
    pub(super) fn with(self, matching_m: f64) -> f64 {
        matching_m.hypot(self.jitter_m).hypot(self.smoothing_m)
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small number of cells in a few squares"
)]
fn smoothing_m2(cells: &[Cell], sizes: Sizes, noise_m2: f64) -> f64 {
    let lags = [2.0, 4.0].map(|squares| (squares * sizes.compared_cells).ceil().max(1.0) as usize);
    let [near_m2, far_m2] = lags.map(|lag| structure_m2(cells, sizes.columns, lag));
    let Some(near_m2) = near_m2.map(|square_m2| square_m2 - noise_m2) else {
        return 0.0;
    };
    if near_m2 <= 0.0 {
        return 0.0;
    }
    let [near, far] = lags.map(|lag| lag as f64);
    let exponent = far_m2
        .map(|square_m2| ((square_m2 - noise_m2) / near_m2).ln() / (far / near).ln())
        .filter(|exponent| exponent.is_finite())
        .map_or(EXPONENT, |exponent| {
            exponent.clamp(*EXPONENTS.start(), *EXPONENTS.end())
        });
    near_m2 * (sizes.compared_cells / near).powf(exponent) * point_against_square(exponent)
}

/// Mean square of the differences of heights `lag` cells apart along rows and columns; `None` for too few.
fn structure_m2(cells: &[Cell], columns: usize, lag: usize) -> Option<f64> {
    let height_m = |at: usize| match cells.get(at) {
        Some(Some(Ok(found))) => Some(found.height_m),
        _ => None,
    };
    let (mut sum_m2, mut count) = (0.0, 0_usize);
    for at in 0..cells.len() {
        let Some(here_m) = height_m(at) else { continue };
        let right = (at % columns + lag < columns).then_some(at + lag);
        for there in right.into_iter().chain([at + lag * columns]) {
            if let Some(there_m) = height_m(there) {
                sum_m2 += (there_m - here_m).powi(2);
                count += 1;
            }
        }
    }
    (count >= PAIRS_MIN).then(|| sum_m2 / count as f64)
}

/// `c(H)` by `exponent = 2H`.
fn point_against_square(exponent: f64) -> f64 {
    let step = 1.0 / POINTS as f64;
    let at = |index: usize| (index as f64 + 0.5) * step - 0.5;
    let points =
        || (0..POINTS).flat_map(|row| (0..POINTS).map(move |column| [at(row), at(column)]));
    let mean = |from: [f64; 2]| {
        let powers = points().map(|to| (to[0] - from[0]).hypot(to[1] - from[1]).powf(exponent));
        powers.sum::<f64>() / (POINTS * POINTS) as f64
    };
    let between = points().map(mean).sum::<f64>() / (POINTS * POINTS) as f64;
    (mean([0.0; 2]) - 0.5 * between).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_not_smoothed_and_noise_is() {
        // A plane (2H = 2): the mean of a square is its middle. Rounding of the numerical means.
        assert!(point_against_square(2.0) < 1e-12);
        // Uncorrelated heights (2H = 0, D twice the variance): half of D remains.
        assert!((point_against_square(1e-9) - 0.5).abs() < 0.02);
    }

    #[test]
    fn shifts_across_the_parallax_show_jitter() {
        // Samples: an offset of 0.5, and ±0.3 about it; NMAD of equal parts is 1.4826 × 0.3.
        let cells: Vec<Cell> = (0..400_u32)
            .map(|at| {
                let aside = if at % 2 == 0 { 0.2 } else { 0.8 };
                Some(Ok(Found {
                    height_m: 0.0,
                    sigma_m: 0.5,
                    aside,
                    correlation: 0.9,
                }))
            })
            .collect();
        let sizes = Sizes {
            columns: 20,
            compared_cells: 3.0,
            height_of_sample_m: 10.0,
        };
        let errors = JitterAndSmoothing::of(&cells, sizes);
        let expected_m = ((14.826_f64 * 0.3).powi(2) - 0.25).sqrt();
        // The factor of the NMAD to its four digits.
        assert!((errors.jitter_m - expected_m).abs() < 1e-3, "{errors:?}");
        assert!(errors.smoothing_m.abs() < 1e-12);
    }
}
