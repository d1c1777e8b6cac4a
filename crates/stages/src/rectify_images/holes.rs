//! Heights across narrow holes of a terrain model: an error of an interpolated height displaces the image only slightly.

use std::collections::BTreeMap;

use crate::{ground::Field, map_surface::SurfaceModel};
use areograph_geom::height_grid::HeightGrid;

/// Maximum distance of interpolation from known cells, cells: holes up to twice as wide are filled, and wider ones stay empty.
const REACH: usize = 8;

/// A terrain model with heights in its narrow holes, up to 16 cells wide. Their standard deviations contain the change of known heights over the
/// distance to the nearest of them.
#[must_use]
pub fn bridged(model: &SurfaceModel) -> SurfaceModel {
    let grid = &model.heights;
    let is_known: Vec<bool> = grid.heights_m.iter().map(|of| !of.is_nan()).collect();
    let distances = closed(&is_known, grid.size);
    let field = |numbers: &[f32]| {
        let field = Field {
            size: grid.size,
            values: numbers.to_vec(),
        };
        field.filled().values
    };
    let (heights_m, sigmas_m) = (field(&grid.heights_m), field(&model.sigmas_m));
    let changes_m = changes_m(grid);
    let change_m = |distance: usize| changes_m.get(&distance).copied().unwrap_or_default();
    let numbers = |of: &dyn Fn(usize, usize) -> f32| -> Vec<f32> {
        let cells = distances.iter().enumerate();
        cells
            .map(|(at, distance)| distance.map_or(f32::NAN, |distance| of(at, distance)))
            .collect()
    };
    SurfaceModel {
        heights: HeightGrid {
            heights_m: numbers(&|at, _| heights_m[at]),
            ..grid.clone()
        },
        sigmas_m: numbers(&|at, distance| sigmas_m[at].hypot(change_m(distance))),
        parallel_rad: model.parallel_rad,
        pairs: Vec::new(),
    }
}

/// Distance in cells to the nearest known one, along rows, columns or diagonals, for known cells and narrow holes between
/// them; `None` elsewhere: cells are added around known ones, also beyond the map, and removed again from outside.
fn closed(is_known: &[bool], [rows, columns]: [usize; 2]) -> Vec<Option<usize>> {
    let size = [rows, columns].map(|of| of + 2 * REACH);
    let place = |at: usize| (at / columns + REACH) * size[1] + at % columns + REACH;
    let mut distances = vec![None; size[0] * size[1]];
    for (at, is_known) in is_known.iter().enumerate() {
        distances[place(at)] = is_known.then_some(0);
    }
    for distance in 1..=REACH {
        let is_reached: Vec<bool> = distances.iter().map(Option::is_some).collect();
        for at in 0..distances.len() {
            if !is_reached[at] && neighbours(at, size).any(|at| is_reached[at]) {
                distances[at] = Some(distance);
            }
        }
    }
    let mut is_inside: Vec<bool> = distances.iter().map(Option::is_some).collect();
    for _ in 0..REACH {
        let before = is_inside.clone();
        for at in 0..is_inside.len() {
            let all = neighbours(at, size).filter(|at| before[*at]).count();
            is_inside[at] = before[at] && all == 8;
        }
    }
    let cells = is_known.iter().enumerate();
    cells
        .map(|(at, is_known)| distances[place(at)].filter(|_| *is_known || is_inside[place(at)]))
        .collect()
}

/// The cells around a cell.
fn neighbours(at: usize, [rows, columns]: [usize; 2]) -> impl Iterator<Item = usize> {
    let [row, column] = [at / columns, at % columns];
    let around = move |of: usize, count: usize| of.saturating_sub(1)..(of + 2).min(count);
    around(row, rows)
        .flat_map(move |row| around(column, columns).map(move |column| row * columns + column))
        .filter(move |other| *other != at)
}

/// Root mean square change of known heights over every distance up to the reach, along rows and columns, metres.
fn changes_m(grid: &HeightGrid) -> BTreeMap<usize, f32> {
    let [_, columns] = grid.size;
    let heights_m = &grid.heights_m;
    let change_m = |distance: usize| {
        let (mut square, mut count) = (0.0_f64, 0_u32);
        for (at, height_m) in heights_m.iter().enumerate() {
            let beside = (at % columns + distance < columns).then_some(at + distance);
            for other in beside.into_iter().chain([at + distance * columns]) {
                let change_m = heights_m
                    .get(other)
                    .map_or(f32::NAN, |other_m| other_m - height_m);
                if !change_m.is_nan() {
                    square += f64::from(change_m * change_m);
                    count += 1;
                }
            }
        }
        #[allow(
            clippy::cast_possible_truncation,
            reason = "a standard deviation needs at most seven digits"
        )]
        let change_m = (square / f64::from(count.max(1))).sqrt() as f32;
        (distance, change_m)
    };
    (1..=REACH).map(change_m).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn narrow_holes_are_bridged_and_wide_ones_and_edges_are_not() {
        let size = [60, 100];
        let plane_m = |row: usize, column: usize| (2 * row + column) as f32;
        let cells = (0..size[0]).flat_map(|row| (0..size[1]).map(move |column| [row, column]));
        let is_hole = |[row, column]: [usize; 2]| {
            // A hole of 10 cells, one of 24, and a margin.
            (20..30).contains(&row) && (15..25).contains(&column)
                || (15..39).contains(&row) && (50..74).contains(&column)
                || row < 5
                // A cell beside the edge of the map.
                || [row, column] == [58, 90]
        };
        let heights_m: Vec<f32> = cells
            .map(|[row, column]| {
                if is_hole([row, column]) {
                    f32::NAN
                } else {
                    plane_m(row, column)
                }
            })
            .collect();
        let sigmas_m = heights_m.iter().map(|of| of * 0.0 + 2.0);
        let model = SurfaceModel {
            sigmas_m: sigmas_m.collect(),
            heights: HeightGrid {
                size,
                first_rad: [1.0, 0.2],
                cell_rad: [1e-5; 2],
                radius_m: 3_396_190.0,
                heights_m,
            },
            parallel_rad: 0.2,
            pairs: Vec::new(),
        };
        let made = bridged(&model);
        let at = |row: usize, column: usize| {
            let at = row * size[1] + column;
            [made.heights.heights_m[at], made.sigmas_m[at]]
        };
        let [height_m, sigma_m] = at(25, 20);
        // Means of coarser cells lie within a cell or two of the plane.
        assert!((height_m - plane_m(25, 20)).abs() < 4.0, "{height_m}");
        // Five cells of 1 and 2 m: √((5² + 10²)/2), of unequal numbers of pairs, and 2 m.
        assert!((sigma_m - 8.15).abs() < 0.1, "{sigma_m}");
        let [height_m, sigma_m] = at(45, 45);
        assert!((height_m - plane_m(45, 45)).abs() < 1e-3 && (sigma_m - 2.0).abs() < 1e-3);
        assert!(at(27, 62)[0].is_nan());
        assert!(at(3, 40)[0].is_nan());
        assert!(!at(58, 90)[0].is_nan());
        assert!((at(5, 40)[1] - 2.0).abs() < 1e-3);
    }
}
