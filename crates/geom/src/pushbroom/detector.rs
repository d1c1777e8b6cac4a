//! The detector line: samples and focal-plane coordinates.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use super::distortion::Distortion;
use crate::collinearity::{BehindCamera, project};
use areograph_base::instruments::Instrument;

/// Geometry of one image's detector line.
///
/// `sample` is the coordinate across the image: 0 at the outer edge of the first pixel, 0.5 at its
/// centre. `y` is the focal-plane coordinate `−f q2/q3` of an ideal camera in image pixels from the
/// boresight, with the sign of Shan et al. 2005; `x_f` is `−f q1/q3`. Without distortion the line is `x_f = 0`.
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
    /// Departure of the look directions from an ideal camera.
    pub distortion: Distortion,
}

/// Positions at which radial coefficients are fitted, equally spaced over the samples.
const FITTED_AT: u32 = 129;

/// Radial distortion of usgscsm and ISIS: ideal focal-plane coordinates are the distorted ones times
/// `1 − (k₀ + k₁ r² + k₂ r⁴)`, `r` the distance of the distorted place from the boresight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialFit {
    /// `k₀`, `k₁`, `k₂`, powers of 1/mm².
    pub coefficients: [f64; 3],
    /// Largest error of the look directions by the coefficients, samples.
    pub error_max_px: f64,
}

impl Detector {
    /// The line of an image of `instrument` whose first sample begins at pixel `first_pixel`, counted from 0,
    /// with `crosstrack_summing` pixels in a sample.
    #[must_use]
    pub fn new(
        instrument: &Instrument,
        crosstrack_summing: u32,
        first_pixel: u32,
        samples: u32,
    ) -> Self {
        let summing = f64::from(crosstrack_summing);
        let (optics, line) = (&instrument.optics, &instrument.detector);
        Self {
            focal_length_px: optics.focal_length_mm / (optics.pixel_pitch_mm * summing),
            boresight_sample: (line.boresight_px - f64::from(first_pixel)) / summing,
            sample_sense: -line.samples_along.sign(),
            samples: f64::from(samples),
            distortion: Distortion::of(instrument, summing),
        }
    }

    /// `x_f` and `y` of a camera vector, pixels.
    ///
    /// # Errors
    /// The point is not in front of the camera.
    pub fn focal_px(&self, camera_m: &Vector3<f64>) -> Result<Vector2<f64>, BehindCamera> {
        project(camera_m, self.focal_length_px)
    }

    /// Distance of the line from a position of the focal plane along the track, pixels.
    #[must_use]
    pub fn missed_px(&self, focal_px: &Vector2<f64>) -> f64 {
        let [along, _] = self.distortion.curve(-focal_px.y / self.focal_length_px);
        focal_px.x + self.focal_length_px * along
    }

    /// Sample coordinate of `y`.
    #[must_use]
    pub fn sample(&self, y_px: f64) -> f64 {
        let samples = self.distortion.samples(-y_px / self.focal_length_px);
        let undistorted_y_px = samples.map_or(y_px, |samples| -samples);
        self.boresight_sample + self.sample_sense * undistorted_y_px
    }

    /// Focal pixels in a sample at `y`: 1 without distortion.
    #[must_use]
    pub fn focal_px_per_sample(&self, y_px: f64) -> f64 {
        let per_sample = self
            .distortion
            .across_per_sample(-y_px / self.focal_length_px);
        per_sample.map_or(1.0, |per_sample| per_sample * self.focal_length_px)
    }

    /// Focal-plane coordinates `x_f` and `y` of a sample coordinate, pixels.
    #[must_use]
    pub fn place_px(&self, sample: f64) -> Vector2<f64> {
        let y_px = self.sample_sense * (sample - self.boresight_sample);
        match self.distortion.look(-y_px) {
            None => Vector2::new(0.0, y_px),
            Some([along, across]) => -self.focal_length_px * Vector2::new(along, across),
        }
    }

    /// The radial coefficients that approximate the distortion over the samples best; zero without distortion.
    #[must_use]
    pub fn radial_fit(&self, instrument: &Instrument) -> RadialFit {
        let mut fit = RadialFit {
            coefficients: [0.0; 3],
            error_max_px: 0.0,
        };
        if self.distortion == Distortion::NONE {
            return fit;
        }
        let mm_per_px = instrument.optics.focal_length_mm / self.focal_length_px;
        let along_mm = instrument.detector.along_track_px * instrument.optics.pixel_pitch_mm;
        let places: Vec<[Vector2<f64>; 2]> = (0..FITTED_AT)
            .map(|index| {
                let sample = self.samples * f64::from(index) / f64::from(FITTED_AT - 1);
                let across_mm = self.sample_sense * (self.boresight_sample - sample) * mm_per_px;
                let ideal_mm = -self.place_px(sample) * mm_per_px;
                [Vector2::new(along_mm, across_mm), ideal_mm]
            })
            .collect();
        // Powers of r over its largest value are of similar size.
        let far_mm = places
            .iter()
            .map(|[from, _]| from.norm())
            .fold(f64::MIN_POSITIVE, f64::max);
        let powers = |distorted_mm: &Vector2<f64>| {
            let square = (distorted_mm.norm() / far_mm).powi(2);
            [1.0, square, square * square]
        };
        let rows = DMatrix::from_fn(places.len(), 3, |row, power| {
            let [distorted_mm, _] = &places[row];
            distorted_mm.y * powers(distorted_mm)[power]
        });
        let right = DVector::from_fn(places.len(), |row, _| places[row][0].y - places[row][1].y);
        let Ok(scaled) = rows.svd(true, true).solve(&right, 0.0) else {
            return fit;
        };
        for (power, coefficient) in (0_i32..).zip(&mut fit.coefficients) {
            *coefficient = scaled[power.unsigned_abs() as usize] * far_mm.powi(-2 * power);
        }
        for [distorted_mm, ideal_mm] in &places {
            let share: f64 = (powers(distorted_mm).iter().zip(&scaled))
                .map(|(a, b)| a * b)
                .sum();
            let missed_px = (distorted_mm * (1.0 - share) - ideal_mm) / mm_per_px;
            let per_sample = self.focal_px_per_sample(-ideal_mm.y / mm_per_px);
            let error_px = missed_px.x.hypot(missed_px.y / per_sample);
            fit.error_max_px = fit.error_max_px.max(error_px);
        }
        fit
    }

    /// Look direction of a sample coordinate in camera axes; its z component is 1.
    #[must_use]
    pub fn look(&self, sample: f64) -> Vector3<f64> {
        let place_px = self.place_px(sample);
        (-place_px / self.focal_length_px).push(1.0)
    }
}
