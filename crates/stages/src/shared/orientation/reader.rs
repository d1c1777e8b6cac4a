//! The camera of an image from the kernels, at any instant.

use super::{Camera, RayOrigin};
use crate::tag_times::ImageTimes;
use areograph_base::{
    body::Body,
    error::Result,
    frames::{BodyFixed, CameraFrame, J2000, Position, Rotation},
    instruments::Instrument,
    time::{Et, PointingBias},
};
use areograph_geom::{body_rotation::body_rotation, light_time::LightTime};
use areograph_spice::{Attitude, Session};

/// Reads position and attitude of the camera of an image.
#[derive(Clone, Copy)]
pub(crate) struct CameraReader<'a> {
    /// Kernels of the spacecraft that carries the camera.
    pub(crate) session: &'a Session,
    pub(crate) instrument: &'a Instrument,
    pub(crate) bias: PointingBias,
    pub(crate) tolerance_s: f64,
    pub(crate) light_time: LightTime,
}

impl CameraReader<'_> {
    /// Checks that position and attitude are covered over the image with its padding.
    ///
    /// The checked times are those that are read: attitude at the exposures shifted by the pointing bias, positions
    /// earlier by up to the light time.
    ///
    /// # Errors
    /// A gap, named with its ends and the kernels beside it.
    pub(crate) fn require_coverage(&self, image: &ImageTimes, padding_s: f64) -> Result<()> {
        let (session, exposures) = (self.session, image.exposures());
        session.require_position(self.light_time.read_over(exposures.padded(padding_s)))?;
        session.require_attitude(exposures, self.bias, padding_s, self.tolerance_s)
    }

    pub(crate) fn attitude(&self, exposure: Et) -> Result<Attitude> {
        let lookup = self.bias.lookup(exposure);
        self.session.attitude(lookup, exposure, self.tolerance_s)
    }

    pub(crate) fn inertial_to_camera(&self, exposure: Et) -> Result<Rotation<J2000, CameraFrame>> {
        let attitude = self.attitude(exposure)?;
        let mounting = self.session.mounting(self.instrument, exposure)?;
        Ok(mounting * attitude.inertial_to_bus)
    }

    /// Geometric position of the spacecraft.
    pub(crate) fn geometric(&self, et: Et) -> Result<Position<BodyFixed>> {
        Ok(body_rotation(Body::Mars, et).apply(&self.session.state(et)?.position))
    }

    /// Start of the rays in IAU 2000, and the rotation from the camera to this frame.
    pub(crate) fn camera(&self, et: Et) -> Result<Camera> {
        let to_camera = self.inertial_to_camera(et)?;
        let boresight = to_camera.matrix().row(2).transpose();
        let origin = RayOrigin::at(self.session, self.light_time, et, &boresight)?;
        Ok(Camera {
            position: origin.position(),
            to_mars: origin.to_mars * to_camera.inverse(),
        })
    }
}
