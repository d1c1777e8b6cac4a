//! How errors of times and attitudes displace the images of a pair along the track.

use nalgebra::Vector3;

use crate::{
    intersect::{IntersectedPoint, MeasureResidual},
    turn::turn_rad_s,
};
use areograph_base::body::BodyModel;
use areograph_geom::{
    oriented_camera::OrientedCamera,
    pushbroom::{CorrectedOrientation, ExteriorOrientation, OrientationCorrection, Projector},
    readings::AlongTrack,
};

/// Smallest cosine of the angle between the flight directions of a pair that has one along-track axis.
const SAME_DIRECTION: f64 = 0.9;
/// Largest share of the base along the track: the intersection absorbs a displacement along the base in heights.
const ALONG_BASE_MAX: f64 = 0.5;
/// Offset of the clock whose effect is computed, seconds: 3 m on the ground, far more than the rounding of a line and still linear.
const STEP_S: f64 = 0.01;

/// The displacement `apart_m` of a pair with its standard deviation, and its change with errors, at the tie point `point`; `None` where
/// a rotated camera does not see it, where the images were not flown in one direction, and where their base is not across the track.
pub(super) fn along_track<M: ExteriorOrientation>(
    pair: [&OrientedCamera<M>; 2],
    body: &BodyModel,
    (point, measures): &(&IntersectedPoint, [MeasureResidual; 2]),
    line_spacing_m: [f64; 2],
    [apart_m, sigma_m]: [f64; 2],
) -> Option<AlongTrack> {
    let ground_m = &point.ground.xyz_m;
    let poses = [0, 1].map(|at| {
        let (pose, rate) = pair[at].orientation.pose_and_rate(measures[at].x_lines);
        (pose.position_m, rate.advance_m.normalize())
    });
    let [(first_m, track), (second_m, other_track)] = poses;
    let base = (second_m - first_m).normalize();
    // Written so that NaN is refused.
    if !(track.dot(&other_track) > SAME_DIRECTION && base.dot(&track).abs() < ALONG_BASE_MAX) {
        return None;
    }
    let [first_s, second_s] = pair.map(|camera| lines_by_clock_s(camera, body, ground_m));
    let period_s = pair.map(|camera| camera.line_times.mean_period_s());
    Some(AlongTrack {
        apart_m,
        sigma_m,
        range_m: [first_m, second_m].map(|position_m| (position_m - ground_m).norm()),
        line_time_m_s: [0, 1].map(|at| line_spacing_m[at] / period_s[at]),
        clock_m_s: first_s? * line_spacing_m[0] - second_s? * line_spacing_m[1],
    })
}

/// Change of the line that shows `ground_m` with an offset of the attitude clock, lines per second. An offset that is added to the time at
/// which attitudes are read rotates the camera as it turns.
fn lines_by_clock_s<M: ExteriorOrientation>(
    camera: &OrientedCamera<M>,
    body: &BodyModel,
    ground_m: &Vector3<f64>,
) -> Option<f64> {
    let turn_rad = turn_rad_s(camera, body) * STEP_S;
    let seen_x = |sign: f64| {
        let mut correction = OrientationCorrection::of(&[0.0; 18], 0.5 * camera.lines(), 0.0);
        correction.rotation_rad[0] = sign * turn_rad;
        let base = &camera.orientation;
        let turned = CorrectedOrientation { base, correction };
        let projector = Projector::new(&turned, camera.lines()).ok()?;
        let projector = projector.through(camera.detector.distortion);
        Some(projector.project(ground_m).ok()?.x)
    };
    Some((seen_x(1.0)? - seen_x(-1.0)?) / (2.0 * STEP_S))
}
