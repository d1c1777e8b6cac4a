//! The ground that a pair of images shows, and how finely it is matched.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{level::Level, sums::HALF};
use crate::{
    ground::Ground,
    image_view::{Prediction, View},
    shot_heights::Heights,
};
use areograph_base::{body::Body, error::Cause};

/// Numbers of lines and samples of the first image at which overlap with the second is tested.
const ASKED: [u32; 2] = [257, 33];
/// Samples of the ground along a cell: as many as a cell has pixels of the coarser image, and one of these.
const PER_CELL: [usize; 3] = [1, 3, 5];
/// Smallest sample of the ground, pixels of the coarser image.
const SAMPLE_PX_MIN: f64 = 0.6;
/// Maximum number of cells of a terrain model: a few hundred bytes each while it is made.
const CELLS_MAX: usize = 1 << 24;
/// Minimum convergence of rays: below it, a pixel of parallax corresponds to more than a hundred pixels of height.
const CONVERGENCE_MIN_RAD: f64 = 0.01;

/// A pair that gives no surface.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(super) enum PairError {
    #[error("images {} and {} do not overlap according to their orientation", images[0], images[1])]
    #[cause(
        "name two images of a stereo pair in surface.images, and check their kernels and times"
    )]
    NothingInCommon { images: [String; 2] },
    #[error(
        "images {} and {} have nearly the same viewing direction: their rays intersect at {degrees:.2} degrees; \
         expected at least 0.57",
        images[0], images[1]
    )]
    #[cause(like = NothingInCommon)]
    Parallel { images: [String; 2], degrees: f64 },
    #[error(
        "surface.cell_m is {cell_m}; expected at least {least_m:.1}, the pixel size of the coarser image"
    )]
    #[cause(
        "use cells of about three pixels: details smaller than the compared areas are not resolved"
    )]
    Fine { cell_m: f64, least_m: f64 },
    #[error(
        "surface.cell_m is {cell_m}: the common ground of the images has {cells} cells of this size; expected at most {CELLS_MAX}"
    )]
    #[cause("give larger cells")]
    TooLarge { cell_m: f64, cells: usize },
}

/// The overlap of two images.
pub(super) struct Common {
    /// Cells of the terrain model.
    pub(super) ground: Ground,
    /// Samples of the ground along a cell.
    pub(super) per_cell: usize,
    /// Edge of a pixel of each image on the ground, metres.
    pub(super) pixels_m: [f64; 2],
    /// Directions of the rays of both images in the middle of the common ground, and the angle between them.
    pub(super) directions: [Vector3<f64>; 2],
    /// See `directions`.
    pub(super) convergence_rad: f64,
    /// The lesser extent of the common ground, metres.
    width_m: f64,
}

impl Common {
    /// # Errors
    /// [`PairError`].
    pub(super) fn of(
        views: [&View<'_>; 2],
        body: Body,
        heights: &Heights,
        cell_m: f64,
    ) -> std::result::Result<Self, PairError> {
        let images = || views.map(|view| view.camera.id.clone());
        let shown = shown(views, heights);
        let Some(middle) = shown.get(shown.len() / 2) else {
            return Err(PairError::NothingInCommon { images: images() });
        };
        let directions = directions(views, middle);
        let [one, other] = &directions;
        let convergence_rad = one.cross(other).norm().atan2(one.dot(other));
        if !(convergence_rad >= CONVERGENCE_MIN_RAD) {
            return Err(PairError::Parallel {
                images: images(),
                degrees: convergence_rad.to_degrees(),
            });
        }
        let pixels_m = middle
            .spacing_m
            .map(|spacing| (spacing.x * spacing.y).sqrt());
        let pixel_m = pixels_m[0].max(pixels_m[1]);
        let fits = |per_cell: &&usize| cell_m / **per_cell as f64 >= SAMPLE_PX_MIN * pixel_m;
        let Some(per_cell) = PER_CELL.iter().rev().find(fits) else {
            return Err(PairError::Fine {
                cell_m,
                least_m: pixel_m,
            });
        };
        let places_m: Vec<Vector3<f64>> = shown.iter().map(|of| of.ground_m).collect();
        let Some(ground) = Ground::over(body, &places_m, cell_m) else {
            return Err(PairError::NothingInCommon { images: images() });
        };
        if ground.size.iter().any(|size| *size > CELLS_MAX) || ground.cells() > CELLS_MAX {
            let cells = ground.size[0].saturating_mul(ground.size[1]);
            return Err(PairError::TooLarge { cell_m, cells });
        }
        let extent = |axis: usize| {
            let places = shown.iter().map(|of| of.affine.from[axis]);
            let [low, high] = places.fold([f64::MAX, f64::MIN], |[low, high], at| {
                [low.min(at), high.max(at)]
            });
            (high - low) * middle.spacing_m[0][axis]
        };
        Ok(Self {
            width_m: extent(0).min(extent(1)),
            ground,
            per_cell: *per_cell,
            pixels_m,
            directions,
            convergence_rad,
        })
    }

    /// Edge of a sample of the ground at full size, metres.
    pub(super) fn sample_m(&self) -> f64 {
        self.ground.cell_m / self.per_cell as f64
    }

    /// Approximate metres of height for a sample of parallax at full size.
    pub(super) fn height_of_sample_m(&self) -> f64 {
        self.sample_m() / self.convergence_rad.tan()
    }

    /// The level after `times` halvings.
    pub(super) fn level<'a>(&self, views: [&'a View<'a>; 2], times: usize) -> Level<'a> {
        let ground = self.ground.halved(times);
        let sample_m = ground.cell_m / self.per_cell as f64;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "ratios of pixel sizes are small numbers"
        )]
        let halvings = self
            .pixels_m
            .map(|pixel_m| (sample_m / pixel_m).log2().round().max(0.0) as usize);
        Level {
            ground,
            per_cell: self.per_cell,
            views,
            halvings,
        }
    }

    /// Halvings of the cells at the coarsest level: until `reach_m` of height is few samples, as long as the images
    /// have such halvings and the ground is wider than the compared square.
    pub(super) fn halvings(&self, views: [&View<'_>; 2], reach_m: f64) -> usize {
        /// Samples that the coarsest level may have to search to either side.
        const FEW: f64 = 5.0;
        let fits = |times: &usize| {
            let level = self.level(views, *times);
            let has_pixels = (views.iter().zip(level.halvings))
                .all(|(view, halvings)| halvings <= view.pixels.halvings());
            let sample_m = self.sample_m() * (1_u64 << times) as f64;
            has_pixels && self.width_m >= (4 * HALF) as f64 * sample_m
        };
        let reaches =
            |times: &usize| reach_m <= FEW * self.height_of_sample_m() * (1_u64 << times) as f64;
        let deepest = (0..8).take_while(fits).last().unwrap_or(0);
        (0..deepest).find(reaches).unwrap_or(deepest)
    }
}

/// Places of the first image that the second shows too, over all of it.
fn shown(views: [&View<'_>; 2], heights: &Heights) -> Vec<Prediction> {
    let [here, there] = views;
    let size = here.size_px();
    let asked: Vec<[u32; 2]> = (0..ASKED[0])
        .flat_map(|line| (0..ASKED[1]).map(move |sample| [line, sample]))
        .collect();
    let shown = asked.into_par_iter().filter_map(|at| {
        let share = |axis: usize| f64::from(at[axis]) / f64::from(ASKED[axis] - 1);
        let place = size.component_mul(&nalgebra::Vector2::new(share(0), share(1)));
        let prediction = here.predict(there, &place, heights)?;
        there.holds(&prediction.affine.to).then_some(prediction)
    });
    shown.collect()
}

/// Directions of the rays of both images at a place.
fn directions(views: [&View<'_>; 2], at: &Prediction) -> [Vector3<f64>; 2] {
    let places = [&at.affine.from, &at.affine.to];
    [0, 1].map(|image: usize| {
        let place = places[image];
        views[image].camera.ray(place.x, place.y).direction()
    })
}
