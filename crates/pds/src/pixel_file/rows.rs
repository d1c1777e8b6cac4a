//! Lines of numbers in order, some at a time.

use areograph_base::error::Result;

/// Largest accepted size of a line, samples: the largest line of any camera here has 5184.
pub(super) const SAMPLES_MAX: u32 = 65_536;
/// Largest accepted size of an image, lines.
pub(super) const LINES_MAX: u32 = 10_000_000;

/// Largest number of values read at a time: a row of tiles.
const NUMBERS_MAX: u64 = 1 << 24;

/// Whether this many lines can be read at a time.
pub(super) fn fits(lines: u32, samples: u32) -> bool {
    u64::from(lines) * u64::from(samples) <= NUMBERS_MAX
}

/// Reads an image from its first line to its last.
pub(crate) trait Rows: std::fmt::Debug {
    /// Lines and samples.
    fn size(&self) -> [u32; 2];

    /// Whether all numbers are whole, from 0 to 255.
    fn is_bytes(&self) -> bool;

    /// The next complete lines; NaN for missing numbers. `None` after the last line.
    ///
    /// # Errors
    /// The file cannot be read; a picture that its library rejects.
    fn next_rows(&mut self) -> Result<Option<Vec<f64>>>;
}

/// Conversion of numbers to bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scale {
    /// As they are.
    Bytes,
    /// Scaled to 1 to 255 between the two; NaN becomes 0.
    Between([f64; 2]),
}

impl Scale {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range of a byte; NaN becomes 0"
    )]
    pub(super) fn byte(self, number: f64) -> u8 {
        match self {
            Self::Bytes => number.clamp(0.0, 255.0) as u8,
            Self::Between(_) if number.is_nan() => 0,
            Self::Between([low, high]) => {
                let share = (number - low) / (high - low).max(f64::MIN_POSITIVE);
                (1.0 + 254.0 * share).round().clamp(1.0, 255.0) as u8
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_between_the_ends_are_spread_and_none_is_none() {
        let scale = Scale::Between([-2.0, 2.0]);
        let bytes = [-2.0, 0.0, 2.0, f64::NAN, f64::INFINITY].map(|number| scale.byte(number));
        assert_eq!(bytes, [1, 128, 255, 0, 255]);
        assert_eq!(Scale::Between([3.0, 3.0]).byte(3.0), 1);
        assert_eq!(
            [7.0, f64::NAN].map(|number| Scale::Bytes.byte(number)),
            [7, 0]
        );
    }
}
