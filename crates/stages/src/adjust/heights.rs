//! Tie points with implausible heights.
//!
//! A measurement error across the track changes only the height of its tie point, which no other image controls. The
//! MOLA surface reveals it once the height error that all tie points share, a slow bend along the flight, is removed.

use nalgebra::{Matrix3, Vector3};

use super::network::Assembled;
use areograph_geom::{
    bundle::{Adjustment, HeightResidual},
    robust::RobustWeight,
};

/// Neighbours within this distance share the ground, metres.
const NEIGHBOUR_M: f64 = 700.0;
/// A neighbour confirms a tie point if its residual has the same sign and more than this share of the size.
const NEIGHBOUR_SHARE: f64 = 0.4;
/// Largest departure of a crater from the surface between the shots, metres.
const CRATER_MAX_M: f64 = 150.0;
/// Weights of heights in the bend.
const WEIGHT: RobustWeight = RobustWeight::Cauchy {
    limit: RobustWeight::CAUCHY_LIMIT,
};
/// Rounds of the robust fit of the bend.
const BEND_ROUNDS: u32 = 30;
/// Fewer heights than this determine neither a bend nor a blunder.
pub const HEIGHTS_MIN: usize = 10;

/// A tie point whose height is a blunder.
pub(super) struct HeightBlunder {
    /// Index in the network.
    pub(super) point: usize,
    /// Height above the surface without the part that tie points share, metres.
    pub(super) above_m: f64,
    /// This height in its standard deviations.
    pub(super) standardised: f64,
}

/// Tie points farther from the surface than `limit` standard deviations, unless a neighbour confirms them.
pub(super) fn height_blunders<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
    limit: f64,
) -> Vec<HeightBlunder> {
    let heights = &adjustment.compared;
    if heights.len() < HEIGHTS_MIN {
        return Vec::new();
    }
    let places = places(assembled);
    let along: Vec<f64> = heights.iter().map(|height| places[height.point]).collect();
    let sigmas_m: Vec<f64> = heights.iter().map(HeightResidual::sigma_m).collect();
    let above_m = beyond_bend(heights, &along, &sigmas_m);
    let grounds_m: Vec<Option<Vector3<f64>>> = heights
        .iter()
        .map(|height| {
            adjustment.points[height.point]
                .map(|point| point.ground_m)
                .ok()
        })
        .collect();
    let has_neighbour = |index: usize| {
        let Some(ground_m) = grounds_m[index] else {
            return false;
        };
        above_m
            .iter()
            .zip(&grounds_m)
            .enumerate()
            .any(|(other, (other_m, place))| {
                other != index
                    && other_m * above_m[index] > 0.0
                    && other_m.abs() > NEIGHBOUR_SHARE * above_m[index].abs()
                    && place.is_some_and(|place| (place - ground_m).norm() < NEIGHBOUR_M)
            })
    };
    let blunders = (0..heights.len()).filter(|index| {
        let residual_m = above_m[*index].abs();
        let stands_out = residual_m > limit * sigmas_m[*index];
        stands_out && !(residual_m <= CRATER_MAX_M && has_neighbour(*index))
    });
    blunders
        .map(|index| HeightBlunder {
            point: heights[index].point,
            above_m: above_m[index],
            standardised: above_m[index].abs() / sigmas_m[index],
        })
        .collect()
}

/// Position of each point along the flight, in units of half its first image; 0 for a point without a view.
fn places<M>(assembled: &Assembled<M>) -> Vec<f64> {
    let mut places = vec![0.0; assembled.points.len()];
    for view in assembled.network.views.iter().rev() {
        places[view.point] = view.x_lines / assembled.network.images[view.image].half_lines;
    }
    places
}

/// Heights minus a robust parabola along the flight.
fn beyond_bend(heights: &[HeightResidual], along: &[f64], sigmas_m: &[f64]) -> Vec<f64> {
    let powers = |t: f64| Vector3::new(1.0, t, t * t);
    let mut sorted_m: Vec<f64> = heights.iter().map(|height| height.above_m).collect();
    sorted_m.sort_unstable_by(f64::total_cmp);
    let mut bend = Vector3::new(sorted_m[sorted_m.len() / 2], 0.0, 0.0);
    let left_m = |bend: &Vector3<f64>| -> Vec<f64> {
        let heights = heights.iter().zip(along);
        heights
            .map(|(height, t)| height.above_m - bend.dot(&powers(*t)))
            .collect()
    };
    for _ in 0..BEND_ROUNDS {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let entries = left_m(&bend)
            .into_iter()
            .zip(sigmas_m)
            .zip(heights.iter().zip(along));
        for ((residual_m, sigma_m), (height, t)) in entries {
            let weight = sigma_m.powi(-2) * WEIGHT.factor(residual_m / sigma_m);
            normal += weight * powers(*t) * powers(*t).transpose();
            right += weight * height.above_m * powers(*t);
        }
        // Heights in one place do not determine a bend: the previous one is kept.
        let Some(solution) = normal.cholesky().map(|factor| factor.solve(&right)) else {
            break;
        };
        bend = solution;
    }
    left_m(&bend)
}
