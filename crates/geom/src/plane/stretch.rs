//! Stretch of a figure against its controls: controls whose axes have different scales, or are not at right angles.

use nalgebra::Matrix2;

use super::{Place, controls::fit_similarity};

/// Minimum number of controls: an affinity has six unknowns in two equations a control.
const CONTROLS_MIN: usize = 5;
/// Smallest square of the sine between the directions of the axes of the figure, as a share: controls nearly on a line
/// determine no stretch across it.
const SPREAD_MIN: f64 = 0.05;

/// What an affinity of the controls has beyond a similarity: `Z = a z + b z̄ + c`.
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

/// The stretch of `given` against `figure`; `None` for fewer than five controls, or controls nearly on a line.
#[must_use]
pub fn stretch(figure: &[Place], given: &[Place]) -> Option<Stretch> {
    let count = figure.len().min(given.len());
    if count < CONTROLS_MIN {
        return None;
    }
    let (figure, given) = (&figure[..count], &given[..count]);
    // In a frame of the size and direction of the controls.
    let similarity = fit_similarity(figure, given)?;
    let middle = given.iter().sum::<Place>() / count as f64;
    let pairs = || {
        let pairs = figure.iter().zip(given);
        pairs.map(|(figure, given)| (similarity.map(*figure) - middle, given - middle))
    };
    let squares: f64 = pairs().map(|(from, _)| from.norm_sqr()).sum();
    let turned: Place = pairs().map(|(from, _)| from * from).sum();
    let spread = 1.0 - turned.norm_sqr() / (squares * squares);
    // Written so that NaN counts.
    if !(spread > SPREAD_MIN) {
        return None;
    }
    let real = Place::from(squares);
    let normal = Matrix2::new(real, turned.conj(), turned, real);
    let right = nalgebra::Vector2::new(
        pairs().map(|(from, to)| from.conj() * to).sum::<Place>(),
        pairs().map(|(from, to)| from * to).sum::<Place>(),
    );
    let [a, b]: [Place; 2] = (normal.try_inverse()? * right).into();
    let left: f64 = pairs()
        .map(|(from, to)| (to - a * from - b * from.conj()).norm_sqr())
        .sum();
    let free = (2 * count - 6) as f64;
    let variance = left / free;
    let of_b = variance / (squares * spread);
    Some(Stretch {
        ratio: 2.0 * b.norm() / a.norm(),
        sigma: 2.0 * of_b.sqrt() / a.norm(),
        free,
        direction_rad: 0.5 * (a * b).arg(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_of_the_east_axis_is_found() {
        let figure: Vec<Place> = (0..8)
            .map(|index| Place::from_polar(1.0 + 0.1 * f64::from(index), 2.4 * f64::from(index)))
            .collect();
        let turn = Place::from_polar(30.0, 0.7);
        let given: Vec<Place> = figure
            .iter()
            .map(|of| of * turn)
            .map(|of| Place::new(1.1 * of.re, of.im) + 500.0)
            .collect();
        let found = stretch(&figure, &given).unwrap();
        // 1.1 against 1, over their mean; exact data leave rounding.
        assert!((found.ratio - 0.1 / 1.05).abs() < 1e-9, "{found:?}");
        assert!(found.direction_rad.abs() < 1e-9, "{found:?}");
        assert!(found.by_chance(1e-4) < 1e-9, "{found:?}");
        let line: Vec<Place> = (0..8)
            .map(|index| Place::new(f64::from(index), 0.0))
            .collect();
        assert!(stretch(&line, &line).is_none());
    }
}
