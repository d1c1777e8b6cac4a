//! Statistics of movements.

use schemars::JsonSchema;
use serde::Serialize;

use areograph_geom::statistics::largest;

/// Movements below this are rounding of `f64`, not movements: metres, arcseconds or seconds of time.
///
/// A Mars-fixed coordinate is good to 1e-9 m, a quaternion to 1e-10 arcsec, an ET of these years to
/// 1e-8 s; no SPICE kernel is good to a micrometre.
pub(super) const ROUNDING: f64 = 1e-6;

/// Statistics of non-negative sizes; the name of the member ends in the unit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct Size {
    /// Mean.
    #[schemars(range(min = 0.0))]
    pub mean: f64,
    /// Largest.
    #[schemars(range(min = 0.0))]
    pub max: f64,
}

/// Statistics of signed values; the name of the member ends in the unit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct Component {
    /// Mean.
    pub mean: f64,
    /// Largest absolute value.
    #[schemars(range(min = 0.0))]
    pub max_abs: f64,
}

impl Size {
    /// Statistics of at least one value; zero without values.
    pub(super) fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        Self {
            mean: mean(values.clone()),
            max: largest(values).unwrap_or(0.0),
        }
    }

    /// Statistics of the known values, if any.
    pub(super) fn of_known(values: impl Iterator<Item = Option<f64>> + Clone) -> Option<Self> {
        let known = values.flatten();
        known.clone().next()?;
        Some(Self::of(known))
    }

    /// Whether this is more than rounding; NaN counts as movement.
    #[must_use]
    pub fn moved(&self) -> bool {
        !(self.max <= ROUNDING)
    }
}

impl Component {
    /// Statistics of at least one value; zero without values.
    pub(super) fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        Self {
            mean: mean(values.clone()),
            max_abs: largest(values.map(f64::abs)).unwrap_or(0.0),
        }
    }

    /// Whether this is more than rounding; NaN counts as movement.
    #[must_use]
    pub fn moved(&self) -> bool {
        !(self.max_abs <= ROUNDING)
    }
}

/// Zero without values.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0_f64), |(sum, count), value| {
        (sum + value, count + 1.0)
    });
    sum / count.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_number_is_not_lost_among_numbers() {
        let values = || [1.0, f64::NAN, -2.0].into_iter();
        let (size, component) = (Size::of(values()), Component::of(values()));
        assert!(size.max.is_nan() && component.max_abs.is_nan());
        assert!(size.moved() && component.moved());
        let known = Size::of_known([None, Some(3.0)].into_iter());
        assert!(known.is_some_and(|size| size.moved()));
        assert_eq!(Size::of_known([None].into_iter()), None);
        assert!(!Size::of(std::iter::empty()).moved());
    }
}
