//! A pair of images: every cell of their common ground, and every cell around a laser shot, is tried in both directions.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::{
    cells::{Common, places, quiet_dn},
    margin::Margin,
    search::{Found, Search},
};
use crate::{image_view::View, shot_heights::Heights};
use areograph_base::{
    error::Result,
    ties::{MatchedPair, TieMeasure, Unmatched},
    watch::Watch,
};

/// Largest difference of a place between the two directions, pixels.
const ONE_WAY_PX: f64 = 0.25;
/// Largest standard deviation of a tie point in an image, pixels.
const SIGMA_MAX_PX: f64 = 0.3;
/// Parts along and across the flight into which the common ground is divided to assess the distribution of tie points.
const PARTS: [usize; 2] = [10, 2];
/// Smallest share of searched places that must be found for the result to be significant: chance finds one in a few
/// hundred.
const FOUND_SHARE_MIN: f64 = 0.1;
/// Minimum number of tie points of a pair.
const TIES_MIN: u32 = 10;

/// Tie points of a pair, each measured in the first image and in the second.
pub(super) struct Matched {
    pub(super) ties: Vec<[TieMeasure; 2]>,
    pub(super) account: MatchedPair,
}

/// A place that was found.
struct Placed {
    measures: [TieMeasure; 2],
    correlation: f64,
    part: [usize; 2],
}

/// The part of the common ground of a cell, and the result of its place.
type Tried = ([usize; 2], std::result::Result<Placed, Unmatched>);

/// Tie points of the images with these indices; `None` where they have no ground in common.
///
/// # Errors
/// The system's refusal to read; [`Stopped`](areograph_base::error::Stopped).
pub(super) fn match_pair(
    [first, second]: [&(usize, View<'_>); 2],
    heights: &Heights,
    margin: &Margin,
    watch: Watch<'_>,
) -> Result<Option<Matched>> {
    let views = [&first.1, &second.1];
    let indices = [first.0, second.0];
    let Some(common) = Common::of(views, heights) else {
        return Ok(None);
    };
    let search = Search {
        views,
        levels: common.levels(),
    };
    let mut cells = common.cells();
    let (pixels, level) = (views[0].pixels, search.levels[0]);
    let quiet_dn = quiet_dn(&cells, pixels, level)?;
    cells.extend(common.cells_at_shots(views[0], heights.shots_m()));
    watch.announce(cells.len());
    let reach_m = margin.reach_m(indices, common.ranges_m);
    let places = places(&cells, pixels, level, quiet_dn)?;
    let tried = cells
        .par_iter()
        .zip(places)
        .map(|(cell, place)| -> Result<Option<Tried>> {
            watch.check()?;
            watch.step(1, "cells");
            let at = place.unwrap_or_else(|_| cell.middle());
            let Some(prediction) = views[0].predict(views[1], &at, heights) else {
                return Ok(None);
            };
            if !views[1].holds(&prediction.affine.to) {
                return Ok(None);
            }
            let part = common.part(&at, PARTS);
            let found = match place {
                Err(why) => Err(why),
                Ok(_) => both_ways(&search, &at, heights, reach_m)?,
            };
            Ok(Some((
                part,
                found.map(|found| placed(&found, indices, part)),
            )))
        });
    let tried: Vec<_> = tried.collect::<Result<_>>()?;
    Ok(Some(account(
        tried.into_iter().flatten().collect(),
        indices,
        reach_m,
    )))
}

/// Finds a place of the first image in the second, and the found place in the first again.
fn both_ways(
    search: &Search<'_>,
    place: &Vector2<f64>,
    heights: &Heights,
    reach_m: f64,
) -> Result<std::result::Result<Found, Unmatched>> {
    let found = match one_way(search, place, heights, reach_m)? {
        Ok(found) => found,
        Err(why) => return Ok(Err(why)),
    };
    let back = match one_way(&search.turned(), &found.affine.to, heights, reach_m)? {
        Ok(back) => back,
        Err(Unmatched::Edge) => return Ok(Err(Unmatched::Edge)),
        Err(_) => return Ok(Err(Unmatched::OneWay)),
    };
    let apart = found
        .affine
        .inverse()
        .map(|inverse| inverse.apply(&back.affine.from) - back.affine.to);
    if !apart.is_some_and(|apart| apart.norm() <= ONE_WAY_PX) {
        return Ok(Err(Unmatched::OneWay));
    }
    if !(sigmas(&found)
        .iter()
        .flatten()
        .all(|sigma| *sigma <= SIGMA_MAX_PX))
    {
        return Ok(Err(Unmatched::Uncertain));
    }
    Ok(Ok(found))
}

/// Searches a place where orientations and heights predict it, within the margin.
fn one_way(
    search: &Search<'_>,
    place: &Vector2<f64>,
    heights: &Heights,
    reach_m: f64,
) -> Result<std::result::Result<Found, Unmatched>> {
    let [here, there] = search.views;
    let Some(prediction) = here.predict(there, place, heights) else {
        return Ok(Err(Unmatched::Edge));
    };
    let reach_px = Vector2::from_fn(|axis, _| {
        let orientation_px = reach_m / prediction.spacing_m[1][axis];
        orientation_px.hypot(3.0 * prediction.height_px[axis]) + 1.0
    });
    search.find(&prediction.affine, &reach_px)
}

/// Standard deviations of lines and samples in both images: a match determines one place relative to the other, so that
/// each image gets half of the variance.
fn sigmas(found: &Found) -> [[f64; 2]; 2] {
    let half = 0.5 * found.covariance_px2;
    let back = found
        .affine
        .matrix
        .try_inverse()
        .unwrap_or(Matrix2::identity());
    [back * half * back.transpose(), half]
        .map(|covariance| [covariance[(0, 0)], covariance[(1, 1)]].map(f64::sqrt))
}

fn placed(found: &Found, indices: [usize; 2], part: [usize; 2]) -> Placed {
    let [first, second] = sigmas(found);
    let measure = |image, place: &Vector2<f64>, sigma_px| TieMeasure {
        image,
        line: place.x,
        sample: place.y,
        sigma_px: Some(sigma_px),
    };
    Placed {
        measures: [
            measure(indices[0], &found.affine.from, first),
            measure(indices[1], &found.affine.to, second),
        ],
        correlation: found.correlation,
        part,
    }
}

/// The tie points of a pair, and statistics of all of its cells.
fn account(tried: Vec<Tried>, images: [usize; 2], reach_m: f64) -> Matched {
    let cells = u32::try_from(tried.len()).unwrap_or(u32::MAX);
    let parts: BTreeSet<[usize; 2]> = tried.iter().map(|(part, _)| *part).collect();
    let mut unmatched = BTreeMap::new();
    let mut found = Vec::new();
    for (_, place) in tried {
        match place {
            Ok(place) => found.push(place),
            Err(why) => *unmatched.entry(why).or_insert(0) += 1,
        }
    }
    let with_ties: BTreeSet<[usize; 2]> = found.iter().map(|place| place.part).collect();
    let median = |of: &dyn Fn(&Placed) -> f64| {
        let mut values: Vec<f64> = found.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    };
    let sigma = |axis: usize| {
        median(&|place| {
            place.measures[1]
                .sigma_px
                .map_or(0.0, |sigma_px| sigma_px[axis])
        })
    };
    let count = |of: usize| u32::try_from(of).unwrap_or(u32::MAX);
    let mut account = MatchedPair {
        images,
        cells,
        ties: count(found.len()),
        parts: [parts.len(), with_ties.len()].map(count),
        reach_m,
        sigma_px: [sigma(0), sigma(1)],
        correlation: median(&|place| place.correlation),
        unmatched,
        is_refused: false,
    };
    let found_share = f64::from(account.ties) / f64::from(account.searched().max(1));
    account.is_refused = account.ties < TIES_MIN || found_share < FOUND_SHARE_MIN;
    let believed = found.into_iter().filter(|_| !account.is_refused);
    Matched {
        ties: believed.map(|place| place.measures).collect(),
        account,
    }
}
