//! Other orbits, into which the calibration goes unchanged.

use super::{
    error::CalibrateError,
    geometry::{CameraImage, Laboratory, Orbit},
    measure::figures,
    read::{OrbitTables, points_of},
    result::ValidationResult,
    tables::Complaints,
};
use crate::{
    body::Body,
    config::{CalibrationConfig, ValidationConfig},
    error::Result,
    geom::calibration::CalibrationState,
};

/// By how much the laboratory's geometry of two orbits may differ, pixels: files are written with fifteen digits.
const MOUNTING_PX: f64 = 0.01;
/// Places at which it is compared, `s′`.
const COMPARED_AT: [f64; 3] = [-1.0, 0.0, 1.0];

/// The calibration orbit, for what other orbits must have in common with it.
pub(super) struct Calibrated<'a> {
    pub(super) names: &'a [String],
    pub(super) orbit: &'a Orbit,
    pub(super) laboratory: &'a Laboratory,
    pub(super) state: &'a CalibrationState,
}

/// Figures of another orbit before and with the calibration.
pub(super) fn validate(
    config: &CalibrationConfig,
    of: &ValidationConfig,
    calibrated: &Calibrated<'_>,
    complaints: &mut Complaints,
) -> Result<ValidationResult> {
    let orbit = orbit(config.body, of, calibrated)?;
    let order = config.solution.order as usize;
    let laboratory = orbit.laboratory(calibrated.names, order)?;
    same_mounting(&of.id, calibrated, &laboratory, &orbit)?;
    let tables = OrbitTables {
        ties: &of.ties,
        control: &of.control,
        held_back_every: None,
    };
    let names = calibrated.names;
    let points = points_of(config, names, &orbit, &laboratory, &tables, complaints)?;
    let pixels: Vec<f64> = orbit.images.iter().map(CameraImage::pixel).collect();
    let unchanged = CalibrationState {
        cameras: calibrated.state.cameras.clone(),
        ..CalibrationState::default()
    };
    Ok(ValidationResult {
        orbit: of.id.clone(),
        before: figures(&points, &laboratory.state, &pixels),
        after: figures(&points, &unchanged, &pixels),
    })
}

/// The images of another orbit, each with the camera whose sensor it names.
fn orbit(body: Body, of: &ValidationConfig, calibrated: &Calibrated<'_>) -> Result<Orbit> {
    let mut found: Vec<CameraImage> = Vec::new();
    for path in &of.isd {
        found.push(CameraImage::read(path, &of.id, body)?);
    }
    let mut images = Vec::new();
    for (image, camera) in calibrated.orbit.images.iter().zip(calibrated.names) {
        let sensor = &image.support.instrument.name;
        let at = found
            .iter()
            .position(|other| other.support.instrument.name == *sensor);
        let at = at.ok_or_else(|| CalibrateError::NoSupport {
            orbit: of.id.clone(),
            sensor: sensor.clone(),
            camera: camera.clone(),
        })?;
        images.push(found.swap_remove(at));
    }
    Ok(Orbit::of(images, body, Some(calibrated.orbit.axes))?)
}

fn same_mounting(
    id: &str,
    calibrated: &Calibrated<'_>,
    laboratory: &Laboratory,
    orbit: &Orbit,
) -> std::result::Result<(), CalibrateError> {
    let both = calibrated
        .laboratory
        .state
        .cameras
        .iter()
        .zip(&laboratory.state.cameras);
    for (index, (here, there)) in both.enumerate() {
        let off = COMPARED_AT.map(|s| (here.tangents(s) - there.tangents(s)).norm());
        let off_px = off.into_iter().fold(0.0, f64::max) / orbit.images[index].pixel();
        if !(off_px <= MOUNTING_PX) {
            return Err(CalibrateError::OtherMounting {
                orbit: id.to_owned(),
                camera: calibrated.names[index].clone(),
                off_px,
                limit_px: MOUNTING_PX,
            });
        }
    }
    Ok(())
}
