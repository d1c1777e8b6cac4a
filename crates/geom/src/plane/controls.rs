//! SCALE: one figure on its controls, gross errors among them detected by least median of squares.

use super::{Place, similarity::Similarity};

/// Median of the squared length of a vector whose coordinates are normal with variance 1: `2 ln 2`.
pub(super) const MEDIAN_OF_SQUARES: f64 = 2.0 * std::f64::consts::LN_2;
/// Minimum number of controls for the detection of a gross error.
const JUDGED_MIN: usize = 5;
/// Robust standard deviations within which controls are selected first.
pub(super) const FIRST_CHOICE: f64 = 5.0;
/// Maximum number of rounds of selection and fit.
pub(super) const ROUNDS: usize = 20;

/// A figure on its controls.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaled {
    /// From the figure to the map.
    pub similarity: Similarity,
    /// Given minus computed of every control, map units.
    pub residuals: Vec<Place>,
    /// Whether each control was kept.
    pub kept: Vec<bool>,
    /// Standard deviation of a coordinate of a kept control, `√(Σ|v|² / (2n − 4))`; `None` for two controls.
    pub sigma: Option<f64>,
}

impl Scaled {
    /// Root mean square of the residuals of kept controls, X and Y; 0 when none is kept.
    #[must_use]
    pub fn rms(&self) -> [f64; 2] {
        let kept = || {
            self.residuals
                .iter()
                .zip(&self.kept)
                .filter(|(_, kept)| **kept)
        };
        let count = kept().count().max(1) as f64;
        let mean = |part: fn(&Place) -> f64| {
            (kept()
                .map(|(residual, _)| part(residual).powi(2))
                .sum::<f64>()
                / count)
                .sqrt()
        };
        [mean(|of| of.re), mean(|of| of.im)]
    }
}

/// The similarity that fits `from` to `to` best, with equal weights; `None` for fewer than two distinct points.
#[must_use]
pub fn fit_similarity(from: &[Place], to: &[Place]) -> Option<Similarity> {
    fit_weighted(from, to, |_| 1.0)
}

/// The same with a weight of each pair of points, by its index, above 0.
#[must_use]
pub fn fit_weighted(
    from: &[Place],
    to: &[Place],
    weight: impl Fn(usize) -> f64,
) -> Option<Similarity> {
    let count = from.len().min(to.len());
    if count < 2 {
        return None;
    }
    let weights: f64 = (0..count).map(&weight).sum();
    let mean = |of: &[Place]| {
        let places = of[..count].iter().enumerate();
        let sum: Place = places.map(|(index, place)| *place * weight(index)).sum();
        sum / weights
    };
    let (middle, target) = (mean(from), mean(to));
    let pairs = || {
        let pairs = from.iter().zip(to).enumerate();
        pairs.map(|(index, (from, to))| (weight(index), from - middle, to - target))
    };
    let squares: f64 = pairs()
        .map(|(weight, from, _)| weight * from.norm_sqr())
        .sum();
    let products = pairs().map(|(weight, from, to)| from.conj() * to * weight);
    let turn = products.sum::<Place>() / squares;
    (squares > 0.0).then(|| Similarity {
        turn,
        shift: target - turn * middle,
    })
}

/// SCALE: puts `figure` on its controls `given` by one similarity, which keeps its shape.
///
/// With five controls or more, the similarities through pairs of them (a fixed choice of pairs beyond sixty controls)
/// are ranked by the median of the squared residuals. The controls near the best one are fitted, and those farther away
/// than `limit` standard deviations are removed until the selection is stable. This detects two gross errors that mask
/// each other in a rejection one by one.
///
/// Returns `None` for fewer than two distinct controls.
///
/// # Source
/// Rousseeuw 1984, "Least median of squares regression", J. Am. Stat. Assoc. 79, 871–880.
#[must_use]
pub fn scale(figure: &[Place], given: &[Place], limit: f64) -> Option<Scaled> {
    let count = figure.len().min(given.len());
    let mut kept = vec![true; count];
    if count >= JUDGED_MIN {
        let (similarity, sigma) = least_median(figure, given)?;
        kept = within(&similarity, figure, given, FIRST_CHOICE * sigma);
        for _ in 0..ROUNDS {
            let fitted = fit_kept(figure, given, &kept)?;
            let sigma = sigma_of(&fitted, figure, given, &kept).unwrap_or(0.0);
            let next = within(&fitted, figure, given, limit * sigma);
            let enough = next.iter().filter(|kept| **kept).count() > count / 2;
            if next == kept || !enough {
                break;
            }
            kept = next;
        }
    }
    let similarity = fit_kept(figure, given, &kept)?;
    let residuals = figure.iter().zip(given);
    Some(Scaled {
        sigma: sigma_of(&similarity, figure, given, &kept),
        residuals: residuals
            .map(|(figure, given)| given - similarity.map(*figure))
            .collect(),
        similarity,
        kept,
    })
}

/// The similarity through two controls with the least median of squares, and its standard deviation.
fn least_median(figure: &[Place], given: &[Place]) -> Option<(Similarity, f64)> {
    let count = figure.len();
    let mut best: Option<(f64, Similarity)> = None;
    let mut squares = Vec::with_capacity(count);
    for (one, two) in pairs(count) {
        let Some(similarity) =
            fit_similarity(&[figure[one], figure[two]], &[given[one], given[two]])
        else {
            continue;
        };
        squares.clear();
        let residuals = figure.iter().zip(given);
        squares
            .extend(residuals.map(|(figure, given)| (given - similarity.map(*figure)).norm_sqr()));
        let median = median(&mut squares);
        if best.is_none_or(|(least, _)| median < least) {
            best = Some((median, similarity));
        }
    }
    let (median, similarity) = best?;
    // The correction for small samples of Rousseeuw and Leroy, for two complex unknowns.
    let small_sample = 1.0 + 5.0 / (count as f64 - 2.0);
    Some((
        similarity,
        small_sample * (median / MEDIAN_OF_SQUARES).sqrt(),
    ))
}

fn fit_kept(figure: &[Place], given: &[Place], kept: &[bool]) -> Option<Similarity> {
    let chosen = |of: &[Place]| -> Vec<Place> {
        let both = of.iter().zip(kept);
        both.filter(|(_, kept)| **kept)
            .map(|(place, _)| *place)
            .collect()
    };
    fit_similarity(&chosen(figure), &chosen(given))
}

fn sigma_of(
    similarity: &Similarity,
    figure: &[Place],
    given: &[Place],
    kept: &[bool],
) -> Option<f64> {
    let count = kept.iter().filter(|kept| **kept).count();
    let squares: f64 = figure
        .iter()
        .zip(given)
        .zip(kept)
        .filter(|(_, kept)| **kept)
        .map(|((figure, given), _)| (given - similarity.map(*figure)).norm_sqr())
        .sum();
    (count > 2).then(|| (squares / (2 * count - 4) as f64).sqrt())
}

fn within(similarity: &Similarity, figure: &[Place], given: &[Place], distance: f64) -> Vec<bool> {
    // Exact data leave rounding, which is not a gross error.
    let size = given.iter().map(|given| given.norm()).fold(0.0, f64::max);
    let reach = distance.max(1e-9 * size);
    let residuals = figure.iter().zip(given);
    residuals
        .map(|(figure, given)| (given - similarity.map(*figure)).norm() <= reach)
        .collect()
}

/// Every pair of `count` controls up to sixty of them; beyond, each with some thirty others, near and far in the list.
fn pairs(count: usize) -> Vec<(usize, usize)> {
    const ALL_UP_TO: usize = 60;
    const STEPS: usize = 30;
    if count <= ALL_UP_TO {
        return (0..count)
            .flat_map(|one| (one + 1..count).map(move |two| (one, two)))
            .collect();
    }
    let step = |index: usize| 1 + index * (count / 2 - 1) / (STEPS - 1);
    (0..STEPS)
        .flat_map(|index| (0..count).map(move |one| (one, (one + step(index)) % count)))
        .collect()
}

/// The value of rank `(n + 3) / 2`, the one of least median for two complex unknowns.
fn median(values: &mut [f64]) -> f64 {
    let rank = (values.len().div_ceil(2) + 1).min(values.len()) - 1;
    *values.select_nth_unstable_by(rank, f64::total_cmp).1
}
