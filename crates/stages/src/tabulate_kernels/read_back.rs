//! Whether written kernels reproduce the orientation that they were made from.

use super::{KernelReading, TabulateError};
use crate::{
    orientation::{Orientation, RayOrigin},
    tag_times::ImageTimes,
};
use areograph_base::error::Result;
use areograph_config::KernelsConfig;
use areograph_geom::{attitude::rotation_vector, statistics::largest};
use areograph_spice::Session;

/// Tolerance for positions read back from a kernel, metres: 30 times the 3e-5 m that MGS flies in the 7e-9 s to which
/// ET is rounded.
const POSITION_TOLERANCE_M: f64 = 1e-3;
/// Tolerance for rotations read back from a kernel, radians: 100 times the rotation of the bus in the 1.5e-8 s to which
/// ticks are rounded.
const ROTATION_TOLERANCE_RAD: f64 = 1e-9;

/// Ensures that `session`, with the original kernels and a pair of the image, gives every sample of `orientation` to
/// readers that compute cameras by `reading`.
///
/// # Errors
/// [`Kind::Bug`](areograph_base::error::Kind::Bug) for orientations that are not reproduced within 1 mm and 1e-9 rad, and the
/// errors of [`Session`] for unreadable kernels.
pub fn require_same(
    session: &Session,
    image: &ImageTimes,
    orientation: &Orientation,
    reading: KernelReading,
    kernels: &KernelsConfig,
) -> Result<()> {
    let session = &session.of(image.instrument.spacecraft);
    let (mut distances_m, mut turns_rad) = (Vec::new(), Vec::new());
    for sample in &orientation.samples {
        let lookup = reading.bias.lookup(sample.et);
        let attitude = session.attitude(lookup, sample.et, kernels.ck_tolerance_s)?;
        let to_camera = session.mounting(&image.instrument, sample.et)? * attitude.inertial_to_bus;
        let boresight = to_camera.matrix().row(2).transpose();
        let origin = RayOrigin::at(session, reading.light_time, sample.et, &boresight)?;
        let camera_to_mars = origin.to_mars * to_camera.inverse();
        let expected = sample.pose().mars_to_camera;
        distances_m.push(origin.position().distance_m(&sample.position));
        turns_rad.push(rotation_vector(&(camera_to_mars.matrix() * expected)).norm());
    }
    let distance_m = largest(distances_m).unwrap_or_default();
    let turn_rad = largest(turns_rad).unwrap_or_default();
    // Written so that NaN is refused too.
    if distance_m <= POSITION_TOLERANCE_M && turn_rad <= ROTATION_TOLERANCE_RAD {
        return Ok(());
    }
    let what = format!(
        "image {}: positions read back differ by {distance_m:.1e} m and rotations by {turn_rad:.1e} rad from the \
         adjusted orientation; expected at most {POSITION_TOLERANCE_M} m and {ROTATION_TOLERANCE_RAD} rad",
        image.id
    );
    Err(TabulateError::ReadBack { what }.into())
}
