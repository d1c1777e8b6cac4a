//! Heights above a sphere on an even grid of longitude and latitude, in memory.

use serde::{Deserialize, Serialize};

use areograph_base::units::wrap_pi;

/// A grid of heights. Grid coordinates are rows (southwards) and columns (eastwards), 0 in the middle of the first
/// cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeightGrid {
    /// Rows and columns.
    pub size: [usize; 2],
    /// East longitude and latitude of the middle of the first cell, in the north-west, radians.
    pub first_rad: [f64; 2],
    /// Size of a cell in longitude and latitude, both above 0, radians.
    pub cell_rad: [f64; 2],
    /// The sphere that heights refer to, metres.
    pub radius_m: f64,
    /// Heights row by row, metres; NaN where missing.
    pub heights_m: Vec<f32>,
}

impl HeightGrid {
    /// West, south, east and north edge, radians; the east edge is the west edge plus the width of the grid.
    #[must_use]
    pub fn edges_rad(&self) -> [f64; 4] {
        let [west, north] = [0, 1].map(|axis| {
            let half_rad = 0.5 * self.cell_rad[axis];
            self.first_rad[axis] + if axis == 0 { -half_rad } else { half_rad }
        });
        [
            west,
            north - self.size[0] as f64 * self.cell_rad[1],
            west + self.size[1] as f64 * self.cell_rad[0],
            north,
        ]
    }

    /// East longitude and latitude of the middle of the grid, radians.
    #[must_use]
    pub fn middle_rad(&self) -> [f64; 2] {
        let [west, south, east, north] = self.edges_rad();
        [0.5 * (west + east), 0.5 * (south + north)]
    }

    /// Size of a cell in its middle towards the east and the north, metres.
    #[must_use]
    pub fn cell_m(&self) -> [f64; 2] {
        let [_, latitude_rad] = self.middle_rad();
        [
            self.cell_rad[0] * self.radius_m * latitude_rad.cos(),
            self.cell_rad[1] * self.radius_m,
        ]
    }

    /// Row and column of a point, inside the grid or outside; longitudes of any turn.
    #[must_use]
    pub fn cell_of(&self, longitude_rad: f64, latitude_rad: f64) -> [f64; 2] {
        let [middle_rad, _] = self.middle_rad();
        let from_middle_rad = wrap_pi(longitude_rad - middle_rad);
        [
            (self.first_rad[1] - latitude_rad) / self.cell_rad[1],
            (from_middle_rad + middle_rad - self.first_rad[0]) / self.cell_rad[0],
        ]
    }

    /// East longitude, of any turn, and latitude of a row and column, radians.
    #[must_use]
    pub fn place_rad(&self, [row, column]: [f64; 2]) -> [f64; 2] {
        [
            self.first_rad[0] + column * self.cell_rad[0],
            self.first_rad[1] - row * self.cell_rad[1],
        ]
    }

    /// Height between the four nearest cells, metres; `None` outside, and where one of them has no height.
    #[must_use]
    pub fn height_m(&self, cell: [f64; 2]) -> Option<f64> {
        let probe = Probe::at(cell);
        self.probed_m(&probe, [0, 0])
    }

    /// The height at a probe shifted by whole rows and columns.
    #[must_use]
    pub fn probed_m(&self, probe: &Probe, shift: [i64; 2]) -> Option<f64> {
        let [row, column] = [0, 1].map(|axis| usize::try_from(probe.first[axis] + shift[axis]));
        let (row, column) = (row.ok()?, column.ok()?);
        let [rows, columns] = self.size;
        if row + 1 >= rows || column + 1 >= columns {
            return None;
        }
        let upper = row * columns + column;
        let lower = upper + columns;
        let [upper, lower] = [upper, lower].map(|at| self.heights_m.get(at..at + 2));
        let (upper, lower) = (upper?, lower?);
        let [a, b, c, d] = [upper[0], upper[1], lower[0], lower[1]].map(f64::from);
        let [wa, wb, wc, wd] = probe.weights;
        let height_m = wa * a + wb * b + wc * c + wd * d;
        (!height_m.is_nan()).then_some(height_m)
    }
}

/// A position between four cells; when shifted by whole cells it keeps its weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// Row and column of the cell in the north-west.
    first: [i64; 2],
    /// Weights of the cells north-west, north-east, south-west, south-east.
    weights: [f64; 4],
}

impl Probe {
    /// The probe at a row and column.
    #[must_use]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a cast from floating point saturates, far outside any grid"
    )]
    pub fn at(cell: [f64; 2]) -> Self {
        let first = cell.map(f64::floor);
        let [down, right] = [cell[0] - first[0], cell[1] - first[1]];
        Self {
            // A sum with a shift must not overflow.
            first: first.map(|of| of.clamp(-1e9, 1e9) as i64),
            weights: [
                (1.0 - down) * (1.0 - right),
                (1.0 - down) * right,
                down * (1.0 - right),
                down * right,
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Heights that are linear in row and column, across the antimeridian.
    fn plane() -> HeightGrid {
        let heights_m = (0..5_u8)
            .flat_map(|row| (0..4_u8).map(move |column| f32::from(row) * 10.0 + f32::from(column)));
        HeightGrid {
            size: [5, 4],
            first_rad: [3.13, 0.2],
            cell_rad: [0.01, 0.02],
            radius_m: 3_396_190.0,
            heights_m: heights_m.collect(),
        }
    }

    #[test]
    fn heights_between_cells_are_linear_and_places_come_back() {
        let grid = plane();
        for cell in [[0.0, 0.0], [2.25, 1.5], [3.999, 2.999]] {
            let [longitude_rad, latitude_rad] = grid.place_rad(cell);
            // The other side of the antimeridian, as in files.
            let back = grid.cell_of(wrap_pi(longitude_rad), latitude_rad);
            assert!((back[0] - cell[0]).hypot(back[1] - cell[1]) < 1e-9); // rounding, cells
            let height_m = grid.height_m(cell);
            let expected_m = 10.0 * cell[0] + cell[1];
            assert!(height_m.is_some_and(|height_m| (height_m - expected_m).abs() < 1e-9)); // rounding, metres
        }
        let shifted_m = grid.probed_m(&Probe::at([0.25, 0.5]), [2, 1]);
        assert_eq!(shifted_m, grid.height_m([2.25, 1.5]));
    }

    #[test]
    fn there_is_no_height_outside_or_beside_a_cell_without_one() {
        let mut grid = plane();
        for cell in [
            [-0.1, 1.0],
            [4.1, 1.0],
            [1.0, 3.1],
            [f64::NAN, 0.0],
            [1e300, 0.0],
        ] {
            assert_eq!(grid.height_m(cell), None, "{cell:?}");
        }
        grid.heights_m[5] = f32::NAN;
        assert_eq!(grid.height_m([0.5, 0.5]), None);
        assert!(grid.height_m([2.5, 2.5]).is_some());
    }
}
