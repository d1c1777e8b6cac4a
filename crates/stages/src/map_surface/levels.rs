//! From coarse to fine: at every level heights are searched about the heights of the coarser one, then refined by least
//! squares.

use rayon::prelude::*;

use super::{
    Cell,
    common::Common,
    level::{Known, Level},
    search::search,
    seen::{Seen, seen, tiles},
    settle::settle,
    tidy::{field, without_strays},
};
use crate::{ground::Field, image_view::View, shot_heights::Heights};
use areograph_base::{error::Result, watch::Watch};

/// Reach of finer levels about the result of the coarser one, samples.
const REACH: usize = 2;
/// Largest reach of the coarsest level, samples.
const REACH_MAX: f64 = 40.0;
/// Steps of least squares at the finest level, and at the others.
const STEPS: [usize; 2] = [3, 1];
/// Cells to either side over which the surface under the images is smoothed: after a search, and between steps of least
/// squares, which restore the smoothed detail.
const SMOOTH: [usize; 2] = [2, 1];
/// Cells to either side over which the offset across the parallax, which changes little, is smoothed.
const SMOOTH_ASIDE: usize = 6;
/// Standard deviations of the a priori heights that the search covers.
const SIGMAS: f64 = 3.0;

/// Every cell at the finest level.
///
/// # Errors
/// The system's refusal to read the images' temporary files; [`Stopped`](areograph_base::error::Stopped).
pub(super) fn all_levels(
    common: &Common,
    views: [&View<'_>; 2],
    heights: &Heights,
    off_m: f64,
    watch: Watch<'_>,
) -> Result<Vec<Cell>> {
    let (_, sigma_m) = beforehand(&common.level(views, 3), heights);
    let reach_m = SIGMAS * sigma_m + off_m;
    let deepest = common.halvings(views, reach_m);
    let height_of_sample_m = |times: usize| common.height_of_sample_m() * (1_u64 << times) as f64;
    let top = common.level(views, deepest);
    let mut known = Known {
        heights_m: beforehand(&top, heights).0,
        aside: Field::even(top.ground.size, 0.0),
    };
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped just before"
    )]
    let mut reach = (reach_m / height_of_sample_m(deepest))
        .ceil()
        .clamp(REACH as f64, REACH_MAX) as usize;
    // All at once, so that the time left is that of all levels.
    for times in 0..=deepest {
        watch.announce(tiles(&common.level(views, times)) * passes(times));
    }
    let mut cells = Vec::new();
    for times in (0..=deepest).rev() {
        let level = common.level(views, times);
        let size = level.ground.size;
        if times < deepest {
            known = Known {
                heights_m: known.heights_m.doubled(size),
                // A sample is half as large.
                aside: twice(known.aside.doubled(size)),
            };
        }
        let sample_m = height_of_sample_m(times);
        let reach_m = (reach + 1) as f64 * sample_m;
        let seen = seen(&level, &known.heights_m, reach_m);
        let unseen = (tiles(&level) - seen.len()) * passes(times);
        watch.step(unseen as u64, "tiles");
        cells = every_tile(&level, &seen, watch, |seen| {
            search(&level, seen, &known, reach)
        })?;
        cells = without_strays(&cells, size, sample_m);
        known.heights_m = field(&cells, &known.heights_m, SMOOTH[0], |found| found.height_m);
        for step in 0..STEPS[usize::from(times > 0)] {
            if step > 0 {
                known.heights_m =
                    field(&cells, &known.heights_m, SMOOTH[1], |found| found.height_m);
            }
            cells = every_tile(&level, &seen, watch, |seen| settle(&level, seen, &known))?;
            cells = without_strays(&cells, size, sample_m);
            known.aside = field(&cells, &known.aside, SMOOTH_ASIDE, |found| found.aside);
        }
        known.heights_m = field(&cells, &known.heights_m, SMOOTH[1], |found| found.height_m);
        reach = REACH;
    }
    Ok(cells)
}

/// Passes over the tiles of the level after `times` halvings: the search, and steps of least squares.
fn passes(times: usize) -> usize {
    1 + STEPS[usize::from(times > 0)]
}

/// Calls `work` for every tile of a level, on all threads; the cells in order.
fn every_tile(
    level: &Level<'_>,
    seen: &[Seen],
    watch: Watch<'_>,
    work: impl Fn(&Seen) -> Result<Vec<(usize, Cell)>> + Sync,
) -> Result<Vec<Cell>> {
    let worked = seen.par_iter().map(|seen| {
        watch.check()?;
        let worked = work(seen);
        watch.step(1, "tiles");
        worked
    });
    let worked: Vec<Vec<(usize, Cell)>> = worked.collect::<Result<_>>()?;
    let mut cells = vec![None; level.ground.cells()];
    for (at, cell) in worked.into_iter().flatten() {
        if let Some(place) = cells.get_mut(at) {
            *place = cell;
        }
    }
    Ok(cells)
}

/// Heights above the sphere by the altimeter's nearby shots, and their largest standard deviation, metres.
#[allow(
    clippy::cast_possible_truncation,
    reason = "planetary heights keep millimetre precision"
)]
fn beforehand(level: &Level<'_>, heights: &Heights) -> (Field, f64) {
    let ground = &level.ground;
    let columns = ground.size[1];
    let known = (0..ground.cells()).into_par_iter().map(|at| {
        let place_m = ground.place_m([(at / columns) as f64, (at % columns) as f64], 0.0);
        let height = heights.near(&place_m);
        ((height.radius_m - ground.radius_m) as f32, height.sigma_m)
    });
    let (values, sigmas): (Vec<f32>, Vec<f64>) = known.unzip();
    let field = Field {
        size: ground.size,
        values,
    };
    (field, sigmas.into_iter().fold(0.0, f64::max))
}

fn twice(mut field: Field) -> Field {
    for value in &mut field.values {
        *value *= 2.0;
    }
    field
}
