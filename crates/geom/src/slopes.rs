//! Slopes and shading of a grid of heights by Horn's method.
//!
//! The gradient of a cell is that of its eight neighbours, those beside it with twice the weight of those at its
//! corners. A cell without a height, or with a neighbour without one, has no gradient.
//!
//! # Source
//! Horn 1981, "Hill shading and the reflectance map", Proc. IEEE 69(1), 14–47: gradient on p. 18, reflectance of a
//! Lambertian surface on p. 21.

use super::height_grid::HeightGrid;

/// Direction to the light, radians: azimuth clockwise from north, and height above the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Azimuth.
    pub azimuth_rad: f64,
    /// Altitude.
    pub altitude_rad: f64,
}

/// Slope of every cell in degrees, row by row; NaN where a height is missing.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    reason = "a slope needs at most seven digits"
)]
pub fn slopes_deg(grid: &HeightGrid) -> Vec<f32> {
    let slope = |gradient: Option<[f64; 2]>| {
        gradient.map_or(f32::NAN, |[east, north]| {
            east.hypot(north).atan().to_degrees() as f32
        })
    };
    gradients(grid).map(slope).collect()
}

/// Brightness of every cell as a Lambertian surface in this light, 1 (in shadow) to 255, row by row; 0 where a height
/// is missing.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 1 and 255"
)]
pub fn shading(grid: &HeightGrid, light: Light) -> Vec<u8> {
    let (sin_altitude, cos_altitude) = light.altitude_rad.sin_cos();
    let (sin_azimuth, cos_azimuth) = light.azimuth_rad.sin_cos();
    let brightness = |gradient: Option<[f64; 2]>| {
        gradient.map_or(0, |[east, north]| {
            // The normal (-east, -north, 1) against the direction to the light.
            let along = east * sin_azimuth + north * cos_azimuth;
            let facing = sin_altitude - along * cos_altitude;
            let cosine = facing / (1.0 + east * east + north * north).sqrt();
            (1.0 + 254.0 * cosine.max(0.0)).round() as u8
        })
    };
    gradients(grid).map(brightness).collect()
}

/// Rise per metre towards east and north of every cell, row by row.
fn gradients(grid: &HeightGrid) -> impl Iterator<Item = Option<[f64; 2]>> {
    let [rows, columns] = grid.size;
    let north_m = grid.cell_rad[1] * grid.radius_m;
    let height_m =
        move |row: usize, column: usize| f64::from(grid.heights_m[row * columns + column]);
    let gradient = move |row: usize, column: usize, east_m: f64| {
        if row == 0 || column == 0 || row + 1 >= rows || column + 1 >= columns {
            return None;
        }
        let [above, here, below] = [row - 1, row, row + 1]
            .map(|row| [column - 1, column, column + 1].map(|column| height_m(row, column)));
        let column_m = |at: usize| above[at] + 2.0 * here[at] + below[at];
        let row_m = |of: [f64; 3]| of[0] + 2.0 * of[1] + of[2];
        let east = (column_m(2) - column_m(0)) / (8.0 * east_m);
        let north = (row_m(above) - row_m(below)) / (8.0 * north_m);
        // The middle has no weight, but a cell without a height has no slope either.
        let is_known = !(east + north + here[1]).is_nan();
        is_known.then_some([east, north])
    };
    (0..rows).flat_map(move |row| {
        let [_, latitude_rad] = grid.place_rad([row as f64, 0.0]);
        let east_m = grid.cell_rad[0] * grid.radius_m * latitude_rad.cos();
        (0..columns).map(move |column| gradient(row, column, east_m))
    })
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells and heights of small grids"
)]
mod tests {
    use super::*;

    /// A plane that rises by these shares towards east and north, at 60° N, where a degree of longitude is half as
    /// wide.
    fn plane(east: f64, north: f64) -> HeightGrid {
        let cell_rad = [2e-5, 1e-5];
        let radius_m = 3e6;
        let first_rad = [0.5, 60_f64.to_radians()];
        let heights_m = (0..5).flat_map(|row| {
            (0..6).map(move |column| {
                let latitude_rad = first_rad[1] - f64::from(row) * cell_rad[1];
                let east_m = f64::from(column) * cell_rad[0] * radius_m * latitude_rad.cos();
                let north_m = -f64::from(row) * cell_rad[1] * radius_m;
                (east * east_m + north * north_m) as f32
            })
        });
        HeightGrid {
            size: [5, 6],
            first_rad,
            cell_rad,
            radius_m,
            heights_m: heights_m.collect(),
        }
    }

    #[test]
    fn a_plane_has_its_slope_and_edges_and_holes_have_none() {
        let mut grid = plane(0.3, -0.4);
        grid.heights_m[2 * 6 + 3] = f32::NAN;
        let slopes = slopes_deg(&grid);
        let is_known = |row: usize, column: usize| {
            // Only the first two inner columns lie apart from the edge and the hole.
            (1..4).contains(&row) && column == 1
        };
        for (at, slope_deg) in slopes.iter().enumerate() {
            let (row, column) = (at / 6, at % 6);
            assert_eq!(!slope_deg.is_nan(), is_known(row, column), "{row} {column}");
            let off_deg = f64::from(*slope_deg) - 0.5_f64.atan().to_degrees();
            // Convergence of the meridians over 60 m, and heights as 32-bit numbers, degrees.
            assert!(slope_deg.is_nan() || off_deg.abs() < 1e-3, "{off_deg}");
        }
        assert_eq!(
            shading(
                &grid,
                Light {
                    azimuth_rad: 0.0,
                    altitude_rad: 1.0
                }
            )
            .map_known(),
            slopes.iter().map(|of| !of.is_nan()).collect::<Vec<_>>()
        );
    }

    trait Known {
        fn map_known(self) -> Vec<bool>;
    }

    impl Known for Vec<u8> {
        fn map_known(self) -> Vec<bool> {
            self.into_iter().map(|of| of > 0).collect()
        }
    }

    #[test]
    fn slopes_towards_the_light_are_brighter() {
        let light = Light {
            azimuth_rad: 315_f64.to_radians(),
            altitude_rad: 45_f64.to_radians(),
        };
        let middle = |grid: &HeightGrid| shading(grid, light)[2 * 6 + 2];
        // Level ground: 1 + 254 sin 45°.
        assert_eq!(middle(&plane(0.0, 0.0)), 181);
        // Falling towards the north-west by 45°: the light meets it at right angles.
        let step = 0.5_f64.sqrt();
        assert_eq!(middle(&plane(step, -step)), 255);
        // Falling towards the south-east: along the light.
        assert!(middle(&plane(-step, step)) <= 2);
    }
}
