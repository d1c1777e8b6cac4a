//! The height at which two images, laid on the ground, are most alike.

use std::ops::Range;

use super::{
    Cell, Found,
    level::{Known, Level},
    pair::Pair,
    seen::Seen,
    sums::{COUNT, HALF, Lines, add_numbers, add_products, centre, over_squares},
};
use areograph_base::{error::Result, ties::Unmatched};

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
    seen: &Seen,
    known: &Known,
    reach: usize,
) -> Result<Vec<(usize, Cell)>> {
    let [_, columns] = level.ground.size;
    let tile = &seen.tile;
    let cells: Vec<(usize, [usize; 2])> = tile.middles(level.per_cell, columns).collect();
    let Some(pair) = Pair::of(level, seen, known, reach as f64 + 1.0)? else {
        return Ok(cells.into_iter().map(|(cell, _)| (cell, None)).collect());
    };
    let step_m = 1.0 / pair.samples_per_m();
    let mut alike: Vec<Vec<Alike>> = vec![Vec::with_capacity(2 * reach + 1); cells.len()];
    let mut images = [Vec::new(), Vec::new()];
    for step in 0..=2 * reach {
        pair.lay((step as f64 - reach as f64) * step_m, &mut images);
        for numbers in &mut images {
            centre(numbers);
        }
        let mut alike = alike.iter_mut();
        let compare = |sums| {
            if let Some(alike) = alike.next() {
                alike.push(Alike::of(sums));
            }
        };
        over_squares(
            tile,
            level.per_cell,
            |line, sums| add(&images, tile.line(line), sums),
            compare,
        );
    }
    let judged = cells
        .into_iter()
        .zip(&alike)
        .map(|((cell, middle), alike)| {
            let edge_px = pair.edge_px(middle);
            if edge_px < 0.0 {
                return (cell, None);
            }
            let found = best(alike, edge_px).map(|(step, correlation)| Found {
                height_m: pair.height_m(middle) + (step - reach as f64) * step_m,
                sigma_m: step_m,
                aside: pair.aside(middle),
                correlation,
            });
            (cell, Some(found))
        });
    Ok(judged.collect())
}

/// Adds of a line of two images both numbers, their squares and their product.
fn add(images: &[Vec<f32>; 2], span: Range<usize>, [a, b, aa, bb, ab]: &mut Lines<5>) {
    let [one, other] = images.each_ref().map(|of| &of[span.clone()]);
    add_numbers(a, one);
    add_numbers(b, other);
    add_products(aa, one, one);
    add_products(bb, other, other);
    add_products(ab, one, other);
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

impl Alike {
    /// By the sums of both numbers, their squares and their product over a square.
    fn of([a, b, aa, bb, ab]: [f64; 5]) -> Self {
        let count = COUNT as f64;
        let [variance, other] = [aa - a * a / count, bb - b * b / count];
        // NaN where a pixel is missing.
        let whole = (variance + other).is_finite();
        let spread_dn = (variance.min(other).max(0.0) / count).sqrt();
        let known = whole && spread_dn > 0.0;
        Self {
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
