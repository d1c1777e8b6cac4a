//! Observation equations of single views and ranges.

use nalgebra::{RowVector3, SVector, Vector2, Vector3};

use super::{Network, ORIENTATION_UNKNOWNS, Range, View, unknowns::State};
use crate::geom::{
    attitude::{matrix_of_rotation_vector, turn_of_rotation_vector},
    collinearity::{BehindCamera, by_camera_point, project},
    pushbroom::{ExteriorOrientation, Pose},
};

/// Partial derivatives with respect to the 18 coefficients of an image's correction and its time bias.
pub(super) type ImagePartials = SVector<f64, { ORIENTATION_UNKNOWNS + 1 }>;

/// One linearised observation, not yet divided by its standard deviation.
#[derive(Clone, Copy)]
pub(super) struct Row {
    /// Observed minus computed.
    pub(super) misclosure: f64,
    pub(super) sigma: f64,
    pub(super) by_image: ImagePartials,
    pub(super) by_point: RowVector3<f64>,
}

fn chain(
    by_position: &RowVector3<f64>,
    by_rotation: &Vector3<f64>,
    t: f64,
    by_time: f64,
) -> ImagePartials {
    let mut partials = ImagePartials::zeros();
    for axis in 0..3 {
        let mut power_of_t = 1.0;
        for power in 0..3 {
            partials[3 * axis + power] = power_of_t * by_position[axis];
            partials[9 + 3 * axis + power] = power_of_t * by_rotation[axis];
            power_of_t *= t;
        }
    }
    partials[ORIENTATION_UNKNOWNS] = by_time;
    partials
}

/// The rows of a view, along the track and across it.
///
/// The line is exposed a time bias later than its tag says, so the initial orientation is taken there.
pub(super) fn of_view<M: ExteriorOrientation>(
    network: &Network<M>,
    state: &State,
    view: &View,
) -> Result<[Row; 2], BehindCamera> {
    let image = &network.images[view.image];
    let correction = &state.orientations[view.image];
    let (base, motion) = image
        .base
        .moving(view.x_lines + correction.time_shift_lines);
    let vector_rad = correction.turn_rad(view.x_lines);
    let rotation = matrix_of_rotation_vector(&vector_rad);
    let pose = Pose {
        position_m: base.position_m + correction.shift_m(view.x_lines),
        mars_to_camera: rotation * base.mars_to_camera,
    };
    let camera_m = pose.camera_vector_m(&state.points_m[view.point]);
    let focal = project(&camera_m, image.focal_length_px)?;
    let by_camera_point = by_camera_point(&camera_m, image.focal_length_px);
    let by_ground = by_camera_point * pose.mars_to_camera;
    let misclosure = Vector2::new(0.0, view.y_px) - focal;
    // The initial orientation turns and advances under its correction.
    let camera_rate_m =
        (rotation * motion.turn_rad).cross(&camera_m) - pose.mars_to_camera * motion.advance_m;
    let by_time = by_camera_point * camera_rate_m / image.line_period_s;
    let t = view.x_lines / image.half_lines;
    Ok([0, 1].map(|axis| {
        let by_point: RowVector3<f64> = by_ground.row(axis).into_owned();
        // A rotation ε moves the camera vector q by ε × q, and a change of the rotation vector turns by
        // the left Jacobian times it.
        let across = camera_m.cross(&by_camera_point.row(axis).transpose());
        let by_rotation = turn_of_rotation_vector(&-vector_rad, &across);
        Row {
            misclosure: misclosure[axis],
            sigma: view.sigma_px[axis],
            by_image: chain(&-by_point, &by_rotation, t, by_time[axis]),
            by_point,
        }
    }))
}

/// The row of a range; its derivative by the bias of its profile is 1.
///
/// The instant of a shot does not come from the image, so a time bias of the image does not move it.
pub(super) fn of_range<M: ExteriorOrientation>(
    network: &Network<M>,
    state: &State,
    range: &Range,
) -> Row {
    let base_m = network.images[range.image]
        .base
        .pose(range.x_lines)
        .position_m;
    let position_m = base_m + state.orientations[range.image].shift_m(range.x_lines);
    let away_m: Vector3<f64> = position_m - state.points_m[range.point];
    let distance_m = away_m.norm();
    let towards = away_m.transpose() / distance_m;
    let t = range.x_lines / network.images[range.image].half_lines;
    Row {
        misclosure: range.range_m - distance_m - state.range_biases_m[range.profile],
        sigma: range.sigma_m,
        by_image: chain(&towards, &Vector3::zeros(), t, 0.0),
        by_point: -towards,
    }
}
