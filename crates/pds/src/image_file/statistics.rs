//! Statistics of the pixels of an image, and their hash.

use super::strip::{LineState, Strip};

/// Accumulates pixels strip by strip.
#[derive(Debug)]
pub struct Statistics {
    counts: [u64; 256],
    hash: blake3::Hasher,
    /// Lines by state: good, suspect, missing.
    lines: [u32; 3],
}

/// Statistics of the decoded pixels, without missing lines.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelStatistics {
    /// Lines as transmitted.
    pub lines_good: u32,
    /// Lines that may be damaged.
    pub lines_suspect: u32,
    /// Lines that are missing.
    pub lines_missing: u32,
    /// Minimum; `None`, as all that follow, for an image without lines.
    pub minimum: Option<u8>,
    /// Maximum.
    pub maximum: Option<u8>,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation of all pixels (not of a sample).
    pub standard_deviation: Option<f64>,
    /// Median, the lower of two middle values.
    pub median: Option<u8>,
    /// Sum of all values.
    pub sum: u64,
    /// Number of different values.
    pub distinct: usize,
    /// Pixels of value 0, which occur in deep shadow and do not indicate missing data.
    pub zeros: u64,
    /// BLAKE3 of the decoded pixels in the order of the file.
    pub blake3: String,
}

impl Default for Statistics {
    fn default() -> Self {
        Self {
            counts: [0; 256],
            hash: blake3::Hasher::new(),
            lines: [0; 3],
        }
    }
}

impl Statistics {
    /// Adds the existing lines of a strip.
    pub fn add(&mut self, strip: &Strip) {
        for (line, state) in strip.lines() {
            self.lines[*state as usize] += 1;
            if *state != LineState::Missing {
                self.hash.update(line);
                for pixel in line {
                    self.counts[usize::from(*pixel)] += 1;
                }
            }
        }
    }

    /// The statistics.
    #[must_use]
    pub fn finish(&self) -> PixelStatistics {
        let pixels: u64 = self.counts.iter().sum();
        let values = || {
            (0..=u8::MAX)
                .zip(self.counts)
                .filter(|(_, count)| *count > 0)
        };
        let sum = values()
            .map(|(value, count)| u64::from(value) * count)
            .sum();
        let mean = (pixels > 0).then(|| sum as f64 / pixels as f64);
        let variance = mean.map(|mean| {
            let squares =
                values().map(|(value, count)| (f64::from(value) - mean).powi(2) * count as f64);
            squares.sum::<f64>() / pixels as f64
        });
        let mut below = 0;
        let median = values().find(|(_, count)| {
            below += count;
            below * 2 >= pixels
        });
        let [lines_good, lines_suspect, lines_missing] = self.lines;
        PixelStatistics {
            lines_good,
            lines_suspect,
            lines_missing,
            minimum: values().next().map(|(value, _)| value),
            maximum: values().next_back().map(|(value, _)| value),
            mean,
            standard_deviation: variance.map(f64::sqrt),
            median: median.map(|(value, _)| value),
            sum,
            distinct: values().count(),
            zeros: self.counts[0],
            blake3: self.hash.finalize().to_hex().to_string(),
        }
    }
}
