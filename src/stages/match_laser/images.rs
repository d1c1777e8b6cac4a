//! Where images that the model was made from show ground points, by the same support data.

use super::{
    error::MatchError,
    result::{MatchImage, MatchedPoint},
};
use crate::{
    body::Body,
    error::{Locate as _, Result},
    geom::{
        ellipsoid::spherical_to_xyz_m,
        oriented_camera::OrientedCamera,
        pushbroom::{Detector, Pose, Projector, SampledOrientation},
    },
    pds::isd::{ImageSupport, read_isd},
};

/// Between two samples of the orientation lie at most so many seconds: over them the tables of a low orbit are cubics within 1e-4
/// pixels. There are never fewer samples than this, nor more.
const STEP_S: f64 = 1.0;
const SAMPLES: [f64; 2] = [64.0, 20_000.0];

/// An image by its support data.
pub(super) fn camera(image: &MatchImage, body: Body) -> Result<OrientedCamera<SampledOrientation>> {
    let support = read_isd(&image.isd)?;
    support.sees(body, &image.name).in_file(&image.isd)?;
    let orientation = SampledOrientation::new(&poses(&support))
        .map_err(|error| refused(&image.name, &error))
        .in_file(&image.isd)?;
    Ok(OrientedCamera {
        id: image.name.clone(),
        orientation,
        detector: Detector::new(
            &support.instrument,
            support.crosstrack_summing,
            support.first_detector,
            support.samples,
        ),
        line_times: support.line_times,
    })
}

fn refused(image: &str, problem: &impl ToString) -> MatchError {
    MatchError::Image {
        image: image.to_owned(),
        problem: problem.to_string(),
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

/// Enters lines and samples into `points`, where an image shows what the model has at a point.
pub(super) fn enter(
    cameras: &[OrientedCamera<SampledOrientation>],
    points: &mut [MatchedPoint],
) -> std::result::Result<(), MatchError> {
    for camera in cameras {
        let projector = Projector::new(&camera.orientation, camera.lines())
            .map_err(|problem| refused(&camera.id, &problem))?
            .through(camera.detector.distortion);
        for point in &mut *points {
            let [longitude_rad, latitude_rad, radius_m] = point.model;
            let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
            let seen = projector.project(&place_m).ok().and_then(|seen| {
                let focal_px = camera.detector.focal_px(&seen.camera_m).ok()?;
                let line = camera.line_times.line_of_offset(seen.x);
                let sample = camera.detector.sample(focal_px.y);
                camera.shows(line, sample).then_some([line, sample])
            });
            point.in_images.push(seen);
        }
    }
    Ok(())
}
