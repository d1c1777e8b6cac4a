//! Both images of a tile, laid on a surface.

use nalgebra::{Matrix2, Vector2};

use super::{
    level::{Known, Level},
    seen::Seen,
};
use crate::ground::Sight;
use areograph_base::error::Result;
use areograph_geom::imaging::Patch;

/// Margin around the pixels that are read of an image: interpolation, smoothing, and the shift across the flight,
/// pixels.
const ROOM_PX: f64 = 6.0;

/// Both images over a tile of the ground.
pub(super) struct Pair<'a> {
    seen: &'a Seen,
    patches: [Patch; 2],
    heights_m: Vec<f32>,
    aside: Vec<f32>,
    /// Shift of the second image against the first for a metre of height, samples of the ground along both axes.
    parallax: Vector2<f64>,
}

impl<'a> Pair<'a> {
    /// Both images of a tile, up to `reach` samples of parallax above and below the known heights; `None` where a height does
    /// not move them against each other.
    ///
    /// # Errors
    /// The system's refusal to read the images' temporary files.
    pub(super) fn of(
        level: &Level<'_>,
        seen: &'a Seen,
        known: &Known,
        reach: f64,
    ) -> Result<Option<Self>> {
        let Seen { tile, sights } = seen;
        let [one, other] = sights;
        let heights_m = tile.sampled(&known.heights_m, level.per_cell);
        let aside = tile.sampled(&known.aside, level.per_cell);
        let parallax = other.shift_per_m - one.shift_per_m;
        if !(parallax.norm() > 0.0) {
            return Ok(None);
        }
        let reach_m = reach / parallax.norm();
        let read = |at: usize, sight: &Sight| -> Result<Patch> {
            let spans = sight.spans_px(&heights_m, reach_m, ROOM_PX, tile);
            let pixels = level.views[at].pixels;
            let window = pixels.window_with_gaps(level.halvings[at], [&spans[0], &spans[1]])?;
            Ok(window.smoothed())
        };
        Ok(Some(Self {
            patches: [read(0, one)?, read(1, other)?],
            seen,
            heights_m,
            aside,
            parallax,
        }))
    }

    /// Samples of the ground by which a metre of height moves the images against each other.
    pub(super) fn samples_per_m(&self) -> f64 {
        self.parallax.norm()
    }

    /// Unit vectors along the parallax and across it, samples of the ground (southwards, eastwards).
    pub(super) fn axes(&self) -> Matrix2<f64> {
        let along = self.parallax.normalize();
        Matrix2::from_columns(&[along, Vector2::new(-along.y, along.x)])
    }

    /// Lays each image on the samples of the tile, `above_m` above the known heights; NaN where it shows nothing.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a displacement of few pixels"
    )]
    pub(super) fn lay(&self, above_m: f64, images: &mut [Vec<f32>; 2]) {
        let width = self.seen.tile.size[1];
        let across = self.axes().column(1).into_owned();
        let mut places_px = [vec![0.0; width], vec![0.0; width]];
        for (image, (numbers, share)) in images.iter_mut().zip([-0.5, 0.5]).enumerate() {
            let (sight, patch) = (&self.seen.sights[image], &self.patches[image]);
            let step_px = sight.px_per_sample * across * share;
            numbers.resize(self.heights_m.len(), f32::NAN);
            let known = self.heights_m.chunks_exact(width);
            let known = known.zip(self.aside.chunks_exact(width));
            let lines = numbers.chunks_exact_mut(width).zip(known).enumerate();
            for (line, (numbers, (heights_m, aside))) in lines {
                let [lines, samples] = &mut places_px;
                sight.places_px(line, (heights_m, above_m), patch.first, [lines, samples]);
                for (places, step_px) in places_px.iter_mut().zip(step_px.iter()) {
                    let step_px = *step_px as f32;
                    for (place, aside) in places.iter_mut().zip(aside) {
                        *place += step_px * aside;
                    }
                }
                patch.numbers([&places_px[0], &places_px[1]], numbers);
            }
        }
    }

    /// The known height at a sample, metres.
    pub(super) fn height_m(&self, at: [usize; 2]) -> f64 {
        f64::from(self.heights_m[self.index(at)])
    }

    /// Offset of the second image across the parallax at a sample.
    pub(super) fn aside(&self, at: [usize; 2]) -> f64 {
        f64::from(self.aside[self.index(at)])
    }

    /// Least distance of a sample from the edges of an image, pixels of its level; below 0 beyond them.
    pub(super) fn edge_px(&self, at: [usize; 2]) -> f64 {
        let height_m = self.height_m(at);
        let [one, other] = [0, 1].map(|image| self.seen.sights[image].edge_px(at, height_m));
        one.min(other)
    }

    fn index(&self, [line, sample]: [usize; 2]) -> usize {
        line * self.seen.tile.size[1] + sample
    }
}
