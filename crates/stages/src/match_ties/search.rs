//! Search for one place of an image in another one: from coarse to fine by correlation, finally by least squares.

use nalgebra::{Matrix2, Vector2};

use crate::image_view::View;
use areograph_base::{error::Result, ties::Unmatched};
use areograph_geom::imaging::{Affine, LeastSquaresFailure, Patch, match_least_squares, search};
use areograph_pds::pixel_file::Pyramid;

/// Half the edge of a template of the search, pixels of its level.
const HALF: i64 = 10;
/// Half the edge of the template of least squares, pixels.
pub(super) const HALF_LEAST_SQUARES: i64 = 15;
/// The search begins at the level at which its reach is at most this, pixels.
const REACH_PX: f64 = 24.0;
/// Near an edge the coarse templates do not fit: a finer one may then search farther, pixels.
const REACH_MAX_PX: f64 = 64.0;
/// Reach of the finer levels about the result of the coarser one, pixels.
const REFINED_PX: f64 = 3.0;
/// Room that interpolation, smoothing and the steps of least squares need around a window, pixels.
const ROOM_PX: f64 = 8.0;
/// Minimum correlation of a search.
const CORRELATION_MIN: f64 = 0.5;
/// Minimum correlation after least squares: a template of 31 pixels on unlike ground reaches 0.5 at most.
const CORRELATION_AT_LAST_MIN: f64 = 0.7;
/// Largest share of the best correlation that another peak may have.
const SECOND_MAX: f64 = 0.85;
/// Systematic error of a place, pixels: interpolation and whole grey values (below 0.02 by the tests of `imaging`), and
/// relief within the template, which no affine distortion follows: together 0.038 along the samples of the synthetic
/// mission's roughest pair, whose pixels are 1.5 times as large in one image as in the other. The value is larger by
/// half, since rims give these errors heavier tails than a normal distribution has: 99 in 100 must be within three
/// standard deviations.
const SYSTEMATIC_PX: f64 = 0.06;

/// A place that was found.
pub(super) struct Found {
    /// From the middle of the template to the other image, pixels of both images.
    pub(super) affine: Affine,
    /// Covariance of the place in the other image, pixels².
    pub(super) covariance_px2: Matrix2<f64>,
    pub(super) correlation: f64,
}

/// The images of a search.
pub(super) struct Search<'a> {
    /// The image of the template, and the other.
    pub(super) views: [&'a View<'a>; 2],
    /// Levels at which a pixel is of like size in both.
    pub(super) levels: [usize; 2],
}

/// Result of a step of the search: failures of the place, or of the system.
type Step<T> = Result<std::result::Result<T, Unmatched>>;

/// Leaves the function with a place that is not matched.
macro_rules! or_unmatched {
    ($step:expr) => {
        match $step {
            Ok(value) => value,
            Err(why) => return Ok(Err(why)),
        }
    };
}

impl Search<'_> {
    /// The search from the other image.
    pub(super) fn turned(&self) -> Self {
        let [here, there] = self.views;
        let [level, other] = self.levels;
        Self {
            views: [there, here],
            levels: [other, level],
        }
    }

    /// Searches for the place `expected.from` within `reach_px` lines and samples of `expected.to`.
    pub(super) fn find(&self, expected: &Affine, reach_px: &Vector2<f64>) -> Step<Found> {
        let [_, there] = self.views;
        let deepest = (self.views.iter().zip(self.levels))
            .map(|(view, level)| view.pixels.halvings().saturating_sub(level))
            .min()
            .unwrap_or(0);
        let reach_at = |step: usize| reach_px.max() / scale(self.levels[1] + step);
        let top = (0..deepest).find(|step| reach_at(*step) <= REACH_PX);
        let top = top.unwrap_or(deepest);
        let (mut warp, mut begun) = (*expected, false);
        for step in (0..=top).rev() {
            let scales = self.levels.map(|level| scale(level + step));
            let at_level = warp.reduced(scales[0], scales[1]);
            let template = template(self.views[0].pixels, self.levels[0] + step, &at_level, HALF)?;
            let template = match template {
                Err(Unmatched::Edge)
                    if !begun && step > 0 && reach_at(step - 1) <= REACH_MAX_PX =>
                {
                    continue;
                }
                template => or_unmatched!(template),
            };
            let reach = if begun {
                Vector2::repeat(REFINED_PX)
            } else {
                reach_px / scales[1]
            };
            let level = self.levels[1] + step;
            let area = or_unmatched!(area(there.pixels, level, &at_level, &template, &reach)?);
            let Some(peak) = search(&template, &area) else {
                return Ok(Err(Unmatched::Flat));
            };
            if !(peak.correlation >= CORRELATION_MIN) {
                return Ok(Err(Unmatched::Unlike));
            }
            if !begun && peak.second > SECOND_MAX * peak.correlation {
                return Ok(Err(Unmatched::Ambiguous));
            }
            let shift = Vector2::from_fn(|axis, _| {
                area.first[axis] as f64 + peak.at[axis] as f64 - template.first[axis] as f64
            });
            warp.to += at_level.matrix * shift * scales[1];
            begun = true;
        }
        self.settle(&warp)
    }

    /// Least squares at the finest level.
    fn settle(&self, warp: &Affine) -> Step<Found> {
        let scales = self.levels.map(scale);
        let at_level = warp.reduced(scales[0], scales[1]);
        let [here, there] = self.views;
        let template = or_unmatched!(template(
            here.pixels,
            self.levels[0],
            &at_level,
            HALF_LEAST_SQUARES
        )?);
        let window = around(&at_level, &template, &Vector2::zeros());
        let other = there.pixels.window(self.levels[1], window.0, window.1)?;
        let Some(other) = other else {
            return Ok(Err(Unmatched::Missing));
        };
        let matched = match match_least_squares(&template, &other.smoothed(), &at_level) {
            Ok(matched) => matched,
            Err(LeastSquaresFailure::Outside) => return Ok(Err(Unmatched::Edge)),
            Err(LeastSquaresFailure::NotConverged) => return Ok(Err(Unmatched::Unsettled)),
            Err(LeastSquaresFailure::Undetermined) => return Ok(Err(Unmatched::Flat)),
        };
        if !(matched.correlation >= CORRELATION_AT_LAST_MIN) {
            return Ok(Err(Unmatched::Unlike));
        }
        let systematic = Matrix2::from_diagonal_element(SYSTEMATIC_PX * SYSTEMATIC_PX);
        Ok(Ok(Found {
            affine: matched.affine.reduced(1.0 / scales[0], 1.0 / scales[1]),
            covariance_px2: (matched.covariance_px2 + systematic) * (scales[1] * scales[1]),
            correlation: matched.correlation,
        }))
    }
}

/// Pixels of an image per pixel of a level.
pub(super) fn scale(level: usize) -> f64 {
    (1_u64 << level.min(63)) as f64
}

/// The smoothed square of `2 half + 1` pixels around the pixel of a place.
fn template(pixels: &Pyramid, level: usize, at_level: &Affine, half: i64) -> Step<Patch> {
    let [line, sample] = [at_level.from.x, at_level.from.y].map(pixel);
    // Smoothing takes a pixel at every edge.
    let first = [line - half - 1, sample - half - 1];
    let edge = usize::try_from(2 * half + 3).unwrap_or_default();
    let size = pixels.size(level);
    let is_inside = (0..2).all(|axis| {
        let end = usize::try_from(first[axis]).map(|first| first + edge);
        end.is_ok_and(|end| end <= size[axis])
    });
    if !is_inside {
        return Ok(Err(Unmatched::Edge));
    }
    let window = pixels.window(level, first, [edge, edge])?;
    Ok(window
        .map(|window| window.smoothed())
        .ok_or(Unmatched::Missing))
}

/// The part of the other image within `reach` pixels of the expected place of the template, resampled to the template's
/// image; less of it near the edge of the other image.
fn area(
    pixels: &Pyramid,
    level: usize,
    at_level: &Affine,
    template: &Patch,
    reach: &Vector2<f64>,
) -> Step<Patch> {
    let (first, size) = around(at_level, template, reach);
    let Some(inverse) = at_level.inverse() else {
        return Ok(Err(Unmatched::Edge));
    };
    let whole = pixels.size(level);
    let beyond = (0..2).any(|axis| {
        first[axis] >= i64::try_from(whole[axis]).unwrap_or(i64::MAX)
            || first[axis].saturating_add_unsigned(size[axis] as u64) <= 0
    });
    if beyond {
        return Ok(Err(Unmatched::Edge));
    }
    let Some(window) = pixels.window(level, first, size)? else {
        return Ok(Err(Unmatched::Missing));
    };
    let window = window.smoothed();
    let steps = inverse.matrix.abs() * reach;
    let Some(margins) = margins(
        at_level,
        template,
        &window,
        [steps.x, steps.y].map(f64::ceil),
    ) else {
        return Ok(Err(Unmatched::Edge));
    };
    let first = [0, 1].map(|axis| template.first[axis] - signed(margins[axis][0]));
    let size = [0, 1].map(|axis| template.size[axis] + margins[axis][0] + margins[axis][1]);
    Ok(window
        .resampled(first, size, at_level)
        .ok_or(Unmatched::Edge))
}

/// First pixel and size of the window of the other image that a template and `reach` pixels around it need.
fn around(at_level: &Affine, template: &Patch, reach: &Vector2<f64>) -> ([i64; 2], [usize; 2]) {
    let half = Vector2::new(template.size[0] as f64, template.size[1] as f64) * 0.5;
    let room = at_level.matrix.abs() * half + reach + Vector2::repeat(ROOM_PX);
    let middle = at_level.apply(&template.middle());
    let first = (middle - room).map(f64::floor);
    let size = (room * 2.0).map(f64::ceil);
    (
        [pixel(first.x), pixel(first.y)],
        [length(size.x), length(size.y)],
    )
}

/// Number of pixels before and behind the template that may be searched on each axis, at most `steps`, so that
/// `window` of the other image holds all of it; `None` where it does not even hold the template.
fn margins(
    at_level: &Affine,
    template: &Patch,
    window: &Patch,
    steps: [f64; 2],
) -> Option<[[usize; 2]; 2]> {
    let mut margins = steps.map(|steps| [length(steps); 2]);
    loop {
        let corners = [[0, 0], [0, 1], [1, 0], [1, 1]].map(|ends: [usize; 2]| {
            let place = Vector2::from_fn(|axis, _| {
                let (start, size) = (template.first[axis] as f64, template.size[axis] as f64);
                match ends[axis] {
                    0 => start + 0.5 - margins[axis][0] as f64,
                    _ => start + size - 0.5 + margins[axis][1] as f64,
                }
            });
            (ends, window.between(&at_level.apply(&place)).is_some())
        });
        let outside = corners.into_iter().filter(|(_, is_inside)| !is_inside);
        let outside: Vec<[usize; 2]> = outside.map(|(ends, _)| ends).collect();
        if outside.is_empty() {
            return Some(margins);
        }
        // Sides of which both corners are outside shrink first.
        let mut gives_way = |corners_min: usize| {
            let mut any = false;
            for (axis, sides) in margins.iter_mut().enumerate() {
                for (end, margin) in sides.iter_mut().enumerate() {
                    let corners = outside.iter().filter(|ends| ends[axis] == end).count();
                    if *margin > 0 && corners >= corners_min {
                        *margin -= 1;
                        any = true;
                    }
                }
            }
            any
        };
        if !gives_way(2) && !gives_way(1) {
            return None;
        }
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "a number that is too large saturates"
)]
fn pixel(coordinate: f64) -> i64 {
    coordinate.floor() as i64
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "negative numbers become 0"
)]
fn length(of: f64) -> usize {
    of as usize
}

fn signed(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}
