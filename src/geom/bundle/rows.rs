//! Observation equations of single views and ranges.

use nalgebra::{RowVector3, SVector, Vector2, Vector3};

use super::{Network, ORIENTATION_UNKNOWNS, Range, View, unknowns::State};
use crate::geom::{
    attitude::OmegaPhiKappa,
    collinearity::{BehindCamera, LineOrientation, observe},
};

/// Partial derivatives with respect to an image's 18 coefficients and its time bias.
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
    by_angles: &RowVector3<f64>,
    t: f64,
    by_time: f64,
) -> ImagePartials {
    let mut partials = ImagePartials::zeros();
    for axis in 0..3 {
        let mut power_of_t = 1.0;
        for power in 0..3 {
            partials[3 * axis + power] = power_of_t * by_position[axis];
            partials[9 + 3 * axis + power] = power_of_t * by_angles[axis];
            power_of_t *= t;
        }
    }
    partials[ORIENTATION_UNKNOWNS] = by_time;
    partials
}

/// The rows of a view, along the track and across it.
///
/// The line is exposed a time bias later than its tag says, so the orientation is taken there.
pub(super) fn of_view(
    network: &Network,
    state: &State,
    view: &View,
) -> Result<[Row; 2], BehindCamera> {
    let image = &network.images[view.image];
    let orientation = &state.orientations[view.image];
    let x_lines = view.x_lines + state.time_biases_s[view.image] / image.line_period_s;
    let angles_rad = orientation.angles_rad.value(x_lines);
    let line = LineOrientation {
        position_m: orientation.path_m.value(x_lines),
        angles: OmegaPhiKappa {
            omega_rad: angles_rad.x,
            phi_rad: angles_rad.y,
            kappa_rad: angles_rad.z,
        },
    };
    let seen = observe(&state.points_m[view.point], &line, image.focal_length_px)?;
    let misclosure = Vector2::new(0.0, view.y_px) - seen.focal;
    let by_line = seen.by_angles * orientation.angles_rad.rate(x_lines)
        - seen.by_ground * orientation.path_m.rate(x_lines);
    let by_time = by_line / image.line_period_s;
    let t = x_lines / image.half_lines;
    Ok([0, 1].map(|axis| {
        let by_point: RowVector3<f64> = seen.by_ground.row(axis).into_owned();
        let by_angles: RowVector3<f64> = seen.by_angles.row(axis).into_owned();
        Row {
            misclosure: misclosure[axis],
            sigma: view.sigma_px[axis],
            by_image: chain(&-by_point, &by_angles, t, by_time[axis]),
            by_point,
        }
    }))
}

/// The row of a range; its derivative by the bias of its profile is 1.
///
/// The instant of a shot does not come from the image, so a time bias of the image does not move it.
pub(super) fn of_range(network: &Network, state: &State, range: &Range) -> Row {
    let position_m = state.orientations[range.image].path_m.value(range.x_lines);
    let away_m: Vector3<f64> = position_m - state.points_m[range.point];
    let distance_m = away_m.norm();
    let towards = away_m.transpose() / distance_m;
    let t = range.x_lines / network.images[range.image].half_lines;
    Row {
        misclosure: range.range_m - distance_m - state.range_biases_m[range.profile],
        sigma: range.sigma_m,
        by_image: chain(&towards, &RowVector3::zeros(), t, 0.0),
        by_point: -towards,
    }
}
