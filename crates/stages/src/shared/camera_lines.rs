//! The lines of one camera in the rounds of a calibration from pixels: their orientation and their pixels.

use std::sync::OnceLock;

use nalgebra::Vector3;

use super::{image_pixels::CLOCKS_APART_MAX_S, line_camera::LineCamera};
use crate::calibrate::Calibration;
use areograph_base::{
    body::Body,
    error::{Cause, Locate as _, Result},
};
use areograph_config::{CameraConfig, all_instruments};
use areograph_pds::{
    ImageLabel,
    isd::SupportSource,
    pixel_file::{PixelFile, Pyramid},
};
use areograph_store::{
    files::HashedFile,
    stage::{InOrder, Input, Inputs, Output},
};

/// A round of a calibration from pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinesRound {
    /// The wide search before the first round.
    Wide,
    /// A round, counted from 1.
    Number(u32),
}

impl LinesRound {
    /// Part of a stage that runs in this round.
    #[must_use]
    pub fn part(self) -> Option<String> {
        Some(match self {
            Self::Wide => "wide".to_owned(),
            Self::Number(round) => format!("round-{round}"),
        })
    }
}

/// The outputs differ by the round, and enter under their labels.
impl Input for LinesRound {
    fn add_to(&self, _field: &str, _inputs: &mut Inputs) {}
}

/// The lines of a camera by their given support data, or by those of a calibration.
#[derive(Debug, Clone, Copy)]
pub struct CameraLines<'a> {
    /// The body.
    pub body: Body,
    /// The lines.
    pub lines: &'a [CameraConfig],
    /// Their given support data.
    pub given: &'a [HashedFile],
    /// The calibration whose support data replace the given ones.
    pub calibrated: Option<&'a Output<Calibration>>,
}

impl Input for CameraLines<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        inputs.setting("body", &self.body);
        inputs.setting("cameras", self.lines);
        match self.calibrated {
            Some(calibrated) => calibrated.add_to("calibrated", inputs),
            None => InOrder(self.given).add_to("isd", inputs),
        }
    }
}

impl<'a> CameraLines<'a> {
    /// The support data of each line.
    ///
    /// # Errors
    /// The calibration is not known yet.
    pub fn support(&self) -> Result<Vec<SupportSource<'a>>> {
        if let Some(calibrated) = self.calibrated {
            let cameras = calibrated.value()?.cameras.iter();
            return Ok(cameras.map(|of| SupportSource::Text(&of.isd)).collect());
        }
        let files = self.given.iter();
        Ok(files.map(|of| SupportSource::File(&of.path)).collect())
    }

    /// The lines.
    ///
    /// # Errors
    /// As [`LineCamera::read`].
    pub fn cameras(&self) -> Result<Vec<LineCamera>> {
        let lines = self.lines.iter().zip(self.support()?);
        lines
            .map(|(line, support)| LineCamera::of(support, &line.id, self.body))
            .collect()
    }

    /// Ground as the lines see it, body-fixed, metres: tie points of the calibration, or `shots_m` before there is one.
    ///
    /// # Errors
    /// The calibration is not known yet.
    pub fn ground_m(&self, shots_m: &[[f64; 3]]) -> Result<Vec<Vector3<f64>>> {
        Ok(match self.calibrated {
            Some(calibrated) => calibrated.value()?.ground_m(),
            None => shots_m.iter().copied().map(Vector3::from).collect(),
        })
    }
}

/// The pixels of the lines, decoded when a stage uses them for the first time.
#[derive(Debug)]
pub struct LinePixels {
    files: Vec<HashedFile>,
    decoded: OnceLock<Vec<Pyramid>>,
}

impl Input for &LinePixels {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        InOrder(&self.files).add_to(field, inputs);
    }
}

/// Pixels of another image.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "check that cameras.pixels are not exchanged and contain the complete images that cameras.isd describe")]
enum PixelsError {
    #[error(
        "camera {camera}: its pixel file has {} lines of {} samples; expected {} of {}, as in its support data",
        found[0], found[1], expected[0], expected[1]
    )]
    Size {
        camera: String,
        found: [u32; 2],
        expected: [u32; 2],
    },
    #[error("camera {camera}: its pixels are map-projected; expected the unprojected image")]
    Map { camera: String },
    #[error(
        "camera {camera}: its pixels belong to {found}; expected {expected}, the sensor of its support data"
    )]
    Sensor {
        camera: String,
        found: String,
        expected: String,
    },
    #[error(
        "camera {camera}: the exposure of its pixels begins at ET {found_s:.3} s; expected {expected_s:.3} s, as in its \
         support data"
    )]
    Start {
        camera: String,
        found_s: f64,
        expected_s: f64,
    },
}

impl LinePixels {
    /// The pixels in these files, one for each line.
    #[must_use]
    pub const fn of(files: Vec<HashedFile>) -> Self {
        Self {
            files,
            decoded: OnceLock::new(),
        }
    }

    /// The pixels of the complete image of each line.
    ///
    /// # Errors
    /// Files that cannot be read; pixels of another image; a temporary file cannot be written.
    pub fn decoded(&self, lines: &[LineCamera]) -> Result<&[Pyramid]> {
        if let Some(decoded) = self.decoded.get() {
            return Ok(decoded);
        }
        let pixels = self.files.iter().zip(lines);
        let pixels = pixels.map(|(file, line)| pixels_of(file, line));
        let pixels = pixels.collect::<Result<Vec<_>>>()?;
        Ok(self.decoded.get_or_init(|| pixels))
    }
}

/// The pixels of a line, which must cover its complete image.
fn pixels_of(file: &HashedFile, line: &LineCamera) -> Result<Pyramid> {
    let pixels = PixelFile::open(&file.path, all_instruments())?;
    if let Some(label) = pixels.label() {
        of_the_line(label, line).in_file(&file.path)?;
    }
    let camera = line.camera.id.clone();
    let found = [pixels.lines(), pixels.samples()];
    let expected = [line.camera.line_times.lines(), line.samples];
    if pixels.is_projected() {
        return Err(PixelsError::Map { camera }).in_file(&file.path);
    }
    if found != expected {
        let wrong = PixelsError::Size {
            camera,
            found,
            expected,
        };
        return Err(wrong).in_file(&file.path);
    }
    Pyramid::of(&pixels)
}

/// Whether a label belongs to the image of a line. Support data may name a sensor that no label names.
fn of_the_line(label: &ImageLabel, line: &LineCamera) -> std::result::Result<(), PixelsError> {
    let found = label.instrument.sensor_name();
    let is_known = |sensor: &str| {
        let mut known = all_instruments().iter();
        known.any(|camera| camera.sensor_name() == sensor)
    };
    if found != line.sensor && is_known(&line.sensor) {
        return Err(PixelsError::Sensor {
            camera: line.camera.id.clone(),
            found: found.to_owned(),
            expected: line.sensor.clone(),
        });
    }
    let first = label.lines.as_ref().and_then(|rows| rows.pieces.first());
    let expected = line.camera.line_times.start();
    match first.map(|piece| piece.start) {
        Some(found) if found.since(expected).abs() > f64::from(CLOCKS_APART_MAX_S) => {
            Err(PixelsError::Start {
                camera: line.camera.id.clone(),
                found_s: found.seconds(),
                expected_s: expected.seconds(),
            })
        }
        _ => Ok(()),
    }
}
