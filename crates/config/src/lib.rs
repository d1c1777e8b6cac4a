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
//! let problems = areograph_config::parse("site = \"gusev\"\nwindow = 3\n", Path::new("gusev.toml"));
//! // The unknown key, and what is missing, each with its line.
//! assert!(problems.unwrap_err().to_string().contains("gusev.toml:2"));
//! ```

mod adjustment;
mod calibration;
mod data_file;
mod declare;
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
mod problems;
mod products;
mod range_check;
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
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

use serde::Serialize;
use toml::de::DeTable;

pub use adjustment::{AdjustmentConfig, OrientationPrior};
pub use calibration::{
    APrioriConfig, CalibrationConfig, CalibrationLaserConfig, CalibrationMode, CameraConfig,
    LoadedCalibration, SolutionConfig, ValidationConfig, calibration_example, calibration_schema,
    load_calibration, parse_calibration,
};
pub use declare::{Accept, DeclaredKey, ValueKind, Word};
pub use exposures::{ExposurePiece, line_times_of};
pub use images::ImageConfig;
pub use instruments::{
    all_instruments, altimeter, built_in_altimeters, built_in_instruments, instrument,
    usual_altimeter, usual_instrument,
};
pub use kernels::KernelsConfig;
pub use laser_surface::MolaSurfaceConfig;
pub use limits::LimitsConfig;
pub use net::{
    Blunders, LoadedNet, Method, NetConfig, TriangulationConfig, YAxis, load_net, net_example,
    net_schema, parse_net,
};
pub use new_site::NewSite;
pub use orientation::{OrientationConfig, RegistrationConfig};
pub use pedr::PedrConfig;
pub use pointing::{PointingConfig, UsedBias};
pub use problems::Problems;
pub use products::{ProductsConfig, ShotFormat};
pub use range_check::{RangeCheckConfig, SCAN_STEPS_MAX};
pub use service::{
    AlertKind, ChangesConfig, FetchConfig, FreshnessConfig, HookConfig, HttpConfig, LoadedService,
    MovedConfig, RetentionConfig, ScheduleConfig, ServiceConfig, ServiceInputs, ServiceOutputs,
    WorkersConfig, load_service, parse_service, service_example, service_schema,
};
pub use shots::{ShotColumns, ShotLayout, ShotTableConfig};
pub use site::SiteConfig;
pub use surface::SurfaceConfig;
pub use ties::{IntersectionConfig, TiesConfig};
pub use unknowns::{PositionUnknowns, RotationUnknowns};
pub use window_list::{load_windows, require_outlines, window_of_box, window_of_polygon};
pub use windows::WindowConfig;

use areograph_base::error::{Cause, Error, IoError, Locate as _};
use declare::{Keys, Table, described};
use problems::Review;
use written::Written;

/// Beginning of the example of a site.
const HEADER: &str = "\
# Site configuration of areograph, every key with its unit, range and default.
#
# Only `site`, one source of kernels, and either [pedr] (or [[shots]]) with [[windows]] or [[images]] are required;
# a key that is left out has the default given here. Relative paths are relative to the folder of this file.
# Angles are degrees, exposures milliseconds, times seconds; longitudes are east, latitudes
# areocentric, both in the frame of the body: IAU 2000 of Mars. Schema: ../schema/site.schema.json

";

/// Longest configuration file, bytes.
const BYTES_MAX: u64 = 1 << 20;

/// A configuration that passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The valid form.
    pub site: SiteConfig,
    /// Warnings, each with its place: entries that are never used.
    pub warnings: Vec<String>,
    /// Files, and folders of kernels, to which its keys refer.
    pub files: Vec<PathBuf>,
}

/// Reads and checks the configuration `path`; relative paths in it are relative to its folder.
///
/// # Errors
/// [`Problems`] with everything that is wrong, or [`IoError`] when the file cannot be read.
pub fn load(path: &Path) -> Result<Loaded, Error> {
    load_within(path, &[])
}

/// As [`load`], for a configuration that may refer only to files below `roots`, links followed.
///
/// # Errors
/// As [`load`].
pub fn load_within(path: &Path, roots: &[PathBuf]) -> Result<Loaded, Error> {
    let text = read(path)?;
    Ok(parse_within(&text, path, roots)?)
}

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

/// As [`load`], for a configuration whose files, folders and globs need not exist yet.
///
/// # Errors
/// As [`load`], missing files excepted.
pub fn load_unfilled(path: &Path) -> Result<Unfilled, Error> {
    let text = read(path)?;
    Ok(parse_unfilled(&text, path)?)
}

/// As [`parse`], for a configuration whose files, folders and globs need not exist yet.
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

/// The text of the file, of bounded length.
fn read(path: &Path) -> Result<String, Error> {
    let size = path.metadata().map_err(IoError::on("read")).in_file(path)?;
    // Devices and pipes may never end.
    if !size.is_file() {
        return Err(Problems::of_file(path, "is not a regular file; expected a TOML file").into());
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(BYTES_MAX + 1).read_to_end(&mut bytes))
        .map_err(IoError::on("read"))
        .in_file(path)?;
    if bytes.len() as u64 > BYTES_MAX {
        let text = format!("is longer than {BYTES_MAX} bytes; expected the TOML file of one site");
        return Err(Problems::of_file(path, &text).into());
    }
    String::from_utf8(bytes).map_err(|error| {
        let byte = error.utf8_error().valid_up_to() + 1;
        Problems::of_file(
            path,
            &format!("is not UTF-8 from byte {byte}; expected text"),
        )
        .into()
    })
}

/// Checks the configuration `text` of `file`.
/// Besides the text it examines only files that the text names: whether they exist, which files globs match, and the
/// polygons of windows.
///
/// # Errors
/// [`Problems`] with all faults.
pub fn parse(text: &str, file: &Path) -> Result<Loaded, Problems> {
    parse_within(text, file, &[])
}

fn parse_within(text: &str, file: &Path, roots: &[PathBuf]) -> Result<Loaded, Problems> {
    let mut review = Review::new(file, text).within(roots);
    let read = read_table::<SiteConfig>(text, &mut review);
    let files = review.take_files();
    let ((site, Written { blake3, keys }), warnings) = review.finish(read)?;
    let site = SiteConfig {
        file: file.to_owned(),
        blake3,
        keys,
        ..site
    };
    Ok(Loaded {
        site,
        warnings,
        files,
    })
}

/// The result of reading, with the keys as written, and warnings.
type Parsed<T> = ((T, Written), Vec<String>);

/// Checks the `text` of `file`, whose keys `T` declares and `documentation` documents.
fn parse_file<T: Table>(
    text: &str,
    file: &Path,
    documentation: &'static str,
) -> Result<Parsed<T>, Problems> {
    let mut review = Review::new(file, text).documented_in(documentation);
    let read = read_table(text, &mut review);
    review.finish(read)
}

/// The content of `text`, to be used only when `review` has found no problem.
fn read_table<T: Table>(text: &str, review: &mut Review<'_>) -> Option<(T, Written)> {
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    if !syntax_errors.is_empty() {
        for error in syntax_errors {
            let text = format!("this is not TOML: {}", error.message());
            review.problem(error.span(), text);
        }
        return None;
    }
    let mut keys = Keys::of_file(document.get_ref(), review);
    let read = T::read(&mut keys);
    keys.finish();
    match toml::from_str(text) {
        Ok(table) => Some((read, Written::of(table, review.renames()))),
        // A value that TOML cannot hold, which its key has refused already.
        Err(error) => {
            if !review.has_problems() {
                review.problem(error.span(), error.message().to_owned());
            }
            None
        }
    }
}

/// Every key that a site file can have, in the order of the example file.
#[must_use]
pub fn keys() -> Vec<DeclaredKey> {
    let mut keys = Vec::new();
    described::<SiteConfig>().walk(&mut keys);
    keys
}

/// The example file, `config/sites/example.toml`.
#[must_use]
pub fn example() -> String {
    declare::example(HEADER, &described::<SiteConfig>())
}

/// The JSON Schema of a site file, `config/schema/site.schema.json`.
#[must_use]
pub fn schema() -> impl Serialize {
    declare::schema(
        "Site configuration of areograph",
        "The TOML file of one site as JSON. areograph checks more than a schema can: existence of files, order \
         within windows, agreement between keys.",
        &described::<SiteConfig>(),
    )
}

/// Two configurations name the same site, so their products would overwrite each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[error("site is \"{site}\" in {first} and in {second}; expected one file per site")]
#[cause(Configuration: "give each site its own identifier: it is also the folder of its products")]
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
