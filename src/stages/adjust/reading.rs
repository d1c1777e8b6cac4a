//! Two readings of images that do not meet along the flight: each is as wrong as the other, or the attitude's clock of
//! those that look to nadir is off. Tie points do not tell them apart; both results belong before the reader.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{AdjustImage, Adjusted, OtherReading, PointKind};
use crate::{
    geom::{ellipsoid::local_axes, pushbroom::ExteriorOrientation},
    stages::intersect::IntersectedTies,
};

/// Images that meet this closely along the flight need no second reading, metres.
const DISPUTED_M: f64 = 100.0;
/// Standard deviation of the attitude's clock in the reading that has one, seconds.
pub(super) const CLOCK_SIGMA_S: f64 = 1.0;

/// What `other` says where `adjusted` says something too.
pub(super) fn other_reading(
    adjusted: &Adjusted,
    other: &Adjusted,
    attitude_clock: bool,
) -> Option<OtherReading> {
    let ties = |of: &Adjusted| -> BTreeMap<usize, Vector3<f64>> {
        let points = of.points.iter();
        let ties = points.filter(|point| point.kind == PointKind::Tie);
        ties.map(|point| (point.index, point.ground.xyz_m))
            .collect()
    };
    let (here, there) = (ties(adjusted), ties(other));
    let both: Vec<_> = here
        .iter()
        .filter_map(|(tie, here_m)| Some((*here_m, *there.get(tie)?)))
        .collect();
    let count = both.len() as f64;
    let middle_m = both.iter().map(|(here_m, _)| here_m).sum::<Vector3<f64>>();
    let moved_m = both.iter().map(|(here_m, there_m)| there_m - here_m);
    let moved_m = local_axes(&middle_m) * moved_m.sum::<Vector3<f64>>() / count;
    (!both.is_empty()).then(|| OtherReading {
        attitude_clock,
        moved_m: moved_m.into(),
        ties: both.len(),
    })
}

/// Whether two images place their tie points farther apart along the flight than that a second reading is needless.
pub(super) fn is_disputed<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    starts: &IntersectedTies,
) -> bool {
    let mut off_m = vec![(0.0, 0.0_f64); images.len()];
    for point in starts.points.iter().filter(|point| !point.outlier) {
        for measure in &point.measures {
            let camera = &images[measure.image].oriented_camera;
            let spacing_m = camera.line_spacing_m(measure.x_lines, &point.ground.xyz_m);
            let (sum_m, count) = &mut off_m[measure.image];
            *sum_m += measure.reprojection_lines * spacing_m;
            *count += 1.0;
        }
    }
    let means_m = off_m.iter().map(|(sum_m, count)| sum_m / count.max(1.0));
    let range_m = means_m.fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[least, most], mean_m| [least.min(mean_m), most.max(mean_m)],
    );
    range_m[1] - range_m[0] > DISPUTED_M
}
