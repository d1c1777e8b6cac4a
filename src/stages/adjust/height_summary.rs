//! Heights of tie points against the MOLA surface, as the adjustment observes them.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{components::variance_factor, network::Assembled};
use crate::{
    geom::{
        bundle::{Adjustment, HeightResidual},
        ellipsoid::local_axes,
        statistics::{BAARDA_LIMIT, Summary},
    },
    schema::none_negative,
};

/// Heights of tie points against the MOLA surface, as observations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeightSummary {
    /// Tie points whose height is observed.
    pub ties: usize,
    /// Shots of the surface.
    pub shots: usize,
    /// Profiles that they belong to.
    pub profiles: usize,
    /// Root mean square difference of heights 300 m apart, metres.
    #[schemars(range(min = 0.0))]
    pub roughness_m: f64,
    /// Whether the surface under these tie points and the weights of their heights had come to rest; if not, both
    /// still changed in the last of 15 rounds.
    pub settled: bool,
    /// Adjusted heights above the surface, metres.
    pub above_m: Summary,
    /// Tie points that are compared with the surface, and those of them that lie farther from it than 3.29 of their own
    /// standard deviations: craters between the profiles are some, more are measurements that err across the track.
    pub compared: usize,
    /// See `compared`.
    pub beyond_limit: usize,
    /// Standard deviations of the mean of these points towards east, north and up, metres: what they have in common.
    #[schemars(transform = none_negative)]
    pub mean_sigma_m: [f64; 3],
}

impl HeightSummary {
    /// Share of the compared tie points that lie beyond the limit; a single one is no share.
    #[must_use]
    pub fn beyond_share(&self) -> f64 {
        if self.beyond_limit > 1 {
            self.beyond_limit as f64 / self.compared as f64
        } else {
            0.0
        }
    }
}

/// Heights as observations, where they are.
pub(super) fn heights<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
) -> Option<HeightSummary> {
    let control = assembled.network.heights.as_ref()?;
    let above_m: Vec<f64> = adjustment
        .heights
        .iter()
        .map(|height| height.above_m)
        .collect();
    let factor = variance_factor(assembled, adjustment);
    Some(HeightSummary {
        ties: adjustment.heights.len(),
        shots: control.surface.shots(),
        profiles: control.surface.profiles().len(),
        roughness_m: control.surface.variogram().roughness_m,
        settled: adjustment.heights_settled,
        above_m: Summary::of(&above_m),
        compared: adjustment.compared.len(),
        beyond_limit: beyond_limit(&adjustment.compared),
        mean_sigma_m: mean_sigma_m(adjustment, factor)?,
    })
}

/// Standard deviations of the mean of the points with an observed height towards east, north and up, metres.
pub(super) fn mean_sigma_m(adjustment: &Adjustment, variance_factor: f64) -> Option<[f64; 3]> {
    let points = adjustment.heights.iter();
    let points = points.filter_map(|height| adjustment.points[height.point].as_ref().ok());
    let middle_m: Vector3<f64> = points.map(|point| point.ground_m).sum();
    let to_local = local_axes(&middle_m);
    let mean_m2 = to_local * adjustment.mean_cofactor_m2? * to_local.transpose();
    Some([0, 1, 2].map(|axis| (variance_factor * mean_m2[(axis, axis)]).sqrt()))
}

/// Heights beyond the limit of the test.
pub(super) fn beyond_limit(heights: &[HeightResidual]) -> usize {
    // Written so that NaN counts.
    let beyond =
        |height: &&HeightResidual| !(height.above_m.abs() <= BAARDA_LIMIT * height.sigma_m());
    heights.iter().filter(beyond).count()
}
