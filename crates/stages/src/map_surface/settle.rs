//! Least squares over the pixels of both images: height of a place above or below the surface that they are laid on.
//!
//! Images on the right surface have no distortion against each other: the unknowns are a shift along the parallax, one
//! across it (orientation errors), an offset and a gain of the light.

use nalgebra::{Matrix2, Matrix4, Vector4};

use super::{
    Cell, Found,
    level::{Known, Level},
    pair::Pair,
    search::HALF,
};
use crate::ground::Tile;
use areograph_base::{error::Result, ties::Unmatched};

/// Largest distance of a cell from the surface, samples of parallax; beyond it, the match is false.
const SHIFT_MAX: f64 = 1.5;
/// Largest difference of a place between the two directions, samples.
const ONE_WAY: f64 = 0.25;
/// Largest standard deviation of a shift, samples.
const SIGMA_MAX: f64 = 0.5;
/// Minimum correlation of the compared squares.
const CORRELATION_MIN: f64 = 0.6;
/// Systematic error of a place, pixels: as for tie points, interpolation, whole grey values, and relief that no surface
/// of cells follows.
pub(super) const SYSTEMATIC_PX: f64 = 0.06;
/// Samples within which residuals are correlated: two by smoothing, a few more by interpolation and the light on
/// slopes.
const JOINED: usize = 6;
/// Gains of the light that two images of the same ground may have.
const GAIN: std::ops::RangeInclusive<f64> = 0.1..=10.0;
/// Edge of the compared square, and its samples.
const EDGE: usize = 2 * HALF + 1;
const COUNT: usize = EDGE * EDGE;

/// The height of every cell of a tile by least squares about the known one.
///
/// # Errors
/// The system's refusal to read the images' temporary files.
pub(super) fn settle(level: &Level<'_>, tile: Tile, known: &Known) -> Result<Vec<(usize, Cell)>> {
    let [_, columns] = level.ground.size;
    let cells: Vec<(usize, [usize; 2])> = tile.middles(level.per_cell, columns).collect();
    let Some(pair) = Pair::of(level, tile, known, 0.0)? else {
        return Ok(cells.into_iter().map(|(cell, _)| (cell, None)).collect());
    };
    let width = pair.tile.size[1];
    let images = pair
        .laid(0.0)
        .map(|image| Slopes::of(image, width, &pair.axes()));
    let settled = cells.into_iter().map(|(cell, middle)| {
        let at = middle[0] * width + middle[1];
        let edge_px = pair.edge_px(at);
        if edge_px < 0.0 {
            return (cell, None);
        }
        let found = shift([&images[0], &images[1]], middle, width).map(|shift| Found {
            height_m: pair.height_m(at) + shift.along / pair.samples_per_m(),
            sigma_m: shift.variance.sqrt() / pair.samples_per_m(),
            aside: pair.aside(at) + shift.aside,
            correlation: shift.correlation,
        });
        (cell, Some(found.map_err(|why| at_edge(why, edge_px))))
    });
    Ok(settled.collect())
}

/// Reports missing pixels near an edge as the edge.
fn at_edge(why: Unmatched, edge_px: f64) -> Unmatched {
    match why {
        // Half of the compared square, and the margin of smoothing, slopes and interpolation.
        Unmatched::Missing if edge_px < (HALF + 5) as f64 => Unmatched::Edge,
        why => why,
    }
}

/// An image of a tile, and its gradients along the parallax and across it.
struct Slopes {
    numbers: Vec<f32>,
    along: Vec<f32>,
    across: Vec<f32>,
}

impl Slopes {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "slopes of bytes keep their precision"
    )]
    fn of(numbers: Vec<f32>, width: usize, axes: &Matrix2<f64>) -> Self {
        let axes = axes.map(|axis| axis as f32);
        let mut slopes = [vec![f32::NAN; numbers.len()], vec![f32::NAN; numbers.len()]];
        for line in 1..(numbers.len() / width).saturating_sub(1) {
            for sample in 1..width - 1 {
                let at = line * width + sample;
                let down = 0.5 * (numbers[at + width] - numbers[at - width]);
                let right = 0.5 * (numbers[at + 1] - numbers[at - 1]);
                for (axis, slopes) in slopes.iter_mut().enumerate() {
                    slopes[at] = axes[(0, axis)] * down + axes[(1, axis)] * right;
                }
            }
        }
        let [along, across] = slopes;
        Self {
            numbers,
            along,
            across,
        }
    }
}

/// A shift of the second image against the first, samples.
struct Shift {
    along: f64,
    aside: f64,
    /// Variance of the shift along the parallax.
    variance: f64,
    correlation: f64,
}

/// The shift about a place, by either image as the template.
fn shift(
    images: [&Slopes; 2],
    middle: [usize; 2],
    width: usize,
) -> std::result::Result<Shift, Unmatched> {
    let forth = one_way(images, middle, width)?;
    let back = one_way([images[1], images[0]], middle, width)?;
    let along = 0.5 * (forth.along - back.along);
    if !(along.abs() <= SHIFT_MAX) {
        return Err(Unmatched::Unsettled);
    }
    if !((forth.along + back.along).abs() <= ONE_WAY) {
        return Err(Unmatched::OneWay);
    }
    let found = Shift {
        along,
        aside: 0.5 * (forth.aside - back.aside),
        variance: 0.5 * (forth.variance + back.variance) + SYSTEMATIC_PX * SYSTEMATIC_PX,
        correlation: forth.correlation.min(back.correlation),
    };
    if !(found.correlation >= CORRELATION_MIN) {
        return Err(Unmatched::Unlike);
    }
    if !(found.variance <= SIGMA_MAX * SIGMA_MAX) {
        return Err(Unmatched::Uncertain);
    }
    Ok(found)
}

/// The shift of the other image that fits the template.
fn one_way(
    [template, other]: [&Slopes; 2],
    middle: [usize; 2],
    width: usize,
) -> std::result::Result<Shift, Unmatched> {
    let samples = || {
        (middle[0] - HALF..=middle[0] + HALF).flat_map(move |line| {
            let first = line * width + middle[1] - HALF;
            first..first + EDGE
        })
    };
    // Numbers relative to the middle of a byte lose fewer digits.
    let row = |at: usize| {
        let numbers = [other.numbers[at] - 128.0, other.along[at], other.across[at]];
        let [number, along, across] = numbers.map(f64::from);
        Vector4::new(1.0, number, along, across)
    };
    let left = |at: usize| f64::from(template.numbers[at] - 128.0);
    let (mut normals, mut right, mut square) = (Matrix4::zeros(), Vector4::zeros(), 0.0);
    for at in samples() {
        let (row, left) = (row(at), left(at));
        normals.ger(1.0, &row, &row, 1.0);
        right.axpy(left, &row, 1.0);
        square += left * left;
    }
    // NaN where pixels of the square are missing.
    if !(normals.sum() + square).is_finite() {
        return Err(Unmatched::Missing);
    }
    let inverse = normals.cholesky().ok_or(Unmatched::Flat)?.inverse();
    let solution = inverse * right;
    let gain = solution[1];
    if !GAIN.contains(&gain) {
        return Err(Unmatched::Unlike);
    }
    let count = COUNT as f64;
    let spread = square - right[0] * right[0] / count;
    let residual = (square - right.dot(&solution)).max(0.0);
    let influence = inverse.row(2) / gain;
    let mut moves = [0.0; COUNT];
    for (at, moved) in samples().zip(&mut moves) {
        let row = row(at);
        *moved = (influence * row).x * (left(at) - row.dot(&solution));
    }
    let freedom = count - 4.0;
    let independent = inverse[(2, 2)] / (gain * gain) * residual / freedom;
    Ok(Shift {
        along: solution[2] / gain,
        aside: solution[3] / gain,
        variance: independent.max(joined(&moves) * count / freedom),
        correlation: (1.0 - residual / spread.max(f64::MIN_POSITIVE))
            .max(0.0)
            .sqrt(),
    })
}

/// The variance of a sum of terms with correlated neighbours: from all sums over small squares, equivalent to weights
/// that fall evenly to zero (Newey & West 1987, in two dimensions).
fn joined(moves: &[f64; COUNT]) -> f64 {
    const ACROSS: usize = EDGE + 1;
    let mut sums = [0.0; ACROSS * ACROSS];
    for line in 0..EDGE {
        let mut row = 0.0;
        for sample in 0..EDGE {
            row += moves[line * EDGE + sample];
            sums[(line + 1) * ACROSS + sample + 1] = sums[line * ACROSS + sample + 1] + row;
        }
    }
    let mut total = 0.0;
    for end in 1..EDGE + JOINED {
        let lines = [end.saturating_sub(JOINED), end.min(EDGE)];
        for end in 1..EDGE + JOINED {
            let samples = [end.saturating_sub(JOINED), end.min(EDGE)];
            let corner = |down: usize, right: usize| sums[lines[down] * ACROSS + samples[right]];
            let sum: f64 = corner(1, 1) - corner(0, 1) - corner(1, 0) + corner(0, 0);
            total += sum * sum;
        }
    }
    total / (JOINED * JOINED) as f64
}
