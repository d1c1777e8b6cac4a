//! Observation equations of single views and ranges.

use nalgebra::{Vector2, Vector3};

use super::{BundleImage, ORIENTATION_UNKNOWNS, Range, View};
use crate::geom::{
    attitude::{matrix_of_rotation_vector, turn_of_rotation_vector},
    collinearity::{BehindCamera, by_camera_point, project},
    pushbroom::{Motion, OrientationCorrection, Pose},
};

/// Partial derivatives with respect to the 18 coefficients of an image's correction and its time bias.
pub(super) type ImagePartials = [f64; ORIENTATION_UNKNOWNS + 1];

/// One linearised observation, not yet divided by its standard deviation.
#[derive(Clone, Copy)]
pub(super) struct Row {
    /// Observed minus computed.
    pub(super) misclosure: f64,
    pub(super) sigma: f64,
    /// By the ground point; by the perspective centre it is the negative.
    pub(super) by_point: Vector3<f64>,
    /// By the rotation vector of the correction.
    pub(super) by_rotation: Vector3<f64>,
    /// By the time bias of the image.
    pub(super) by_time: f64,
    /// Place in the image, half its lines being 1.
    t: f64,
}

impl Row {
    /// Partial derivatives with respect to the unknowns of the image.
    pub(super) fn by_image(&self) -> ImagePartials {
        let mut partials = [0.0; ORIENTATION_UNKNOWNS + 1];
        for axis in 0..3 {
            let mut power_of_t = 1.0;
            for power in 0..3 {
                partials[3 * axis + power] = -power_of_t * self.by_point[axis];
                partials[9 + 3 * axis + power] = power_of_t * self.by_rotation[axis];
                power_of_t *= self.t;
            }
        }
        partials[ORIENTATION_UNKNOWNS] = self.by_time;
        partials
    }
}

/// The rows of a view of `ground_m`, along the track and across it.
///
/// `base` is the initial orientation where the line was exposed: a time bias later than its tag says.
/// Its `motion` is wanted where the time bias is unknown.
pub(super) fn of_view<M>(
    image: &BundleImage<M>,
    correction: &OrientationCorrection,
    base: &Pose,
    motion: Option<&Motion>,
    view: &View,
    ground_m: &Vector3<f64>,
) -> Result<[Row; 2], BehindCamera> {
    let vector_rad = correction.turn_rad(view.x_lines);
    let rotation = matrix_of_rotation_vector(&vector_rad);
    let pose = Pose {
        position_m: base.position_m + correction.shift_m(view.x_lines),
        mars_to_camera: rotation * base.mars_to_camera,
    };
    let camera_m = pose.camera_vector_m(ground_m);
    let focal = project(&camera_m, image.focal_length_px)?;
    let misclosure = Vector2::new(0.0, view.y_px) - focal;
    let by_camera_point = by_camera_point(&camera_m, image.focal_length_px);
    // The initial orientation turns and advances under its correction.
    let by_time = motion.map_or_else(Vector2::zeros, |motion| {
        let rate_m =
            (rotation * motion.turn_rad).cross(&camera_m) - pose.mars_to_camera * motion.advance_m;
        by_camera_point * rate_m / image.line_period_s
    });
    Ok([0, 1].map(|axis| {
        let by_camera_point = by_camera_point.row(axis).transpose();
        // A rotation ε moves the camera vector q by ε × q, and a change of the rotation vector turns by
        // the left Jacobian times it.
        let by_turn = camera_m.cross(&by_camera_point);
        Row {
            misclosure: misclosure[axis],
            sigma: view.sigma_px[axis],
            by_point: pose.mars_to_camera.tr_mul(&by_camera_point),
            by_rotation: turn_of_rotation_vector(&-vector_rad, &by_turn),
            by_time: by_time[axis],
            t: view.x_lines / image.half_lines,
        }
    }))
}

/// The row of a range to `ground_m`; its derivative by the bias of its profile is 1.
///
/// `base_m` is the initial position at the instant of the shot. That instant does not come from the
/// image, so a time bias of the image does not move it.
pub(super) fn of_range<M>(
    image: &BundleImage<M>,
    correction: &OrientationCorrection,
    base_m: &Vector3<f64>,
    range: &Range,
    bias_m: f64,
    ground_m: &Vector3<f64>,
) -> Row {
    let away_m = ground_m - base_m - correction.shift_m(range.x_lines);
    let distance_m = away_m.norm();
    Row {
        misclosure: range.range_m - distance_m - bias_m,
        sigma: range.sigma_m,
        by_point: away_m / distance_m,
        by_rotation: Vector3::zeros(),
        by_time: 0.0,
        t: range.x_lines / image.half_lines,
    }
}
