//! Instruments as data: cameras and altimeters, as described in their files under `config/`.
//!
//! `config/instruments` holds cameras, the pointing bias included; an image carries its camera through all stages
//! (`ImageTimes::instrument`). `config/altimeters` has the clock of the altimeter, `config/spacecraft` the identifiers
//! of spacecraft: the one with the laser (`constants::SPACECRAFT`), and others that carry cameras. An instrument names
//! its spacecraft, and a stage queries `Session::of` this spacecraft for clock, orbit and attitude of an image; shots
//! belong to the spacecraft of the laser.
//!
//! In code, only readers of labels and files, the synthetic mission and examples of keys name any of them: a test
//! checks the sources. The look direction of a sample is `geom::pushbroom::Detector`: a straight line in an ideal focal
//! plane, or a curve (`Distortion`), which ground to image, intersection and adjustment use through the tangents of
//! look directions.

use std::fmt;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use crate::{constants::Spacecraft, time::PointingBias};

/// Maximum number of coefficients of a distortion.
pub const COEFFICIENTS_MAX: usize = 10;
/// Terms of a polynomial of third degree in two coordinates: 1, x, y, x², xy, y², x³, x²y, xy², y³.
pub const TRANSVERSE_TERMS: usize = 10;

/// A line-scan camera.
///
/// Camera axes: +Z along the boresight, +Y along the detector, +X against the flight or with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Instrument {
    /// Identifier, the name of its file.
    pub id: String,
    /// Its name in texts.
    pub name: String,
    /// Its spacecraft, whose clock, orbit and attitude are read for its images.
    #[serde(
        serialize_with = "id_of_spacecraft",
        deserialize_with = "spacecraft_of_id"
    )]
    pub spacecraft: &'static Spacecraft,
    /// Its names in labels.
    pub label: LabelNames,
    /// Numbers and frames in kernels.
    pub naif: NaifNames,
    /// Rotation from the bus to the camera, used if no kernel is available, and for a calibrated camera.
    pub mounting: Mounting,
    /// Focal length and pixel pitch.
    pub optics: Optics,
    /// The detector line.
    pub detector: DetectorLine,
    /// Departure from an ideal camera.
    pub distortion: DistortionModel,
    /// Limits of the summing of detector lines and pixels.
    pub summing: SummingLimits,
    /// Time correction of its attitude.
    pub pointing: PointingTime,
    /// Calibration whose result its mounting, optics, detector line and distortion are; `None` for a camera of an
    /// instrument file.
    #[serde(default)]
    pub calibration: Option<Calibrated>,
}

/// The calibration that determined a camera.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Calibrated {
    /// Its name.
    pub calibration: String,
    /// Name of the camera in it.
    pub camera: String,
    /// Whether its verdict is valid.
    pub valid: bool,
    /// Whether it was determined in another orbit than that of the image: its angles contain the error of that orbit.
    #[serde(default)]
    pub is_of_other_orbit: bool,
}

impl Instrument {
    /// Its name in support data: that of its frame, or its filter where several cameras share a frame, as the nine
    /// lines of the HRSC share that of the camera head.
    #[must_use]
    pub fn sensor_name(&self) -> &str {
        match &self.label.filter {
            Some(filter) if self.naif.frame_id != self.naif.instrument => filter,
            _ => &self.naif.frame,
        }
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes fields by reference"
)]
fn id_of_spacecraft<S: Serializer>(
    spacecraft: &&'static Spacecraft,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&spacecraft.id)
}

fn spacecraft_of_id<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<&'static Spacecraft, D::Error> {
    let id = String::deserialize(deserializer)?;
    Spacecraft::of_id(&id).ok_or_else(|| D::Error::custom(format!("unknown spacecraft {id}")))
}

/// Names of an instrument in labels and ISIS image identifiers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LabelNames {
    /// Instrument keyword.
    pub instrument: String,
    /// Filter keyword, if it distinguishes cameras of one instrument.
    pub filter: Option<String>,
    /// Instrument and filter in the serial numbers of ISIS; `None` if these are formed differently.
    pub serial: Option<String>,
}

impl fmt::Display for LabelNames {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.instrument)?;
        match &self.filter {
            Some(filter) => write!(formatter, " {filter}"),
            None => Ok(()),
        }
    }
}

/// Names and numbers of NAIF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NaifNames {
    /// Number of the instrument.
    pub instrument: i32,
    /// Frame of the camera.
    pub frame: String,
    /// Number of that frame, usually the instrument's.
    pub frame_id: i32,
    /// From that frame to the camera axes, about their common +Z, radians.
    pub turn_rad: f64,
    /// Number of the bus, the object of attitude kernels.
    pub bus: i32,
    /// Frame of the bus.
    pub bus_frame: String,
    /// A file of the mission's archive that defines the frame of the camera.
    pub kernel: String,
}

/// Rotations of the frame about X, Y and Z, in this order, from the bus to the camera, radians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Mounting {
    /// About X.
    pub roll_rad: f64,
    /// About Y.
    pub pitch_rad: f64,
    /// About Z.
    pub yaw_rad: f64,
}

/// Focal length and pixel pitch; only their ratio enters geometry without distortion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Optics {
    /// Focal length, millimetres.
    pub focal_length_mm: f64,
    /// Pixel pitch, millimetres.
    pub pixel_pitch_mm: f64,
}

/// A line of detector pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DetectorLine {
    /// Pixels.
    pub pixels: u32,
    /// Pixel coordinate of the boresight, 0 at the outer edge of the first pixel.
    pub boresight_px: f64,
    /// Distance of the line from the boresight towards +X, pixels.
    pub along_track_px: f64,
    /// The axis that pixel numbers follow.
    pub samples_along: Sense,
}

/// An axis or its opposite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sense {
    /// Along +Y of the camera.
    #[serde(rename = "+y")]
    PlusY,
    /// Against +Y of the camera.
    #[serde(rename = "-y")]
    MinusY,
}

impl Sense {
    /// +1 along +Y, −1 against it.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::PlusY => 1.0,
            Self::MinusY => -1.0,
        }
    }
}

/// Departure of a camera from an ideal one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum DistortionModel {
    /// The detector lies in the focal plane of an ideal camera.
    None,
    /// Ideal focal-plane coordinates are the distorted ones times `1 − (k₀ + k₁ r² + k₂ r⁴ + …)`, `r` the
    /// distance of the distorted place from the boresight in millimetres: the form of usgscsm and ISIS.
    RadialPolynomial {
        /// `k₀`, `k₁` …, powers of 1/mm².
        coefficients: Vec<f64>,
    },
    /// Across the track the ideal focal-plane coordinate is the distorted one over `1 + k y²`, `y` the distorted one in
    /// millimetres; along the track both are the same: the form of usgscsm and ISIS for LROC's narrow angles.
    AcrossQuotient {
        /// `k`, 1/mm².
        coefficient_per_mm2: f64,
    },
    /// Distorted focal-plane coordinates are polynomials of third degree of the ideal ones, millimetres: the form
    /// `transverse` of usgscsm.
    Transverse {
        /// Coefficients of the coordinate along the track, towards +X, then of that across it, towards +Y.
        coefficients: [[f64; TRANSVERSE_TERMS]; 2],
    },
    /// The angle off the boresight is `c₁ r + c₃ r³ + …`, `r` the distance of the detector place from the
    /// boresight in thousands of pixels, across the track after multiplication by a scale: the form of the
    /// MOC instrument kernel.
    AnglePolynomial {
        /// `c₁`, `c₃` …, radians.
        coefficients_rad: Vec<f64>,
        /// Scale of the coordinate across the track.
        scale: f64,
    },
}

/// Limits of summing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SummingLimits {
    /// Maximum number of detector lines or pixels in a line or sample.
    pub max: u32,
    /// Codes across the track for a summing that varies over the line.
    pub variable_codes: Vec<u32>,
}

/// Time correction of attitude kernels for an instrument.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointingTime {
    /// Attitude of an exposure at `t` is read at `t` plus this, seconds.
    pub ck_bias_s: f64,
    /// Its source; products repeat it.
    pub source: String,
}

impl Instrument {
    /// Time correction of its attitude.
    #[must_use]
    pub const fn pointing_bias(&self) -> PointingBias {
        PointingBias::from_seconds(self.pointing.ck_bias_s)
    }
}

/// A laser altimeter.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Altimeter {
    /// Identifier, the name of its file.
    pub id: String,
    /// Its name in texts.
    pub name: String,
    /// Its name in full.
    pub full_name: String,
    /// Size of the error of its time tags, seconds.
    pub clock_bias_s: f64,
    /// Its source; products repeat it.
    pub clock_source: String,
    /// Direction of its beam, components of the bus; `None` if its file does not state it.
    pub beam_in_bus: Option<[f64; 3]>,
    /// Its source.
    pub beam_source: Option<String>,
}

impl Altimeter {
    /// Its axes as columns, components of the bus: the directions towards which the two boresight angles rotate the
    /// beam (X of the bus, and its complement to a right-handed system), and the beam.
    #[must_use]
    pub fn axes_in_bus(&self) -> Option<Matrix3<f64>> {
        let beam = Vector3::from(self.beam_in_bus?).normalize();
        let x = Vector3::x() - beam * beam.x;
        let first = x.try_normalize(1e-3).unwrap_or_else(|| -Vector3::z());
        Some(Matrix3::from_columns(&[first, beam.cross(&first), beam]))
    }
}
