//! Orthoimages: images on the cells of a map, where heights of the terrain model no longer displace them.
//!
//! Cubic convolution interpolates the brightness of a cell at the image point of its ground. A cell stays empty if its ground has
//! no height or is hidden by relief, or if its lines were not received. Heights are interpolated across narrow holes of the terrain
//! model, with larger standard deviations. Brightness lies in tiles in a temporary file: memory contains the tiles at work.
//!
//! # Source
//! The products that Shan, Lee & Yoon 2002 and Yoon & Shan 2004 announce; cubic convolution: Keys 1981.

mod cells;
mod drift;
mod holes;
mod sight_lines;

use std::{borrow::Cow, sync::atomic::AtomicBool};

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

pub use super::look::OrthoimageLook;
use super::{
    adjust::Adjusted,
    image_pixels::PixelFiles,
    image_view::View,
    interpolate_shots::ShotModel,
    map_surface::{AdjustmentOfImages, Surface, SurfaceModel},
    site_image::SiteImages,
    tag_times::ImageTimes,
};
use areograph_base::{
    column::Tiles,
    error::{Cause, Result},
    watch::Watch,
};
use areograph_config::AdjustmentConfig;
use areograph_geom::{height_grid::HeightGrid, pushbroom::Unseen};
use areograph_store::{
    book::Book,
    stage::{Input, Inputs, Output, Round, Stage},
    stage_inputs,
};

use cells::Cells;
use drift::OrientationErrors;
pub use holes::bridged;
use sight_lines::SightLines;

/// Maximum number of cells of an orthoimage: 1.3 bytes each in its file.
pub(crate) const CELLS_MAX: usize = 1 << 27;

stage_inputs! {
    /// Images with their orientation and their pixels, and the heights of the ground.
    pub struct RectifyImages<'a> {
        /// The images.
        pub images: SiteImages<'a>,
        /// Their pixels.
        pub pixels: PixelFiles<'a>,
        /// The heights of the ground.
        pub surface: GroundModel<'a>,
        /// The adjustment of the images, where there is one: images without tie points are left out.
        pub adjusted: AdjustmentOfImages<'a>,
        /// Standard deviations of orientations from kernels.
        pub priors: &'a AdjustmentConfig,
        /// The orientation of the images: from the kernels, or adjusted.
        pub round: Round,
        /// Edge of a cell, metres.
        pub cell_m: &'a f64,
    }
}

/// The heights on which images are rectified.
#[derive(Debug, Clone, Copy)]
pub enum GroundModel<'a> {
    /// A terrain model.
    Terrain(&'a Output<Surface>),
    /// The ground between the altimeter's shots.
    Shots(&'a Output<ShotModel>),
}

impl Input for GroundModel<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        match self {
            Self::Terrain(surface) => surface.add_to(field, inputs),
            Self::Shots(model) => model.add_to(field, inputs),
        }
    }
}

impl<'a> GroundModel<'a> {
    /// The heights and their standard deviations; `None` where they are withheld.
    ///
    /// # Errors
    /// An output that cannot be read.
    pub fn model(self) -> Result<Option<&'a SurfaceModel>> {
        Ok(match self {
            Self::Terrain(surface) => surface.value()?.model(),
            Self::Shots(model) => model.value()?.model.as_ref().ok(),
        })
    }

    /// The heights in cells large enough for a page; `None` where they are withheld.
    ///
    /// # Errors
    /// As [`Self::model`].
    pub fn look(self) -> Result<Option<&'a HeightGrid>> {
        Ok(match self {
            Self::Terrain(surface) => {
                let surface = surface.value()?;
                surface.model().map(|_| &surface.account.look.heights)
            }
            Self::Shots(_) => self.model()?.map(|model| &model.heights),
        })
    }

    /// The ground of the orthoimages of a site; `None` for a site without them, or with a model that is withheld.
    ///
    /// # Errors
    /// An output that is not known or cannot be read.
    pub fn of(book: &'a Book) -> Result<Option<&'a SurfaceModel>> {
        if let Some(terrain) = book.find::<Surface>(Round::Initial)?
            && let Some(model) = terrain.model()
        {
            return Ok(Some(model));
        }
        let shots = book.find::<ShotModel>(Round::Initial)?;
        Ok(shots.and_then(|shots| shots.model.as_ref().ok()))
    }
}

/// An image on the cells of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Orthoimage {
    /// Statistics.
    pub account: OrthoimageAccount,
    /// Brightness: pixel values from 1 on (a pixel of 0 becomes 1), 0 where there is none.
    pub brightness: Tiles,
    /// Standard deviations of the horizontal position of the ground in the cells of the terrain model, metres, NaN where the
    /// image does not show them: by heights, jitter and drift of the orientation, without the shared error.
    pub sigmas_m: Vec<f32>,
}

impl Orthoimage {
    /// The orthoimages of a site with its best orientation; empty if it requests none.
    ///
    /// # Errors
    /// An output that is not known or cannot be read.
    pub fn best(book: &Book) -> Result<&[Self]> {
        Ok(book.find_best::<Vec<Self>>()?.map_or(&[], Vec::as_slice))
    }

    /// Those with the orientation from the kernels, in a site whose best orientation is the adjusted one; empty if it requests
    /// none.
    ///
    /// # Errors
    /// As [`Self::best`].
    pub fn before(book: &Book) -> Result<&[Self]> {
        Ok(book.find_before::<Vec<Self>>()?.map_or(&[], Vec::as_slice))
    }

    /// Its statistics, which a page shows.
    #[must_use]
    pub fn without_cells(&self) -> Self {
        Self {
            account: self.account.clone(),
            brightness: Tiles::default(),
            sigmas_m: Vec::new(),
        }
    }
}

/// Statistics of an orthoimage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrthoimageAccount {
    /// Index of the image.
    pub image: usize,
    /// Cells of the map, without heights.
    pub map: HeightGrid,
    /// Latitude at which cells are as wide as high, radians.
    pub parallel_rad: f64,
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// Edge of a pixel of the image on the ground, metres.
    pub pixel_m: f64,
    /// Number of cells with a brightness.
    pub filled: u32,
    /// Number of cells on the terrain model without image pixels.
    pub without_pixels: u32,
    /// Number of terrain cells inside the image, including interpolated holes.
    pub terrain_cells: u32,
    /// Number of these terrain cells with an interpolated height.
    pub interpolated: u32,
    /// Number of these terrain cells that relief hides from the camera.
    pub hidden: u32,
    /// Root mean square of the standard deviations of its horizontal position, metres.
    pub sigma_m: f64,
    /// Standard deviation due to jitter, metres; `None` where the adjustment does not measure it.
    pub jitter_m: Option<f64>,
    /// Standard deviation due to drift, metres: errors of the orientation that change along the image, by the adjustment, or by
    /// the usual errors of kernels; `None` where neither is known.
    pub drift_m: Option<f64>,
    /// Standard deviations of the error that all adjusted images share, east and north, metres; `None` without an adjustment of
    /// heights.
    pub shared_sigma_m: Option<[f64; 2]>,
    /// Standard deviations of the error that all places of this image share, and no other image, east and north, metres, by the
    /// usual errors of kernels; `None` after an adjustment, and for support data.
    pub image_sigma_m: Option<[f64; 2]>,
    /// The orthoimage in larger cells, for display.
    pub look: OrthoimageLook,
}

/// An orthoimage cannot be made.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum RectifyError {
    #[error("image {image}: its rays do not intersect the ground ({unseen})")]
    #[cause("check the kernels and times of the image")]
    Unseen { image: String, unseen: Unseen },
    #[error("surface.orthoimage_cell_m is {cell_m} m: no cell of this size lies in an image")]
    #[cause(
        "decrease surface.orthoimage_cell_m; a usual value is the ground size of an image pixel"
    )]
    Empty { cell_m: f64 },
    #[error(
        "image {image}: surface.orthoimage_cell_m is {cell_m} m and requires {cells} cells; expected at most {CELLS_MAX}"
    )]
    #[cause(
        "increase surface.orthoimage_cell_m; a usual value is the ground size of an image pixel"
    )]
    TooLarge {
        image: String,
        cell_m: f64,
        cells: usize,
    },
}

impl Stage for RectifyImages<'_> {
    const NAME: &'static str = "rectify_images";
    const METHOD: u32 = 5;
    type Output = Vec<Orthoimage>;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Vec<Orthoimage>> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Vec<Orthoimage>> {
        let (mut made, mut is_empty) = (Vec::new(), false);
        let Some(surface) = self.surface.model()? else {
            return Ok(made);
        };
        let tied = self.adjusted.0.map(Output::value).transpose()?;
        // It states nothing of orientations from kernels.
        let adjusted = tied.filter(|_| self.round != Round::Initial);
        let oriented = self.images.oriented()?;
        let times = self.images.0.iter().map(|image| image.times.value());
        let times: Vec<&ImageTimes> = times.collect::<Result<_>>()?;
        let pixels = self.pixels.decoded(&times)?;
        // Holes of a terrain model are narrow; between shots, empty cells are far from all of them.
        let model = match self.surface {
            GroundModel::Terrain(_) => Cow::Owned(bridged(surface)),
            GroundModel::Shots(_) => Cow::Borrowed(surface),
        };
        let images = oriented.iter().zip(&pixels).enumerate();
        for (index, (image, pixels)) in images {
            let Some(pixels) = pixels else { continue };
            let id = || times[index].id.clone();
            let view = View::of(image, pixels).map_err(|unseen| RectifyError::Unseen {
                image: id(),
                unseen,
            })?;
            // Its own error is not the shared error of the adjusted images.
            if tied.is_some_and(|tied| !tied.is_tied(index)) {
                continue;
            }
            let of_view = if let Some(adjusted) = adjusted {
                adjusted.images.get(index).map(|image| OrientedView {
                    scatter_px: Some(adjusted.summary.tie_scatter_of_axes_px()),
                    errors: OrientationErrors::adjusted(image),
                })
            } else {
                // Support data and cubes may have any accuracy.
                let from_kernels = times[index].support.is_none();
                from_kernels.then(|| OrientedView {
                    scatter_px: None,
                    errors: OrientationErrors::a_priori(
                        &view,
                        self.priors,
                        times[index].instrument.spacecraft,
                    ),
                })
            };
            let orthoimage = rectified(&view, &model, *self.cell_m, of_view.as_ref(), watch)?;
            let Some(mut orthoimage) = orthoimage else {
                is_empty = true;
                continue;
            };
            let account = &mut orthoimage.account;
            account.image = index;
            account.interpolated = interpolated(&orthoimage.sigmas_m, surface);
            if let Some(adjusted) = adjusted {
                account.shared_sigma_m = shared_sigma_m(adjusted);
                account.image_sigma_m = None;
            }
            made.push(orthoimage);
        }
        // The images of the model show it, so that only cells larger than they are leave nothing.
        if made.is_empty() && is_empty {
            let cell_m = *self.cell_m;
            return Err(RectifyError::Empty { cell_m }.into());
        }
        Ok(made)
    }
}

/// What is known of the orientation of an image.
#[derive(Debug)]
struct OrientedView {
    /// Scatter of tie points along and across the track, focal-plane pixels, where an adjustment measured it.
    scatter_px: Option<[f64; 2]>,
    errors: OrientationErrors,
}

/// Number of shown cells whose height is not one of the terrain model.
fn interpolated(shown_sigmas_m: &[f32], model: &SurfaceModel) -> u32 {
    let cells = shown_sigmas_m.iter().zip(&model.heights.heights_m);
    let interpolated = cells.filter(|(sigma_m, height_m)| !sigma_m.is_nan() && height_m.is_nan());
    u32::try_from(interpolated.count()).unwrap_or(u32::MAX)
}

/// Standard deviations of the mean place of the adjusted tie points, in east and north, metres.
fn shared_sigma_m(adjusted: &Adjusted) -> Option<[f64; 2]> {
    let [east_m, north_m, _] = adjusted.heights.as_ref()?.mean_sigma_m;
    Some([east_m, north_m])
}

/// The orthoimage of a view, without its index; `None` where no cell has a brightness.
fn rectified(
    view: &View<'_>,
    model: &SurfaceModel,
    cell_m: f64,
    of_view: Option<&OrientedView>,
    watch: Watch<'_>,
) -> Result<Option<Orthoimage>> {
    watch.check()?;
    let Some(sight_lines) = SightLines::of(view, model) else {
        return Ok(None);
    };
    // Jitter in pitch and in roll displaces along and across the track.
    let scatter_px = of_view.and_then(|of| of.scatter_px);
    let scatter_px = scatter_px.map(|scatter_px| Vector2::from(scatter_px).norm());
    let scatter_px = scatter_px.filter(|scatter_px| *scatter_px > 0.0);
    let jitter_m = scatter_px.map(|scatter_px| scatter_px * sight_lines.focal_pixel_m);
    let plan = of_view.map(|of| of.errors.plan_sigmas(view, sight_lines.radius_m));
    let drift_m = plan.map(|plan| plan.drift_m);
    let of_orientation_m = jitter_m
        .unwrap_or_default()
        .hypot(drift_m.unwrap_or_default());
    let sigmas_m = sight_lines.sigmas_m(&model.sigmas_m, of_orientation_m);
    let cells = Cells::of(view, model, &sight_lines, cell_m)?;
    let Some(cells) = cells else {
        return Ok(None);
    };
    let brightness = cells.brightness(view, &sight_lines, watch)?;
    if brightness.filled == 0 {
        return Ok(None);
    }
    let count = |of: usize| u32::try_from(of).unwrap_or(u32::MAX);
    let known = sigmas_m.iter().filter(|sigma_m| !sigma_m.is_nan());
    let square_m2: f64 = known.clone().map(|of| f64::from(of * of)).sum();
    let account = OrthoimageAccount {
        image: 0,
        map: cells.map(),
        parallel_rad: model.parallel_rad,
        cell_m,
        pixel_m: sight_lines.pixel_m,
        filled: brightness.filled,
        without_pixels: brightness.without_pixels,
        terrain_cells: count(sight_lines.seen()),
        hidden: count(sight_lines.hidden()),
        interpolated: 0,
        sigma_m: (square_m2 / known.count().max(1) as f64).sqrt(),
        jitter_m,
        drift_m,
        shared_sigma_m: None,
        image_sigma_m: plan.map(|plan| plan.shared_m),
        look: OrthoimageLook::of(&brightness.cells),
    };
    Ok(Some(Orthoimage {
        account,
        brightness: brightness.cells,
        sigmas_m,
    }))
}

#[cfg(test)]
mod tests;
