//! Tone balance: a gain and an offset for every orthoimage, so that overlapping ones have one median and one spread where
//! both show the ground.
//!
//! Median and spread, half the range of the middle quartiles, do not change with a few bright or dark pixels, nor with small
//! shifts of one image against the other. Gains have a geometric mean of 1.
//!
//! # Source
//! Matching of moments, as Horn & Woodham 1979 match the detectors of a scanner, with robust moments.

use nalgebra::{DMatrix, DVector};

/// Steps of brightness of a histogram in a grey value.
const STEPS: usize = 16;
/// Fewest blocks of an overlap.
const BLOCKS_MIN: u32 = 100;
/// Least spread, grey values: flatter ground shows no gain.
const SPREAD_MIN: f64 = 0.5;
/// Weight of a gain of 1 and an offset of 0 against all overlaps: decides only for orthoimages without an overlap.
const RIDGE: f64 = 1e-9;

/// Gain and offset of the brightness of an orthoimage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tone {
    pub(super) gain: f64,
    /// Grey values.
    pub(super) offset: f64,
}

impl Tone {
    pub(super) const UNCHANGED: Self = Self {
        gain: 1.0,
        offset: 0.0,
    };

    /// Brightness of every grey value; 0, which means no brightness, stays.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range of a byte"
    )]
    pub(super) fn table(&self) -> [u8; 256] {
        let mut table = [0; 256];
        for (of, to) in (0..=u8::MAX).zip(&mut table).skip(1) {
            let value = self.gain * f64::from(of) + self.offset;
            *to = value.round().clamp(1.0, 255.0) as u8;
        }
        table
    }
}

/// Frequency of brightness.
#[derive(Debug, Clone)]
pub(super) struct Histogram {
    counts: Vec<u32>,
    pub(super) total: u32,
}

impl Histogram {
    pub(super) fn new() -> Self {
        Self {
            counts: vec![0; 256 * STEPS],
            total: 0,
        }
    }

    /// Adds a mean brightness: the sum of some pixels.
    pub(super) fn add(&mut self, sum: u32, pixels: u32) {
        let step = sum as usize * STEPS / pixels.max(1) as usize;
        self.counts[step.min(256 * STEPS - 1)] += 1;
        self.total += 1;
    }

    /// Brightness below which this share of the values lies.
    fn quantile(&self, share: f64) -> f64 {
        let mut below = 0.0;
        let sought = share * f64::from(self.total);
        for (step, count) in self.counts.iter().enumerate() {
            let count = f64::from(*count);
            if count > 0.0 && below + count >= sought {
                return (step as f64 + (sought - below) / count) / STEPS as f64;
            }
            below += count;
        }
        0.0
    }

    /// Median and spread.
    fn moments(&self) -> [f64; 2] {
        let [low, middle, high] = [0.25, 0.5, 0.75].map(|share| self.quantile(share));
        [middle, 0.5 * (high - low)]
    }
}

/// Brightness of two orthoimages where both show the ground.
#[derive(Debug)]
pub(super) struct Overlap {
    /// Indices of the orthoimages.
    pub(super) of: [usize; 2],
    pub(super) brightness: [Histogram; 2],
}

/// The tone of every orthoimage that balances their overlaps.
pub(super) fn balanced(count: usize, overlaps: &[Overlap]) -> Vec<Tone> {
    let moments = overlaps.iter().filter_map(|overlap| {
        let moments = [0, 1].map(|side| overlap.brightness[side].moments());
        let weight = f64::from(overlap.brightness[0].total);
        let is_usable = overlap.brightness[0].total >= BLOCKS_MIN
            && moments.iter().all(|[_, spread]| *spread >= SPREAD_MIN);
        is_usable.then_some((overlap.of, weight, moments))
    });
    let moments: Vec<_> = moments.collect();
    // Of the logarithms of gains, then of offsets: the second minus the first of a pair.
    let differences = moments
        .iter()
        .map(|(of, weight, [one, other])| (*of, *weight, (one[1] / other[1]).ln()));
    let gains: Vec<f64> = solved(count, differences)
        .iter()
        .map(|of| of.exp())
        .collect();
    let differences = moments.iter().map(|(of, weight, [one, other])| {
        let [one, other] = [gains[of[0]] * one[0], gains[of[1]] * other[0]];
        (*of, *weight, one - other)
    });
    let offsets = solved(count, differences);
    // As bright as before on average.
    let mut change = [0.0, 0.0];
    for (of, weight, moments) in &moments {
        for (image, [median, _]) in of.iter().zip(moments) {
            change[0] += weight * ((gains[*image] - 1.0) * median + offsets[*image]);
            change[1] += weight;
        }
    }
    let mean = change[0] / change[1].max(1.0);
    let is_tied = |image: usize| moments.iter().any(|(of, ..)| of.contains(&image));
    let tone = |image: usize| Tone {
        gain: gains[image],
        offset: offsets[image] - if is_tied(image) { mean } else { 0.0 },
    };
    (0..count).map(tone).collect()
}

/// Numbers whose differences (of the second minus the first, with a weight) are these by least squares, with a mean of 0.
fn solved(
    count: usize,
    differences: impl Iterator<Item = ([usize; 2], f64, f64)> + Clone,
) -> DVector<f64> {
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    let total: f64 = differences.clone().map(|(_, weight, _)| weight).sum();
    for ([one, other], weight, difference) in differences {
        normal[(one, one)] += weight;
        normal[(other, other)] += weight;
        normal[(one, other)] -= weight;
        normal[(other, one)] -= weight;
        right[other] += weight * difference;
        right[one] -= weight * difference;
    }
    let ridge = RIDGE * total.max(1.0);
    for at in 0..count {
        normal[(at, at)] += ridge;
    }
    let solution = normal.cholesky().map(|of| of.solve(&right));
    solution.unwrap_or_else(|| DVector::zeros(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brightness of ground from 40 to 160, seen with a gain and an offset.
    fn seen(gain: u32, offset: u32) -> Histogram {
        let mut histogram = Histogram::new();
        for ground in 40..160 {
            for _ in 0..4 {
                histogram.add(gain * ground + 2 * offset, 2);
            }
        }
        // A few saturated pixels.
        for _ in 0..20 {
            histogram.add(255, 1);
        }
        histogram
    }

    #[test]
    fn gains_and_offsets_of_a_chain_are_found() {
        // Brightness g · ground / 2 + o of three images; the fourth overlaps none.
        let tones = [(2, 0), (1, 30), (3, 10)];
        let pair = |one: usize, other: usize| Overlap {
            of: [one, other],
            brightness: [one, other].map(|of| seen(tones[of].0, tones[of].1)),
        };
        let found = balanced(4, &[pair(0, 1), pair(1, 2)]);
        let ground = |of: usize, ground: f64| {
            let (gain, offset) = tones[of];
            let brightness = 0.5 * f64::from(gain) * ground + f64::from(offset);
            found[of].gain * brightness + found[of].offset
        };
        for place in [60.0, 140.0] {
            let brightness = [0, 1, 2].map(|of| ground(of, place));
            for other in &brightness[1..] {
                // Steps of the histogram, an eighth of a grey value at most, times a gain of about 2.
                assert!((brightness[0] - other).abs() < 0.5, "{brightness:?}");
            }
        }
        let product: f64 = found[..3].iter().map(|of| of.gain).product();
        assert!((product - 1.0).abs() < 1e-6, "{product}"); // the ridge
        assert_eq!(found[3], Tone::UNCHANGED);
    }

    #[test]
    fn tables_keep_empty_cells_and_the_range_of_a_byte() {
        let table = Tone {
            gain: 2.0,
            offset: -10.0,
        }
        .table();
        assert_eq!([table[0], table[1], table[50], table[200]], [0, 1, 90, 255]);
        let unchanged = Tone::UNCHANGED.table();
        assert!((0..=255).eq(unchanged));
    }
}
