//! The ground that two images both show, cut into cells, and the place with the most texture in each.

use std::ops::Range;

use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::search::{HALF_LEAST_SQUARES, scale};
use crate::{image_view::View, shot_heights::Heights};
use areograph_base::{error::Result, ties::Unmatched};
use areograph_geom::imaging::{Patch, noise_dn, texture};
use areograph_pds::pixel_file::Pyramid;

/// Cells that the common ground is cut into.
const CELLS: f64 = 320.0;
/// Edge of a cell around a laser shot, metres, and its minimum in pixels: the cell contains a place with texture, and its height
/// differs little from the height of the shot.
const SHOT_EDGE_M: f64 = 60.0;
const SHOT_EDGE_PX: f64 = 8.0;
/// Numbers of lines and samples of an image at which overlap with the other is tested.
const ASKED: [u32; 2] = [257, 33];
/// Quantile of the cells' noise that counts as the noise of the image: texture only adds to it.
const QUIET_SHARE: f64 = 0.25;
/// Largest standard deviation of a place from noise, pixels; beyond it, the place is flat.
const FLAT_PX: f64 = 0.2;

/// A part of an image: lines and samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Cell {
    lines: Range<usize>,
    samples: Range<usize>,
}

/// A place of a cell, or why it has no place.
pub(super) type Place = std::result::Result<Vector2<f64>, Unmatched>;

/// The overlap of two images, in pixels of the first.
pub(super) struct Common {
    /// First and last line and sample that the other shows too.
    low: Vector2<f64>,
    high: Vector2<f64>,
    /// Size of a pixel of each image on the ground in the middle, metres.
    pub(super) spacing_m: [Vector2<f64>; 2],
    /// Distance from the first camera to the ground and from the second, in the middle, metres.
    pub(super) ranges_m: [f64; 2],
}

impl Common {
    /// `None` where the images have no ground in common.
    pub(super) fn of(views: [&View<'_>; 2], heights: &Heights) -> Option<Self> {
        let [here, there] = views;
        let size = here.size_px();
        let asked: Vec<Vector2<f64>> = (0..ASKED[0])
            .flat_map(|line| (0..ASKED[1]).map(move |sample| [line, sample]))
            .map(|at| {
                Vector2::from_fn(|axis, _| {
                    size[axis] * f64::from(at[axis]) / f64::from(ASKED[axis] - 1)
                })
            })
            .collect();
        let shown = asked.into_par_iter().filter_map(|place| {
            let prediction = here.predict(there, &place, heights)?;
            there
                .holds(&prediction.affine.to)
                .then_some((place, prediction))
        });
        let shown: Vec<_> = shown.collect();
        let (_, middle) = shown.get(shown.len() / 2)?;
        let fold = |start: f64, with: fn(f64, f64) -> f64| {
            Vector2::from_fn(|axis, _| {
                let places = shown.iter().map(|(place, _)| place[axis]);
                places.fold(start, with)
            })
        };
        let range_m = |view: &View<'_>, place: &Vector2<f64>| {
            let (x_lines, _) = view.camera.focal_plane_coordinates(place.x, place.y);
            let position_m = view.camera.orientation.pose(x_lines).position_m;
            (position_m - middle.ground_m).norm()
        };
        Some(Self {
            low: fold(f64::INFINITY, f64::min),
            high: fold(f64::NEG_INFINITY, f64::max),
            spacing_m: middle.spacing_m,
            ranges_m: [
                range_m(here, &middle.affine.from),
                range_m(there, &middle.affine.to),
            ],
        })
    }

    /// Levels at which a pixel of either image is of like size on the ground.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "ratios of pixel sizes are small numbers"
    )]
    pub(super) fn levels(&self) -> [usize; 2] {
        let [here, there] = self.spacing_m.map(|spacing| (spacing.x * spacing.y).sqrt());
        let halvings = (there / here).log2().round();
        [halvings, -halvings].map(|halvings| halvings.max(0.0) as usize)
    }

    /// The cells, line by line, each nearly a square on the ground.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "coordinates within an image"
    )]
    pub(super) fn cells(&self) -> Vec<Cell> {
        let extent = self.high - self.low;
        let extent_m = extent.component_mul(&self.spacing_m[0]);
        let edge_m = (extent_m.x * extent_m.y / CELLS).sqrt();
        let counts = extent_m.map(|length_m| (length_m / edge_m).ceil().max(1.0) as usize);
        let span = |axis: usize, number: usize| {
            let at = |share: usize| {
                (self.low[axis] + extent[axis] * share as f64 / counts[axis] as f64) as usize
            };
            at(number)..at(number + 1)
        };
        (0..counts.x)
            .flat_map(|line| (0..counts.y).map(move |sample| [line, sample]))
            .map(|[line, sample]| Cell {
                lines: span(0, line),
                samples: span(1, sample),
            })
            .collect()
    }

    /// Cells around laser shots `shots_m` in the common ground: at most as many as [`Self::cells`], evenly selected in the order
    /// of the shots. Between profiles the ground is known less precisely, so that heights there determine the position of
    /// the images less precisely.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "coordinates within an image"
    )]
    pub(super) fn cells_at_shots(&self, here: &View<'_>, shots_m: &[Vector3<f64>]) -> Vec<Cell> {
        let half_px =
            self.spacing_m[0].map(|spacing_m| 0.5 * (SHOT_EDGE_M / spacing_m).max(SHOT_EDGE_PX));
        let around = shots_m.par_iter().filter_map(|shot_m| {
            let place = here.place(shot_m)?;
            let [from, to] = [place - half_px, place + half_px];
            let is_inside =
                (0..2).all(|axis| from[axis] >= self.low[axis] && to[axis] < self.high[axis]);
            let span = |axis: usize| from[axis] as usize..to[axis] as usize;
            is_inside.then(|| Cell {
                lines: span(0),
                samples: span(1),
            })
        });
        let around: Vec<Cell> = around.collect();
        let count = around.len().min(CELLS as usize);
        (0..count)
            .map(|index| around[index * around.len() / count].clone())
            .collect()
    }

    /// The part that holds a place, of `parts` along lines and samples.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "shares of an image"
    )]
    pub(super) fn part(&self, place: &Vector2<f64>, parts: [usize; 2]) -> [usize; 2] {
        [0, 1].map(|axis| {
            let share = (place[axis] - self.low[axis]) / (self.high[axis] - self.low[axis]);
            ((share * parts[axis] as f64) as usize).min(parts[axis] - 1)
        })
    }
}

impl Cell {
    /// Middle of the cell.
    pub(super) fn middle(&self) -> Vector2<f64> {
        let middle = |of: &Range<usize>| 0.5 * (of.start + of.end) as f64;
        Vector2::new(middle(&self.lines), middle(&self.samples))
    }

    /// The pixels at `level` that are searched for places, with the surroundings that templates need; where lines are
    /// missing, the longest stretch between them. `None` where that is too short for a template.
    fn pixels(&self, pixels: &Pyramid, level: usize) -> Result<Option<Patch>> {
        let size = 1_usize << level;
        let margin = usize::try_from(HALF_LEAST_SQUARES + 1).unwrap_or_default();
        let [lines, samples] = [&self.lines, &self.samples]
            .map(|span| span.start.saturating_sub(margin * size)..span.end + margin * size);
        let spans = [pixels.longest_good(lines), samples]
            .map(|span| span.start.div_ceil(size)..span.end / size);
        let first = spans
            .each_ref()
            .map(|span| i64::try_from(span.start).unwrap_or_default());
        let patch = pixels.window(level, first, spans.map(|span| span.len()))?;
        Ok(patch.filter(|patch| patch.size.iter().all(|length| *length > 2 * margin)))
    }
}

/// Noise of an image with these `cells`, in its digital numbers.
///
/// # Errors
/// The system's refusal to read.
pub(super) fn quiet_dn(cells: &[Cell], pixels: &Pyramid, level: usize) -> Result<f64> {
    let noise = cells.par_iter().map(|cell| -> Result<Option<f64>> {
        let patch = cell.pixels(pixels, level)?;
        Ok(patch.and_then(|patch| noise_dn(&patch)))
    });
    let noise: Vec<Option<f64>> = noise.collect::<Result<_>>()?;
    let mut noise: Vec<f64> = noise.into_iter().flatten().collect();
    noise.sort_by(f64::total_cmp);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a number of elements"
    )]
    let quiet = noise.get((QUIET_SHARE * noise.len() as f64) as usize);
    Ok(quiet.copied().unwrap_or_default())
}

/// In each cell the place with the most texture above the noise `quiet_dn`, or why there is none.
///
/// # Errors
/// The system's refusal to read.
pub(super) fn places(
    cells: &[Cell],
    pixels: &Pyramid,
    level: usize,
    quiet_dn: f64,
) -> Result<Vec<Place>> {
    let half = usize::try_from(HALF_LEAST_SQUARES).unwrap_or_default();
    let places = cells.par_iter().map(|cell| -> Result<Place> {
        let Some(patch) = cell.pixels(pixels, level)? else {
            return Ok(Err(Unmatched::Missing));
        };
        let found = texture(&patch, half, quiet_dn).filter(|found| found.sigma_px <= FLAT_PX);
        Ok(found.ok_or(Unmatched::Flat).map(|found| {
            let [line, sample] = found.at.map(|pixel| (pixel as f64 + 0.5) * scale(level));
            Vector2::new(line, sample)
        }))
    });
    places.collect()
}
