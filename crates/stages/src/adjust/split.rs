//! Two readings of the along-track disagreement of images.
//!
//! Tie points determine the distance between two images, not which of them is right. Either all images are equally
//! likely to be wrong, and the distance is split evenly; or attitudes were read at a time with the same offset for all
//! images: then nadir-tracking images are wrong and inertially held images are right. The standard deviations of either
//! reading hold only if that reading does.
//!
//! # Source
//! A choice. In Shan et al. 2005, Table 5, the nadir images of three sites are displaced to the same side, which one
//! offset of the attitude clock would explain; the paper does not state this.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    attitude_clock::{by_attitude_clock, evenly},
    height_summary::mean_sigma_m,
    input::AdjustImage,
    network::Assembled,
    points::PointKind,
};
use areograph_base::footprints::AdjustmentModel;
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    bundle::{Adjustment, BundleError, BundleOptions, solve_comparing},
    ellipsoid::local_axes,
    pushbroom::ExteriorOrientation,
};

/// Images with a smaller along-track disagreement need no other reading, metres: both place the tie points within half
/// of it, below the stated accuracy of the position.
const BOTH_ABOVE_M: f64 = 100.0;

/// Position of the tie points by the other reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OtherReading {
    /// Offset of the attitude clock with its standard deviation, seconds, where this reading uses it; otherwise all
    /// images are treated as equally likely to be in error.
    pub attitude_clock_s: Option<(f64, f64)>,
    /// Mean of the tie points by this reading minus their mean by the adjustment, towards east, north and up, metres.
    pub moved_m: [f64; 3],
    /// Standard deviations of their mean by this reading, in east, north and height, metres; `None` where no surface
    /// controls heights.
    pub mean_sigma_m: Option<[f64; 3]>,
}

/// Whether images with this along-track disagreement need both readings.
pub(super) fn needs_both_readings(disagreement_m: f64, config: &AdjustmentConfig) -> bool {
    config.model == AdjustmentModel::MolaSurface && disagreement_m > BOTH_ABOVE_M
}

/// Adjusts the remaining tie points by the other reading.
pub(super) fn other_reading<'a, M: ExteriorOrientation>(
    images: &'a [AdjustImage<M>],
    assembled: &Assembled<&'a M>,
    adjustment: &Adjustment,
    variance_factor: f64,
    bundle_options: &BundleOptions,
    config: &AdjustmentConfig,
) -> Result<OtherReading, BundleError> {
    let mut network = assembled.network.clone();
    if config.attitude_clock {
        evenly(&mut network, images, config);
    } else {
        by_attitude_clock(&mut network, images, config);
    }
    // Only its observed heights are used.
    let other = solve_comparing(&network, bundle_options, |_| false)?;
    let points = adjustment.points.iter().zip(&other.points).enumerate();
    let both_m: Vec<[Vector3<f64>; 2]> = points
        .filter(|(point, _)| assembled.kind(*point) == PointKind::Tie)
        .filter_map(|(_, (here, there))| {
            Some([here.as_ref().ok()?.ground_m, there.as_ref().ok()?.ground_m])
        })
        .collect();
    let middle_m: Vector3<f64> = both_m.iter().map(|[here_m, _]| here_m).sum();
    let moved_m: Vector3<f64> = both_m
        .iter()
        .map(|[here_m, there_m]| there_m - here_m)
        .sum();
    let root = variance_factor.sqrt();
    Ok(OtherReading {
        attitude_clock_s: other
            .attitude_clock_s
            .map(|(offset_s, root_s)| (offset_s, root_s * root)),
        moved_m: (local_axes(&middle_m) * moved_m / both_m.len().max(1) as f64).into(),
        mean_sigma_m: mean_sigma_m(&other, variance_factor),
    })
}
