//! The valid configuration of one site: every value checked, metres, radians and seconds inside.

use std::{collections::BTreeMap, path::PathBuf};

use serde::{Deserialize, Serialize};

use super::adjustment::{AdjustmentConfig, IntersectionConfig, TiesConfig};
use crate::{frames::MarsDatum, instruments::Instrument, time::PointingBias};

/// Everything that `areograph run` needs to know about a site.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SiteConfig {
    /// Identifier: lower-case letters, digits, `_` and `-`; also the folder of its products.
    pub site: String,
    /// Free text for the report.
    pub description: String,
    /// The file it was read from.
    pub file: PathBuf,
    /// BLAKE3, hexadecimal, of the keys and values as written: comments, spacing, order of keys
    /// and the place of the file do not change it.
    pub blake3: String,
    /// The same keys and values one by one: dots between tables, elements of lists by their `id`, else
    /// their place from 1.
    pub keys: BTreeMap<String, String>,
    /// Where kernels come from.
    pub kernels: KernelsConfig,
    /// Pointing (CK) bias.
    pub pointing: PointingConfig,
    /// MOLA clock bias.
    pub mola_clock: MolaClock,
    /// PEDR files and filters; no files when only images are oriented.
    pub pedr: PedrConfig,
    /// Windows on the ground, 1 to 64, or none when there are no PEDR files; bit `i` of `Footprints::windows` is entry `i`.
    pub windows: Vec<WindowConfig>,
    /// Images, possibly none.
    pub images: Vec<ImageConfig>,
    /// Limits of the range check.
    pub range_check: RangeCheckConfig,
    /// Sampling of exterior orientation.
    pub orientation: OrientationConfig,
    /// Projection of footprints into the images.
    pub registration: RegistrationConfig,
    /// Tie points between the images.
    pub ties: TiesConfig,
    /// Intersection of tie points.
    pub intersection: IntersectionConfig,
    /// Combined adjustment.
    pub adjustment: AdjustmentConfig,
}

/// Where kernels come from, and how coverage is judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KernelsConfig {
    /// The source of the kernel list.
    pub source: KernelSource,
    /// How far from an attitude sample the C-kernel may be asked, seconds; 0 asks only inside its intervals.
    pub ck_tolerance_s: f64,
    /// Margin that coverage must have beyond the first and last instant used, seconds.
    pub padding_s: f64,
}

/// The ways to name kernels.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelSource {
    /// One list.
    Listed(KernelList),
    /// A folder to choose from.
    Root(KernelSelection),
    /// Rival sets, at least two: the one whose trajectory is closest to the mean of all is used.
    Sets(Vec<RivalKernels>),
}

/// Kernels named one by one.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelList {
    /// A metakernel; relative paths in it count from its own folder.
    Metakernel(PathBuf),
    /// Files in load order (later ones win).
    Files(Vec<PathBuf>),
}

/// One of several complete sets of kernels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RivalKernels {
    /// Identifier, unique in the site, for example `nav`.
    pub id: String,
    /// Its kernels.
    pub list: KernelList,
}

/// How kernels are chosen from a folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KernelSelection {
    /// The folder, searched with its subfolders.
    pub root: PathBuf,
    /// Orbit solution, for example `nav`, `gsfc` or `ipng`.
    pub spk_family: String,
    /// Attitude qualities that may be used, best first: `reconstructed`, `nominal`.
    pub ck_quality: Vec<CkQuality>,
    /// Text kernels pinned by file name, such as `pck00010.tpc`; without one the latest version is taken.
    pub pinned: Vec<String>,
}

/// Where an attitude kernel comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CkQuality {
    /// From telemetry.
    Reconstructed,
    /// Commanded attitude that fills telemetry gaps (`mgs_ext_roto_all_v*`); loaded first, so that telemetry wins.
    Nominal,
}

/// Pointing bias and where its value comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointingConfig {
    /// The bias; it moves attitude look-ups only.
    pub ck_bias: PointingBias,
    /// Citation that products repeat.
    pub source: String,
}

/// The clock bias of MOLA: how shot tags become shot times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MolaClock {
    /// Size, seconds, not negative.
    pub bias_s: f64,
    /// On which side of the true time the tags lie.
    pub sign: TagSign,
    /// What the corrected time is used for.
    pub scope: BiasScope,
    /// Citation that products repeat.
    pub source: String,
}

/// On which side of the true time a tag lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TagSign {
    /// Tags are late: true time = tag − bias.
    Late,
    /// Tags are early: true time = tag + bias.
    Early,
}

/// What the corrected shot time is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BiasScope {
    /// The spacecraft's position in the range check; the default, which is what Shan 2005 did.
    SpkLookup,
    /// The rotation into IAU 2000 (the one out of the file's datum stays at the tag).
    Rotation,
    /// Both.
    Both,
    /// Nothing: tags are taken as they are.
    None,
}

impl MolaClock {
    /// Seconds to add to a tag: `−bias` for late tags, `+bias` for early ones, 0 when switched off.
    #[must_use]
    pub fn correction_s(&self) -> f64 {
        match (self.scope, self.sign) {
            (BiasScope::None, _) => 0.0,
            (_, TagSign::Late) => -self.bias_s,
            (_, TagSign::Early) => self.bias_s,
        }
    }

    /// Whether the spacecraft's position is looked up at the corrected time.
    #[must_use]
    pub const fn moves_spacecraft(&self) -> bool {
        matches!(self.scope, BiasScope::SpkLookup | BiasScope::Both)
    }

    /// Whether Mars turns between leaving the file's datum and entering IAU 2000.
    #[must_use]
    pub const fn moves_rotation(&self) -> bool {
        matches!(self.scope, BiasScope::Rotation | BiasScope::Both)
    }
}

/// PEDR files and filters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PedrConfig {
    /// The files, globs resolved, sorted, without repeats.
    pub files: Vec<PathBuf>,
    /// Datum of their coordinates.
    pub datum: DatumChoice,
    /// Shots to keep.
    pub filter: ShotFilter,
}

/// How the datum of a PEDR file is decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DatumChoice {
    /// By version letter and label: L is IAU 2000, older ones IAU 1991.
    Auto,
    /// As stated; a contradiction with letter or label is an error.
    Stated(MarsDatum),
}

/// Shots to keep; a shot must pass every test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShotFilter {
    /// Classification codes (1 ground, 0 cloud or noise).
    pub classes: Vec<i16>,
    /// Trigger channels, 1 to 4.
    pub channels: Vec<u8>,
    /// Attitude flags (0 known, 2 partly, 3 unknown).
    pub attitude_flags: Vec<u16>,
    /// Largest off-nadir angle, radians.
    pub off_nadir_max_rad: f64,
}

/// A window on the ground.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WindowConfig {
    /// Identifier, unique in the site.
    pub id: String,
    /// Its outline in IAU 2000 areocentric latitude and east longitude.
    pub shape: WindowShape,
}

/// Outline of a window, radians.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WindowShape {
    /// From `west_rad` eastwards to `east_rad`, both `0..2π`; `west > east` crosses 0°.
    /// A box over all longitudes has `west = 0`, `east = 2π`, and holds a pole when it reaches ±π/2.
    Box {
        /// Western edge, radians.
        west_rad: f64,
        /// Eastern edge, radians.
        east_rad: f64,
        /// Southern edge, radians.
        south_rad: f64,
        /// Northern edge, radians.
        north_rad: f64,
    },
    /// GeoJSON polygons; each is an outer ring followed by holes, rings of (longitude, latitude) as written.
    Polygons {
        /// Polygons, rings, vertices: radians.
        polygons: Vec<Vec<Vec<[f64; 2]>>>,
    },
}

/// An image: a label, keys written in the configuration, or both (keys written here win).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageConfig {
    /// Identifier, unique in the site; also a folder name.
    pub id: String,
    /// PDS3 or ISIS label, attached or detached.
    pub label: Option<PathBuf>,
    /// The camera, where the configuration names it: else the label does.
    pub instrument: Option<Instrument>,
    /// Its name in tie point files and in what is written for ISIS, when that is not the identifier.
    pub serial_number: Option<String>,
    /// Keys written in the configuration.
    pub fields: ImageFields,
}

impl ImageConfig {
    /// The name that tie points give the image.
    #[must_use]
    pub fn name_in_ties(&self) -> &str {
        self.serial_number.as_deref().unwrap_or(&self.id)
    }
}

/// What a label or the configuration says of an image; anything may be missing from either.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ImageFields {
    /// Spacecraft clock at the start of the first line, for example `619971158:28`.
    pub sclk_start: Option<String>,
    /// UTC at the start of the first line, used when there is no clock string.
    pub utc_start: Option<String>,
    /// Exposure of one detector line, seconds.
    pub exposure_s: Option<f64>,
    /// Time between two image lines, seconds.
    pub line_period_s: Option<f64>,
    /// Detector lines summed along the track.
    pub downtrack_summing: Option<u32>,
    /// Detector pixels summed across the track.
    pub crosstrack_summing: Option<u32>,
    /// Lines that were exposed, as the header says; the time model counts these.
    pub lines_header: Option<u32>,
    /// Lines in the delivered file, when fewer.
    pub lines_delivered: Option<u32>,
    /// Samples per line.
    pub samples: Option<u32>,
    /// First detector pixel, counted from 0 (`EDIT_MODE_ID`).
    pub first_detector: Option<u32>,
}

/// Fewest lines of an image: orientation is fitted over its length.
pub const IMAGE_LINES_MIN: u32 = 3;

/// No image is exposed this long, seconds: the longest of the mission take about a minute, and minutes
/// later the orientation is no polynomial of second order any more.
pub const IMAGE_DURATION_END_S: f64 = 600.0;

/// Labels print exposures and periods to 0.0001 ms; half of that is their rounding, seconds.
const EXPOSURE_ROUNDING_S: f64 = 0.5e-7;

/// Whether a line period is exposure × downtrack summing, within the rounding of printed values.
///
/// The rounding of the exposure counts once for every summed line, that of the period once.
#[must_use]
pub fn line_period_agrees(line_period_s: f64, exposure_s: f64, downtrack_summing: u32) -> bool {
    let summing = f64::from(downtrack_summing);
    (line_period_s - exposure_s * summing).abs() <= EXPOSURE_ROUNDING_S * (summing + 1.0)
}

/// Most steps of the bias scan, so that a slip in its step cannot make a run endless.
pub const SCAN_STEPS_MAX: u32 = 10_000;

/// Limits and options of the range check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RangeCheckConfig {
    /// Largest |mean| of a valid profile, metres.
    pub mean_max_m: f64,
    /// A shot farther from the median than this many robust standard deviations is an outlier.
    pub outlier_sigma: f64,
    /// Largest share of outliers in a valid profile, 0 to 1.
    pub outlier_share_max: f64,
    /// Fewest shots of a valid profile.
    pub shots_min: u32,
    /// Largest |range − distance to the file's own spacecraft position| (mean) of a valid profile, metres.
    pub decoding_max_m: f64,
    /// Largest clock bias that the scan tries on either side, seconds.
    pub scan_half_width_s: f64,
    /// Step of the scan, seconds.
    pub scan_step_s: f64,
}

/// Sampling of exterior orientation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OrientationConfig {
    /// Equal intervals over the image; one epoch more than intervals.
    pub intervals: u32,
    /// Largest second-order position RMSE (norm of x, y, z) of a valid sensor model, metres.
    pub position_rmse_max_m: f64,
    /// Largest second-order pointing RMSE (each angle) of a valid sensor model, radians.
    pub pointing_rmse_max_rad: f64,
}

/// Projection of footprints into the images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegistrationConfig {
    /// The orientation that points are projected with.
    pub model: CameraModel,
    /// A step of the published iterations below this is the last, lines.
    pub tolerance_lines: f64,
    /// Steps after which the published iterations are given up.
    pub steps_max: u32,
}

/// The forms of an image's orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraModel {
    /// Positions and angles as polynomials of first order.
    FirstOrder,
    /// Positions and angles as polynomials of second order.
    SecondOrder,
    /// Positions and a rotation vector as polynomials of second order.
    RotationVector,
    /// Interpolation between the samples, no polynomial over the whole image.
    Samples,
}

impl CameraModel {
    /// Every model, with its word in configuration and products.
    pub const WORDS: [(&'static str, Self); 4] = [
        ("first_order", Self::FirstOrder),
        ("second_order", Self::SecondOrder),
        ("rotation_vector", Self::RotationVector),
        ("samples", Self::Samples),
    ];
}

#[cfg(test)]
mod tests {
    use super::line_period_agrees;

    #[test]
    fn periods_agree_within_the_rounding_of_what_labels_print() {
        // (period, exposure) in milliseconds, summing: the limits are 0.00045, 0.0002 and 0.0001 ms.
        for (period_ms, exposure_ms, summing, agrees) in [
            (3.8568, 0.4821, 8, true),
            (3.8572, 0.4821, 8, true),
            (3.8573, 0.4821, 8, false),
            (3.8564, 0.4821, 8, true),
            (3.8563, 0.4821, 8, false),
            (1.4463, 0.482_067, 3, true),
            (1.4465, 0.482_067, 3, false),
            (0.482_19, 0.4821, 1, true),
            (0.482_21, 0.4821, 1, false),
            (0.4821, 0.4821, 8, false),
            (f64::NAN, 0.4821, 8, false),
        ] {
            assert_eq!(
                line_period_agrees(period_ms * 1e-3, exposure_ms * 1e-3, summing),
                agrees,
                "{period_ms} ms of {summing} × {exposure_ms} ms"
            );
        }
    }
}
