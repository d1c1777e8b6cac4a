//! Controls without gross errors, identified by least median of squares.
//!
//! # Source
//! Rousseeuw 1984, "Least median of squares regression", J. Am. Stat. Assoc. 79, 871–880; Rousseeuw and Leroy 1987,
//! "Robust Regression and Outlier Detection", for the correction for small samples.

use super::Place;

/// Median of the squared length of a vector whose coordinates are normal with variance 1: `2 ln 2`.
const MEDIAN_OF_SQUARES: f64 = 2.0 * std::f64::consts::LN_2;
/// Robust standard deviations within which controls are selected first.
const FIRST_CHOICE: f64 = 5.0;
/// Maximum number of rounds of selection and fit.
const ROUNDS: usize = 20;
/// Exact data leave rounding, this share of the largest coordinate, which is not a gross error.
const ROUNDING: f64 = 1e-9;

/// A transformation from a figure to its controls.
pub(super) trait Transformation: Copy {
    /// Number of complex unknowns, and of controls that determine them.
    const UNKNOWNS: usize;

    /// The transformation that fits `figure` to `given` best; `None` where they do not determine it.
    fn fitted(figure: &[Place], given: &[Place]) -> Option<Self>;

    /// The map position of a point of the figure.
    fn position(&self, place: Place) -> Place;
}

/// Whether each control has no gross error; `None` where no sample determines a transformation.
///
/// The transformations through `samples` of the controls are ranked by the median of the squared residuals. The controls
/// near the best one are fitted, and those farther away than `limit` standard deviations are removed until the selection
/// is stable. This detects two gross errors that mask each other in a rejection one by one.
///
/// * `figure`, `given` – of equal length, more than [`Transformation::UNKNOWNS`]
pub(super) fn without_gross_errors<T: Transformation, const N: usize>(
    figure: &[Place],
    given: &[Place],
    samples: &[[usize; N]],
    limit: f64,
) -> Option<Vec<bool>> {
    let (best, sigma) = least_median::<T, N>(figure, given, samples)?;
    let mut kept = within(&best, figure, given, FIRST_CHOICE * sigma);
    for _ in 0..ROUNDS {
        let (chosen, of_chosen) = of_kept(figure, given, &kept);
        let fitted = T::fitted(&chosen, &of_chosen)?;
        let sigma = sigma_of(&fitted, &chosen, &of_chosen).unwrap_or(0.0);
        let next = within(&fitted, figure, given, limit * sigma);
        let enough = next.iter().filter(|kept| **kept).count() > figure.len() / 2;
        if next == kept || !enough {
            break;
        }
        kept = next;
    }
    Some(kept)
}

/// The transformation through a sample with the least median of squares, and its standard deviation.
fn least_median<T: Transformation, const N: usize>(
    figure: &[Place],
    given: &[Place],
    samples: &[[usize; N]],
) -> Option<(T, f64)> {
    let count = figure.len();
    // The rank of least median for this number of complex unknowns.
    let rank = (count + T::UNKNOWNS).div_ceil(2).min(count) - 1;
    let mut best: Option<(f64, T)> = None;
    let mut squares = Vec::with_capacity(count);
    for sample in samples {
        let [from, to] = [figure, given].map(|places| sample.map(|index| places[index]));
        let Some(transformation) = T::fitted(&from, &to) else {
            continue;
        };
        squares.clear();
        squares
            .extend(residuals(&transformation, figure, given).map(|residual| residual.norm_sqr()));
        let median = *squares.select_nth_unstable_by(rank, f64::total_cmp).1;
        if best.is_none_or(|(least, _)| median < least) {
            best = Some((median, transformation));
        }
    }
    let (median, transformation) = best?;
    let small_sample = 1.0 + 5.0 / (count as f64 - T::UNKNOWNS as f64);
    Some((
        transformation,
        small_sample * (median / MEDIAN_OF_SQUARES).sqrt(),
    ))
}

/// Given minus computed position of every control.
pub(super) fn residuals<T: Transformation>(
    transformation: &T,
    figure: &[Place],
    given: &[Place],
) -> impl Iterator<Item = Place> {
    let pairs = figure.iter().zip(given);
    pairs.map(move |(figure, given)| given - transformation.position(*figure))
}

/// Standard deviation of a coordinate of a control, `√(Σ|v|² / (2n − 2u))` for `u` complex unknowns; `None` without
/// redundancy.
pub(super) fn sigma_of<T: Transformation>(
    transformation: &T,
    figure: &[Place],
    given: &[Place],
) -> Option<f64> {
    let count = figure.len();
    let squares: f64 = residuals(transformation, figure, given)
        .map(|residual| residual.norm_sqr())
        .sum();
    (count > T::UNKNOWNS).then(|| (squares / (2 * count - 2 * T::UNKNOWNS) as f64).sqrt())
}

/// The controls that are kept, with their points of the figure.
pub(super) fn of_kept(
    figure: &[Place],
    given: &[Place],
    kept: &[bool],
) -> (Vec<Place>, Vec<Place>) {
    let pairs = figure.iter().zip(given).zip(kept);
    let pairs = pairs.filter(|(_, kept)| **kept);
    pairs.map(|((figure, given), _)| (*figure, *given)).unzip()
}

fn within<T: Transformation>(
    transformation: &T,
    figure: &[Place],
    given: &[Place],
    distance: f64,
) -> Vec<bool> {
    let size = given.iter().map(|given| given.norm()).fold(0.0, f64::max);
    let reach = distance.max(ROUNDING * size);
    residuals(transformation, figure, given)
        .map(|residual| residual.norm() <= reach)
        .collect()
}
