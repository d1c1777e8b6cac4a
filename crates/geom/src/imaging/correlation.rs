//! Matching of a patch in another image to a pixel.

use super::Patch;

/// A second peak is distinct when it is farther away than this, pixels.
const APART_PX: usize = 3;
/// Sums of squares about the mean below this belong to a flat patch.
const FLAT: f64 = 1e-3;

/// Position of the best correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Line and sample of the area for the first pixel of the template, counted from 0.
    pub at: [usize; 2],
    /// Normalised cross-correlation at that position.
    pub correlation: f64,
    /// The largest correlation of another peak; −1 without one.
    pub second: f64,
}

/// Searches `area` for `template` by normalised cross-correlation at every whole pixel.
///
/// Returns `None` where the area is smaller than the template, or one of them has no texture.
#[must_use]
pub fn search(template: &Patch, area: &Patch) -> Option<Peak> {
    let places = [0, 1].map(|axis| (area.size[axis] + 1).saturating_sub(template.size[axis]));
    if places.contains(&0) {
        return None;
    }
    let count = (template.size[0] * template.size[1]) as f64;
    let mean = template.values.iter().copied().map(f64::from).sum::<f64>() / count;
    #[allow(clippy::cast_possible_truncation, reason = "pixels are bytes")]
    let centred: Vec<f32> = template
        .values
        .iter()
        .map(|value| (f64::from(*value) - mean) as f32)
        .collect();
    let square: f64 = centred.iter().map(|value| f64::from(value * value)).sum();
    if square < FLAT {
        return None;
    }
    let sums = Sums::of(area);
    let mut surface = Vec::with_capacity(places[0] * places[1]);
    for line in 0..places[0] {
        for sample in 0..places[1] {
            let [sum, squares] = sums.over([line, sample], template.size);
            let spread = squares - sum * sum / count;
            let product = product(&centred, template.size, area, [line, sample]);
            surface.push(if spread < FLAT {
                -1.0
            } else {
                product / (spread * square).sqrt()
            });
        }
    }
    peaks(&surface, places)
}

/// Sum of the products of a template without its mean and the pixels below it.
fn product(centred: &[f32], size: [usize; 2], area: &Patch, at: [usize; 2]) -> f64 {
    let rows = centred.chunks_exact(size[1]).enumerate();
    rows.map(|(line, row)| {
        let below = area.row(at[0] + line, at[1]..at[1] + size[1]);
        let products = row.iter().zip(below).map(|(one, other)| one * other);
        f64::from(products.sum::<f32>())
    })
    .sum()
}

/// The best position of a surface and the best other peak.
fn peaks(surface: &[f64], places: [usize; 2]) -> Option<Peak> {
    let value = |line: usize, sample: usize| surface[line * places[1] + sample];
    let best = (0..surface.len()).max_by(|one, other| surface[*one].total_cmp(&surface[*other]))?;
    let at = [best / places[1], best % places[1]];
    let mut second = -1.0_f64;
    for line in 0..places[0] {
        for sample in 0..places[1] {
            let apart = line.abs_diff(at[0]).max(sample.abs_diff(at[1]));
            let here = value(line, sample);
            if apart <= APART_PX || here <= second {
                continue;
            }
            let is_peak = (line.saturating_sub(1)..(line + 2).min(places[0])).all(|line| {
                (sample.saturating_sub(1)..(sample + 2).min(places[1]))
                    .all(|sample| value(line, sample) <= here)
            });
            if is_peak {
                second = here;
            }
        }
    }
    Some(Peak {
        at,
        correlation: surface[best],
        second,
    })
}

/// Sums of pixels and of their squares from the first pixel on.
struct Sums {
    width: usize,
    sums: Vec<[f64; 2]>,
}

impl Sums {
    fn of(patch: &Patch) -> Self {
        let width = patch.size[1] + 1;
        let mut sums = vec![[0.0; 2]; width * (patch.size[0] + 1)];
        for line in 0..patch.size[0] {
            let mut row = [0.0; 2];
            for sample in 0..patch.size[1] {
                let value = f64::from(patch.at(line, sample));
                row = [row[0] + value, row[1] + value * value];
                let above = sums[line * width + sample + 1];
                sums[(line + 1) * width + sample + 1] = [above[0] + row[0], above[1] + row[1]];
            }
        }
        Self { width, sums }
    }

    /// Sums over a rectangle.
    fn over(&self, at: [usize; 2], size: [usize; 2]) -> [f64; 2] {
        let corner = |down: usize, right: usize| {
            self.sums[(at[0] + down * size[0]) * self.width + at[1] + right * size[1]]
        };
        [0, 1].map(|of| corner(1, 1)[of] - corner(0, 1)[of] - corner(1, 0)[of] + corner(0, 0)[of])
    }
}
