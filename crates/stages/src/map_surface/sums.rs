//! Sums over the compared squares of all cells of a tile, whose squares overlap.

use crate::ground::Tile;

/// Half the edge of the compared square, samples of the ground.
pub(super) const HALF: usize = 8;
/// Edge of the compared square, and its samples.
pub(super) const EDGE: usize = 2 * HALF + 1;
pub(super) const COUNT: usize = EDGE * EDGE;

/// `N` numbers of every sample of a line.
pub(super) type Lines<const N: usize> = [Vec<f32>; N];

/// Calls `each` for every cell of a tile, in order, with the sums of `N` numbers over the square about its middle; NaN where
/// a number is missing. `add` adds these numbers of a line of the tile.
///
/// A number is added up once for all squares that contain all lines of its cell. Sums over the lines of a cell, and over the single
/// lines beyond whole cells, are in single precision, all others in double.
pub(super) fn over_squares<const N: usize>(
    tile: &Tile,
    per_cell: usize,
    add: impl Fn(usize, &mut Lines<N>),
    mut each: impl FnMut([f64; N]),
) {
    let width = tile.size[1];
    let [rows, columns] = [0, 1].map(|axis| tile.cells[axis].len());
    let [top, left] =
        [(0, rows), (1, columns)].map(|(axis, cells)| (tile.size[axis] - cells * per_cell) / 2);
    // Lines of the square beyond those of its cell: whole cells, and single lines.
    let beyond = HALF - (per_cell - 1) / 2;
    let (whole, single) = (beyond / per_cell, beyond % per_cell);
    let of_lines = |lines: &mut dyn Iterator<Item = usize>, sums: &mut Lines<N>| {
        for of in sums.iter_mut() {
            of.fill(0.0);
        }
        for line in lines {
            add(line, sums);
        }
    };
    let lines = || -> Lines<N> { std::array::from_fn(|_| vec![0.0; width]) };
    let mut of_cells: Vec<Lines<N>> = (0..=2 * whole).map(|_| lines()).collect();
    let mut of_singles = lines();
    let mut sums: [Vec<f64>; N] = std::array::from_fn(|_| vec![0.0; width]);
    for row in 0..rows + 2 * whole {
        let first = top + row * per_cell - whole * per_cell;
        let last = of_cells.len() - 1;
        of_cells.rotate_left(1);
        of_lines(&mut (first..first + per_cell), &mut of_cells[last]);
        if row < 2 * whole {
            continue;
        }
        // Of the square about the cell `whole` rows above.
        let below = first + per_cell;
        let above = below - EDGE + single;
        let mut singles = (above..above + single).chain(below..below + single);
        of_lines(&mut singles, &mut of_singles);
        for (at, sums) in sums.iter_mut().enumerate() {
            sums.fill(0.0);
            for lines in of_cells.iter().chain([&of_singles]) {
                for (sum, number) in sums.iter_mut().zip(&lines[at]) {
                    *sum += f64::from(*number);
                }
            }
        }
        for column in 0..columns {
            let first = left + column * per_cell - beyond;
            each(std::array::from_fn(
                |at| sum(&sums[at][first..first + EDGE]),
            ));
        }
    }
}

/// The sum of the numbers of an edge.
fn sum(numbers: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let fours = numbers.chunks_exact(4);
    let rest: f64 = fours.remainder().iter().sum();
    for four in fours {
        for (sum, number) in sums.iter_mut().zip(four) {
            *sum += number;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Subtracts the mean of the known numbers, which comparisons of images ignore: sums in single precision lose fewer digits.
#[allow(
    clippy::cast_possible_truncation,
    reason = "grey values need few digits"
)]
pub(super) fn centre(numbers: &mut [f32]) {
    let (mut sum, mut count) = (0.0, 0_u32);
    for number in numbers.iter().filter(|number| number.is_finite()) {
        sum += f64::from(*number);
        count += 1;
    }
    let mean = (sum / f64::from(count.max(1))) as f32;
    for number in numbers {
        *number -= mean;
    }
}

/// Adds numbers to sums.
pub(super) fn add_numbers(sums: &mut [f32], numbers: &[f32]) {
    for (sum, number) in sums.iter_mut().zip(numbers) {
        *sum += number;
    }
}

/// Adds products to sums.
pub(super) fn add_products(sums: &mut [f32], one: &[f32], other: &[f32]) {
    for (sum, (one, other)) in sums.iter_mut().zip(one.iter().zip(other)) {
        *sum += one * other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bright image that is nearly flat: its variance is a millionth of its mean square.
    #[test]
    fn sums_over_a_bright_flat_square_keep_the_variance() {
        let margin = HALF + 2;
        let tiles = Tile::all([5, 5], 5, 3, margin);
        let tile = &tiles[0];
        let width = tile.size[1];
        let bright: Vec<f32> = (0..tile.size[0] * width)
            .map(|at| 250.0 + 0.003 * ((at * 7919) % 251) as f32)
            .collect();
        let mut numbers = bright.clone();
        numbers[0] = f32::NAN;
        centre(&mut numbers);
        assert!(numbers[0].is_nan());
        let mut found = Vec::new();
        let add = |line: usize, [sums, squares]: &mut Lines<2>| {
            let row = &numbers[line * width..(line + 1) * width];
            add_numbers(sums, row);
            add_products(squares, row, row);
        };
        over_squares(tile, 3, add, |sums| found.push(sums));
        for ((_, [line, sample]), [sum, squares]) in tile.middles(3, 5).zip(found) {
            let square = (line - HALF..=line + HALF)
                .flat_map(|line| &bright[line * width..][sample - HALF..=sample + HALF]);
            let square: Vec<f64> = square.copied().map(f64::from).collect();
            let mean = square.iter().sum::<f64>() / (COUNT as f64);
            let expected = square.iter().map(|of| (of - mean).powi(2)).sum::<f64>();
            let variance = squares - sum * sum / (COUNT as f64);
            // Rounding of a few hundred sums in single precision.
            assert!(
                (variance / expected - 1.0).abs() < 1e-5,
                "{variance} {expected}"
            );
        }
    }

    #[test]
    fn sums_are_those_of_every_square_for_all_samples_of_a_cell() {
        for per_cell in [1, 3, 5] {
            let margin = HALF + 2;
            let tiles = Tile::all([5, 4], 5, per_cell, margin);
            let tile = &tiles[0];
            let width = tile.size[1];
            let mut numbers: Vec<f32> = (0..tile.size[0] * width)
                .map(|at| ((at * 7919) % 251) as f32)
                .collect();
            // Below and right of the middle of the first cell by half a square, and one more.
            let middle = margin + (per_cell - 1) / 2;
            let missing = [middle + HALF, middle + HALF + 1];
            numbers[missing[0] * width + missing[1]] = f32::NAN;
            let mut found = Vec::new();
            let row = |line: usize| &numbers[line * width..(line + 1) * width];
            let add = |line: usize, [sums, squares]: &mut Lines<2>| {
                add_numbers(sums, row(line));
                add_products(squares, row(line), row(line));
            };
            over_squares(tile, per_cell, add, |sums| found.push(sums));
            let cells: Vec<_> = tile.middles(per_cell, 4).collect();
            assert_eq!(found.len(), cells.len());
            for ((_, [line, sample]), sums) in cells.into_iter().zip(found) {
                let square = (line - HALF..=line + HALF)
                    .flat_map(|line| &row(line)[sample - HALF..=sample + HALF]);
                let square: Vec<f64> = square.copied().map(f64::from).collect();
                let expected: f64 = square.iter().sum();
                if expected.is_nan() {
                    assert!(sums.iter().all(|sum| sum.is_nan()));
                } else {
                    // Whole numbers below 2^24 have exact sums.
                    let squares: f64 = square.iter().map(|of| of * of).sum();
                    assert!((sums[0] - expected).abs() < 1e-9 && (sums[1] - squares).abs() < 1e-9);
                }
            }
        }
    }
}
