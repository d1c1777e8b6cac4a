//! The surface, tested on the shots from which it is made: every profile in turn is withheld and predicted from the
//! others.

use nalgebra::Vector3;
use rayon::prelude::*;
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LaserSurface, SurfaceOptions, SurfaceShot, tails};
use crate::{ellipsoid::height_m, statistics::median};

/// Maximum number of shots of a withheld stretch: 18 km with MOLA.
const STRETCH_SHOTS: usize = 60;
/// Shorter stretches are not tested.
const STRETCH_MIN: usize = 20;
/// Of more stretches than this, an even selection is tested.
const STRETCHES_MAX: usize = 60;
/// Shots of other profiles that predict a stretch: the nearest.
const PREDICTING: usize = 400;
/// Step, in shots of a stretch, at which the distance of others is taken.
const DISTANCE_STEP: usize = 5;

/// Rounding of distances, metres.
const ROUNDING_M: f64 = 0.001;

/// A stretch of a profile, predicted from the other profiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Withheld {
    /// Index of the profile.
    pub profile: usize,
    /// Index of its first shot.
    pub first: usize,
    /// Its shots.
    pub shots: usize,
    /// Mean of measured minus predicted heights, metres.
    pub above_m: f64,
    /// Standard deviation of `above_m` according to the surface, metres.
    pub sigma_m: f64,
    /// Distance to the nearest shot of another profile, metres.
    pub nearest_m: f64,
}

/// Agreement of withheld stretches with the stated standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct WithheldScore {
    /// Stretches.
    pub stretches: usize,
    /// Shares of the stretches inside the stated intervals of 68.27, 95 and 99.7 %.
    pub inside: [f64; 3],
    /// Mean log-likelihood of a stretch, which for a normal distribution would be −½ z² − ln σ.
    pub log_likelihood: f64,
    /// Mean of ln σ, σ in metres.
    pub log_sigma: f64,
    /// Root mean square of the errors, metres.
    pub rms_m: f64,
    /// Median absolute error, in standard deviations; 0.67 for a normal distribution.
    pub median_sigmas: f64,
}

impl WithheldScore {
    /// Probabilities of the intervals.
    pub const INTERVALS: [f64; 3] = [0.6827, 0.95, 0.997];

    /// The score of these stretches; `None` without any.
    #[must_use]
    pub fn of(stretches: &[Withheld]) -> Option<Self> {
        let count = stretches.len() as f64;
        let mut sigmas: Vec<f64> = stretches
            .iter()
            .map(|stretch| stretch.above_m.abs() / stretch.sigma_m)
            .collect();
        let inside = Self::INTERVALS.map(|probability| {
            let half_width = tails::half_width(probability);
            let inside = sigmas.iter().filter(|sigmas| **sigmas <= half_width);
            inside.count() as f64 / count
        });
        let mean = |value: fn(&Withheld) -> f64| stretches.iter().map(value).sum::<f64>() / count;
        (!stretches.is_empty()).then(|| Self {
            stretches: stretches.len(),
            inside,
            log_likelihood: mean(|of| tails::log_likelihood(of.above_m, of.sigma_m)),
            log_sigma: mean(|of| of.sigma_m.ln()),
            rms_m: mean(|of| of.above_m.powi(2)).sqrt(),
            median_sigmas: median(&mut sigmas),
        })
    }
}

/// Stretches of all profiles, each predicted from the shots of all other profiles.
///
/// `shots` are in their order along the profiles. Stretches that too few other shots predict are left out.
#[must_use]
pub fn withheld(shots: &[SurfaceShot], options: &SurfaceOptions) -> Vec<Withheld> {
    // Shots of one instrument share the errors of its position in plan.
    let options = SurfaceOptions {
        plan_sigma_m: 0.0,
        uses_relief: false,
        ..*options
    };
    let mut stretches = Vec::new();
    let mut first = 0;
    for profile in shots.chunk_by(|one, next| one.profile == next.profile) {
        let pieces = profile.len().div_ceil(STRETCH_SHOTS);
        for piece in 0..pieces {
            let from = piece * profile.len() / pieces;
            let to = (piece + 1) * profile.len() / pieces;
            if to - from >= STRETCH_MIN {
                stretches.push((first + from, first + to));
            }
        }
        first += profile.len();
    }
    let taken = stretches.len().min(STRETCHES_MAX);
    let chosen: Vec<(usize, usize)> = (0..taken)
        .map(|index| stretches[index * stretches.len() / taken])
        .collect();
    let predicted = chosen
        .par_iter()
        .map(|(from, to)| predicted(shots, *from, *to, &options));
    predicted
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect()
}

/// Shots of other profiles, among them the [`PREDICTING`] nearest to the sampled shots of a stretch.
///
/// A shot is at most as far from the samples as from their middle, and nearer by at most the reach of the samples: of a million
/// shots few remain.
fn candidates(shots: &[SurfaceShot], profile: usize, sampled: &[&Vector3<f64>]) -> Vec<usize> {
    let middle = sampled[sampled.len() / 2];
    let reach_m = sampled.iter().map(|of| (*of - middle).norm());
    let reach_m = reach_m.fold(0.0, f64::max);
    let from_middle_m = |shot: &SurfaceShot| {
        let from_m = (shot.ground_m - middle).norm();
        if shot.profile != profile && from_m.is_finite() {
            from_m
        } else {
            f64::INFINITY
        }
    };
    let far_m = if shots.len() > PREDICTING {
        let mut sizes_m: Vec<f64> = shots.iter().map(from_middle_m).collect();
        let (_, of_last, _) = sizes_m.select_nth_unstable_by(PREDICTING, f64::total_cmp);
        (*of_last + reach_m + ROUNDING_M).min(f64::MAX)
    } else {
        f64::MAX
    };
    let near = shots.iter().map(from_middle_m).enumerate();
    near.filter(|(_, from_m)| *from_m <= far_m)
        .map(|(index, _)| index)
        .collect()
}

fn predicted(
    shots: &[SurfaceShot],
    from: usize,
    to: usize,
    options: &SurfaceOptions,
) -> Option<Withheld> {
    let stretch = &shots[from..to];
    let profile = stretch[0].profile;
    let sampled: Vec<&Vector3<f64>> = stretch
        .iter()
        .step_by(DISTANCE_STEP)
        .map(|shot| &shot.ground_m)
        .collect();
    let mut by_distance: Vec<(f64, usize)> = candidates(shots, profile, &sampled)
        .into_iter()
        .map(|index| {
            let distances_m = sampled
                .iter()
                .map(|of| (*of - shots[index].ground_m).norm());
            (distances_m.fold(f64::INFINITY, f64::min), index)
        })
        .collect();
    if by_distance.len() > PREDICTING {
        by_distance.select_nth_unstable_by(PREDICTING, |one, other| {
            one.0.total_cmp(&other.0).then(one.1.cmp(&other.1))
        });
        by_distance.truncate(PREDICTING);
    }
    let mut nearest: Vec<usize> = by_distance.into_iter().map(|(_, index)| index).collect();
    // In their order along the profiles.
    nearest.sort_unstable();
    let nearest: Vec<SurfaceShot> = nearest.into_iter().map(|index| shots[index]).collect();
    let surface = LaserSurface::new(&nearest, &[], options).ok()?;
    let places_m: Vec<Vector3<f64>> = stretch.iter().map(|shot| shot.ground_m).collect();
    let found = surface.predict_mean(&places_m);
    let count = places_m.len() as f64;
    let measured_m = places_m
        .iter()
        .map(|place_m| height_m(options.body.model(), place_m).0);
    let shared = stretch[0].shared(options.profile_sigma_m);
    let own_m2 = options.shot_sigma_m.powi(2) + 2.0 * surface.variogram().at(shared.farther_m());
    let variance_m2 =
        found.variance_m2 + own_m2 / count + (options.profile_sigma_m * shared.radial).powi(2);
    Some(Withheld {
        profile,
        first: from,
        shots: stretch.len(),
        above_m: measured_m.sum::<f64>() / count - found.height_m,
        sigma_m: variance_m2.sqrt(),
        nearest_m: surface.nearest_m(&places_m),
    })
}
