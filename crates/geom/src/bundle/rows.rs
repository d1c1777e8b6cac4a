//! Observation equations of single views and ranges.

use nalgebra::{Matrix2x3, Vector3};

use super::{BundleImage, ORIENTATION_UNKNOWNS, Range, View};
use crate::{
    attitude::{left_jacobian_product, matrix_of_rotation_vector},
    collinearity::by_camera_point,
    pushbroom::{
        CorrectedOrientation, ExteriorOrientation, OrientationCorrection, Sighting, Unseen,
    },
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

/// A step below this many lines ends the search for the line of a view: rates that change by 1e-4 of themselves per
/// line are exact to 1e-7.
const LAST_STEP_LINES: f64 = 1e-3;

/// Displacement of a point at its initial coordinates along the focal plane from the measured line to the next,
/// with the initial orientation, focal-plane pixels.
///
/// The unit of the along-track residuals must not depend on the unknowns: a model that flies more slowly would make
/// them smaller.
pub(super) fn initial_px_per_line<M: ExteriorOrientation>(
    image: &BundleImage<M>,
    view: &View,
    ground_m: &Vector3<f64>,
) -> f64 {
    let (pose, motion) = image.base.pose_and_rate(view.x_lines);
    let camera_m = pose.camera_vector_m(ground_m);
    let rate_m = motion.camera_vector_rate_m(&pose, &camera_m);
    (by_camera_point_off_line(image, &camera_m) * rate_m).x
}

/// Change of the along-track miss of the line, and of the point's across-track position, with the point.
fn by_camera_point_off_line<M>(image: &BundleImage<M>, camera_m: &Vector3<f64>) -> Matrix2x3<f64> {
    let mut partials = by_camera_point(camera_m, image.focal_length_px);
    let [_, slope] = image.distortion.curve(camera_m.y / camera_m.z);
    let along = partials.row(0) - partials.row(1) * slope;
    partials.set_row(0, &along);
    partials
}

/// The rows of a view of `ground_m`, along and across the track: measured minus computed, with `px_per_line`
/// focal-plane pixels a line; computed are the line that sees the point and the position in that line.
pub(super) fn of_view<M: ExteriorOrientation>(
    image: &BundleImage<M>,
    correction: &OrientationCorrection,
    px_per_line: f64,
    view: &View,
    ground_m: &Vector3<f64>,
) -> Result<[Row; 2], Unseen> {
    let orientation = CorrectedOrientation {
        base: &image.base,
        correction: *correction,
    };
    let seen = Sighting::near(
        &orientation,
        &image.distortion,
        view.x_lines,
        ground_m,
        LAST_STEP_LINES,
    )?;
    let (x_lines, camera_m) = (seen.solution.x, seen.solution.camera_m);
    let focal_y_px = -image.focal_length_px * camera_m.y / camera_m.z;
    // The sign follows the point's position in the focal plane of the measured line.
    let misclosures = [
        px_per_line * (x_lines - view.x_lines),
        view.y_px - focal_y_px,
    ];
    // A motion of the point by one pixel along the focal plane is compensated by `1/rate_px.x` lines less, and these
    // move it across.
    let by_camera_point = by_camera_point_off_line(image, &camera_m);
    let rate_px = by_camera_point * seen.rate_m;
    let [along, across] = [0, 1].map(|axis| by_camera_point.row(axis).transpose());
    let by_camera_point = [
        along * (px_per_line / rate_px.x),
        across - along * (rate_px.y / rate_px.x),
    ];
    let vector_rad = correction.turn_rad(x_lines);
    let by_time_m = if image.time_bias_sigma_s > 0.0 {
        // The initial orientation rotates and advances under its correction.
        let (_, motion) = image
            .base
            .pose_and_rate(x_lines + correction.time_shift_lines);
        let turn_rad = matrix_of_rotation_vector(&vector_rad) * motion.turn_rad;
        let rate_m = turn_rad.cross(&camera_m) - seen.pose.mars_to_camera * motion.advance_m;
        rate_m / image.line_period_s
    } else {
        Vector3::zeros()
    };
    Ok([0, 1].map(|axis| {
        // A rotation ε moves the camera vector q by ε × q, and a change of the rotation vector turns by
        // the left Jacobian times it.
        let by_turn = camera_m.cross(&by_camera_point[axis]);
        Row {
            misclosure: misclosures[axis],
            sigma: view.sigma_px[axis],
            by_point: seen.pose.mars_to_camera.tr_mul(&by_camera_point[axis]),
            by_rotation: left_jacobian_product(&-vector_rad, &by_turn),
            by_time: by_camera_point[axis].dot(&by_time_m),
            t: x_lines / image.half_lines,
        }
    }))
}

/// The row of a range to `ground_m`; its derivative by the bias of its profile is 1.
///
/// `base_m` is the initial position at the instant of the shot. That instant does not depend on the image, so a time
/// bias of the image does not move it.
pub(super) fn of_range<M>(
    image: &BundleImage<M>,
    correction: &OrientationCorrection,
    base_m: &Vector3<f64>,
    range: &Range,
    bias_m: f64,
    ground_m: &Vector3<f64>,
) -> Row {
    let laser_m = base_m + range.to_laser_m + correction.shift_m(range.x_lines);
    let away_m = ground_m - laser_m;
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
