//! The height at which two images, laid on the ground, are most alike.

use super::{
    Cell, Found,
    level::{Known, Level},
    pair::Pair,
};
use crate::ground::Tile;
use areograph_base::{error::Result, ties::Unmatched};

/// Half the edge of the compared square, samples of the ground.
pub(super) const HALF: usize = 8;
/// Minimum correlation.
const CORRELATION_MIN: f64 = 0.5;
/// Largest share of the best correlation that another height may have.
const SECOND_MAX: f64 = 0.85;
/// Heights closer than this count as one, samples of parallax.
const APART: usize = 3;
/// A standard deviation of grey values below this is noise: smoothing leaves 0.4 of one grey value.
const FLAT_DN: f64 = 0.8;

/// The height of every cell of a tile at which the images are most alike, within `reach` samples of parallax of the
/// known one.
///
/// # Errors
/// The system's refusal to read the images' temporary files.
pub(super) fn search(
    level: &Level<'_>,
    tile: Tile,
    known: &Known,
    reach: usize,
) -> Result<Vec<(usize, Cell)>> {
    let [_, columns] = level.ground.size;
    let cells: Vec<(usize, [usize; 2])> = tile.middles(level.per_cell, columns).collect();
    let Some(pair) = Pair::of(level, tile, known, reach as f64 + 1.0)? else {
        return Ok(cells.into_iter().map(|(cell, _)| (cell, None)).collect());
    };
    let width = pair.tile.size[1];
    let step_m = 1.0 / pair.samples_per_m();
    let mut alike: Vec<Vec<Alike>> = vec![Vec::with_capacity(2 * reach + 1); cells.len()];
    for step in 0..=2 * reach {
        let [one, other] = pair.laid((step as f64 - reach as f64) * step_m);
        let sums = Sums::of(&one, &other, width);
        for ((_, middle), alike) in cells.iter().zip(&mut alike) {
            alike.push(sums.about(*middle));
        }
    }
    let judged = cells
        .into_iter()
        .zip(&alike)
        .map(|((cell, middle), alike)| {
            let at = middle[0] * width + middle[1];
            let edge_px = pair.edge_px(at);
            if edge_px < 0.0 {
                return (cell, None);
            }
            let found = best(alike, edge_px).map(|(step, correlation)| Found {
                height_m: pair.height_m(at) + (step - reach as f64) * step_m,
                sigma_m: step_m,
                aside: pair.aside(at),
                correlation,
            });
            (cell, Some(found))
        });
    Ok(judged.collect())
}

/// The best of the steps, between them by a parabola, and its correlation.
fn best(alike: &[Alike], edge_px: f64) -> std::result::Result<(f64, f64), Unmatched> {
    let whole = alike.iter().filter(|of| of.whole);
    if whole.clone().count() == 0 {
        // Half of the compared square, and the margin of smoothing and interpolation.
        let near = edge_px < (HALF + 4) as f64;
        return Err(if near {
            Unmatched::Edge
        } else {
            Unmatched::Missing
        });
    }
    if whole.clone().all(|of| of.spread_dn < FLAT_DN) {
        return Err(Unmatched::Flat);
    }
    let correlations: Vec<f64> = alike.iter().map(|of| of.correlation).collect();
    let peak = (0..alike.len())
        .max_by(|one, other| correlations[*one].total_cmp(&correlations[*other]))
        .unwrap_or_default();
    let correlation = correlations[peak];
    if !(correlation >= CORRELATION_MIN) {
        return Err(Unmatched::Unlike);
    }
    let others = correlations.iter().enumerate();
    let second = others
        .filter(|(step, _)| step.abs_diff(peak) >= APART)
        .map(|(_, correlation)| *correlation)
        .fold(-1.0, f64::max);
    if second > SECOND_MAX * correlation {
        return Err(Unmatched::Ambiguous);
    }
    let beside = [peak.wrapping_sub(1), peak + 1].map(|step| correlations.get(step).copied());
    let between = match beside {
        [Some(before), Some(behind)] if before > -1.0 && behind > -1.0 => {
            let bend = before + behind - 2.0 * correlation;
            if bend < 0.0 {
                (0.5 * (before - behind) / bend).clamp(-0.5, 0.5)
            } else {
                0.0
            }
        }
        _ => 0.0,
    };
    Ok((peak as f64 + between, correlation))
}

/// Similarity of two images about a place.
#[derive(Debug, Clone, Copy)]
struct Alike {
    /// Normalised cross-correlation; −1 where it is not known.
    correlation: f64,
    /// The lesser standard deviation of the two.
    spread_dn: f64,
    /// Whether no pixel is missing.
    whole: bool,
}

/// Sums from the first sample on: missing ones, both numbers, their squares and their product.
struct Sums {
    width: usize,
    sums: Vec<[f64; 6]>,
}

impl Sums {
    fn of(one: &[f32], other: &[f32], width: usize) -> Self {
        let across = width + 1;
        let mut sums = vec![[0.0; 6]; across * (one.len() / width + 1)];
        let rows = one.chunks_exact(width).zip(other.chunks_exact(width));
        for (line, (one, other)) in rows.enumerate() {
            let mut row = [0.0; 6];
            for (sample, (one, other)) in one.iter().zip(other).enumerate() {
                if one.is_nan() || other.is_nan() {
                    row[0] += 1.0;
                } else {
                    // Numbers relative to the middle of a byte lose fewer digits.
                    let [a, b] = [one, other].map(|of| f64::from(*of) - 128.0);
                    for (sum, term) in row[1..].iter_mut().zip([a, b, a * a, b * b, a * b]) {
                        *sum += term;
                    }
                }
                let above = sums[line * across + sample + 1];
                let here = &mut sums[(line + 1) * across + sample + 1];
                for (here, (above, row)) in here.iter_mut().zip(above.iter().zip(row)) {
                    *here = above + row;
                }
            }
        }
        Self {
            width: across,
            sums,
        }
    }

    /// Over the square about a sample.
    fn about(&self, [line, sample]: [usize; 2]) -> Alike {
        let corner = |down: usize, right: usize| {
            &self.sums[(line + down - HALF) * self.width + sample + right - HALF]
        };
        let edge = 2 * HALF + 1;
        let [first, right, below, last] = [
            corner(0, 0),
            corner(0, edge),
            corner(edge, 0),
            corner(edge, edge),
        ];
        let sum: [f64; 6] = std::array::from_fn(|of| last[of] - right[of] - below[of] + first[of]);
        let count = (edge * edge) as f64;
        let [missing, a, b, aa, bb, ab] = sum;
        let [variance, other] = [aa - a * a / count, bb - b * b / count];
        let whole = missing < 0.5;
        let spread_dn = (variance.min(other).max(0.0) / count).sqrt();
        let known = whole && spread_dn > 0.0;
        Alike {
            correlation: if known {
                (ab - a * b / count) / (variance * other).sqrt()
            } else {
                -1.0
            },
            spread_dn,
            whole,
        }
    }
}
