//! Ground cells of a terrain model or an orthoimage, at full and repeatedly halved resolution, and their image coordinates.

mod field;
mod sight;

pub(crate) use field::Field;
pub(crate) use sight::{Sight, Tile};

use nalgebra::Vector3;

use areograph_base::{
    body::Body,
    units::{RADIANS_PER_DEGREE, wrap_pi},
};
use areograph_geom::{
    ellipsoid::{Spherical, spherical_to_xyz_m},
    height_grid::HeightGrid,
};

/// Cells beyond the expected common ground, on every side: heights shift it.
const BEYOND: f64 = 2.0;
/// Largest latitude of the parallel of the map, degrees.
const PARALLEL_MAX_DEG: f64 = 80.0;

/// Cells with even longitudes and latitudes, square at the parallel of the map.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ground {
    /// The sphere of the body's maps, metres; heights refer to it.
    pub(crate) radius_m: f64,
    /// Latitude at which cells are as wide as high.
    pub(crate) parallel_rad: f64,
    /// Edge of a cell at the parallel, metres.
    pub(crate) cell_m: f64,
    /// Rows and columns.
    pub(crate) size: [usize; 2],
    /// Western and northern edge, cells from 0° E 0° N.
    west: f64,
    north: f64,
}

impl Ground {
    /// Cells of this edge over all `places_m`, body-fixed; edges lie at whole cells, so that models of one parallel fit each
    /// other. `None` without a place.
    pub(crate) fn over(body: Body, places_m: &[Vector3<f64>], cell_m: f64) -> Option<Self> {
        let middle = Spherical::from_xyz_m(&places_m.iter().sum());
        let degrees = (middle.latitude.0 / RADIANS_PER_DEGREE).round();
        let parallel_rad = degrees.clamp(-PARALLEL_MAX_DEG, PARALLEL_MAX_DEG) * RADIANS_PER_DEGREE;
        let middle_rad = [wrap_pi(middle.longitude_rad), parallel_rad];
        Self::over_at(middle_rad, body.map().radius_m, places_m, cell_m)
    }

    /// As [`Self::over`], on the map of a sphere whose cells are square at `parallel_rad`, with longitudes within half a turn of
    /// `middle_rad`.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of cells that the caller compares with a limit; a cast saturates"
    )]
    pub(crate) fn over_at(
        [middle_rad, parallel_rad]: [f64; 2],
        radius_m: f64,
        places_m: &[Vector3<f64>],
        cell_m: f64,
    ) -> Option<Self> {
        let mut edges = [f64::INFINITY, f64::INFINITY, -f64::INFINITY, -f64::INFINITY];
        for place_m in places_m {
            let place = Spherical::from_xyz_m(place_m);
            let longitude_rad = middle_rad + wrap_pi(place.longitude_rad - middle_rad);
            let x = longitude_rad * parallel_rad.cos() * radius_m / cell_m;
            let y = place.latitude.0 * radius_m / cell_m;
            edges = [
                edges[0].min(x),
                edges[1].min(y),
                edges[2].max(x),
                edges[3].max(y),
            ];
        }
        let [west, south] = [edges[0], edges[1]].map(|edge| edge.floor() - BEYOND);
        let [east, north] = [edges[2], edges[3]].map(|edge| edge.ceil() + BEYOND);
        (!places_m.is_empty()).then_some(Self {
            radius_m,
            parallel_rad,
            cell_m,
            size: [(north - south) as usize, (east - west) as usize],
            west,
            north,
        })
    }

    /// The ground after `times` halvings of its resolution.
    pub(crate) fn halved(&self, times: usize) -> Self {
        let factor = 1_usize << times;
        Self {
            cell_m: self.cell_m * factor as f64,
            size: self.size.map(|size| size.div_ceil(factor)),
            west: self.west / factor as f64,
            north: self.north / factor as f64,
            ..self.clone()
        }
    }

    /// Number of cells.
    pub(crate) const fn cells(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The place at this height above the sphere at a row and column, 0 in the middle of the first cell; body-fixed,
    /// metres.
    pub(crate) fn place_m(&self, [row, column]: [f64; 2], height_m: f64) -> Vector3<f64> {
        let cell_rad = self.cell_m / self.radius_m;
        let longitude_rad = (self.west + column + 0.5) * cell_rad / self.parallel_rad.cos();
        let latitude_rad = (self.north - row - 0.5) * cell_rad;
        spherical_to_xyz_m(longitude_rad, latitude_rad, self.radius_m + height_m)
    }

    /// Heights of all cells, metres above the sphere, row by row; NaN where there is none.
    pub(crate) fn height_grid(&self, heights_m: Vec<f32>) -> HeightGrid {
        let north_rad = self.cell_m / self.radius_m;
        let east_rad = north_rad / self.parallel_rad.cos();
        HeightGrid {
            size: self.size,
            first_rad: [(self.west + 0.5) * east_rad, (self.north - 0.5) * north_rad],
            cell_rad: [east_rad, north_rad],
            radius_m: self.radius_m,
            heights_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_their_places_also_across_the_antimeridian() {
        let places_m = [-0.002, 0.001]
            .map(|east_rad| spherical_to_xyz_m(std::f64::consts::PI + east_rad, -0.3, 3_390_000.0));
        let ground = Ground::over(Body::Mars, &places_m, 20.0).unwrap();
        let grid = ground.height_grid(vec![0.0; ground.cells()]);
        // 3 mrad at 17° S, and the cells beyond.
        let columns = 0.003 * ground.radius_m * ground.parallel_rad.cos() / 20.0;
        assert!((ground.size[1] as f64 - columns).abs() <= 6.0);
        for place_m in places_m {
            let place = Spherical::from_xyz_m(&place_m);
            let cell = grid.cell_of(place.longitude_rad, place.latitude.0);
            let again_m = ground.place_m(cell, place_m.norm() - ground.radius_m);
            assert!((again_m - place_m).norm() < 1e-6); // rounding of 3.4e6 m, metres
            assert!((0.0..ground.size[1] as f64).contains(&cell[1]));
        }
        // The first cell of a halved grid lies over four cells of the full one.
        let first_m = ground.halved(1).place_m([0.0, 0.0], 0.0);
        assert!((first_m - ground.place_m([0.5, 0.5], 0.0)).norm() < 1e-6);
    }
}
