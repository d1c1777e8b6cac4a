//! The valid configuration of one site: every value checked, metres, radians and seconds inside.

use std::{collections::BTreeMap, path::PathBuf};

use serde::Serialize;

use super::adjustment::{AdjustmentConfig, IntersectionConfig, TiesConfig};
use crate::{
    altimetry::{DatumChoice, MolaClock, ShotFilter},
    geom::{pushbroom::CameraModel, window::WindowShape},
    image::ImageFields,
    instruments::Instrument,
    kernel_source::KernelSource,
    time::PointingBias,
};

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

/// Pointing bias and where its value comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointingConfig {
    /// The bias; it moves attitude look-ups only.
    pub ck_bias: PointingBias,
    /// Citation that products repeat.
    pub source: String,
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

/// A window on the ground.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WindowConfig {
    /// Identifier, unique in the site.
    pub id: String,
    /// Its outline in IAU 2000 areocentric latitude and east longitude.
    pub shape: WindowShape,
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
