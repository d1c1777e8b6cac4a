//! Keys and nesting of image support data, as in ALE.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use crate::kernel_report::KernelsByType;
use areograph_base::{
    instruments::TRANSVERSE_TERMS,
    schema::{DocumentSchema, at},
};
use areograph_stages::{
    sample_orientation::{InterpolationCheck, LightTimeEffect},
    tag_times::StartFrom,
};

/// Schema of the document.
pub(super) fn schema() -> DocumentSchema {
    DocumentSchema::of::<Isd>("isd")
}

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Image support data of an image",
    description = "images/<id>/isd.json and adjusted_isd.json of areograph: the keys that usgscsm's line scanner model \
                   reads, kilometres and seconds, J2000; quaternions (w, x, y, z)."
)]
#[allow(clippy::struct_field_names, reason = "the keys that usgscsm reads")]
pub(super) struct Isd<'a> {
    #[schemars(extend("const" = 1))]
    pub(super) isis_camera_version: u32,
    pub(super) image_identifier: &'a str,
    #[schemars(range(min = 1))]
    pub(super) image_lines: u32,
    #[schemars(range(min = 1))]
    pub(super) image_samples: u32,
    pub(super) name_platform: &'a str,
    /// The camera's frame, or its filter where cameras share a frame.
    pub(super) name_sensor: &'a str,
    pub(super) reference_height: ReferenceHeight,
    #[schemars(extend("const" = "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL"))]
    pub(super) name_model: &'static str,
    #[schemars(extend("const" = "lagrange"))]
    pub(super) interpolation_method: &'static str,
    /// For every piece of the image: first line coordinate, time relative to `center_ephemeris_time`, seconds per image
    /// line. The time of a coordinate is the time of its piece plus seconds per line × (coordinate − line + 0.5).
    #[schemars(length(min = 1))]
    pub(super) line_scan_rate: Vec<[f64; 3]>,
    pub(super) starting_ephemeris_time: f64,
    pub(super) center_ephemeris_time: f64,
    pub(super) radii: Radii,
    pub(super) body_rotation: Rotation,
    pub(super) instrument_pointing: InstrumentPointing,
    /// Sources of the numbers, under NAIF's names.
    pub(super) naif_keywords: BTreeMap<String, Keyword>,
    #[schemars(range(min = 1))]
    pub(super) detector_sample_summing: u32,
    #[schemars(range(min = 1))]
    pub(super) detector_line_summing: u32,
    pub(super) focal_length_model: FocalLength,
    pub(super) detector_center: DetectorCentre,
    pub(super) focal2pixel_lines: [f64; 3],
    pub(super) focal2pixel_samples: [f64; 3],
    pub(super) optical_distortion: OpticalDistortion,
    pub(super) starting_detector_line: u32,
    pub(super) starting_detector_sample: u32,
    pub(super) instrument_position: Positions,
    pub(super) sun_position: Positions,
    /// Kernel names by type, in load order, and qualities.
    pub(super) kernels: KernelsByType<'a>,
    pub(super) areograph: Provenance<'a>,
    /// Calibration whose result the camera is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) areograph_calibration: Option<CalibratedBy<'a>>,
}

/// The calibration of a camera.
#[derive(Serialize, JsonSchema)]
pub(super) struct CalibratedBy<'a> {
    pub(super) calibration: &'a str,
    pub(super) camera: &'a str,
    /// `valid` or `invalid`.
    pub(super) verdict: &'static str,
    /// Whether the calibration was determined in another orbit than that of the image.
    pub(super) is_of_other_orbit: bool,
}

/// Range of heights in which camera models search for the ground.
#[derive(Serialize, JsonSchema)]
pub(super) struct ReferenceHeight {
    pub(super) maxheight: i32,
    pub(super) minheight: i32,
    #[schemars(extend("const" = "m"))]
    pub(super) unit: &'static str,
}

/// The ellipsoid.
#[derive(Serialize, JsonSchema)]
pub(super) struct Radii {
    pub(super) semimajor: f64,
    pub(super) semiminor: f64,
    #[schemars(extend("const" = "km"))]
    pub(super) unit: &'static str,
}

/// Focal length, millimetres.
#[derive(Serialize, JsonSchema)]
pub(super) struct FocalLength {
    pub(super) focal_length: f64,
}

/// Position of the detector centre, pixels from the detector's edge.
#[derive(Serialize, JsonSchema)]
pub(super) struct DetectorCentre {
    pub(super) line: f64,
    pub(super) sample: f64,
}

#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum OpticalDistortion {
    Radial(Radial),
    /// Of a calibrated camera whose line is curved.
    Transverse(Transverse),
}

/// Coefficients of 1, x, y, x², xy, y², x³, x²y, xy² and y³, with the ideal x and y in millimetres.
#[derive(Serialize, JsonSchema)]
pub(super) struct Transverse {
    pub(super) x: [f64; TRANSVERSE_TERMS],
    pub(super) y: [f64; TRANSVERSE_TERMS],
}

/// Coefficients of r, r³ and r⁵, with r in millimetres.
#[derive(Serialize, JsonSchema)]
pub(super) struct Radial {
    pub(super) coefficients: [f64; 3],
}

/// A NAIF code, a count, or one or three numbers.
#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Keyword {
    Code(i32),
    Pixels(u32),
    Number(f64),
    Numbers([f64; 3]),
}

/// Quaternions (w, x, y, z) from J2000.
#[derive(Serialize, JsonSchema)]
#[allow(clippy::struct_field_names, reason = "the keys that usgscsm reads")]
pub(super) struct Rotation {
    pub(super) time_dependent_frames: [i32; 2],
    pub(super) ck_table_start_time: f64,
    pub(super) ck_table_end_time: f64,
    pub(super) ck_table_original_size: usize,
    pub(super) ephemeris_times: Vec<f64>,
    pub(super) quaternions: Vec<[f64; 4]>,
    pub(super) angular_velocities: Vec<[f64; 3]>,
    #[schemars(extend("const" = 1))]
    pub(super) reference_frame: i32,
}

/// Rotations from J2000 to the bus, and from the bus to the camera.
#[derive(Serialize, JsonSchema)]
pub(super) struct InstrumentPointing {
    #[serde(flatten)]
    pub(super) bus: Rotation,
    pub(super) constant_frames: [i32; 2],
    #[schemars(length(min = 9, max = 9))]
    pub(super) constant_rotation: Vec<f64>,
}

/// Positions and velocities relative to the centre of Mars, J2000, kilometres and kilometres per second.
#[derive(Serialize, JsonSchema)]
#[allow(clippy::struct_field_names, reason = "the keys that usgscsm reads")]
pub(super) struct Positions {
    pub(super) spk_table_start_time: f64,
    pub(super) spk_table_end_time: f64,
    pub(super) spk_table_original_size: usize,
    pub(super) ephemeris_times: Vec<f64>,
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) velocities: Vec<[f64; 3]>,
    #[schemars(extend("const" = 1))]
    pub(super) reference_frame: i32,
}

/// Notes for readers of the file; camera models ignore them.
#[derive(Serialize, JsonSchema)]
pub(super) struct Provenance<'a> {
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub(super) configuration_blake3: &'a str,
    pub(super) detector_line_exposure_s: f64,
    pub(super) interpolation: Interpolation,
    /// All kernels in load order.
    #[schemars(length(min = 1))]
    pub(super) kernels: Vec<KernelName<'a>>,
    /// Light-time convention of the positions, and image offsets of the other conventions, with the orientation from kernels.
    pub(super) light_time: &'a LightTimeEffect,
    pub(super) line_period_s: f64,
    pub(super) lines_header: u32,
    pub(super) notes: Vec<String>,
    pub(super) site: &'a str,
    pub(super) start_from: StartFrom,
    pub(super) utc_start: &'a str,
    pub(super) version: &'static str,
}

/// Interpolation error of the tables, measured against the kernels.
#[derive(Serialize, JsonSchema)]
pub(super) struct Interpolation {
    /// Number of compared epochs; 0 if the nodes come from support data, without kernels for comparison.
    pub(super) epochs_compared_with_kernels: usize,
    #[schemars(range(min = 0.0))]
    pub(super) error_max_px: f64,
    #[schemars(transform = at("", "const", InterpolationCheck::LIMIT_PX))]
    pub(super) limit_px: f64,
    pub(super) method: &'static str,
    pub(super) within_limit: bool,
}

#[derive(Serialize, JsonSchema)]
pub(super) struct KernelName<'a> {
    pub(super) blake3: &'a str,
    pub(super) name: &'a str,
}
