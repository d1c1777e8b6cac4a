//! Prefixes of rows: start time and exposure of each line.

use std::{fs::File, io, os::unix::fs::FileExt as _};

use super::raster::{PREFIX_BYTES_MIN, Raster};
use areograph_base::units::SECONDS_PER_MS;

/// Accepted instants, seconds of ET: 1970 to 2060.
const EPOCHS_S: std::ops::Range<f64> = -1e9..1.9e9;
/// Accepted exposures of a line, milliseconds: a detector line takes at least 2.24, and up to eight are summed.
const EXPOSURES_MS: std::ops::RangeInclusive<f32> = 0.5..=1_000.0;

/// Contents of the prefix of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Prefix {
    /// Start of the line, seconds of ET; `None` if it is invalid.
    pub(super) start_s: Option<f64>,
    /// Time to the next line, seconds: the exposure of all summed detector lines; `None` if it is invalid.
    pub(super) period_s: Option<f64>,
}

impl Prefix {
    /// Bytes 0 to 7 are the start of the line as a double, 8 to 11 the exposure in milliseconds as a float, both with
    /// the least significant byte first, independent of the byte order of samples.
    ///
    /// # Source
    /// `hrsc2isis` of ISIS; the prefixes of `h0279_0000_re2` and `h7926_0009_s22`.
    fn of(bytes: [u8; PREFIX_BYTES_MIN]) -> Self {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = bytes;
        let start_s = f64::from_le_bytes([a, b, c, d, e, f, g, h]);
        let period_ms = f32::from_le_bytes([i, j, k, l]);
        // Prefixes of lines that were not transmitted are zeros.
        let is_there = EPOCHS_S.contains(&start_s) && start_s.to_bits() != 0;
        let is_exposed = EXPOSURES_MS.contains(&period_ms);
        Self {
            start_s: is_there.then_some(start_s),
            period_s: is_exposed.then(|| f64::from(period_ms) * SECONDS_PER_MS),
        }
    }
}

/// The prefixes of all rows.
///
/// # Errors
/// The file cannot be read.
pub(super) fn read(raster: &Raster, file: &File) -> io::Result<Vec<Prefix>> {
    let prefix = |line| {
        let mut bytes = [0; PREFIX_BYTES_MIN];
        file.read_exact_at(&mut bytes, raster.row(line))?;
        Ok(Prefix::of(bytes))
    };
    (0..raster.lines).map(prefix).collect()
}
