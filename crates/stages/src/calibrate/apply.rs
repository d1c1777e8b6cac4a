//! A calibration applied to support data of other images.

use std::path::{Path, PathBuf};

use crate::calibrated_camera::calibrated_camera;
use areograph_base::{
    error::{Cause, Locate as _, Result},
    instruments::Instrument,
};
use areograph_pds::isd::{SupportSource, read_isd};

/// Support data with a calibrated camera.
#[derive(Debug, Clone, PartialEq)]
pub struct AppliedCalibration {
    /// The calibration.
    pub calibration: String,
    /// Name of the camera in it.
    pub camera: String,
    /// Largest change of a look direction, pixels of the detector.
    pub moved_px: f64,
    /// The support data.
    pub isd: String,
}

/// Support data of another spacecraft than that of the calibration.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the spacecraft is {0}; expected the spacecraft of the calibration")]
#[cause(Input: "name support data of the calibrated lines")]
struct OtherSpacecraft(String);

/// Puts the calibrated camera of its line in the support data of an image; orbit and attitude are unchanged.
///
/// * `calibrated` – support data of the lines of a calibration
///
/// # Errors
/// Files that cannot be read; a calibration that is invalid, or does not contain this line.
pub fn apply_calibration(calibrated: &[PathBuf], isd: &Path) -> Result<AppliedCalibration> {
    let support = read_isd(isd)?;
    let given = support.instrument;
    let names = [&*support.platform, &*given.name];
    let found = calibrated_camera(&given, names, calibrated.iter().map(PathBuf::as_path));
    let found =
        found.and_then(|found| Ok(found.ok_or_else(|| OtherSpacecraft(support.platform.clone()))?));
    let found = found.in_file(isd)?;
    Ok(AppliedCalibration {
        moved_px: found.moved_rad / pixel_rad(&given),
        isd: SupportSource::File(isd).with_camera_of(SupportSource::File(&found.file))?,
        calibration: found.origin.calibration,
        camera: found.origin.camera,
    })
}

fn pixel_rad(camera: &Instrument) -> f64 {
    camera.optics.pixel_pitch_mm / camera.optics.focal_length_mm
}
