//! Least squares over the pixels of both images: height of a place above or below the surface that they are laid on.
//!
//! Images on the right surface have no distortion against each other: the unknowns are a shift along the parallax, one
//! across it (orientation errors), an offset and a gain of the light.

use std::ops::Range;

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::{
    Cell, Found,
    level::{Known, Level},
    pair::Pair,
    seen::Seen,
    sums::{COUNT, EDGE, HALF, Lines, add_numbers, add_products, centre, over_squares},
};
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

/// The height of every cell of a tile by least squares about the known one.
///
/// # Errors
/// The system's refusal to read the images' temporary files.
pub(super) fn settle(level: &Level<'_>, seen: &Seen, known: &Known) -> Result<Vec<(usize, Cell)>> {
    let [_, columns] = level.ground.size;
    let tile = &seen.tile;
    let cells: Vec<(usize, [usize; 2])> = tile.middles(level.per_cell, columns).collect();
    let Some(pair) = Pair::of(level, seen, known, 0.0)? else {
        return Ok(cells.into_iter().map(|(cell, _)| (cell, None)).collect());
    };
    let width = tile.size[1];
    let mut images = [Vec::new(), Vec::new()];
    pair.lay(0.0, &mut images);
    let images = images.map(|image| Slopes::of(image, width, &pair.axes()));
    let mut sums = Vec::with_capacity(cells.len());
    let add = |line: usize, sums: &mut Lines<SUMS>| add(&images, tile.line(line), sums);
    over_squares(tile, level.per_cell, add, |of_square| sums.push(of_square));
    let settled = cells.into_iter().zip(sums).map(|((cell, middle), sums)| {
        let edge_px = pair.edge_px(middle);
        if edge_px < 0.0 {
            return (cell, None);
        }
        let first = (middle[0] - HALF) * width + middle[1] - HALF;
        let found = shift(&images, &sums, [first, width]).map(|shift| Found {
            height_m: pair.height_m(middle) + shift.along / pair.samples_per_m(),
            sigma_m: shift.variance.sqrt() / pair.samples_per_m(),
            aside: pair.aside(middle) + shift.aside,
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

/// An image of a tile: its numbers relative to the middle of a byte, which lose fewer digits, and its gradients along the
/// parallax and across it.
struct Slopes([Vec<f32>; 3]);

impl Slopes {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "slopes of bytes keep their precision"
    )]
    fn of(mut numbers: Vec<f32>, width: usize, axes: &Matrix2<f64>) -> Self {
        let axes = axes.map(|axis| 0.5 * axis as f32);
        let mut slopes = [vec![f32::NAN; numbers.len()], vec![f32::NAN; numbers.len()]];
        let lines = (numbers.len() / width).saturating_sub(2);
        for (axis, slopes) in slopes.iter_mut().enumerate() {
            let [of_line, of_sample] = [0, 1].map(|of| axes[(of, axis)]);
            for line in 0..lines {
                let [above, here, below] = [0, 1, 2]
                    .map(|down| &numbers[(line + down) * width..(line + down + 1) * width]);
                let slopes = &mut slopes[(line + 1) * width + 1..(line + 2) * width - 1];
                let along = above[1..].iter().zip(&below[1..]);
                let across = here.iter().zip(&here[2..]);
                for (slope, ((above, below), (left, right))) in
                    slopes.iter_mut().zip(along.zip(across))
                {
                    *slope = of_line * (below - above) + of_sample * (right - left);
                }
            }
        }
        centre(&mut numbers);
        let [along, across] = slopes;
        Self([numbers, along, across])
    }
}

/// Products of the numbers and slopes of both images that normal equations need: of the first image, of the second, and
/// of both.
const PRODUCTS: [[usize; 2]; 17] = [
    [0, 0],
    [0, 1],
    [0, 2],
    [1, 1],
    [1, 2],
    [2, 2],
    [3, 3],
    [3, 4],
    [3, 5],
    [4, 4],
    [4, 5],
    [5, 5],
    [0, 3],
    [0, 4],
    [0, 5],
    [1, 3],
    [2, 3],
];
/// Sums over a square: of numbers and slopes, and of their products.
const SUMS: usize = 6 + PRODUCTS.len();

/// Adds the numbers, slopes and products of a line.
fn add(images: &[Slopes; 2], span: Range<usize>, sums: &mut Lines<SUMS>) {
    let [one, other] = images.each_ref().map(|of| of.0.each_ref());
    let terms = [one[0], one[1], one[2], other[0], other[1], other[2]].map(|of| &of[span.clone()]);
    let (numbers, products) = sums.split_at_mut(terms.len());
    for (sums, term) in numbers.iter_mut().zip(terms) {
        add_numbers(sums, term);
    }
    for (sums, [one, other]) in products.iter_mut().zip(PRODUCTS) {
        add_products(sums, terms[one], terms[other]);
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

/// The shift over a square, by either image as the template; `place` is the first sample of the square and the width of
/// the images.
fn shift(
    images: &[Slopes; 2],
    sums: &[f64; SUMS],
    place: [usize; 2],
) -> std::result::Result<Shift, Unmatched> {
    let [forth, back] = Moments::of(sums).ok_or(Unmatched::Missing)?;
    let (forth, back) = (Fit::of(&forth)?, Fit::of(&back)?);
    let along = 0.5 * (forth.along() - back.along());
    if !(along.abs() <= SHIFT_MAX) {
        return Err(Unmatched::Unsettled);
    }
    if !((forth.along() + back.along()).abs() <= ONE_WAY) {
        return Err(Unmatched::OneWay);
    }
    let correlation = forth.correlation.min(back.correlation);
    if !(correlation >= CORRELATION_MIN) {
        return Err(Unmatched::Unlike);
    }
    let [one, other] = images;
    let variance = 0.5 * (forth.variance([one, other], place) + back.variance([other, one], place));
    let variance = variance + SYSTEMATIC_PX * SYSTEMATIC_PX;
    if !(variance <= SIGMA_MAX * SIGMA_MAX) {
        return Err(Unmatched::Uncertain);
    }
    Ok(Shift {
        along,
        aside: 0.5 * (forth.aside() - back.aside()),
        variance,
        correlation,
    })
}

/// Means over a square, and sums of products about them: of the template, and of the number and slopes of the other
/// image.
struct Moments {
    template_mean: f64,
    means: Vector3<f64>,
    square: f64,
    right: Vector3<f64>,
    normals: Matrix3<f64>,
}

impl Moments {
    /// With the first image as the template, and with the second; `None` where pixels of the square are missing.
    fn of(sums: &[f64; SUMS]) -> Option<[Self; 2]> {
        if !sums.iter().sum::<f64>().is_finite() {
            return None;
        }
        let (totals, products) = sums.split_at(6);
        let means: [f64; 6] = std::array::from_fn(|at| totals[at] / COUNT as f64);
        let centred: [f64; PRODUCTS.len()] = std::array::from_fn(|at| {
            let [one, other] = PRODUCTS[at];
            products[at] - totals[one] * means[other]
        });
        let normals = |first: usize| {
            let [a, b, c, d, e, f]: [f64; 6] = std::array::from_fn(|at| centred[first + at]);
            Matrix3::new(a, b, c, b, d, e, c, e, f)
        };
        let right = |of: [usize; 3]| Vector3::from(of.map(|at| centred[at]));
        let forth = Self {
            template_mean: means[0],
            means: Vector3::new(means[3], means[4], means[5]),
            square: centred[0],
            right: right([12, 13, 14]),
            normals: normals(6),
        };
        let back = Self {
            template_mean: means[3],
            means: Vector3::new(means[0], means[1], means[2]),
            square: centred[6],
            right: right([12, 15, 16]),
            normals: normals(0),
        };
        Some([forth, back])
    }
}

/// The shift of the other image that fits the template.
struct Fit {
    /// Gain of the light, and its products with the shifts along the parallax and across it.
    solution: Vector3<f64>,
    /// Value of the template where numbers and slopes of the other image are 0.
    offset: f64,
    /// Shift along the parallax for a residual, by number and slopes of the other image, and where these are 0.
    influence: Vector3<f64>,
    influence_offset: f64,
    /// Variance of the shift along the parallax if residuals are independent.
    independent: f64,
    correlation: f64,
}

/// Observations beyond the unknowns.
const FREEDOM: f64 = COUNT as f64 - 4.0;

impl Fit {
    fn of(moments: &Moments) -> std::result::Result<Self, Unmatched> {
        let inverse = inverse(&moments.normals).ok_or(Unmatched::Flat)?;
        let solution = inverse * moments.right;
        let gain = solution[0];
        if !GAIN.contains(&gain) {
            return Err(Unmatched::Unlike);
        }
        let residual = (moments.square - moments.right.dot(&solution)).max(0.0);
        let influence = inverse.column(1) / gain;
        Ok(Self {
            solution,
            offset: moments.template_mean - solution.dot(&moments.means),
            influence_offset: -influence.dot(&moments.means),
            influence,
            independent: inverse[(1, 1)] / (gain * gain) * residual / FREEDOM,
            correlation: (1.0 - residual / moments.square.max(f64::MIN_POSITIVE))
                .max(0.0)
                .sqrt(),
        })
    }

    fn along(&self) -> f64 {
        self.solution[1] / self.solution[0]
    }

    fn aside(&self) -> f64 {
        self.solution[2] / self.solution[0]
    }

    /// Variance of the shift along the parallax, with residuals that are correlated or not.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a variance needs few digits"
    )]
    fn variance(&self, [template, other]: [&Slopes; 2], [first, width]: [usize; 2]) -> f64 {
        let [gain, along, across] = [0, 1, 2].map(|at| self.solution[at] as f32);
        let [of_number, of_along, of_across] = [0, 1, 2].map(|at| self.influence[at] as f32);
        let [offset, of_none] = [self.offset, self.influence_offset].map(|of| of as f32);
        let mut moves = [[0.0; PADDED]; EDGE];
        for (line, moves) in moves.iter_mut().enumerate() {
            let of_line = |numbers: &[f32]| {
                let start = first + line * width;
                numbers[start..]
                    .first_chunk::<EDGE>()
                    .copied()
                    .unwrap_or([f32::NAN; EDGE])
            };
            let here = of_line(&template.0[0]);
            let [number, slope, aside] = other.0.each_ref().map(|of| of_line(of));
            let there = number.iter().zip(slope.iter().zip(&aside));
            let samples = here.iter().zip(there);
            for (moved, (here, (number, (slope, aside)))) in moves[BEFORE..].iter_mut().zip(samples)
            {
                let fitted = offset + gain * number + along * slope + across * aside;
                let influence = of_none + of_number * number + of_along * slope + of_across * aside;
                *moved = influence * (here - fitted);
            }
        }
        self.independent
            .max(joined(&moves) * COUNT as f64 / FREEDOM)
    }
}

/// Inverse of a positive definite matrix; `None` of another one.
fn inverse(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let [a, b, c] = [matrix[(0, 0)], matrix[(0, 1)], matrix[(0, 2)]];
    let [d, e, f] = [matrix[(1, 1)], matrix[(1, 2)], matrix[(2, 2)]];
    let minors = [d * f - e * e, c * e - b * f, b * e - c * d];
    let determinant = a * minors[0] + b * minors[1] + c * minors[2];
    let of_two = a * d - b * b;
    (a > 0.0 && of_two > 0.0 && determinant > 0.0).then(|| {
        let [ac, ae] = [a * f - c * c, b * c - a * e];
        Matrix3::new(
            minors[0], minors[1], minors[2], minors[1], ac, ae, minors[2], ae, of_two,
        ) / determinant
    })
}

/// Zeros before a line of moves, and numbers of a line with those behind.
const BEFORE: usize = JOINED - 1;
const PADDED: usize = 32;
/// Small squares along an axis that contain a sample of the square, and zeros.
const SQUARES: usize = 24;

/// The variance of a sum of terms with correlated neighbours: from all sums over small squares, equivalent to weights
/// that fall evenly to zero (Newey & West 1987, in two dimensions).
fn joined(moves: &[[f32; PADDED]; EDGE]) -> f64 {
    let mut sums = [0.0_f32; SQUARES];
    let mut squares = [0.0_f32; SQUARES];
    let mut of_lines = [[0.0_f32; SQUARES]; EDGE];
    for end in 0..EDGE + JOINED - 1 {
        if let Some(moves) = moves.get(end) {
            let two: [f32; PADDED - 1] = std::array::from_fn(|at| moves[at] + moves[at + 1]);
            of_lines[end] = std::array::from_fn(|at| two[at] + two[at + 2] + two[at + 4]);
            for (sum, of_line) in sums.iter_mut().zip(&of_lines[end]) {
                *sum += of_line;
            }
        }
        if let Some(of_line) = end
            .checked_sub(JOINED)
            .and_then(|first| of_lines.get(first))
        {
            for (sum, of_line) in sums.iter_mut().zip(of_line) {
                *sum -= of_line;
            }
        }
        for (square, sum) in squares.iter_mut().zip(&sums) {
            *square += sum * sum;
        }
    }
    let total: f64 = squares.iter().copied().map(f64::from).sum();
    total / (JOINED * JOINED) as f64
}
