//! The exterior orientation of an image, whether sampled from kernels or corrected.

mod centre;
mod interpolation;
mod light_time;
mod reader;
mod support;
mod tables;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use centre::SeenFromCentre;
pub(crate) use light_time::RayOrigin;
pub use light_time::{LightTimeEffect, OtherConvention};
pub(crate) use reader::CameraReader;
pub(crate) use tables::{Camera, Nodes};
pub use tables::{CameraTables, InterpolationCheck};

use crate::tag_times::ImageTimes;
use areograph_base::{
    body::{Body, BodyModel},
    error::Result,
    frames::{BodyFixed, CameraFrame, Position, Rotation},
    time::Et,
};
use areograph_geom::{
    attitude::OmegaPhiKappa,
    ellipsoid::{Spherical, ray_meets_ellipsoid},
    pushbroom::Pose,
};

/// Intervals of the outline along the image: between two of them the track bends by centimetres.
const OUTLINE_INTERVALS: u32 = 10;

/// Orientation of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Orientation {
    /// Image identifier.
    pub image: String,
    /// The body that it shows.
    pub body: Body,
    /// Samples over the complete header image, both ends included.
    pub samples: Vec<OrientationSample>,
    /// Outline of the delivered image on the ellipsoid: along the first pixel's outer edge,
    /// back along the last one's, not closed. `None` when a corner sees no ground.
    pub outline: Option<Vec<GroundPoint>>,
    /// Tables for camera models, in J2000.
    pub tables: CameraTables,
    /// The light-time convention of all positions, and its difference from the others.
    pub light_time: LightTimeEffect,
    /// The image as ISIS and ALE see it with the same kernels; `None` if they have the same rays: with the convention
    /// [`LightTime::Centre`](areograph_geom::light_time::LightTime::Centre), with support data, and after an adjustment.
    pub centre: Option<SeenFromCentre>,
    /// Notes for the reader, one sentence each.
    pub notes: Vec<String>,
    /// Reasons why the orientation is invalid; empty when it is valid.
    pub invalid_because: Vec<String>,
}

impl Orientation {
    /// The orientation without the nodes of its tables for camera models.
    #[must_use]
    pub fn without_tables(&self) -> Self {
        Self {
            image: self.image.clone(),
            samples: self.samples.clone(),
            outline: self.outline.clone(),
            tables: self.tables.without_nodes(),
            light_time: self.light_time.clone(),
            centre: self.centre.as_ref().map(SeenFromCentre::without_nodes),
            notes: self.notes.clone(),
            invalid_because: self.invalid_because.clone(),
            body: self.body,
        }
    }
}

/// Orientation of the camera at one epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrientationSample {
    /// Epoch.
    pub et: Et,
    /// Line offset from the middle of the header image, lines, see
    /// [`LineTimes::offset`](areograph_base::line_times::LineTimes::offset).
    pub line_offset: f64,
    /// Perspective centre, where straight rays start: see [`LightTimeEffect`].
    pub position: Position<BodyFixed>,
    /// Rotation from camera to Mars-fixed axes.
    pub camera_to_mars: Rotation<CameraFrame, BodyFixed>,
    /// This rotation as ω, φ, κ.
    pub angles: OmegaPhiKappa,
    /// Point where the boresight meets the ellipsoid, if it does.
    pub boresight: Option<BoresightGround>,
    /// From the perspective centre to the geometric position of the spacecraft from the kernels at the epoch, from
    /// where ranges are measured; body-fixed, metres.
    pub to_spacecraft_m: Vector3<f64>,
}

impl Orientation {
    /// [`OrientationSample::to_spacecraft_m`] between the samples, at `line_offset` lines from the middle.
    ///
    /// # Accuracy
    /// Linear: over half a second the curvature of the hundred metres to the apparent position is 1e-5 m.
    #[must_use]
    pub fn to_spacecraft_m(&self, line_offset: f64) -> Vector3<f64> {
        let after = self
            .samples
            .partition_point(|sample| sample.line_offset <= line_offset);
        let last = self.samples.len().saturating_sub(1);
        let [before, after] =
            [after.saturating_sub(1), after].map(|at| self.samples.get(at.min(last)));
        let (Some(before), Some(after)) = (before, after) else {
            return Vector3::zeros();
        };
        let width = after.line_offset - before.line_offset;
        let share = if width > 0.0 {
            ((line_offset - before.line_offset) / width).clamp(0.0, 1.0)
        } else {
            0.0
        };
        before.to_spacecraft_m.lerp(&after.to_spacecraft_m, share)
    }
}

/// A point on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GroundPoint {
    /// East longitude, radians.
    pub longitude_rad: f64,
    /// Areocentric latitude, radians.
    pub latitude_rad: f64,
}

/// Ground point of the camera's boresight on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BoresightGround {
    /// East longitude, radians.
    pub longitude_rad: f64,
    /// Areocentric latitude, radians.
    pub latitude_rad: f64,
    /// Distance from the camera, metres.
    pub range_m: f64,
    /// Angle at the ground between the ellipsoid's normal and the camera, radians.
    pub emission_rad: f64,
}

impl OrientationSample {
    fn new(image: &ImageTimes, et: Et, camera: &Camera) -> Self {
        Self {
            et,
            line_offset: image.line_offset(et),
            position: camera.position,
            camera_to_mars: camera.to_mars,
            angles: OmegaPhiKappa::from_camera_to_mars(camera.to_mars.matrix()),
            boresight: boresight_ground(image.body.model(), camera),
            to_spacecraft_m: Vector3::zeros(),
        }
    }

    /// Its pose.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose {
            position_m: self.position.xyz_m,
            mars_to_camera: self.camera_to_mars.matrix().transpose(),
        }
    }

    /// Samples with the camera that `camera` gives for their epochs.
    pub(crate) fn at_epochs(
        image: &ImageTimes,
        epochs: &[Et],
        camera: impl Fn(Et) -> Result<Camera>,
    ) -> Result<Vec<Self>> {
        let sample = |epoch: &Et| Ok(Self::new(image, *epoch, &camera(*epoch)?));
        epochs.iter().map(sample).collect()
    }
}

impl GroundPoint {
    fn of(ground: &Position<BodyFixed>) -> Self {
        let coordinates = Spherical::from_xyz_m(&ground.xyz_m);
        Self {
            longitude_rad: coordinates.longitude_rad,
            latitude_rad: coordinates.latitude.0,
        }
    }

    /// Outline of the delivered lines and samples, seen by the camera that `camera` gives for an instant.
    pub(crate) fn outline(
        image: &ImageTimes,
        camera: impl Fn(Et) -> Result<Camera>,
    ) -> Result<Option<Vec<Self>>> {
        let line_times = &image.line_times;
        let duration_s = line_times.seconds(f64::from(image.lines_delivered));
        let step_s = duration_s / f64::from(OUTLINE_INTERVALS);
        let (mut first_edge, mut last_edge) = (Vec::new(), Vec::new());
        for k in 0..=OUTLINE_INTERVALS {
            let Camera { position, to_mars } =
                camera(line_times.start().plus(f64::from(k) * step_s))?;
            let [first, last] = swath_directions(image).map(|direction| {
                let direction = to_mars.matrix() * direction;
                let ground = ray_meets_ellipsoid(image.body.model(), &position, &direction);
                ground.map(|ground| Self::of(&ground))
            });
            let (Some(first), Some(last)) = (first, last) else {
                return Ok(None);
            };
            first_edge.push(first);
            last_edge.push(last);
        }
        let back = last_edge.into_iter().rev();
        Ok(Some(first_edge.into_iter().chain(back).collect()))
    }
}

/// Viewing directions of the outer edges of the first and the last sample, camera frame.
fn swath_directions(image: &ImageTimes) -> [Vector3<f64>; 2] {
    let detector = image.detector();
    [0.0, detector.samples].map(|sample| detector.look(sample))
}

fn boresight_ground(model: &BodyModel, camera: &Camera) -> Option<BoresightGround> {
    let boresight = camera.to_mars.matrix() * Vector3::z();
    let ground = ray_meets_ellipsoid(model, &camera.position, &boresight)?;
    let scale = Vector3::new(
        model.equatorial_radius_m.powi(-2),
        model.equatorial_radius_m.powi(-2),
        model.polar_radius_m.powi(-2),
    );
    let normal = ground.xyz_m.component_mul(&scale);
    let point = GroundPoint::of(&ground);
    Some(BoresightGround {
        longitude_rad: point.longitude_rad,
        latitude_rad: point.latitude_rad,
        range_m: camera.position.distance_m(&ground),
        emission_rad: normal.angle(&-boresight),
    })
}
