//! Contours of a grid of heights, as lines between the middles of its cells.
//!
//! Every square of four neighbouring cells is crossed where the height along its sides, linear between the cells, equals
//! the level; lines of neighbouring squares are joined. A square with a cell without a height is not crossed, so that
//! contours end at holes. In a saddle, the mean of the four heights decides which corners belong together.
//!
//! # Source
//! Marching squares after Lorensen & Cline 1987, "Marching cubes", Computer Graphics 21(4), 163–169.

use std::collections::BTreeMap;

use super::height_grid::HeightGrid;

/// A line at one height.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Its height, metres.
    pub height_m: f64,
    /// Rows and columns of its points, with the higher ground to the right; the last point of a closed line is the
    /// first one.
    pub cells: Vec<[f64; 2]>,
}

impl Contour {
    /// Whether it is closed around ground that is narrower than `cells` rows and columns.
    #[must_use]
    pub fn is_islet(&self, cells: f64) -> bool {
        let extent = |axis: usize| {
            let ends = [f64::INFINITY, f64::NEG_INFINITY];
            let [low, high] = self.cells.iter().fold(ends, |[low, high], cell| {
                [low.min(cell[axis]), high.max(cell[axis])]
            });
            high - low
        };
        self.cells.first() == self.cells.last() && extent(0).max(extent(1)) < cells
    }
}

/// A grid with the mean of the heights around every cell that has one, `half` cells to each side.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    reason = "planetary heights keep millimetre precision"
)]
pub fn generalised(grid: &HeightGrid, half: usize) -> HeightGrid {
    let [rows, columns] = grid.size;
    // Sums and numbers of the heights north-west of every corner.
    let mut sums = vec![[0.0_f64; 2]; (rows + 1) * (columns + 1)];
    let corner = |row: usize, column: usize| row * (columns + 1) + column;
    for row in 0..rows {
        let mut of_row = [0.0; 2];
        for column in 0..columns {
            let height_m = f64::from(grid.heights_m[row * columns + column]);
            if !height_m.is_nan() {
                of_row = [of_row[0] + height_m, of_row[1] + 1.0];
            }
            let above = sums[corner(row, column + 1)];
            sums[corner(row + 1, column + 1)] = [above[0] + of_row[0], above[1] + of_row[1]];
        }
    }
    let mean = |(at, height_m): (usize, &f32)| {
        if height_m.is_nan() {
            return f32::NAN;
        }
        let [row, column] = [at / columns, at % columns];
        let [top, left] = [row, column].map(|of| of.saturating_sub(half));
        let (bottom, right) = ((row + half + 1).min(rows), (column + half + 1).min(columns));
        let [sum_m, count] = [0, 1].map(|of| {
            sums[corner(bottom, right)][of] + sums[corner(top, left)][of]
                - sums[corner(top, right)][of]
                - sums[corner(bottom, left)][of]
        });
        (sum_m / count) as f32
    };
    HeightGrid {
        heights_m: grid.heights_m.iter().enumerate().map(mean).collect(),
        ..grid.clone()
    }
}

/// A side of a square: its cell in the north-west, and whether it leads to the cell below rather than beside.
type Side = (usize, bool);

/// Contours of the heights of a grid at the multiples of `interval_m`, from the lowest.
///
/// # Panics
/// If the interval is not above 0.
#[must_use]
pub fn contours(grid: &HeightGrid, interval_m: f64) -> Vec<Contour> {
    assert!(interval_m > 0.0, "contours have an interval");
    let [rows, columns] = grid.size;
    let mut levels: BTreeMap<i64, BTreeMap<Side, Side>> = BTreeMap::new();
    for row in 0..rows.saturating_sub(1) {
        for column in 0..columns.saturating_sub(1) {
            let at = row * columns + column;
            // Clockwise from the north-west.
            let corners = [at, at + 1, at + columns + 1, at + columns];
            let heights_m = corners.map(|at| f64::from(grid.heights_m[at]));
            if heights_m.iter().any(|height_m| height_m.is_nan()) {
                continue;
            }
            let ends = |least: f64, height_m: &f64| least.min(*height_m);
            let low_m = heights_m.iter().fold(f64::INFINITY, ends);
            let high_m = heights_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sides = [
                (at, false),
                (at + 1, true),
                (at + columns, false),
                (at, true),
            ];
            // A corner at the level counts as above it.
            for level in first_above(low_m, interval_m)..=last_below(high_m, interval_m) {
                let crossed = crossings(heights_m, level as f64 * interval_m);
                let steps = levels.entry(level).or_default();
                steps.extend(crossed.map(|[from, to]| (sides[from], sides[to])));
            }
        }
    }
    let lines = levels.into_iter().flat_map(|(level, steps)| {
        let height_m = level as f64 * interval_m;
        let lines = joined(steps).into_iter();
        lines.map(move |sides| Contour {
            height_m,
            cells: sides
                .iter()
                .map(|side| place(grid, *side, height_m))
                .collect(),
        })
    });
    lines.collect()
}

#[allow(clippy::cast_possible_truncation, reason = "a cast saturates")]
fn first_above(height_m: f64, interval_m: f64) -> i64 {
    (height_m / interval_m).floor() as i64 + 1
}

#[allow(clippy::cast_possible_truncation, reason = "a cast saturates")]
fn last_below(height_m: f64, interval_m: f64) -> i64 {
    (height_m / interval_m).floor() as i64
}

/// Sides on which lines at a level enter and leave a square, with the higher corners to the right.
fn crossings(heights_m: [f64; 4], level_m: f64) -> impl Iterator<Item = [usize; 2]> {
    let is_above = heights_m.map(|height_m| height_m >= level_m);
    // The side from corner k to the next is crossed upwards or downwards; a line with the higher ground to its right
    // enters where the height rises clockwise, seen from inside.
    let rises = move |side: usize| !is_above[side] && is_above[(side + 1) % 4];
    let falls = move |side: usize| is_above[side] && !is_above[(side + 1) % 4];
    let middle_is_above = heights_m.iter().sum::<f64>() >= 4.0 * level_m;
    let entries = (0..4).filter(move |side| rises(*side));
    entries.filter_map(move |from| {
        // Around the higher corners between both sides, or, in a saddle with a low middle, around the lower ones.
        let mut after = (1..4)
            .map(|step| (from + step) % 4)
            .filter(|side| falls(*side));
        let (near, far) = (after.next(), after.next());
        // Both corners of a saddle with a high middle belong together.
        let to = if middle_is_above { far.or(near) } else { near };
        to.map(|to| [to, from])
    })
}

/// Steps from side to side as lines: open ones first, then closed ones, each by its first side.
fn joined(mut steps: BTreeMap<Side, Side>) -> Vec<Vec<Side>> {
    let ends: std::collections::BTreeSet<Side> = steps.values().copied().collect();
    let mut lines = Vec::new();
    let starts: Vec<Side> = steps
        .keys()
        .copied()
        .filter(|from| !ends.contains(from))
        .collect();
    let mut walk = |start: Side, steps: &mut BTreeMap<Side, Side>| {
        let mut line = vec![start];
        let mut at = start;
        while let Some(next) = steps.remove(&at) {
            line.push(next);
            at = next;
        }
        lines.push(line);
    };
    for start in starts {
        walk(start, &mut steps);
    }
    while let Some(start) = steps.keys().next().copied() {
        walk(start, &mut steps);
    }
    lines
}

/// Where a side has the height, in rows and columns.
fn place(grid: &HeightGrid, (at, is_down): Side, height_m: f64) -> [f64; 2] {
    let columns = grid.size[1];
    let other = if is_down { at + columns } else { at + 1 };
    let [from_m, to_m] = [at, other].map(|at| f64::from(grid.heights_m[at]));
    let share = (height_m - from_m) / (to_m - from_m);
    let [row, column] = [at / columns, at % columns].map(|of| of as f64);
    if is_down {
        [row + share, column]
    } else {
        [row, column + share]
    }
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells and heights of small grids"
)]
mod tests {
    use super::*;

    fn grid(size: [usize; 2], height_m: impl Fn(f64, f64) -> f64) -> HeightGrid {
        let cells = (0..size[0] * size[1]).map(|at| (at / size[1], at % size[1]));
        HeightGrid {
            size,
            first_rad: [0.1, 0.2],
            cell_rad: [1e-6; 2],
            radius_m: 3e6,
            heights_m: cells
                .map(|(row, column)| height_m(row as f64, column as f64) as f32)
                .collect(),
        }
    }

    #[test]
    fn contours_of_a_cone_are_closed_circles_with_the_higher_ground_to_the_right() {
        let radius = |row: f64, column: f64| (row - 20.0).hypot(column - 24.0);
        let cone = grid([41, 49], |row, column| 100.0 - 5.0 * radius(row, column));
        // Heights of 0.0001 m apart from the levels at whole cells: no corner is at a level.
        let lines = contours(&cone, 10.0001);
        let circles: Vec<&Contour> = lines.iter().filter(|of| of.height_m > 5.0).collect();
        assert_eq!(circles.len(), 9);
        for circle in circles {
            let expected = (100.0 - circle.height_m) / 5.0;
            for [row, column] in &circle.cells {
                // A chord of a cell lies off the circle by 1/8 of its curvature, at most 1/(8 r) cells.
                let off = (radius(*row, *column) - expected).abs();
                assert!(off < 0.2 / expected.max(1.0), "{off}");
            }
            assert_eq!(circle.cells.first(), circle.cells.last());
            let pairs = circle.cells.windows(2);
            // Twice the area, positive for a line that runs clockwise on a map with rows southwards.
            let area: f64 = pairs
                .map(|of| of[0][1] * of[1][0] - of[1][1] * of[0][0])
                .sum();
            assert!((0.5 * area / (std::f64::consts::PI * expected.powi(2)) - 1.0).abs() < 0.1);
        }
    }

    #[test]
    fn means_are_of_known_heights_and_fill_no_hole() {
        let mut plane = grid([9, 9], |row, column| 3.0 * row + column);
        plane.heights_m[4 * 9 + 5] = f32::NAN;
        let means = generalised(&plane, 1);
        assert!(means.heights_m[4 * 9 + 5].is_nan());
        // A plane stays a plane, apart from the edge and the hole; 32-bit numbers.
        assert!((means.heights_m[2 * 9 + 2] - 8.0).abs() < 1e-5);
        // West of the hole: the mean of 15 to 17 without 17, and of the rows beside it.
        let expected = (12.0 + 13.0 + 14.0 + 15.0 + 16.0 + 18.0 + 19.0 + 20.0) / 8.0;
        assert!((means.heights_m[4 * 9 + 4] - expected).abs() < 1e-5);
        // In the corner: the mean of four.
        assert!((means.heights_m[0] - 2.0).abs() < 1e-5);
    }

    #[test]
    fn islets_are_closed_and_narrow() {
        let cone = grid([41, 49], |row, column| (row - 20.0).hypot(column - 24.0));
        let is_islet: Vec<bool> = contours(&cone, 5.01)
            .iter()
            .map(|of| of.is_islet(12.0))
            .collect();
        // Diameters of 10, 20 … cells; beyond 20 cells, circles are cut by the edge.
        assert!(is_islet[0] && !is_islet[1..].iter().any(|of| *of));
    }

    #[test]
    fn contours_end_at_holes() {
        let mut plane = grid([20, 30], |row, _| row);
        let is_hole =
            |row: usize, column: usize| (5..15).contains(&row) && (10..20).contains(&column);
        for at in 0..plane.heights_m.len() {
            if is_hole(at / 30, at % 30) {
                plane.heights_m[at] = f32::NAN;
            }
        }
        let lines = contours(&plane, 4.5);
        for line in &lines {
            for [row, column] in &line.cells {
                let around = [row.floor(), row.ceil()].map(|row| row as usize);
                let beside = [column.floor(), column.ceil()].map(|column| column as usize);
                assert!(
                    !around
                        .iter()
                        .any(|row| beside.iter().any(|column| is_hole(*row, *column)))
                );
            }
        }
        let count = |height_m: f64| {
            lines
                .iter()
                .filter(|of| (of.height_m - height_m).abs() < 0.1)
                .count()
        };
        // On either side of the hole, and in one piece beyond it.
        assert_eq!([4.5, 9.0, 13.5, 18.0].map(count), [2, 2, 2, 1]);
    }

    #[test]
    fn both_lines_of_a_saddle_are_kept() {
        for low_middle in [false, true] {
            let height_m = if low_middle { 0.7 } else { 1.4 };
            let saddle = grid([2, 2], |row, column| {
                if (row + column) % 2.0 > 0.5 {
                    height_m
                } else {
                    0.0
                }
            });
            let lines = contours(&saddle, 0.5);
            assert_eq!(lines.iter().filter(|of| of.height_m < 0.6).count(), 2);
            assert!(lines.iter().all(|of| of.cells.len() == 2));
        }
    }

    #[test]
    fn level_ground_at_a_level_has_no_contour() {
        assert!(contours(&grid([5, 5], |_, _| 10.0), 5.0).is_empty());
    }
}
