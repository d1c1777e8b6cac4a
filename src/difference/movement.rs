//! Statistics of movements.

use serde::Serialize;

/// Movements below this are rounding of `f64`, not movements: metres, arcseconds or seconds of time.
///
/// A Mars-fixed coordinate is good to 1e-9 m, a quaternion to 1e-10 arcsec, an ET of these years to
/// 1e-8 s; no SPICE kernel is good to a micrometre.
pub(super) const ROUNDING: f64 = 1e-6;

/// Statistics of sizes, none negative; the unit is that of the member's name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Size {
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// Statistics of values with a sign; the unit is that of the member's name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Component {
    /// Mean.
    pub mean: f64,
    /// Largest absolute value.
    pub max_abs: f64,
}

impl Size {
    /// Of at least one value; zero of none.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut sum, mut max, mut count) = (0.0, 0.0_f64, 0.0_f64);
        for value in values {
            sum += value;
            max = max.max(value);
            count += 1.0;
        }
        Self {
            mean: sum / count.max(1.0),
            max,
        }
    }

    /// Of the values that are known, if one is.
    pub(super) fn of_known(values: impl Iterator<Item = Option<f64>>) -> Option<Self> {
        let mut known = values.flatten().peekable();
        known.peek()?;
        Some(Self::of(known))
    }

    /// Whether this is more than rounding.
    #[must_use]
    pub fn moved(&self) -> bool {
        self.max > ROUNDING
    }
}

impl Component {
    /// Of at least one value; zero of none.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut sum, mut max_abs, mut count) = (0.0, 0.0_f64, 0.0_f64);
        for value in values {
            sum += value;
            max_abs = max_abs.max(value.abs());
            count += 1.0;
        }
        Self {
            mean: sum / count.max(1.0),
            max_abs,
        }
    }

    /// Whether this is more than rounding.
    #[must_use]
    pub fn moved(&self) -> bool {
        self.max_abs > ROUNDING
    }
}
