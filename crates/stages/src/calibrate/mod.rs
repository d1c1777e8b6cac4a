//! Calibration of the lines of a camera: by tie points only, then with laser control, validated by withheld control.
//!
//! This stage knows support data, names and withheld points. The axes across, along and down are the spacecraft axes
//! nearest to these directions in the first image. Calibrated support data are the given ones with a straight line of
//! equal samples and a distortion of third degree (`pds/isd/rewrite`), and the remaining difference is stated.

mod apply;
mod demands;
mod elsewhere;
mod error;
mod geometry;
mod given;
mod ground;
mod judge;
mod lines;
mod looks;
mod measure;
mod outcome;
mod read;
mod result;
mod rounds;
mod run;
mod support;
mod tables;
mod validate;

use std::{path::PathBuf, sync::atomic::AtomicBool};

use areograph_base::error::Result;
use areograph_config::CalibrationConfig;
use areograph_store::{
    files::HashedFile,
    stage::{InOrder, Input, Inputs, Stage},
    stage_inputs,
};

pub use apply::{AppliedCalibration, apply_calibration};
pub use demands::CONTROLS_MIN;
pub use error::CalibrateError;
pub use lines::{AlignLines, CalibrateLines, LineKeys, OtherOrbits};
pub use result::{
    Calibration, CalibrationRound, CalibrationStep, CameraResult, ControlFigures, ControlOffset,
    Figures, HeldBack, ImageResult, LineLooks, Looks, PixelsAndMetres, PointKind, PointResult,
    Rounds, Scatter, Scattered, TieFigures, TieGround, ValidationResult, Value,
};

stage_inputs! {
    /// A calibration and its files.
    pub struct Calibrate<'a> {
        /// The configuration.
        pub calibration: CalibrationKeys<'a>,
        /// Its files with their hashes.
        pub files: CalibrationFiles<'a>,
    }
}

/// The keys of a calibration's configuration that enter the result.
#[derive(Debug)]
pub struct CalibrationKeys<'a>(pub &'a CalibrationConfig);

impl Input for CalibrationKeys<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        inputs.setting("body", &self.0.body);
        inputs.setting("cameras", &self.0.cameras);
        inputs.setting("ties", &self.0.ties);
        inputs.setting("control", &self.0.control);
        inputs.setting("a_priori", &self.0.a_priori);
        inputs.setting("solution", &self.0.solution);
        inputs.setting("validation", &self.0.validation);
        // Number of files of each key: hashes do not identify the key.
        let counts: Vec<usize> = kinds(self.0).iter().map(Vec::len).collect();
        inputs.setting("files", &counts);
    }
}

/// The files of a calibration, in order.
#[derive(Debug)]
pub struct CalibrationFiles<'a>(pub &'a [HashedFile]);

impl Input for CalibrationFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        InOrder(self.0).add_to("file", inputs);
    }
}

impl Stage for Calibrate<'_> {
    const NAME: &'static str = "calibrate";
    const METHOD: u32 = 17;
    type Output = Calibration;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Calibration> {
        run::calibrate(self.calibration.0)
    }
}

/// Every file that a calibration names, in a fixed order.
#[must_use]
pub fn calibration_files(of: &CalibrationConfig) -> Vec<PathBuf> {
    kinds(of).into_iter().flatten().cloned().collect()
}

/// The files of each key: of cameras, ties and control, and of each other orbit.
fn kinds(of: &CalibrationConfig) -> Vec<Vec<&PathBuf>> {
    let cameras = of.cameras.iter().map(|camera| &camera.isd).collect();
    let mut kinds: Vec<Vec<&PathBuf>> = vec![
        cameras,
        of.ties.files.iter().collect(),
        of.control.files.iter().collect(),
    ];
    for orbit in &of.validation {
        kinds.extend([&orbit.isd, &orbit.ties, &orbit.control].map(|files| files.iter().collect()));
    }
    kinds
}
