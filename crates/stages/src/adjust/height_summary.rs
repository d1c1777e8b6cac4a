//! Heights of tie points above the MOLA surface, as the adjustment observes them.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    components::variance_factor,
    mean_parts::MeanSigmaParts,
    network::Assembled,
    points::{RejectedPoint, RejectionReason},
};
use areograph_base::schema::none_negative;
use areograph_geom::{
    bundle::{Adjustment, HeightResidual},
    ellipsoid::local_axes,
    statistics::{BAARDA_LIMIT, Summary},
};

/// Numbers of tie points beyond the limit that chance explains: kept ones only, and together with the rejected ones.
const CHANCE_KEPT: usize = 1;
const CHANCE_ALL: usize = 2;

/// Heights of tie points above the MOLA surface, as observations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeightSummary {
    /// Number of tie points with an observed height.
    pub ties: usize,
    /// Number of shots of the surface.
    pub shots: usize,
    /// Number of profiles to which these shots belong.
    pub profiles: usize,
    /// Root mean square difference of heights 300 m apart, metres.
    #[schemars(range(min = 0.0))]
    pub roughness_m: f64,
    /// Whether the surface under the tie points and the weights of their heights converged; if not, both still changed
    /// in the last of 15 rounds.
    pub settled: bool,
    /// Statistics of adjusted heights above the surface, metres.
    pub above_m: Summary,
    /// Number of tie points that are compared with the surface; `beyond_limit` of these points are farther from the
    /// surface than 3.29 of their own standard deviations. A few of these may lie in craters between the profiles; a
    /// larger number indicates measurement errors across the track.
    pub compared: usize,
    /// Number of compared tie points that are farther from the surface than 3.29 of their own standard deviations.
    pub beyond_limit: usize,
    /// Number of tie points that were rejected for their height; `compared` does not include these points.
    pub rejected: usize,
    /// Standard deviations of the mean of the tie points in east, north and height, metres. They contain the common
    /// errors of the tie points and, in height, the shift of the mean by points beyond the limit, some of which may be
    /// in error.
    #[schemars(transform = none_negative)]
    pub mean_sigma_m: [f64; 3],
    /// Parts of `mean_sigma_m` by cause.
    pub mean_sigma_parts: MeanSigmaParts,
}

impl HeightSummary {
    /// Share of the tie points beyond the limit, including those rejected for it: an error across the track is
    /// identified only where no neighbour has a similar one. One kept point, or two including rejected ones, count as
    /// 0.
    #[must_use]
    pub fn beyond_share(&self) -> f64 {
        let share = |beyond: usize, of: usize, chance: usize| {
            if beyond > chance {
                beyond as f64 / of as f64
            } else {
                0.0
            }
        };
        let kept = share(self.beyond_limit, self.compared, CHANCE_KEPT);
        let all = share(
            self.beyond_limit + self.rejected,
            self.compared + self.rejected,
            CHANCE_ALL,
        );
        kept.max(all)
    }
}

/// Summary of the heights, where they are observations.
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
    let mean_sigma_m = datum_sigma_m(adjustment, factor)?;
    let parts = adjustment.mean_parts.as_ref()?;
    let to_local = local_axes(&middle_m(adjustment));
    let mean_m2 = adjustment.mean_cofactor_m2.as_ref()?;
    let moved_m = moved_by_outliers_m(adjustment);
    let compared = &adjustment.compared;
    let for_height = |of: &&RejectedPoint| matches!(of.reason, RejectionReason::Height { .. });
    Some(HeightSummary {
        ties: adjustment.heights.len(),
        shots: control.surface.shots(),
        profiles: control.surface.profiles().len(),
        roughness_m: control.surface.variogram().roughness_m,
        settled: adjustment.heights_settled,
        above_m: Summary::of(&above_m),
        compared: compared.len(),
        beyond_limit: beyond_limit(compared),
        rejected: assembled.rejected.iter().filter(for_height).count(),
        mean_sigma_m,
        mean_sigma_parts: MeanSigmaParts::of(mean_m2, parts, &to_local, factor, moved_m),
    })
}

/// Standard deviations of the error that tie points share in east, north and height, metres: standard deviations of
/// their mean and, upwards, the shift of the mean by points beyond the limit.
pub(super) fn datum_sigma_m(adjustment: &Adjustment, variance_factor: f64) -> Option<[f64; 3]> {
    let [east_m, north_m, up_m] = mean_sigma_m(adjustment, variance_factor)?;
    Some([east_m, north_m, up_m.hypot(moved_by_outliers_m(adjustment))])
}

/// Shift of the mean height by points beyond the limit, metres.
fn moved_by_outliers_m(adjustment: &Adjustment) -> f64 {
    let compared = &adjustment.compared;
    let moved_m = compared
        .iter()
        .filter(|of| is_beyond(of))
        .map(|of| of.above_m);
    moved_m.sum::<f64>() / compared.len().max(1) as f64
}

/// Standard deviations of the mean of the points with an observed height in east, north and height, metres.
pub(super) fn mean_sigma_m(adjustment: &Adjustment, variance_factor: f64) -> Option<[f64; 3]> {
    let to_local = local_axes(&middle_m(adjustment));
    let mean_m2 = to_local * adjustment.mean_cofactor_m2? * to_local.transpose();
    Some([0, 1, 2].map(|axis| (variance_factor * mean_m2[(axis, axis)]).sqrt()))
}

/// Direction of the mean of the points with an observed height.
fn middle_m(adjustment: &Adjustment) -> Vector3<f64> {
    let points = adjustment.heights.iter();
    let points = points.filter_map(|height| adjustment.points[height.point].as_ref().ok());
    points.map(|point| point.ground_m).sum()
}

/// Heights beyond the limit of the test.
pub(super) fn beyond_limit(heights: &[HeightResidual]) -> usize {
    heights.iter().filter(|height| is_beyond(height)).count()
}

fn is_beyond(height: &HeightResidual) -> bool {
    // Written so that NaN counts.
    !(height.above_m.abs() <= BAARDA_LIMIT * height.sigma_m())
}
