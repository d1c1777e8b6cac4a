//! Requirements of a calibration.

use super::{error::CalibrateError, geometry::CameraImage, read::OrbitPoint, result::PointKind};

/// Minimum number of tie points of a camera.
const TIES_MIN: usize = 10;
/// Minimum number of control points of each kind.
pub const CONTROLS_MIN: usize = 5;

/// Checks that the images are of different lines on one spacecraft.
pub(super) fn belong_together(
    images: &[CameraImage],
    names: &[String],
) -> std::result::Result<(), CalibrateError> {
    for (index, image) in images.iter().enumerate() {
        let [first, this] = [&images[0], image].map(|of| &of.support.instrument);
        if this.naif.bus != first.naif.bus {
            return Err(CalibrateError::OtherFrame {
                camera: names[index].clone(),
                found: this.naif.bus,
                first: names[0].clone(),
                expected: first.naif.bus,
            });
        }
        let same = |other: &CameraImage| other.support.instrument.name == this.name;
        if let Some(other) = images[..index].iter().position(same) {
            return Err(CalibrateError::SameSensor {
                first: names[other].clone(),
                second: names[index].clone(),
                sensor: this.name.clone(),
            });
        }
    }
    Ok(())
}

/// Checks that every camera has enough ties.
pub(super) fn enough_ties(
    points: &[OrbitPoint],
    names: &[String],
) -> std::result::Result<(), CalibrateError> {
    for (camera, name) in names.iter().enumerate() {
        let sees = |of: &&OrbitPoint| of.point.sights.iter().any(|sight| sight.camera == camera);
        let ties = points.iter().filter(|point| point.is(PointKind::Tie));
        let found = ties.filter(sees).count();
        if found < TIES_MIN {
            return Err(CalibrateError::TooFewTies {
                camera: name.clone(),
                found,
                expected: TIES_MIN,
            });
        }
    }
    Ok(())
}

/// Checks that there are enough points for a calibration.
pub(super) fn enough(
    points: &[OrbitPoint],
    names: &[String],
    is_controlled: bool,
) -> std::result::Result<(), CalibrateError> {
    enough_ties(points, names)?;
    let count = |kind| points.iter().filter(|point| point.is(kind)).count();
    let [controls, held_back] = [PointKind::Control, PointKind::HeldBack].map(count);
    if is_controlled && controls.min(held_back) < CONTROLS_MIN {
        return Err(CalibrateError::TooFewControls {
            found: controls,
            held_back,
            expected: CONTROLS_MIN,
        });
    }
    Ok(())
}
