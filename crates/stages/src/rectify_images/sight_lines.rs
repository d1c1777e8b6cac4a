//! Rays from the cells of a terrain model to the camera: which cells the image shows, and by how much a height displaces them.

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::{image_view::View, map_surface::SurfaceModel};
use areograph_geom::{
    ellipsoid::{local_axes, spherical_to_xyz_m},
    height_grid::HeightGrid,
    statistics::median,
};

/// Horizontal displacement for a metre of height below which nothing can be hidden.
const STEEP: f64 = 1e-3;

/// A cell inside an image.
#[derive(Debug, Clone, Copy)]
struct Ray {
    /// Horizontal displacement for an error of a metre in the height, metres.
    displacement: f64,
    is_hidden: bool,
    /// Edge of a pixel of the image, and of the focal plane, on the ground, metres.
    pixels_m: [f64; 2],
}

/// Rays of all cells of a terrain model.
pub(super) struct SightLines {
    /// Row by row; `None` for cells without a height or outside the image.
    rays: Vec<Option<Ray>>,
    /// Heights of the cells that the image shows, NaN elsewhere.
    pub(super) shown: HeightGrid,
    /// Median edge of a pixel of the image on the ground, metres.
    pub(super) pixel_m: f64,
    /// Median edge of a pixel of the focal plane on the ground, metres: lines may be farther apart.
    pub(super) focal_pixel_m: f64,
    /// Median radius of the cells inside the image, metres.
    pub(super) radius_m: f64,
}

impl SightLines {
    /// `None` where the image shows no cell.
    pub(super) fn of(view: &View<'_>, model: &SurfaceModel) -> Option<Self> {
        let grid = &model.heights;
        let highest_m = grid.heights_m.iter().copied().fold(f32::MIN, f32::max);
        let columns = grid.size[1];
        let rays = (0..grid.heights_m.len()).into_par_iter();
        let rays: Vec<Option<Ray>> = rays
            .map(|at| {
                ray(
                    view,
                    grid,
                    [at / columns, at % columns],
                    f64::from(highest_m),
                )
            })
            .collect();
        rays.iter().flatten().next()?;
        let [pixel_m, focal_pixel_m] = [0, 1].map(|of| {
            let edges_m = rays.iter().flatten().map(|ray| ray.pixels_m[of]);
            median(&mut edges_m.collect::<Vec<f64>>())
        });
        let seen = grid.heights_m.iter().zip(&rays);
        let seen = seen.filter(|(_, ray)| ray.is_some());
        let mut heights_m: Vec<f64> = seen.map(|(height_m, _)| f64::from(*height_m)).collect();
        let radius_m = grid.radius_m + median(&mut heights_m);
        let heights = grid.heights_m.iter().zip(&rays);
        let heights_m = heights.map(|(height_m, ray)| match ray {
            Some(ray) if !ray.is_hidden => *height_m,
            _ => f32::NAN,
        });
        Some(Self {
            shown: HeightGrid {
                heights_m: heights_m.collect(),
                ..grid.clone()
            },
            rays,
            pixel_m,
            focal_pixel_m,
            radius_m,
        })
    }

    /// Number of cells inside the image.
    pub(super) fn seen(&self) -> usize {
        self.rays.iter().flatten().count()
    }

    /// Number of cells inside the image that relief hides.
    pub(super) fn hidden(&self) -> usize {
        self.rays
            .iter()
            .flatten()
            .filter(|ray| ray.is_hidden)
            .count()
    }

    /// Standard deviations of the horizontal position by heights with these standard deviations and by the orientation,
    /// metres; NaN in cells that the image does not show.
    pub(super) fn sigmas_m(&self, heights_m: &[f32], of_orientation_m: f64) -> Vec<f32> {
        let cells = self.rays.iter().zip(heights_m);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "a standard deviation needs at most seven digits"
        )]
        let sigma_m = |(ray, height_m): (&Option<Ray>, &f32)| match ray {
            Some(ray) if !ray.is_hidden => {
                (ray.displacement * f64::from(*height_m)).hypot(of_orientation_m) as f32
            }
            _ => f32::NAN,
        };
        cells.map(sigma_m).collect()
    }
}

/// The ray of the cell at a row and column.
fn ray(view: &View<'_>, grid: &HeightGrid, cell: [usize; 2], highest_m: f64) -> Option<Ray> {
    let cell = cell.map(|of| of as f64);
    let height_m = f64::from(grid.heights_m[cell_index(grid, cell)?]);
    if height_m.is_nan() {
        return None;
    }
    let ground_m = |cell: [f64; 2]| {
        let [longitude_rad, latitude_rad] = grid.place_rad(cell);
        spherical_to_xyz_m(longitude_rad, latitude_rad, grid.radius_m + height_m)
    };
    let here_m = ground_m(cell);
    let place = view.place(&here_m)?;
    if !view.holds(&place) {
        return None;
    }
    let beside = view.place(&ground_m([cell[0], cell[1] + 1.0]))? - place;
    let below = view.place(&ground_m([cell[0] + 1.0, cell[1]]))? - place;
    let [east_m, north_m] = grid.cell_m();
    let (x_lines, _) = view.camera.focal_plane_coordinates(place.x, place.y);
    let to_camera_m = view.camera.orientation.pose(x_lines).position_m - here_m;
    let towards_m = local_axes(&here_m) * to_camera_m;
    let displacement = towards_m.xy().norm() / towards_m.z;
    let direction = towards_m.xy().try_normalize(0.0).unwrap_or_default();
    // Rows count southwards.
    let cells_per_m = Vector2::new(-direction.y / north_m, direction.x / east_m);
    let is_above = |step: u32| {
        let away_m = f64::from(step) * north_m;
        let at = cells_per_m * away_m;
        let ground_m = grid.height_m([cell[0] + at.x, cell[1] + at.y]);
        ground_m.is_some_and(|ground_m| ground_m > height_m + away_m / displacement)
    };
    Some(Ray {
        displacement,
        is_hidden: (1..=steps(displacement, highest_m - height_m, north_m)).any(is_above),
        pixels_m: [
            (east_m * north_m / beside.perp(&below).abs()).sqrt(),
            towards_m.norm_squared() / towards_m.z / view.camera.detector.focal_length_px,
        ],
    })
}

/// Number of cells after which a ray is above the highest ground.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast from floating point saturates far beyond the edge of the grid"
)]
fn steps(displacement: f64, climb_m: f64, cell_m: f64) -> u32 {
    if displacement > STEEP {
        (climb_m * displacement / cell_m) as u32
    } else {
        0
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "integer coordinates of a grid"
)]
fn cell_index(grid: &HeightGrid, [row, column]: [f64; 2]) -> Option<usize> {
    let at = row as usize * grid.size[1] + column as usize;
    (at < grid.heights_m.len()).then_some(at)
}
