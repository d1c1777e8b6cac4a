//! Many windows at once: a grid of cells of one degree, each with the windows that a small cap about any of its
//! directions may touch.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::{Bounds, Cap, Extent, Region};
use areograph_base::units::RADIANS_PER_DEGREE;

/// Side of a cell, radians.
const CELL_RAD: f64 = RADIANS_PER_DEGREE;
const ROWS: usize = 180;
const COLUMNS: usize = 360;
/// A window in more cells than its share of this many, and in more than `CELLS_MIN`, is tested for every direction
/// instead, so that memory stays bounded.
const ENTRIES_MAX: usize = 1 << 22;
const CELLS_MIN: usize = 1_024;
/// Cells are widened by this, radians: far above the rounding of the tests, far below a cell.
const ROUNDING_RAD: f64 = 1e-6;
/// Maximum radius of caps that cells cover, degrees: half a frame of 2 s and the parallax of its relief. Towards the
/// poles, half a frame's change in longitude grows as the parallels shorten.
const CAP_DEG: f64 = 0.25;
const CAP_ON_PARALLEL_DEG: f64 = 0.09;

/// Windows in order, prepared for searches by direction.
///
/// A cell has the windows that a cap about *some* direction in it touches; each of them is then tested. So no window is
/// lost for any cap: for those larger than cells every window is tested.
#[derive(Debug, Clone)]
pub struct WindowGrid {
    regions: Vec<Region>,
    /// Largest cap that cells of a row cover, radians.
    caps_rad: Vec<f64>,
    /// Start of the windows of each cell in `windows`, row by row, and end of the windows of the last cell.
    starts: Vec<u32>,
    windows: Vec<u32>,
    /// Windows of very many cells.
    wide: Vec<u32>,
}

impl WindowGrid {
    /// The grid of these windows, for caps larger by `margin_rad` than frames.
    #[must_use]
    pub fn new(regions: Vec<Region>, margin_rad: f64) -> Self {
        let caps_rad: Vec<f64> = (0..ROWS)
            .map(|row| {
                let [south, north] = row_edges_rad(row);
                let parallel = south.abs().max(north.abs()).cos().max(CELL_RAD.sin());
                margin_rad + (CAP_DEG + CAP_ON_PARALLEL_DEG / parallel) * RADIANS_PER_DEGREE
            })
            .collect();
        let cells_max = (ENTRIES_MAX / regions.len().max(1)).max(CELLS_MIN);
        let (mut wide, mut entries) = (Vec::new(), Vec::new());
        for (window, region) in (0_u32..).zip(&regions) {
            let cells = cells_of(region, &caps_rad);
            if cells.len() > cells_max {
                wide.push(window);
            } else {
                entries.extend(cells.into_iter().map(|cell| (cell, window)));
            }
        }
        entries.sort_unstable();
        let mut starts = vec![0; ROWS * COLUMNS + 1];
        for (cell, _) in &entries {
            starts[*cell as usize + 1] += 1;
        }
        for cell in 0..ROWS * COLUMNS {
            starts[cell + 1] += starts[cell];
        }
        Self {
            regions,
            caps_rad,
            starts,
            windows: entries.into_iter().map(|(_, window)| window).collect(),
            wide,
        }
    }

    /// Number of windows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.regions.len()
    }

    /// Whether there are no windows.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.regions.is_empty()
    }

    /// Whether a window lies within `margin_rad` of the direction; see [`Region::may_contain_within`].
    #[must_use]
    pub fn any_within(&self, longitude_rad: f64, latitude_rad: f64, margin_rad: f64) -> bool {
        let cell = self.cell(longitude_rad, latitude_rad, margin_rad);
        // Most frames of an archive are far from all windows.
        if cell.is_some_and(<[_]>::is_empty) && self.wide.is_empty() {
            return false;
        }
        let cap = Cap::new(longitude_rad, latitude_rad, margin_rad);
        match cell {
            None => self.regions.iter().any(|region| region.may_touch(&cap)),
            Some(cell) => {
                let mut windows = cell.iter().chain(&self.wide);
                windows.any(|window| self.regions[*window as usize].may_touch(&cap))
            }
        }
    }

    /// Puts into `near`, in ascending order, the windows that lie within `margin_rad` of the direction.
    pub fn within(
        &self,
        longitude_rad: f64,
        latitude_rad: f64,
        margin_rad: f64,
        near: &mut Vec<u32>,
    ) {
        near.clear();
        match self.cell(longitude_rad, latitude_rad, margin_rad) {
            None => near.extend((0..).zip(&self.regions).map(|(window, _)| window)),
            Some(cell) => {
                near.extend(cell);
                near.extend(&self.wide);
                near.sort_unstable();
            }
        }
        if near.is_empty() {
            return;
        }
        let cap = Cap::new(longitude_rad, latitude_rad, margin_rad);
        near.retain(|window| self.regions[*window as usize].may_touch(&cap));
    }

    /// Whether window `window` contains the direction.
    #[must_use]
    pub fn holds(&self, window: u32, longitude_rad: f64, latitude_rad: f64) -> bool {
        self.regions[window as usize].contains(longitude_rad, latitude_rad)
    }

    /// Whether a window may lie within reach of the extent.
    #[must_use]
    pub fn meets(&self, extent: &Extent) -> bool {
        self.regions.iter().any(|region| region.meets(extent))
    }

    /// The windows of the direction's cell; `None` when all of them have to be tested.
    fn cell(&self, longitude_rad: f64, latitude_rad: f64, margin_rad: f64) -> Option<&[u32]> {
        let row = row_of(latitude_rad)?;
        // Written so that a NaN margin tests them all.
        if !(margin_rad <= self.caps_rad[row]) {
            return None;
        }
        let turns = longitude_rad / TAU;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to 360; NaN becomes 0, and the margin was checked above"
        )]
        let column = ((turns - turns.floor()) * COLUMNS as f64) as usize;
        let cell = row * COLUMNS + column.min(COLUMNS - 1);
        self.windows
            .get(self.starts[cell] as usize..self.starts[cell + 1] as usize)
    }
}

/// The row of a latitude; `None` beyond a pole.
fn row_of(latitude_rad: f64) -> Option<usize> {
    let rows = (latitude_rad + FRAC_PI_2) / CELL_RAD;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 180"
    )]
    (0.0..=ROWS as f64)
        .contains(&rows)
        .then(|| (rows as usize).min(ROWS - 1))
}

/// South and north edge of a row, radians.
fn row_edges_rad(row: usize) -> [f64; 2] {
    [row, row + 1].map(|edge| edge as f64 * CELL_RAD - FRAC_PI_2)
}

/// The cells with a direction that is no farther from the region than the cap of its row.
fn cells_of(region: &Region, caps_rad: &[f64]) -> Vec<u32> {
    let mut cells = Vec::new();
    for (row, cap_rad) in caps_rad.iter().enumerate() {
        for piece in &region.pieces {
            let columns = columns_of(piece.bounds(), row_edges_rad(row), cap_rad + ROUNDING_RAD);
            cells.extend(columns.map(|column| u32::try_from(row * COLUMNS + column).unwrap_or(0)));
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// The columns of a row from which caps of radius `cap_rad` may extend to the bounds.
fn columns_of(
    bounds: &Bounds,
    [south, north]: [f64; 2],
    cap_rad: f64,
) -> impl Iterator<Item = usize> + use<> {
    let apart = north + cap_rad < bounds.south || south - cap_rad > bounds.north;
    let half_width_rad = super::half_width_rad(south.abs().max(north.abs()), cap_rad);
    let (first, count) = match half_width_rad {
        _ if apart => (0, 0),
        None => (0, COLUMNS),
        Some(half_width_rad) => {
            let first = ((bounds.west - half_width_rad - ROUNDING_RAD) / CELL_RAD).floor();
            let last = ((bounds.east + half_width_rad + ROUNDING_RAD) / CELL_RAD).floor();
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "columns of a few turns"
            )]
            {
                let first_column = first.rem_euclid(COLUMNS as f64) as usize;
                (first_column, ((last - first) as usize + 1).min(COLUMNS))
            }
        }
    };
    (first..first + count).map(|column| column % COLUMNS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::WindowShape;
    use proptest::prelude::*;

    fn shape() -> impl Strategy<Value = WindowShape> {
        let measures = (
            -360.0..360.0_f64,
            0.01..359.0_f64,
            -90.0..90.0_f64,
            0.0..1.0_f64,
            0..4,
        );
        measures.prop_map(|(west, width, south, share, kind)| {
            let radians = RADIANS_PER_DEGREE;
            // Small windows as well as ones half round Mars.
            let width = if kind < 2 { 0.02 * width } else { width };
            let north = south + share * (90.0 - south) * if kind < 2 { 0.05 } else { 1.0 };
            if kind == 1 {
                let ring = [[west, south], [west + width, south], [west, north]];
                return WindowShape::Polygons {
                    polygons: vec![vec![ring.map(|v| v.map(|a| a * radians)).to_vec()]],
                };
            }
            let all_round = kind == 3;
            let wrapped = |degrees: f64| degrees.rem_euclid(360.0) * radians;
            WindowShape::Box {
                west_rad: if all_round { 0.0 } else { wrapped(west) },
                east_rad: if all_round {
                    TAU
                } else {
                    wrapped(west + width)
                },
                south_rad: south * radians,
                north_rad: north * radians,
            }
        })
    }

    proptest! {
        #[test]
        fn the_grid_says_what_every_window_says(
            shapes in proptest::collection::vec(shape(), 0..40),
            directions in proptest::collection::vec(
                (-400.0..400.0_f64, -90.0..90.0_f64, 0.0..3.0_f64, any::<bool>()), 200),
            margin_deg in 0.0..0.4_f64,
        ) {
            let regions: Vec<Region> = shapes.iter().map(Region::new).collect();
            let grid = WindowGrid::new(regions.clone(), margin_deg * RADIANS_PER_DEGREE);
            let mut near = Vec::new();
            for (longitude, latitude, reach, at_edge) in directions {
                // Edges of cells are where rounding would lose a window.
                let (longitude, latitude) =
                    if at_edge { (longitude.round(), latitude.round()) } else { (longitude, latitude) };
                let [longitude, latitude, reach] =
                    [longitude, latitude, reach * reach * reach].map(|angle| angle * RADIANS_PER_DEGREE);
                let expected: Vec<u32> = (0..).zip(&regions)
                    .filter(|(_, region)| region.may_contain_within(longitude, latitude, reach))
                    .map(|(window, _)| window)
                    .collect();
                grid.within(longitude, latitude, reach, &mut near);
                prop_assert_eq!(&near, &expected);
                prop_assert_eq!(grid.any_within(longitude, latitude, reach), !expected.is_empty());
            }
        }
    }

    #[test]
    fn poles_and_directions_that_are_none_ask_every_window() {
        let cap = WindowShape::Box {
            west_rad: 0.0,
            east_rad: TAU,
            south_rad: 89.0 * RADIANS_PER_DEGREE,
            north_rad: FRAC_PI_2,
        };
        let grid = WindowGrid::new(vec![Region::new(&cap)], 0.0);
        assert!(grid.any_within(1.0, FRAC_PI_2, 0.0) && !grid.any_within(1.0, -FRAC_PI_2, 0.0));
        assert!(grid.cell(1.0, 0.0, f64::NAN).is_none() && grid.cell(1.0, 2.0, 0.0).is_none());
    }
}
