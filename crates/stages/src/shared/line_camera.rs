//! An image of a line scanner through its support data: orientation and detector, without kernels.

use std::path::Path;

use nalgebra::Vector3;

use areograph_base::{
    body::Body,
    error::{Cause, Result},
};
use areograph_geom::{
    ellipsoid::Spherical,
    intersection::Ray,
    oriented_camera::OrientedCamera,
    pushbroom::{Detector, ExteriorOrientation, Pose, Projector, SampledOrientation},
};
use areograph_pds::isd::{ImageSupport, SupportSource};

/// Longest time between two samples of the orientation, seconds: over it the tables of a low orbit are cubics within
/// 1e-4 pixels. `SAMPLES` bounds their number.
const STEP_S: f64 = 1.0;
const SAMPLES: [f64; 2] = [64.0, 20_000.0];

/// An image with its support data.
#[derive(Debug)]
pub struct LineCamera {
    /// Orientation, detector and line times.
    pub camera: OrientedCamera<SampledOrientation>,
    /// Samples of a line.
    pub samples: u32,
    /// Name of the line in its support data.
    pub sensor: String,
}

/// Support data that do not form an orientation, or one that sees no ground.
#[derive(Debug, thiserror::Error, Cause)]
#[error("image {image}: {problem}")]
#[cause(Input: "check that the support data belong to an image that shows the ground")]
struct NoSight {
    image: String,
    problem: String,
}

impl LineCamera {
    /// Viewing direction of the middle of the image, unit vector, body-fixed.
    #[must_use]
    pub fn looks(&self) -> Vector3<f64> {
        self.ray([0.5, 0.5]).direction()
    }

    /// Edge of a pixel below the spacecraft on a sphere, metres.
    #[must_use]
    pub fn pixel_m(&self, radius_m: f64) -> f64 {
        self.height_m(radius_m) / self.camera.detector.focal_length_px
    }

    /// Height of the spacecraft above a sphere, metres.
    #[must_use]
    pub fn height_m(&self, radius_m: f64) -> f64 {
        self.ray([0.5, 0.5]).position_m.norm() - radius_m
    }

    /// Points where the corners and the middle of the image meet a sphere: east longitudes and latitudes, radians.
    #[must_use]
    pub fn corners_rad(&self, radius_m: f64) -> Vec<[f64; 2]> {
        let shares = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5]];
        let corners = shares.into_iter().filter_map(|share| {
            let ray = self.ray(share);
            let (from_m, direction) = (ray.position_m, ray.direction());
            let along_m = -from_m.dot(&direction);
            let square_m2 = radius_m * radius_m - (from_m.norm_squared() - along_m * along_m);
            let place_m = from_m + (along_m - square_m2.max(0.0).sqrt()) * direction;
            let place = Spherical::from_xyz_m(&place_m);
            (square_m2 >= 0.0).then_some([place.longitude_rad, place.latitude.0])
        });
        corners.collect()
    }

    /// Finds lines for points of the ground.
    ///
    /// # Errors
    /// An orientation that sees no ground: a camera that does not move along its x axis.
    pub fn projector(&self) -> Result<Projector<'_, SampledOrientation>> {
        let camera = &self.camera;
        let projector = Projector::new(&camera.orientation, camera.lines());
        let projector = projector.map_err(|problem| NoSight {
            image: camera.id.clone(),
            problem: problem.to_string(),
        })?;
        Ok(projector.through(camera.detector.distortion))
    }

    /// The ray of a place, shares of lines and samples.
    fn ray(&self, [line, sample]: [f64; 2]) -> Ray {
        let camera = &self.camera;
        camera.ray(line * camera.lines(), sample * f64::from(self.samples))
    }

    /// The camera, borrowed.
    pub(crate) fn seen(&self) -> OrientedCamera<&(dyn ExteriorOrientation + 'static)> {
        OrientedCamera {
            id: self.camera.id.clone(),
            orientation: &self.camera.orientation,
            detector: self.camera.detector,
            line_times: self.camera.line_times.clone(),
        }
    }

    /// The image `name` of `body` by the support data at `path`.
    ///
    /// # Errors
    /// Files that cannot be read; support data of another body, or that do not form an orientation.
    pub fn read(path: &Path, name: &str, body: Body) -> Result<Self> {
        Self::of(SupportSource::File(path), name, body)
    }

    /// The image `name` of `body` by support data.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn of(source: SupportSource<'_>, name: &str, body: Body) -> Result<Self> {
        let support = source.read()?;
        source.located(support.sees(body, name))?;
        let orientation = SampledOrientation::new(&poses(&support)).map_err(|error| NoSight {
            image: name.to_owned(),
            problem: error.to_string(),
        });
        let orientation = source.located(orientation)?;
        Ok(Self {
            camera: OrientedCamera {
                id: name.to_owned(),
                orientation,
                detector: Detector::new(
                    &support.instrument,
                    support.crosstrack_summing,
                    support.first_detector,
                    support.samples,
                ),
                line_times: support.line_times,
            },
            samples: support.samples,
            sensor: support.instrument.name,
        })
    }
}

/// Poses at even times over the image, with their times in mean line periods from its middle.
fn poses(support: &ImageSupport) -> Vec<(f64, Pose)> {
    let times = &support.line_times;
    let steps = (times.duration_s() / STEP_S)
        .ceil()
        .clamp(SAMPLES[0], SAMPLES[1]);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between two small numbers above 0"
    )]
    let count = steps as u32;
    let tables = &support.tables;
    let pose = |step: u32| {
        let et = times
            .interval()
            .start
            .plus(times.duration_s() * f64::from(step) / steps);
        let to_body = tables.body_rotation.constant * tables.body_rotation.at(et.seconds()).0;
        let to_camera = tables.pointing.constant * tables.pointing.at(et.seconds()).0;
        let pose = Pose {
            position_m: to_body * tables.position.at(et.seconds()).0,
            mars_to_camera: to_camera * to_body.transpose(),
        };
        (times.offset(et), pose)
    };
    (0..=count).map(pose).collect()
}
