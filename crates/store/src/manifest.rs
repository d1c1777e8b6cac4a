//! `manifest.json`: the origin of a site's products.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use areograph_base::verdict::Verdict;
use areograph_base::{schema::DocumentSchema, time::Interval};

/// Name of the manifest in a site's folder.
pub const MANIFEST: &str = "manifest.json";

/// Schema of the manifest.
#[must_use]
pub fn schema() -> DocumentSchema {
    DocumentSchema::of::<Manifest>("manifest")
}

/// The manifest of one site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(
    title = "Manifest of a site",
    description = "manifest.json of areograph: the inputs of the products of a site. finished_utc is the only entry that depends on the clock."
)]
pub struct Manifest {
    /// Always `areograph`.
    #[schemars(extend("const" = "areograph"))]
    pub tool: String,
    /// Version of the program.
    pub version: String,
    /// Site identifier.
    pub site: String,
    /// Whether every profile and image is within the configured limits.
    pub verdict: Verdict,
    /// The configuration file.
    pub configuration: ConfigurationEntry,
    /// Time corrections as used.
    pub biases: Vec<BiasEntry>,
    /// Kernels in load order.
    pub kernels: Vec<KernelEntry>,
    /// Rival kernel sets, and the set that was used; empty if the configuration names one source of kernels.
    pub kernel_choice: Vec<KernelChoiceEntry>,
    /// Stages with the fingerprint of all their inputs.
    pub stages: Vec<StageEntry>,
    /// Product files.
    #[schemars(length(min = 1))]
    pub products: Vec<ProductEntry>,
    /// Numbers of rows and other items.
    pub counts: BTreeMap<String, u64>,
    /// The largest figures of the site under the names in [`figures`]; absent without figures.
    #[schemars(schema_with = "figures::schema")]
    pub figures: BTreeMap<String, f64>,
    /// Rejected shots inside a window, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Problems of input records.
    pub complaints: Complaints,
    /// Notes for the reader, one sentence each.
    pub notes: Vec<String>,
    /// Time of publication: the only entry that depends on the clock.
    pub finished_utc: String,
}

/// Names of [`Manifest::figures`].
pub mod figures {
    use schemars::{Schema, SchemaGenerator, json_schema};
    use serde_json::{Map, Value, json};

    /// Largest |mean| of range − distance of a profile, metres.
    pub const RANGE_MEAN_M: &str = "range_mean_m";
    /// Largest second-order position RMSE of an image, metres.
    pub const POSITION_RMSE_M: &str = "position_rmse_m";
    /// Largest second-order pointing RMSE of an image, radians.
    pub const POINTING_RMSE_RAD: &str = "pointing_rmse_rad";
    /// Largest along-track parallax of two images at their tie points, metres.
    pub const ALONG_TRACK_PARALLAX_M: &str = "along_track_parallax_m";
    /// Largest along-track parallax of two images at their tie points, adjusted orientation, metres.
    pub const ADJUSTED_ALONG_TRACK_PARALLAX_M: &str = "adjusted_along_track_parallax_m";
    /// Magnitude of the median height of tie points above the MOLA surface, metres.
    pub const HEIGHT_OFF_SURFACE_M: &str = "height_off_surface_m";
    /// Magnitude of the median height of tie points above the MOLA surface, adjusted orientation, metres.
    pub const ADJUSTED_HEIGHT_OFF_SURFACE_M: &str = "adjusted_height_off_surface_m";
    /// A posteriori standard deviation of unit weight of the adjustment.
    pub const ADJUSTMENT_SIGMA0: &str = "adjustment_sigma0";

    /// Root mean square deviation of tie-point images in a net of pictures, the larger of the two coordinates, metres.
    pub const TIE_DEVIATION_RMS_M: &str = "tie_deviation_rms_m";
    /// Root mean square residual of the kept controls of a net, the larger of the two coordinates, metres.
    pub const CONTROL_RESIDUAL_RMS_M: &str = "control_residual_rms_m";

    /// Largest root mean square residual of tie points among the lines and axes of a calibrated camera, pixels.
    pub const TIE_RESIDUAL_RMS_PX: &str = "tie_residual_rms_px";
    /// Root mean square of intersected minus laser height at withheld control of a calibration, metres.
    pub const HELD_BACK_HEIGHT_RMS_M: &str = "held_back_height_rms_m";

    /// Root mean square of terrain model minus laser at shots withheld from a match, bias removed, metres.
    pub const HELD_OUT_RMS_M: &str = "held_out_rms_m";

    /// All of them, with their descriptions.
    const ALL: [(&str, &str); 13] = [
        (
            HELD_OUT_RMS_M,
            "Root mean square of terrain model minus laser at shots withheld from a match, bias removed, metres.",
        ),
        (
            RANGE_MEAN_M,
            "Largest |mean| of range minus distance of a profile, metres.",
        ),
        (
            POSITION_RMSE_M,
            "Largest second-order position RMSE of an image, metres.",
        ),
        (
            POINTING_RMSE_RAD,
            "Largest second-order pointing RMSE of an image, radians.",
        ),
        (
            ALONG_TRACK_PARALLAX_M,
            "Largest along-track parallax of two images at their tie points, metres.",
        ),
        (
            ADJUSTED_ALONG_TRACK_PARALLAX_M,
            "Largest along-track parallax of two images at their tie points, adjusted orientation, metres.",
        ),
        (
            HEIGHT_OFF_SURFACE_M,
            "Magnitude of the median height of tie points above the MOLA surface, metres.",
        ),
        (
            ADJUSTED_HEIGHT_OFF_SURFACE_M,
            "Magnitude of the median height of tie points above the MOLA surface, adjusted orientation, metres.",
        ),
        (
            ADJUSTMENT_SIGMA0,
            "A posteriori standard deviation of unit weight of the adjustment.",
        ),
        (
            TIE_DEVIATION_RMS_M,
            "Root mean square deviation of tie-point images in a net of pictures, the larger of the two coordinates, \
             metres.",
        ),
        (
            CONTROL_RESIDUAL_RMS_M,
            "Root mean square residual of the kept controls of a net, the larger of the two coordinates, metres.",
        ),
        (
            TIE_RESIDUAL_RMS_PX,
            "Largest root mean square residual of tie points among the lines and axes of a calibrated camera, pixels.",
        ),
        (
            HELD_BACK_HEIGHT_RMS_M,
            "Root mean square of intersected minus laser height at withheld control of a calibration, metres.",
        ),
    ];

    /// Schema of the map of figures.
    pub(super) fn schema(_: &mut SchemaGenerator) -> Schema {
        let figure = |(name, what): (&str, &str)| {
            let figure = json!({ "description": what, "type": "number", "minimum": 0 });
            (name.to_owned(), figure)
        };
        let properties: Map<String, Value> = ALL.into_iter().map(figure).collect();
        json_schema!({ "type": "object", "properties": properties })
    }
}

/// The configuration of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ConfigurationEntry {
    /// File name, without folders.
    pub file_name: String,
    /// BLAKE3 of the keys and values as written; comments and layout do not change it.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub blake3: String,
    /// The keys and values of the configuration; dots separate the names of tables and keys.
    pub keys: BTreeMap<String, String>,
}

/// A time correction as used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BiasEntry {
    /// `ck_bias` or `mola_clock`.
    #[schemars(extend("enum" = ["ck_bias", "mola_clock"]))]
    pub name: String,
    /// Seconds added to the time of a look-up.
    pub correction_s: f64,
    /// Look-ups or computations to which the correction applies.
    pub scope: String,
    /// Source of the value.
    pub source: String,
}

/// A kernel of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KernelEntry {
    /// File name, without folders.
    pub name: String,
    /// Role by content.
    pub role: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of the file.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub blake3: String,
    /// Required intervals that were read from this kernel, ET seconds: later kernels take precedence.
    pub coverage_used: Vec<Interval>,
}

/// One of several kernel sets, compared over the positions that the site requires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KernelChoiceEntry {
    /// Identifier in the configuration.
    pub set: String,
    /// Whether the set was used: its trajectory has the smallest root mean square distance from the mean of all sets.
    pub chosen: bool,
    /// Number of instants at which all sets were compared.
    #[schemars(range(min = 1))]
    pub epochs: u64,
    /// Root mean square distance from the mean of all sets, metres.
    #[schemars(range(min = 0.0))]
    pub distance_rms_m: f64,
    /// Largest distance from the mean of all sets, metres.
    #[schemars(range(min = 0.0))]
    pub distance_max_m: f64,
    /// Mean radial deviation from the mean of all sets, metres.
    pub radial_mean_m: f64,
    /// Mean along-track deviation from the mean of all sets, metres.
    pub along_track_mean_m: f64,
    /// Mean deviation from the mean of all sets along the orbit normal, metres.
    pub cross_track_mean_m: f64,
    /// Ephemerides of the set in load order.
    pub ephemerides: Vec<FileEntry>,
}

/// A file by name and content.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FileEntry {
    /// File name, without folders.
    pub name: String,
    /// BLAKE3 of the file.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub blake3: String,
}

/// A stage of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct StageEntry {
    /// Name; for a stage of one image, followed by `/` and the image.
    pub name: String,
    /// BLAKE3 over its parts.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub fingerprint: String,
}

/// A product file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ProductEntry {
    /// Path below the site's folder, with `/` as separator.
    pub path: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of the file.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub blake3: String,
    /// Number of rows; 1 for a document.
    pub rows: u64,
}

/// Problems in the input records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Complaints {
    /// Their number.
    pub count: u64,
    /// The first of them.
    pub texts: Vec<String>,
}
