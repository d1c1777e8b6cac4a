//! Rotation of an image while its lines are exposed.

use nalgebra::Vector3;

use areograph_base::body::BodyModel;
use areograph_geom::{
    attitude::rotation_vector, body_rotation::spin_rad_s, oriented_camera::OrientedCamera,
    pushbroom::ExteriorOrientation,
};

/// Mean rate of rotation of a camera against the stars, camera components, radians per second: attitudes that were read
/// later are rotated by as much.
pub(crate) fn turn_rad_s<M: ExteriorOrientation>(
    camera: &OrientedCamera<M>,
    body: &BodyModel,
) -> Vector3<f64> {
    let half_lines = 0.5 * camera.lines();
    let [before, middle, after] =
        [-half_lines, 0.0, half_lines].map(|x| camera.orientation.pose(x).mars_to_camera);
    let duration_s = 2.0 * half_lines * camera.line_times.mean_period_s();
    let against_mars = rotation_vector(&(after * before.transpose())) / duration_s;
    against_mars - middle * spin_rad_s(body)
}
