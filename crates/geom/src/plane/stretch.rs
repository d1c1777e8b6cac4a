//! Stretch of a figure against its controls: controls whose axes have different scales, or are not at right angles.
//!
//! A similarity between stretched controls has large residuals, under which gross errors hide. Gross errors are
//! therefore identified about an affinity, again by least median of squares.

use super::{
    Place,
    least_median::{Transformation, of_kept, sigma_of, without_gross_errors},
};
use crate::random::Random;

/// Minimum number of controls: an affinity has six unknowns in two equations a control.
const CONTROLS_MIN: usize = 5;
/// Minimum number of controls among which gross errors are identified about an affinity.
const JUDGED_MIN: usize = 7;
/// Affinities through three controls that are compared, at most: all of them up to thirty controls.
const TRIPLES_MAX: usize = 4_096;
/// Smallest spread of controls that determine a stretch, see [`Affinity::fit`]: a tenth in width, and for three of them
/// what rounding leaves.
const SPREAD_MIN: f64 = 0.05;
const SPREAD_OF_THREE: f64 = 1e-6;

/// The part of an affinity of the controls beyond a similarity: `Z = a z + b z̄ + c`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// `2|b| / |a|`: the relative difference of the largest and the smallest scale.
    pub ratio: f64,
    /// Standard deviation of it on an axis, from the residuals of the affinity.
    pub sigma: f64,
    /// Degrees of freedom of these.
    pub free: f64,
    /// Direction on the map in which scale is largest, radians from east, `-π/2..π/2`.
    pub direction_rad: f64,
}

impl Stretch {
    /// The stretch that errors of the controls exceed with a probability of `chance`.
    ///
    /// Fisher's ratio of two degrees of freedom over `free` has its distribution in closed form.
    #[must_use]
    pub fn by_chance(&self, chance: f64) -> f64 {
        self.sigma * (self.free * (chance.powf(-2.0 / self.free) - 1.0)).sqrt()
    }
}

/// `Z = a z + b z̄ + c`.
#[derive(Debug, Clone, Copy)]
struct Affinity {
    a: Place,
    b: Place,
    c: Place,
    /// Variance of a coordinate of `b` where the variance of a control is 1.
    of_b: f64,
}

impl Affinity {
    /// The affinity that fits `from` to `to` best; `None` where their spread, the square of the sine between the
    /// regressions on both axes, is below a limit: points nearly on a line.
    fn fit(from: &[Place], to: &[Place], spread_min: f64) -> Option<Self> {
        let count = from.len().min(to.len()) as f64;
        let (middle, target) = (
            from.iter().sum::<Place>() / count,
            to.iter().sum::<Place>() / count,
        );
        let pairs = || {
            let pairs = from.iter().zip(to);
            pairs.map(|(from, to)| (from - middle, to - target))
        };
        let squares: f64 = pairs().map(|(from, _)| from.norm_sqr()).sum();
        let turned: Place = pairs().map(|(from, _)| from * from).sum();
        let spread = 1.0 - turned.norm_sqr() / (squares * squares);
        // Written so that NaN counts.
        if !(spread > spread_min) {
            return None;
        }
        let of_plain: Place = pairs().map(|(from, to)| from.conj() * to).sum();
        let of_mirrored: Place = pairs().map(|(from, to)| from * to).sum();
        let determinant = squares * squares * spread;
        let a = (of_plain * squares - turned.conj() * of_mirrored) / determinant;
        let b = (of_mirrored * squares - turned * of_plain) / determinant;
        Some(Self {
            a,
            b,
            c: target - a * middle - b * middle.conj(),
            of_b: 1.0 / (squares * spread),
        })
    }
}

impl Transformation for Affinity {
    const UNKNOWNS: usize = 3;

    fn fitted(figure: &[Place], given: &[Place]) -> Option<Self> {
        Self::fit(figure, given, SPREAD_OF_THREE)
    }

    fn position(&self, place: Place) -> Place {
        self.a * place + self.b * place.conj() + self.c
    }
}

/// The stretch of `given` against `figure`; `None` for fewer than five controls, or controls nearly on a line.
///
/// * `kept` – controls without gross errors about a similarity: those used where they are too few to identify gross
///   errors about an affinity
/// * `limit` – standard deviations beyond which a control has a gross error
#[must_use]
pub fn stretch(figure: &[Place], given: &[Place], kept: &[bool], limit: f64) -> Option<Stretch> {
    let count = figure.len().min(given.len());
    let own = if count >= JUDGED_MIN {
        let (figure, given) = (&figure[..count], &given[..count]);
        let samples = triples(count);
        Some(without_gross_errors::<Affinity, 3>(
            figure, given, &samples, limit,
        )?)
    } else {
        None
    };
    let (figure, given) = of_kept(figure, given, own.as_deref().unwrap_or(kept));
    if figure.len() < CONTROLS_MIN {
        return None;
    }
    let fitted = Affinity::fit(&figure, &given, SPREAD_MIN)?;
    let free = (2 * figure.len() - 6) as f64;
    let sigma = sigma_of(&fitted, &figure, &given)? * fitted.of_b.sqrt();
    let (a, b) = (fitted.a, fitted.b);
    Some(Stretch {
        ratio: 2.0 * b.norm() / a.norm(),
        sigma: 2.0 * sigma / a.norm(),
        free,
        direction_rad: 0.5 * (a * b).arg(),
    })
}

/// Every three of some controls; of many controls, a fixed choice.
fn triples(count: usize) -> Vec<[usize; 3]> {
    if count * (count - 1) * (count - 2) / 6 <= TRIPLES_MAX {
        let last_two = |one: usize| {
            (one + 1..count)
                .flat_map(move |two| (two + 1..count).map(move |three| [one, two, three]))
        };
        return (0..count).flat_map(last_two).collect();
    }
    let mut random = Random::new(0, "three controls");
    let mut triples = Vec::with_capacity(TRIPLES_MAX);
    while triples.len() < TRIPLES_MAX {
        let three = [0; 3].map(|_: usize| {
            let index = random.bits() % count as u64;
            usize::try_from(index).unwrap_or(0)
        });
        if three[0] != three[1] && three[1] != three[2] && three[0] != three[2] {
            triples.push(three);
        }
    }
    triples
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(count: usize) -> Vec<Place> {
        (0..count)
            .map(|index| Place::from_polar(1.0 + 0.1 * index as f64, 2.4 * index as f64))
            .collect()
    }

    /// The figure on a map whose east axis is a tenth too long.
    fn stretched(figure: &[Place]) -> Vec<Place> {
        let turn = Place::from_polar(30.0, 0.7);
        let turned = figure.iter().map(|of| of * turn);
        turned
            .map(|of| Place::new(1.1 * of.re, of.im) + 500.0)
            .collect()
    }

    #[test]
    fn a_stretch_of_the_east_axis_is_found() {
        for count in [5, 8, 40] {
            let figure = figure(count);
            let given = stretched(&figure);
            let found = stretch(&figure, &given, &vec![true; count], 4.0).unwrap();
            // 1.1 against 1, over their mean; exact data leave rounding.
            assert!((found.ratio - 0.1 / 1.05).abs() < 1e-9, "{found:?}");
            assert!(found.direction_rad.abs() < 1e-9, "{found:?}");
            assert!(found.by_chance(1e-3) < 1e-9, "{found:?}");
        }
        let line: Vec<Place> = (0..8_u32).map(|at| Place::new(at.into(), 0.0)).collect();
        assert!(stretch(&line, &line, &[true; 8], 4.0).is_none());
    }

    #[test]
    fn gross_errors_do_not_hide_a_stretch() {
        let figure = figure(12);
        let mut given = stretched(&figure);
        for (index, of) in given.iter_mut().enumerate() {
            // Errors of a hundredth of the figure, and two of half of it.
            *of += Place::from_polar(0.5, 1.7 * (index * index) as f64);
        }
        given[4] += Place::new(0.0, 17.0);
        given[5] += Place::new(0.0, 19.0);
        let found = stretch(&figure, &given, &[true; 12], 4.0).unwrap();
        // Ten controls, six unknowns.
        assert!((found.free - 14.0).abs() < 0.5, "{found:?}");
        // Errors of 0.35 in a coordinate over a figure of 45: within four standard deviations of half a per cent.
        assert!((found.ratio - 0.1 / 1.05).abs() < 0.02, "{found:?}");
        assert!(found.ratio > found.by_chance(1e-3), "{found:?}");
    }
}
