//! The detector line: pixels and focal-plane coordinates.

use nalgebra::{Vector2, Vector3};

use crate::{
    constants::{MOC_NA_DETECTORS, MOC_NA_FOCAL_LENGTH_MM, MOC_NA_PIXEL_PITCH_MM},
    geom::collinearity::{BehindCamera, project},
};

/// Geometry of one image's detector line.
///
/// `sample` is the coordinate across the image: 0 at the outer edge of the first pixel, 0.5 at its
/// centre. `y` is the focal-plane coordinate `−f q2/q3` in image pixels from the boresight, with the
/// sign of Shan et al. 2005; `x_f` is `−f q1/q3`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detector {
    /// Focal length in image pixels: focal length over pitch and summing.
    pub focal_length_px: f64,
    /// Sample coordinate of the boresight.
    pub boresight_sample: f64,
    /// +1 when samples follow `y`, −1 when they run against it.
    pub sample_sense: f64,
    /// Samples per line.
    pub samples: f64,
}

impl Detector {
    /// The narrow-angle camera of MOC with `crosstrack_summing` detector pixels in a sample.
    ///
    /// Samples follow the camera's +Y, hence run against `y`; detector 1024 of 2048 lies on the boresight.
    ///
    /// # Source
    /// Instrument kernel `moc20.ti`, its ISIS addendum for the pitch.
    #[must_use]
    pub fn moc_na(crosstrack_summing: u32, first_detector: u32, samples: u32) -> Self {
        let summing = f64::from(crosstrack_summing);
        let centre = 0.5 * f64::from(MOC_NA_DETECTORS);
        Self {
            focal_length_px: MOC_NA_FOCAL_LENGTH_MM / (MOC_NA_PIXEL_PITCH_MM * summing),
            boresight_sample: (centre - f64::from(first_detector)) / summing,
            sample_sense: -1.0,
            samples: f64::from(samples),
        }
    }

    /// `x_f` and `y` of a camera vector, pixels; `x_f` is how far its line misses the point.
    ///
    /// # Errors
    /// The point is not in front of the camera.
    pub fn focal_px(&self, camera_m: &Vector3<f64>) -> Result<Vector2<f64>, BehindCamera> {
        project(camera_m, self.focal_length_px)
    }

    /// Sample coordinate of `y`.
    #[must_use]
    pub fn sample(&self, y_px: f64) -> f64 {
        self.boresight_sample + self.sample_sense * y_px
    }

    /// `y` of a sample coordinate, pixels.
    #[must_use]
    pub fn y_of_sample_px(&self, sample: f64) -> f64 {
        self.sample_sense * (sample - self.boresight_sample)
    }
}
