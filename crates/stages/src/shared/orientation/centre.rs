//! An image as ISIS and ALE see it with the same kernels.
//!
//! All cameras see along straight rays: a line exposed at `t` sees the points `C + s R u`, with the look `u` of a
//! sample. A convention for light time decides which `C` and `R` follow from the geometric position `S` of the
//! spacecraft, the attitude `A(t)` from J2000 to the camera, and the rotation `B` from J2000 to the body:
//!
//! | convention | `C` | `R` |
//! |---|---|---|
//! | `surface` | `B(t − λ) S(t − λ)`, `λ` the light time from the ground | `B(t − λ) A(t)ᵀ` |
//! | `none` | `B(t) S(t)` | `B(t) A(t)ᵀ` |
//! | `centre` | `B(t) a(S, t)`, `a` the apparent position from the centre of the body (`LT+S`) | `B(t) A(t)ᵀ` |
//!
//! ISIS and ALE always apply `centre`, which makes two cases:
//!
//! * *Orientation from the kernels.* These programs have a camera of their own, displaced by `B(t) a(S, t) − C`. It is
//!   read from the kernels at the nodes of the camera tables ([`SeenFromCentre`]), not converted from another
//!   convention, and is exact there. Support data, lines and samples, and corrections of an orientation depend on it.
//! * *Adjusted orientation.* Its rays are a result, and the adjusted ground points lie on them: all programs must have
//!   the same rays. Support data contain `C` and `R` themselves and do not depend on the convention. Kernels contain `S`
//!   and `A`; a pair for ISIS and ALE contains those from which `centre` computes `C` and `R`, the inverse of the last
//!   row of the table ([`OrientationSample::flown`](super::OrientationSample)). Networks, ground control and residuals
//!   contain ground points and image points, which do not depend on the convention either.

use std::borrow::Cow;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    CameraReader, CameraTables, InterpolationCheck, LightTimeEffect, Orientation, RayOrigin,
};
use crate::tag_times::ImageTimes;
use areograph_base::{
    error::Result,
    frames::{BodyFixed, J2000, Rotation},
    time::Et,
};
use areograph_geom::{body_rotation::body_rotation, light_time::LightTime, pushbroom::Pose};

/// What differs from an [`Orientation`] if the same kernels are read with [`LightTime::Centre`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeenFromCentre {
    /// Apparent position of the spacecraft at the nodes of the camera tables, J2000, metres.
    pub position_m: Vec<Vector3<f64>>,
    /// Its velocity, metres per second.
    pub velocity_m_s: Vec<Vector3<f64>>,
    /// Interpolation error of these tables over the image.
    pub interpolation: InterpolationCheck,
    /// The difference from the other conventions.
    pub light_time: LightTimeEffect,
}

impl SeenFromCentre {
    /// The same without nodes.
    #[must_use]
    pub(super) fn without_nodes(&self) -> Self {
        Self {
            position_m: Vec::new(),
            velocity_m_s: Vec::new(),
            light_time: self.light_time.clone(),
            ..*self
        }
    }

    /// The image of `tables` as `reader` sees it with the convention of ISIS and ALE; `light_time` is the effect of this
    /// convention.
    ///
    /// # Errors
    /// Kernels that do not cover a node.
    pub(crate) fn of(
        reader: &CameraReader<'_>,
        image: &ImageTimes,
        tables: &CameraTables,
        light_time: LightTimeEffect,
    ) -> Result<Self> {
        let (mut position_m, mut velocity_m_s) = (Vec::new(), Vec::new());
        // The direction of a look does not matter to this convention.
        let look = Vector3::z();
        for et_s in &tables.et_s {
            let et = Et::from_seconds(*et_s);
            let state = RayOrigin::at(reader.session, reader.light_time, et, &look)?.state;
            position_m.push(state.position.xyz_m);
            velocity_m_s.push(state.velocity_m_s);
        }
        let mut seen = Self {
            position_m,
            velocity_m_s,
            interpolation: InterpolationCheck::default(),
            light_time,
        };
        let tables = seen.tables(image, tables);
        seen.interpolation = InterpolationCheck::of(image, &tables, |et| reader.camera(et))?;
        Ok(seen)
    }

    /// `own` tables with these positions, and with the body as it was at the exposures.
    fn tables(&self, image: &ImageTimes, own: &CameraTables) -> CameraTables {
        let epochs = own.et_s.iter().copied().map(Et::from_seconds);
        let inertial_to_mars: Vec<Rotation<J2000, BodyFixed>> =
            epochs.map(|et| body_rotation(image.body, et)).collect();
        let spins = inertial_to_mars.iter();
        let spins = spins.map(|to_mars| CameraTables::spin_rad_s(image.body, to_mars.matrix()));
        CameraTables {
            position_m: self.position_m.clone(),
            velocity_m_s: self.velocity_m_s.clone(),
            mars_angular_velocity_rad_s: spins.collect(),
            inertial_to_mars,
            interpolation: self.interpolation,
            ..own.clone()
        }
    }
}

impl Orientation {
    /// Camera tables with which ISIS and ALE see the image, and the effect of their convention: the orientation's own
    /// where these programs have the same rays.
    #[must_use]
    pub fn as_isis_sees(&self, image: &ImageTimes) -> (Cow<'_, CameraTables>, &LightTimeEffect) {
        match &self.centre {
            Some(centre) => {
                let tables = centre.tables(image, &self.tables);
                (Cow::Owned(tables), &centre.light_time)
            }
            None => (Cow::Borrowed(&self.tables), &self.light_time),
        }
    }
}

impl CameraReader<'_> {
    /// The same kernels, read with another convention.
    pub(crate) fn with(&self, light_time: LightTime) -> Self {
        Self {
            light_time,
            ..*self
        }
    }
}

impl CameraTables {
    /// Lines from the middle of the image with the poses of the nodes.
    #[must_use]
    pub fn poses(&self, image: &ImageTimes) -> Vec<(f64, Pose)> {
        let pose = |row: usize| {
            let to_mars = self.inertial_to_mars[row].matrix();
            let to_camera = self.bus_to_camera.matrix() * self.inertial_to_bus[row].matrix();
            let pose = Pose {
                position_m: to_mars * self.position_m[row],
                mars_to_camera: to_camera * to_mars.transpose(),
            };
            (image.line_offset(Et::from_seconds(self.et_s[row])), pose)
        };
        (0..self.et_s.len()).map(pose).collect()
    }
}
