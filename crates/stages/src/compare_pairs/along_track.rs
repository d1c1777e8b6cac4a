//! How errors of times and attitudes displace the images of a pair along the track.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    intersect::{IntersectedPoint, MeasureResidual},
    turn::turn_rad_s,
};
use areograph_base::{body::BodyModel, schema::all_positive};
use areograph_geom::{
    oriented_camera::OrientedCamera,
    pushbroom::{CorrectedOrientation, ExteriorOrientation, OrientationCorrection, Projector},
    readings::PairDisagreement,
    statistics::Summary,
};

/// Smallest cosine of the angle between the flight directions of a pair that has one along-track axis.
const SAME_DIRECTION: f64 = 0.9;
/// Largest share of the base along the track: the intersection absorbs a displacement along the base in heights.
const ALONG_BASE_MAX: f64 = 0.5;
/// Offset of the clock whose effect is computed, seconds: 3 m on the ground, far more than the rounding of a line and still linear.
const STEP_S: f64 = 0.01;

/// Displacement of the ground along the track, first minus second image of a pair, and its dependence on errors of both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlongTrack {
    /// Measured displacement, metres: the mean over the tie points.
    pub apart_m: f64,
    /// Its standard deviation from the scatter of the tie points, metres.
    #[schemars(range(min = 0.0))]
    pub sigma_m: f64,
    /// Distance of the ground from each camera, metres: displacement per radian of a rotation about the axis across the track.
    #[schemars(transform = all_positive)]
    pub range_m: [f64; 2],
    /// Displacement by a delay of the lines of each image, metres per second.
    #[schemars(transform = all_positive)]
    pub line_time_m_s: [f64; 2],
    /// Displacement by an offset of the attitude clock of both images, metres per second.
    pub clock_m_s: f64,
}

impl AlongTrack {
    /// The displacement of the tie points `points` of a pair; `None` where a rotated camera does not see them, where the images were not
    /// flown in one direction, and where their base is not across the track.
    pub(super) fn of<M: ExteriorOrientation>(
        points: &[(&IntersectedPoint, [MeasureResidual; 2])],
        pair: [&OrientedCamera<M>; 2],
        body: &BodyModel,
        line_spacing_m: [f64; 2],
        pixel_size_m: [f64; 2],
    ) -> Option<Self> {
        let apart = points.iter().map(|(_, [first, second])| {
            first.reprojection_lines * line_spacing_m[0]
                - second.reprojection_lines * line_spacing_m[1]
        });
        let apart = Summary::of(&apart.collect::<Vec<f64>>());
        let (one, measures) = points[points.len() / 2];
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
        let lines_s = pair.map(|camera| lines_by_clock_s(camera, body, &one.ground.xyz_m));
        let [first_s, second_s] = lines_s;
        Some(Self {
            apart_m: apart.mean,
            sigma_m: apart.standard_deviation / (points.len() as f64).sqrt(),
            range_m: [0, 1].map(|at| pixel_size_m[at] * pair[at].detector.focal_length_px),
            line_time_m_s: [0, 1]
                .map(|at| line_spacing_m[at] / pair[at].line_times.mean_period_s()),
            clock_m_s: first_s? * line_spacing_m[0] - second_s? * line_spacing_m[1],
        })
    }

    /// The displacement as an observation of its causes.
    #[must_use]
    pub fn disagreement(&self, images: [String; 2]) -> PairDisagreement {
        PairDisagreement {
            images,
            apart_m: self.apart_m,
            sigma_m: self.sigma_m,
            range_m: self.range_m,
            line_time_m_s: self.line_time_m_s,
            clock_m_s: self.clock_m_s,
        }
    }
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
