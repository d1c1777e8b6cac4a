//! An image of a line scanner through its support data: orientation and detector, without kernels.

use std::path::Path;

use crate::{
    body::Body,
    error::{Cause, Kind, Locate as _, Result},
    geom::{
        oriented_camera::OrientedCamera,
        pushbroom::{Detector, Pose, SampledOrientation},
    },
    pds::isd::{ImageSupport, read_isd},
};

/// Between two samples of the orientation lie at most so many seconds: over them the tables of a low orbit are cubics within 1e-4
/// pixels. There are never fewer samples than this, nor more.
const STEP_S: f64 = 1.0;
const SAMPLES: [f64; 2] = [64.0, 20_000.0];

/// An image as its support data have it.
#[derive(Debug)]
pub struct LineCamera {
    /// Orientation, detector and line times.
    pub camera: OrientedCamera<SampledOrientation>,
}

/// Support data that are no orientation.
#[derive(Debug, thiserror::Error)]
#[error("image {image}: {problem}")]
pub(in crate::stages) struct NoSight {
    pub(in crate::stages) image: String,
    pub(in crate::stages) problem: String,
}

impl Cause for NoSight {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "check the support data: they must be those of an image that sees the ground".to_owned()
    }
}

impl LineCamera {
    /// The image `name` by the support data at `path`, which see `body`.
    ///
    /// # Errors
    /// Files that cannot be read; support data of another body, or that are no orientation.
    pub fn read(path: &Path, name: &str, body: Body) -> Result<Self> {
        let support = read_isd(path)?;
        support.sees(body, name).in_file(path)?;
        let orientation = SampledOrientation::new(&poses(&support))
            .map_err(|error| NoSight {
                image: name.to_owned(),
                problem: error.to_string(),
            })
            .in_file(path)?;
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
