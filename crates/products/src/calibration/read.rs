//! `calibration.json` of published calibrations.

use std::path::Path;

use serde::Deserialize;

use super::document::DOCUMENT;
use crate::files::read_bytes;
use areograph_base::error::{Cause, Locate as _, Result};
use areograph_stages::calibrate::Looks;

/// A file that is not a calibration of this version.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{0}; expected calibration.json of `areograph calibrate`")]
#[cause(Input: "run `areograph calibrate` again with this version of areograph")]
struct NoDocument(String);

/// A published calibration.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct PublishedCalibration {
    /// Its name.
    pub calibration: String,
    /// Name of the body.
    pub body: String,
    /// Whether it is valid.
    pub verdict: PublishedVerdict,
    /// The lines of the camera.
    pub cameras: Vec<PublishedLine>,
    /// Look directions of all lines.
    pub looks: Looks,
}

/// The verdict, as far as it is read.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct PublishedVerdict {
    /// Whether the result is to be used.
    pub valid: bool,
}

/// A line of the camera, as far as it is read.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct PublishedLine {
    /// Its name in the calibration.
    pub camera: String,
    /// Coefficients of the tangents of the laboratory, across and along the flight.
    pub laboratory: [Vec<f64>; 2],
    /// Tangent of a pixel.
    pub pixel_tangent: f64,
}

impl PublishedCalibration {
    /// The calibration whose products are in `folder`; the caller has verified them.
    ///
    /// # Errors
    /// A file that cannot be read, or is not a calibration of this version.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(DOCUMENT.path);
        let of: Self = serde_json::from_slice(&read_bytes(&path)?)
            .map_err(|error| NoDocument(error.to_string()))
            .in_file(&path)?;
        let numbers = 6 * of.cameras.len();
        let Looks {
            lines,
            covariance,
            by_orbit,
            ..
        } = &of.looks;
        let rows = covariance.iter().chain(by_orbit);
        let fits = !lines.is_empty()
            && lines.len() == of.cameras.len()
            && covariance.len() == numbers
            && rows.clone().all(|row| row.len() == numbers);
        if !fits {
            return Err(NoDocument(
                "the member looks does not fit the number of lines".to_owned(),
            ))
            .in_file(&path);
        }
        Ok(of)
    }

    /// Whether a folder of products is that of a calibration.
    #[must_use]
    pub fn is_in(folder: &Path) -> bool {
        folder.join(DOCUMENT.path).is_file()
    }
}
