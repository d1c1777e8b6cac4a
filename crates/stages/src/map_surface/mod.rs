//! A terrain model of a pair of images, cell by cell.
//!
//! Both images are laid on the ground as it is known so far, from coarse to fine: where they differ, the ground is
//! higher or lower. Since each cell is compared along its vertical, the comparison follows the epipolar curves of any
//! camera. Heights are searched by correlation, then refined by least squares with either image as the template; a
//! height that does not correlate, differs in the two directions or is contradicted by its neighbours is a hole. The
//! altimeter validates the result.
//!
//! Both images are resampled at every halving of the cells, so that the epipolar curves of the camera need not be
//! known; their difference is height along the parallax, and orientation across it. A thread holds tiles of at most 240
//! samples and the margin of the comparison; all cells are in memory, at most 2²⁴. Every tile sees the complete result
//! of the previous step, so that there are no seams and the number of threads changes no byte. Standard deviations
//! result from the matching; the common part of all heights is stated separately, by the adjustment.

mod common;
mod compare;
mod jitter;
mod level;
mod levels;
mod lines;
mod pair;
mod result;
mod search;
mod seen;
mod settle;
mod sums;
mod tidy;

#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use self::{
    common::Common,
    jitter::{JitterAndSmoothing, Sizes},
    levels::all_levels,
};
use super::{
    adjust::Adjusted, convert_datum::Converted, group_profiles::Profile, image_pixels::PixelFiles,
    image_view::View, shot_heights::Heights, site_image::SiteImages, tag_times::ImageTimes,
};
use areograph_base::{
    body::Body,
    error::{Cause, Result},
    ties::Unmatched,
    watch::Watch,
};
use areograph_config::MolaSurfaceConfig;
use areograph_geom::pushbroom::Unseen;
use areograph_store::{
    stage::{Input, Inputs, Output, Stage},
    stage_inputs,
};

pub use lines::{LinesToMap, MapLines, map_lines};
pub use result::{
    JoinedPair, Joint, ProfileOnSurface, SHOTS_MIN, Seam, ShotComparison, ShotOnSurface, Surface,
    SurfaceAccount, SurfaceLook, SurfaceModel,
};

/// Smallest share of searched cells that must be found for the result to be significant: chance finds one in a few
/// hundred.
const FOUND_SHARE_MIN: f64 = 0.1;
/// Cells along the longer side of the model on a page.
pub(crate) const LOOK: usize = 480;

stage_inputs! {
    /// Images with their best orientation and their pixels, known heights, and the configuration.
    pub struct MapSurface<'a> {
        /// The images.
        pub images: SiteImages<'a>,
        /// Their pixels.
        pub pixels: PixelFiles<'a>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Edge of a cell, metres.
        pub cell_m: &'a f64,
        /// Identifiers of the two images, where they are named.
        pub pair: &'a Option<[String; 2]>,
        /// Whether it is one of all pairs of the site, so that it may have nothing in common.
        pub is_of_all: &'a bool,
        /// Uncertainties of shots.
        pub laser_surface: &'a MolaSurfaceConfig,
        /// The adjustment that gave the images their orientation.
        pub adjusted: AdjustmentOfImages<'a>,
        /// Largest common error of heights from the images, metres.
        pub off_m: &'a f64,
    }
}

/// The adjustment, where there is one.
#[derive(Debug)]
pub struct AdjustmentOfImages<'a>(pub Option<&'a Output<Adjusted>>);

impl Input for AdjustmentOfImages<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        if let Some(adjusted) = self.0 {
            adjusted.add_to(field, inputs);
        }
    }
}

/// No surface can be made.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum SurfaceError {
    #[error("image {image} shows no ground according to its orientation: {unseen}")]
    #[cause("check the kernels and times of the image")]
    Unseen { image: String, unseen: Unseen },
    #[error(
        "{found} images have pixels; expected two, or the identifiers of two images in surface.images"
    )]
    #[cause("name two images with images.pixels in surface.images")]
    NotTwo { found: usize },
}

/// Result of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Found {
    /// Above the sphere, metres.
    height_m: f64,
    /// Standard deviation of the height from the match, metres.
    sigma_m: f64,
    /// Offset of the second image across the parallax, samples of the ground.
    aside: f64,
    correlation: f64,
}

/// A cell; `None` where not both images show it.
type Cell = Option<std::result::Result<Found, Unmatched>>;

impl Stage for MapSurface<'_> {
    const NAME: &'static str = "map_surface";
    const METHOD: u32 = 7;
    type Output = Surface;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        let pair = self.pair.as_ref().filter(|_| *self.is_of_all);
        pair.map(|pair| pair.join("/"))
    }

    fn run(&self, stop: &AtomicBool) -> Result<Surface> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Surface> {
        let oriented = self.images.oriented()?;
        let times = self.images.0.iter().map(|image| image.times.value());
        let times: Vec<&ImageTimes> = times.collect::<Result<_>>()?;
        let pair = self.pair(&times)?;
        let adjusted = self.adjusted.0.map(Output::value).transpose()?;
        let withheld = || Ok(Surface::withheld([pair[0], pair[1]], *self.cell_m));
        let is_tied = |image: &usize| adjusted.is_none_or(|of| of.is_tied(*image));
        // The error of an image without tie points is not that of the adjustment, and would displace all pairs.
        if *self.is_of_all && !pair.iter().all(is_tied) {
            return withheld();
        }
        let pixels = self.pixels.decoded_among(&times, &pair)?;
        let mut views = Vec::new();
        for &index in &pair {
            if let Some(pixels) = &pixels[index] {
                match View::of(&oriented[index], pixels) {
                    Ok(view) => views.push((index, view)),
                    Err(_) if *self.is_of_all => return withheld(),
                    Err(unseen) => {
                        let image = times[index].id.clone();
                        return Err(SurfaceError::Unseen { image, unseen }.into());
                    }
                }
            }
        }
        let [(first, one), (second, other)] = &views[..] else {
            return Err(SurfaceError::NotTwo { found: views.len() }.into());
        };
        let footprints = &self.converted.value()?.footprints;
        let profiles = self.profiles.value()?;
        let heights = Heights::of(footprints, profiles);
        let options = Options {
            body: footprints.body,
            cell_m: *self.cell_m,
            off_m: *self.off_m,
        };
        let common = Common::of([one, other], options.body, &heights, options.cell_m);
        let common = match common {
            Err(_) if *self.is_of_all => return withheld(),
            common => common?,
        };
        let mut surface = of_ground(&common, [one, other], &heights, &options, watch)?;
        let account = &mut surface.account;
        account.images = [*first, *second];
        let of_heights = adjusted.and_then(|adjusted| adjusted.heights.as_ref());
        account.common_sigma_m = of_heights.map(|of| of.mean_sigma_m[2]);
        account.shots_take_part = of_heights.is_some();
        account.reference = surface.model.reference(footprints);
        let shots = self.laser_surface.options(footprints.body);
        account.shots = ShotComparison::of(&surface.model, footprints, profiles, &shots);
        Ok(surface)
    }
}

impl MapSurface<'_> {
    /// Indices of the two images: the named ones, or those with pixels.
    fn pair(&self, times: &[&ImageTimes]) -> Result<Vec<usize>> {
        let images = times.iter().enumerate();
        let pair: Vec<usize> = match self.pair {
            Some(named) => {
                let place = |id: &String| times.iter().position(|time| time.id == *id);
                named.iter().filter_map(place).collect()
            }
            None => images
                .filter(|(index, _)| self.pixels.0[*index].is_some())
                .map(|(index, _)| index)
                .collect(),
        };
        if pair.len() == 2 {
            return Ok(pair);
        }
        Err(SurfaceError::NotTwo { found: pair.len() }.into())
    }
}

/// Options of a terrain model.
struct Options {
    body: Body,
    /// Edge of a cell, metres.
    cell_m: f64,
    /// Largest common error of heights from the images, metres.
    off_m: f64,
}

/// The surface of a pair, without statistics of shots or adjustment.
fn map_surface(
    views: [&View<'_>; 2],
    heights: &Heights,
    options: &Options,
    watch: Watch<'_>,
) -> Result<Surface> {
    let common = Common::of(views, options.body, heights, options.cell_m)?;
    of_ground(&common, views, heights, options, watch)
}

/// The surface of a pair on its common ground.
fn of_ground(
    common: &Common,
    views: [&View<'_>; 2],
    heights: &Heights,
    options: &Options,
    watch: Watch<'_>,
) -> Result<Surface> {
    let cells = all_levels(common, views, heights, options.off_m, watch)?;
    Ok(surface_of(common, &cells))
}

/// The model of all cells, and its statistics.
fn surface_of(common: &Common, cells: &[Cell]) -> Surface {
    let mut unfilled = BTreeMap::new();
    let (mut found, mut count) = (Vec::new(), 0);
    for cell in cells.iter().flatten() {
        count += 1;
        match cell {
            Ok(cell) => found.push(cell),
            Err(why) => *unfilled.entry(*why).or_insert(0) += 1,
        }
    }
    let median = |of: fn(&Found) -> f64| {
        let mut values: Vec<f64> = found.iter().map(|cell| of(cell)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    };
    let sample_m = common.sample_m();
    let compared_m = sums::EDGE as f64 * sample_m;
    let sizes = Sizes {
        columns: common.ground.size[1],
        compared_cells: compared_m / common.ground.cell_m,
        height_of_sample_m: common.height_of_sample_m(),
    };
    let errors = JitterAndSmoothing::of(cells, sizes);
    let squares_m2 = found.iter().map(|cell| errors.with(cell.sigma_m).powi(2));
    let square_m2: f64 = squares_m2.sum();
    let pixel_m = common.pixels_m[0].max(common.pixels_m[1]);
    let mut account = SurfaceAccount {
        images: [0, 1],
        directions: common.directions.map(Into::into),
        cell_m: common.ground.cell_m,
        sample_m,
        compared_m,
        cells: count,
        filled: u32::try_from(found.len()).unwrap_or(u32::MAX),
        unfilled,
        is_refused: false,
        convergence_rad: common.convergence_rad,
        height_of_pixel_m: common.height_of_sample_m() * pixel_m / sample_m,
        sigma_m: (square_m2 / found.len().max(1) as f64).sqrt(),
        jitter_m: errors.jitter_m,
        smoothing_m: errors.smoothing_m,
        correlation: median(|cell| cell.correlation),
        aside_m: median(|cell| cell.aside) * sample_m,
        common_sigma_m: None,
        shots_take_part: false,
        reference: None,
        shots: ShotComparison::default(),
        look: SurfaceModel::nothing().look(1),
        joint: None,
    };
    let found_share = f64::from(account.filled) / f64::from(account.searched().max(1));
    account.is_refused = !(account.filled > 0 && found_share >= FOUND_SHARE_MIN);
    #[allow(
        clippy::cast_possible_truncation,
        reason = "planetary heights keep millimetre precision"
    )]
    let numbers = |of: &dyn Fn(&Found) -> f64| -> Vec<f32> {
        let number = |cell: &Cell| match cell {
            Some(Ok(cell)) if !account.is_refused => of(cell) as f32,
            _ => f32::NAN,
        };
        cells.iter().map(number).collect()
    };
    let model = SurfaceModel {
        sigmas_m: numbers(&|cell| errors.with(cell.sigma_m)),
        heights: common.ground.height_grid(numbers(&|cell| cell.height_m)),
        parallel_rad: common.ground.parallel_rad,
        pairs: Vec::new(),
    };
    account.look = model.look(LOOK);
    Surface { account, model }
}
