//! Heights of the ground between the altimeter's shots, on a map below the images with pixels: the ground of orthoimages where a site
//! requests no terrain model.
//!
//! The surface of the shots is kriged at every cell ([`areograph_geom::surface`]). Cells farther than 3 km from every shot
//! stay empty, because the surface there returns to the mean of its neighbourhood.

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    convert_datum::Converted, ground::Ground, group_profiles::Profile, image_pixels::PixelFiles,
    map_surface::SurfaceModel, mola_surface::MolaShots, oriented::OrientedImage,
    shot_heights::Heights, site_image::SiteImages,
};
use areograph_base::{error::Result, footprints::Footprints, frames::BodyFixed, watch::Watch};
use areograph_config::MolaSurfaceConfig;
use areograph_geom::{
    ellipsoid::{Spherical, on_ellipsoid_m},
    height_grid::HeightGrid,
    surface::SurfaceOptions,
};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

/// Edges of a cell, metres: a third of the distance between shots, and this distance.
const CELL_M: [f64; 2] = [100.0, 300.0];
/// Number of cells below the images above which they become larger: the cost of a height is the square of the number of shots.
const CELLS_MAX: f64 = 20_000.0;
/// Maximum number of cells of the map, most of which may be empty.
const MAP_CELLS_MAX: usize = 4_000_000;
/// Maximum distance of a cell from the nearest shot, metres: the width of an image of the narrow angle.
const REACH_M: f64 = 3_000.0;
/// Heights that are computed between two requests to stop.
const CELLS_AT_ONCE: usize = 1_024;

stage_inputs! {
    /// Images with pixels, and the shots of a site.
    pub struct InterpolateShots<'a> {
        /// The images.
        pub images: SiteImages<'a>,
        /// Their pixels: images without any have no part.
        pub pixels: PixelFiles<'a>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Uncertainties of shots.
        pub laser_surface: &'a MolaSurfaceConfig,
    }
}

/// The ground between shots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShotModel {
    /// Heights and their standard deviations, or the reason why there are none, in words.
    pub model: std::result::Result<SurfaceModel, String>,
}

impl ShotModel {
    /// The model without its cells, which no page shows.
    #[must_use]
    pub fn without_cells(&self) -> Self {
        let model = self.model.as_ref().map(|_| SurfaceModel {
            heights: HeightGrid {
                size: [0; 2],
                first_rad: [0.0; 2],
                cell_rad: [1.0; 2],
                radius_m: 0.0,
                heights_m: Vec::new(),
            },
            parallel_rad: 0.0,
            sigmas_m: Vec::new(),
            pairs: Vec::new(),
        });
        Self {
            model: model.map_err(Clone::clone),
        }
    }
}

impl Stage for InterpolateShots<'_> {
    const NAME: &'static str = "interpolate_shots";
    const METHOD: u32 = 1;
    type Output = ShotModel;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<ShotModel> {
        let watch = Watch::from(stop);
        let footprints = &self.converted.value()?.footprints;
        let oriented = self.images.oriented()?;
        let images = oriented.iter().zip(self.pixels.0);
        let images: Vec<&OrientedImage<'_>> = images
            .filter_map(|(image, pixels)| pixels.as_ref().map(|_| image))
            .collect();
        let options = self.laser_surface.options(footprints.body);
        let below = Below::of(&images, footprints, self.profiles.value()?);
        let model = match below {
            Ok(below) => below.interpolated(footprints, self.profiles.value()?, &options, watch)?,
            Err(reason) => Err(reason),
        };
        Ok(ShotModel { model })
    }
}

/// The cells below images.
struct Below {
    ground: Ground,
    /// Numbers of the cells, row by row, in order, and their middles, body-fixed, metres.
    cells: Vec<(usize, Vector3<f64>)>,
}

impl Below {
    /// Cells below these images; the reason why there are none, in words.
    fn of(
        images: &[&OrientedImage<'_>],
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
    ) -> std::result::Result<Self, String> {
        let heights = Heights::of(footprints, profiles);
        let body = footprints.body;
        let coarse_m = CELL_M[1];
        let coarse = places_m(images, &heights, coarse_m);
        let map = Ground::over(body, &coarse, coarse_m).ok_or("no image shows the ground")?;
        let count = covered(&map, &coarse)?.len() as f64;
        if count > CELLS_MAX {
            let area_km2 = |cells: f64| cells * (coarse_m / 1e3).powi(2);
            return Err(format!(
                "the images cover {:.0} km²; expected at most {:.0}",
                area_km2(count),
                area_km2(CELLS_MAX)
            ));
        }
        let cell_m = (coarse_m * (count / CELLS_MAX).sqrt()).max(CELL_M[0]);
        let places_m = places_m(images, &heights, cell_m);
        let ground = Ground::over(body, &places_m, cell_m).ok_or("no image shows the ground")?;
        let columns = ground.size[1];
        let cells = covered(&ground, &places_m)?.into_iter().map(|at| {
            let cell = [(at / columns) as f64, (at % columns) as f64];
            (at, ground.place_m(cell, 0.0))
        });
        let cells = cells.collect();
        Ok(Self { ground, cells })
    }

    /// Their heights, or the reason why there are none.
    ///
    /// # Errors
    /// A stop.
    fn interpolated(
        &self,
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
        options: &SurfaceOptions,
        watch: Watch<'_>,
    ) -> Result<std::result::Result<SurfaceModel, String>> {
        let middles_m: Vec<Vector3<f64>> =
            self.cells.iter().map(|(_, middle_m)| *middle_m).collect();
        let shots = MolaShots::of(footprints, profiles, options);
        let surface = match shots.surface(&middles_m, options) {
            Ok(surface) => surface,
            Err(error) => return Ok(Err(error.to_string())),
        };
        let model = options.body.model();
        let none = || vec![f32::NAN; self.ground.cells()];
        let (mut heights_m, mut sigmas_m) = (none(), none());
        let mut is_empty = true;
        for cells in self.cells.chunks(CELLS_AT_ONCE) {
            watch.check()?;
            let middles_m: Vec<Vector3<f64>> =
                cells.iter().map(|(_, middle_m)| *middle_m).collect();
            for ((at, middle_m), found) in cells.iter().zip(surface.predict_each(&middles_m)) {
                if found.nearest_m > REACH_M {
                    continue;
                }
                // Heights of the surface are above the ellipsoid, and those of the map above its sphere.
                let ellipsoid_m = on_ellipsoid_m(model, middle_m).norm() - self.ground.radius_m;
                #[allow(
                    clippy::cast_possible_truncation,
                    reason = "heights keep millimetres in seven digits"
                )]
                {
                    heights_m[*at] = (found.height_m + ellipsoid_m) as f32;
                    sigmas_m[*at] = found.sigma_m as f32;
                }
                is_empty = false;
            }
        }
        if is_empty {
            let reach_km = REACH_M / 1e3;
            return Ok(Err(format!(
                "no shot is within {reach_km} km of the images"
            )));
        }
        Ok(Ok(SurfaceModel {
            heights: self.ground.height_grid(heights_m),
            parallel_rad: self.ground.parallel_rad,
            sigmas_m,
            pairs: Vec::new(),
        }))
    }
}

/// Ground points of the images, body-fixed, metres, at most about this far apart.
fn places_m(images: &[&OrientedImage<'_>], heights: &Heights, apart_m: f64) -> Vec<Vector3<f64>> {
    let mut places_m = Vec::new();
    for image in images {
        let camera = image.oriented_camera();
        let start_m = camera.orientation.pose(0.0).position_m;
        let radius_m = heights.near(&start_m).radius_m;
        let place_m = |line: f64, sample: f64| camera.on_sphere_m(line, sample, radius_m);
        let [lines, samples] = [image.image.lines_delivered, image.image.samples].map(f64::from);
        let (Some(first_m), Some(along_m), Some(across_m)) = (
            place_m(0.0, 0.0),
            place_m(lines, 0.0),
            place_m(0.0, samples),
        ) else {
            continue;
        };
        let count = |to_m: &Vector3<f64>| ((to_m - first_m).norm() / apart_m).ceil().max(1.0);
        let [rows, columns] = [&along_m, &across_m].map(count);
        let steps = |count: f64| {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a number of cells along an image"
            )]
            let count = count as u32;
            (0..=count).map(move |at| f64::from(at) / f64::from(count))
        };
        for line in steps(rows) {
            // Heights change little over a line of cells.
            let middle_m = place_m(line * lines, 0.5 * samples);
            let radius_m = middle_m.map_or(radius_m, |place_m| heights.near(&place_m).radius_m);
            let places = steps(columns)
                .filter_map(|sample| camera.on_sphere_m(line * lines, sample * samples, radius_m));
            places_m.extend(places);
        }
    }
    places_m
}

/// Numbers of the cells at these places and of their neighbours, in order.
fn covered(ground: &Ground, places_m: &[Vector3<f64>]) -> std::result::Result<Vec<usize>, String> {
    let cells = ground.size[0].saturating_mul(ground.size[1]);
    if cells > MAP_CELLS_MAX {
        return Err("the images lie too far apart for one map; divide the site".to_owned());
    }
    let grid = ground.height_grid(Vec::new());
    let mut is_covered = vec![false; cells];
    let [rows, columns] = ground.size;
    for place_m in places_m {
        let place = Spherical::from_xyz_m(place_m);
        let [row, column] = grid.cell_of(place.longitude_rad, place.latitude.0);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the ground lies over all places"
        )]
        let near = |at: f64, count: usize| {
            let middle = at.round().max(0.0) as usize;
            middle.saturating_sub(2)..(middle + 3).min(count)
        };
        for row in near(row, rows) {
            is_covered[row * columns..][near(column, columns)].fill(true);
        }
    }
    let found = is_covered.iter().enumerate().filter(|(_, is_it)| **is_it);
    Ok(found.map(|(at, _)| at).collect())
}
