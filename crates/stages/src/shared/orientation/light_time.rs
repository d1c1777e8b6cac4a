//! The one place where light time enters: which position of the spacecraft and which rotation of Mars belong to an
//! exposure, so that rays from there to the ground are straight.
//!
//! `[orientation] light_time` selects the position and the rotation. All cameras behind this module see along straight
//! rays, in every stage and product; ranges are geometric.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::OrientationSample;
use areograph_base::{
    body::Body,
    error::Result,
    frames::{BodyFixed, J2000, Position, Rotation},
    time::Et,
};
use areograph_geom::{
    body_rotation::body_rotation,
    ellipsoid::range_to_ellipsoid_m,
    light_time::{LightTime, light_time_s, without_aberration_m},
};
use areograph_spice::{Session, State};

/// Steps of the search for the instant at which a position was left; each reduces the error to 1e-5 of that before it.
const STEPS: u32 = 3;

/// The origin of the rays of an exposure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayOrigin {
    /// The spacecraft relative to the centre of Mars.
    pub(crate) state: State,
    /// Orientation of Mars for the ground that is seen; stamped with the exposure's instant.
    pub(crate) to_mars: Rotation<J2000, BodyFixed>,
}

impl RayOrigin {
    /// The origin at `exposure` of a camera that looks along `boresight`, J2000.
    ///
    /// # Errors
    /// Kernels that do not cover the instant.
    /// # Accuracy
    /// For [`LightTime::Surface`] the light time is counted to the ellipsoid along the boresight: ground one kilometre
    /// above it is seen 0.011 m (`v/c`) away along the track, and the limb at the edge of a wide-angle image, four times
    /// as far as nadir, 14 m, less than a tenth of its pixels.
    pub(crate) fn at(
        session: &Session,
        light_time: LightTime,
        exposure: Et,
        boresight: &Vector3<f64>,
    ) -> Result<Self> {
        let to_mars = body_rotation(Body::Mars, exposure);
        match light_time {
            LightTime::None | LightTime::Support => Ok(Self {
                state: session.state(exposure)?,
                to_mars,
            }),
            LightTime::Centre => Ok(Self {
                state: session.apparent_state(exposure)?,
                to_mars,
            }),
            LightTime::Surface => {
                let position = to_mars.apply(&session.state(exposure)?.position);
                let left = left(exposure, &position, &(to_mars.matrix() * boresight));
                Ok(Self {
                    state: session.state(left)?,
                    to_mars: mars_at(left, exposure),
                })
            }
        }
    }

    /// The position, IAU 2000.
    pub(crate) fn position(&self) -> Position<BodyFixed> {
        self.to_mars.apply(&self.state.position)
    }
}

impl OrientationSample {
    /// Instant and geometric position of the spacecraft for which this is the position: the inverse of
    /// [`RayOrigin::at`].
    ///
    /// # Errors
    /// Kernels that do not cover the instant.
    /// # Accuracy
    /// [`LightTime::Centre`] uses the velocity of the kernels: an error of 10 m/s leaves 0.01 mm.
    pub(crate) fn flown(
        &self,
        session: &Session,
        light_time: LightTime,
    ) -> Result<(Et, Position<J2000>)> {
        let seen = self.mars_seen(light_time).inverse().apply(&self.position);
        match light_time {
            LightTime::None | LightTime::Support => Ok((self.et, seen)),
            LightTime::Surface => Ok((left(self.et, &self.position, &self.boresight()), seen)),
            LightTime::Centre => {
                let mars = session.mars_state(self.et)?;
                let apparent_m = without_aberration_m(&seen.xyz_m, &mars.velocity_m_s);
                let velocity_m_s = session.state(self.et)?.velocity_m_s;
                // CSPICE's `LT` uses the light time to the position of the target at the exposure.
                let (mut earlier_s, mut flown_m) = (light_time_s(apparent_m.norm()), apparent_m);
                for _ in 0..STEPS {
                    let then = session.mars_state(self.et.plus(-earlier_s))?;
                    flown_m = apparent_m + mars.position.xyz_m - then.position.xyz_m;
                    earlier_s = light_time_s((flown_m + velocity_m_s * earlier_s).norm());
                }
                Ok((self.et.plus(-earlier_s), Position::new(flown_m)))
            }
        }
    }

    /// Orientation of Mars for the ground that is seen, stamped with the exposure's instant.
    pub(crate) fn mars_seen(&self, light_time: LightTime) -> Rotation<J2000, BodyFixed> {
        match light_time {
            LightTime::None | LightTime::Centre | LightTime::Support => {
                body_rotation(Body::Mars, self.et)
            }
            LightTime::Surface => {
                mars_at(left(self.et, &self.position, &self.boresight()), self.et)
            }
        }
    }

    fn boresight(&self) -> Vector3<f64> {
        self.camera_to_mars.matrix() * Vector3::z()
    }
}

/// Instant at which the light that `exposure` sees left the ground.
fn left(exposure: Et, origin: &Position<BodyFixed>, boresight: &Vector3<f64>) -> Et {
    exposure.plus(-light_time_s(range_to_ellipsoid_m(
        Body::Mars.model(),
        origin,
        boresight,
    )))
}

/// Mars at the instant `left`, stamped with the instant of the exposure.
fn mars_at(left: Et, exposure: Et) -> Rotation<J2000, BodyFixed> {
    Rotation::new(*body_rotation(Body::Mars, left).matrix(), exposure)
}

/// Effect of the light-time convention of a run on an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LightTimeEffect {
    /// Convention of all camera positions.
    pub convention: LightTime,
    /// Light time from the ground along the boresight in the middle of the image, seconds.
    #[schemars(range(min = 0.0))]
    pub light_time_s: f64,
    /// Effects of the other conventions; empty if the boresight misses the ground.
    pub others: Vec<OtherConvention>,
}

/// Effect of another convention in the middle of an image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OtherConvention {
    /// The other convention.
    pub convention: LightTime,
    /// Shift of the boresight on the ellipsoid, metres.
    #[schemars(range(min = 0.0))]
    pub ground_m: f64,
    /// Shift of the same ground point in lines, positive towards later lines.
    pub lines: f64,
    /// Shift of the same ground point in samples.
    pub samples: f64,
}
