//! Site configuration: a TOML file, checked completely, converted into [`SiteConfig`].
//!
//! The file uses degrees and milliseconds, the valid form radians and seconds. All problems of a file are reported
//! together, each as `file:line:column: key is value; expected …`.
//! Each table has a file here, in which its keys are declared; `config/sites/example.toml`, which
//! documents every key, and `config/schema/site.schema.json` are made from the declarations.
//!
//! The crate uses only the vocabulary of `base` and `geom`.
//!
//! ```
//! use std::path::Path;
//!
//! use areograph_config::{Document as _, SiteConfig};
//!
//! let problems = SiteConfig::parse("site = \"gusev\"\nwindow = 3\n", Path::new("gusev.toml"));
//! // The unknown key, and what is missing, each with its line.
//! assert!(problems.unwrap_err().to_string().contains("gusev.toml:2"));
//! ```

mod adjustment;
mod boresight;
mod calibration;
mod cameras;
mod campaign;
mod data_file;
mod declare;
mod document;
mod exposures;
mod forms;
mod geojson;
mod images;
mod instruments;
mod kernels;
mod laser_surface;
mod limits;
mod net;
mod new_site;
mod orientation;
mod paths;
mod pedr;
mod pointing;
mod printed_file;
mod problems;
mod products;
mod range_check;
mod readings;
mod relief;
mod service;
mod shots;
mod site;
mod surface;
mod ties;
mod unknowns;
mod window_list;
mod windows;
mod written;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

pub use adjustment::{AdjustmentConfig, OrientationPrior};
pub use boresight::{BoresightOfSite, BoresightStatements, LaserMounting};
pub use calibration::{
    APrioriConfig, CalibrationConfig, CalibrationLaserConfig, CalibrationMode, CameraConfig,
    SolutionConfig, ValidationConfig,
};
pub use cameras::CamerasConfig;
pub use campaign::{
    CampaignArchiveConfig, CampaignConfig, CampaignImage, CampaignPairsConfig, ExecutorConfig,
    ExecutorKind, SITE_FILE_MARK, SelectionConfig, SiteTemplate, load_campaign,
};
pub use declare::{Accept, DeclaredKey, ValueKind, Word};
pub use document::{Document, Loaded};
pub use exposures::{ExposurePiece, line_times_of};
pub use forms::{SITE_IDENTIFIER, is_site_identifier};
pub use images::ImageConfig;
pub use instruments::{
    all_instruments, altimeter, built_in_altimeters, built_in_instruments, instrument,
    usual_altimeter, usual_instrument,
};
pub use kernels::KernelsConfig;
pub use laser_surface::MolaSurfaceConfig;
pub use limits::LimitsConfig;
pub use net::{Blunders, Method, NetConfig, TriangulationConfig, YAxis};
pub use new_site::NewSite;
pub use orientation::{OrientationConfig, RegistrationConfig};
pub use paths::{
    DEPTH_MAX, PEDR_ENDINGS, SHOT_TABLE_ENDINGS, TIE_ENDINGS, absolute, files_in, real, seen_from,
};
pub use pedr::PedrConfig;
pub use pointing::{PointingConfig, UsedBias};
pub use problems::Problems;
pub use products::{ProductsConfig, ShotFormat};
pub use range_check::{RangeCheckConfig, SCAN_STEPS_MAX};
pub use readings::ReadingsDecision;
pub use relief::ReliefForPlan;
pub use service::{
    AlertKind, ChangesConfig, FetchConfig, FreshnessConfig, HookConfig, HttpConfig, MovedConfig,
    RetentionConfig, ScheduleConfig, ServiceConfig, ServiceInputs, ServiceOutputs, WorkersConfig,
};
pub use shots::{ShotColumns, ShotLayout, ShotTableConfig};
pub use site::SiteConfig;
pub use surface::SurfaceConfig;
pub use ties::{IntersectionConfig, TiesConfig};
pub use unknowns::{PositionUnknowns, RotationUnknowns};
pub use window_list::{load_windows, require_outlines, window_of_box, window_of_polygon};
pub use windows::{
    BoxCoordinates, LatitudeKind, LongitudeSense, WindowConfig, suspicious_width_deg,
};

use areograph_base::error::{Cause, Error};
use declare::described;
use document::{read, read_table};
use problems::Review;

/// A configuration whose inputs may be missing, checked in all else.
#[derive(Debug, Clone, PartialEq)]
pub struct Unfilled {
    /// The valid form, with the paths and globs of missing files.
    pub site: SiteConfig,
    /// Files, folders and globs that lead nowhere yet.
    pub absent: Vec<PathBuf>,
    /// Paths and globs of each table `[[shots]]`, as written.
    pub shot_globs: Vec<Vec<ShotGlob>>,
}

/// A path or glob of tables of shots.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShotGlob {
    /// The path, from the current folder on; its last part may have wildcards.
    pub path: PathBuf,
    /// Whether it leads to no file yet.
    pub is_absent: bool,
}

/// As [`Document::load`], for a configuration whose files, folders and globs need not exist yet.
///
/// # Errors
/// As [`Document::load`], missing files excepted.
pub fn load_unfilled(path: &Path) -> Result<Unfilled, Error> {
    let text = read(path)?;
    Ok(parse_unfilled(&text, path)?)
}

/// As [`Document::parse`], for a configuration whose files, folders and globs need not exist yet.
///
/// # Errors
/// [`Problems`] with everything that is wrong, missing files excepted.
pub fn parse_unfilled(text: &str, path: &Path) -> Result<Unfilled, Problems> {
    let mut review = Review::new(path, text).unfilled();
    let read = read_table::<SiteConfig>(text, &mut review);
    let absent = review.take_absent();
    let ((site, _), _) = review.finish(read)?;
    let file = path.to_owned();
    let site = SiteConfig { file, ..site };
    let shot_globs = shot_globs(text, path, &absent);
    Ok(Unfilled {
        site,
        absent,
        shot_globs,
    })
}

/// Paths and globs of the tables of shots of a valid text.
fn shot_globs(text: &str, path: &Path, absent: &[PathBuf]) -> Vec<Vec<ShotGlob>> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let table: toml::Table = text.parse().unwrap_or_default();
    let tables = table.get("shots").and_then(toml::Value::as_array);
    let globs = |table: &toml::Value| {
        let globs = table.get("files").and_then(toml::Value::as_array);
        let globs = globs.into_iter().flatten().filter_map(toml::Value::as_str);
        globs
            .map(|glob| ShotGlob {
                path: folder.join(glob),
                is_absent: absent.contains(&PathBuf::from(paths::below(folder, glob))),
            })
            .collect()
    };
    tables.into_iter().flatten().map(globs).collect()
}

/// Every key that a site file can have, in the order of the example file.
#[must_use]
pub fn keys() -> Vec<DeclaredKey> {
    let mut keys = Vec::new();
    described::<SiteConfig>().walk(&mut keys);
    keys
}

/// Two configurations name the same site, so their products would overwrite each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[error("site is \"{site}\" in {first} and in {second}; expected one file per site")]
#[cause(Configuration: "give each site its own identifier, which is also the name of its products folder")]
pub struct DuplicateSite {
    /// The identifier they share.
    pub site: String,
    /// The file that came first.
    pub first: String,
    /// The file that came later.
    pub second: String,
}

/// Sites of one run must have different identifiers.
///
/// # Errors
/// [`DuplicateSite`] for the first identifier that comes twice.
pub fn check_sites(sites: &[SiteConfig]) -> Result<(), DuplicateSite> {
    let mut seen: BTreeMap<&str, &Path> = BTreeMap::new();
    for site in sites {
        if let Some(first) = seen.insert(&site.site, &site.file) {
            return Err(DuplicateSite {
                site: site.site.clone(),
                first: first.display().to_string(),
                second: site.file.display().to_string(),
            });
        }
    }
    Ok(())
}
