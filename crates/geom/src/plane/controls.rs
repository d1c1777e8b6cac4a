//! SCALE: one figure on its controls, gross errors among them detected by least median of squares.

use super::{
    Place,
    least_median::{Transformation, of_kept, residuals, sigma_of, without_gross_errors},
    similarity::Similarity,
};

/// Minimum number of controls for the detection of a gross error.
const JUDGED_MIN: usize = 5;

impl Transformation for Similarity {
    const UNKNOWNS: usize = 2;

    fn fitted(figure: &[Place], given: &[Place]) -> Option<Self> {
        fit_similarity(figure, given)
    }

    fn position(&self, place: Place) -> Place {
        self.map(place)
    }
}

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

/// The similarity that fits best with a weight of each pair of points, by its index, above 0.
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
/// With five controls or more, gross errors are identified about similarities through pairs of them (a fixed choice of
/// pairs beyond sixty controls).
///
/// Returns `None` for fewer than two distinct controls.
#[must_use]
pub fn scale(figure: &[Place], given: &[Place], limit: f64) -> Option<Scaled> {
    let count = figure.len().min(given.len());
    let (figure, given) = (&figure[..count], &given[..count]);
    let kept = if count >= JUDGED_MIN {
        without_gross_errors::<Similarity, 2>(figure, given, &pairs(count), limit)?
    } else {
        vec![true; count]
    };
    let (of_figure, of_given) = of_kept(figure, given, &kept);
    let similarity = fit_similarity(&of_figure, &of_given)?;
    Some(Scaled {
        sigma: sigma_of(&similarity, &of_figure, &of_given),
        residuals: residuals(&similarity, figure, given).collect(),
        similarity,
        kept,
    })
}

/// Every pair of `count` controls up to sixty of them; beyond, each with some thirty others, near and far in the list.
fn pairs(count: usize) -> Vec<[usize; 2]> {
    const ALL_UP_TO: usize = 60;
    const STEPS: usize = 30;
    if count <= ALL_UP_TO {
        return (0..count)
            .flat_map(|one| (one + 1..count).map(move |two| [one, two]))
            .collect();
    }
    let step = |index: usize| 1 + index * (count / 2 - 1) / (STEPS - 1);
    (0..STEPS)
        .flat_map(|index| (0..count).map(move |one| [one, (one + step(index)) % count]))
        .collect()
}
