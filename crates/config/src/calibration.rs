//! The configuration of a calibration of the lines of a camera: `areograph calibrate`.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::{
    altimetry::{GroundRadius, ShotFilter},
    body::Body,
    constants::{CONTROL_SIGMA_MAX_M, SIGMA_MIN},
    units::RADIANS_PER_DEGREE,
};

use super::{
    declare::{Declare as _, Keys, Many, declare_table, key, of_the_file, table, tables},
    document::{Document, with_file},
    forms::{
        Switch, above_to, any_text, from_to, identifier, lower_case_identifier, whole_from_to,
        words,
    },
    paths::{FILE, Globs, PEDR_ENDINGS},
    pedr::ground_radius,
};

/// Lines of a camera: the HRSC has nine.
const CAMERAS: Many = Many {
    count: Some((2, 9)),
    purpose: " that see the same ground",
    further: &[],
};

declare_table! {
    /// Everything that `areograph calibrate` needs to know: every value checked, metres and radians inside.
    pub struct CalibrationConfig {
        /// Identifier of the calibration, and name of its products folder.
        calibration: String = key(lower_case_identifier()).required().example(r#""hrsc_i864""#),
        /// Free text for the report.
        description: String = key(any_text()).or(String::new()).example(r#""Stereo lines over orbit I864""#),
        /// Body that the cameras observe; support data of a different body are refused.
        body: Body = key(words([
            ("mars", Body::Mars, "in IAU 2000"),
            ("moon", Body::Moon, "in the mean Earth/polar axis frame"),
        ])).or(Body::Mars),
        /// The file it was read from.
        file: PathBuf = of_the_file(),
        /// BLAKE3, hexadecimal, of the keys and values as written.
        blake3: String = of_the_file(),
        /// The same keys and values one by one.
        keys: BTreeMap<String, String> = of_the_file(),
        /// The lines of the camera.
        cameras: Vec<CameraConfig> = tables(CAMERAS),
        /// Points that several lines see.
        ties: CalibrationTiesConfig = table(),
        /// Points located by the laser.
        control: CalibrationControlConfig = table(),
        /// Laser passes from which such points are found.
        laser: CalibrationLaserConfig = table(),
        /// A priori values.
        a_priori: APrioriConfig = table(),
        /// Solution of the calibration.
        solution: SolutionConfig = table(),
        /// Other orbits, to which the result is applied unchanged.
        validation: Vec<ValidationConfig> = tables(Many::ANY),
    }
    check across_tables
}

impl Document for CalibrationConfig {
    const EXAMPLE: &'static str = "config/calibrations/example.toml";
    const HEADER: &'static str = "\
# Calibration of the lines of a camera with `areograph calibrate`: every key with its unit, range and default.
#
# Only `calibration`, two [[cameras]] and [ties] are required; an omitted key has the default given here.
# Without laser points ([control] or [laser]), absolute pointing is not determined, and the result is marked invalid.
# If every camera has `pixels`, ties.match and [laser] can replace tables of points.
# Relative paths are relative to the folder of this file.
# Schema: ../schema/calibration.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Calibration of the lines of a camera by areograph",
        "The TOML file of one calibration as JSON. areograph checks more than a schema can: the existence of \
         files and the agreement between keys.",
    ];

    with_file!();
}

/// Required entries.
fn across_tables(written: &CalibrationConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| serde_json::json!({"required": ["ties"]}));
    if written.ties.files.is_empty() && keys.span_of("ties").is_none() {
        keys.missing("ties", "a table [ties] with files");
    }
    from_pixels(written, keys);
    let mut seen = BTreeSet::new();
    for camera in keys.entries(&["cameras"]) {
        let Some(id) = camera.get("id") else { continue };
        if id
            .get_ref()
            .as_str()
            .is_some_and(|id| !seen.insert(id.to_owned()))
        {
            keys.review()
                .refuse(id.span(), "cameras.id", "a name that no other camera has");
        }
    }
}

/// Either tables of points, or pixels and laser passes.
fn from_pixels(written: &CalibrationConfig, keys: &mut Keys<'_, '_>) {
    if !written.ties.matched {
        if keys.span_of("laser").is_some() {
            keys.missing(
                "ties.match",
                "ties.match = true, because [laser] finds control points in a terrain model of matched pixels",
            );
        }
        return;
    }
    if keys.span_of("laser").is_none() {
        keys.missing(
            "laser",
            "a table [laser] with files and cell_m, because tie points are matched (ties.match)",
        );
    }
    let entries = keys.entries(&["cameras"]);
    let without = entries.iter().filter(|entry| !entry.contains_key("pixels"));
    for camera in without.filter_map(|entry| entry.get("id")) {
        let id = camera.get_ref().as_str().unwrap_or_default();
        keys.review().refuse(
            camera.span(),
            "cameras.pixels",
            format!(
                "a file with the pixels of camera {id}, because tie points are matched (ties.match)"
            ),
        );
    }
    for (given, key) in [
        (&written.ties.files, "ties.files"),
        (&written.control.files, "control.files"),
    ] {
        if !given.is_empty() {
            let span = keys.span_of("ties").unwrap_or_default();
            keys.review().refuse(
                span,
                key,
                "no table of points: with ties.match, points are measured in the images",
            );
        }
    }
}

declare_table! {
    /// 2 to 9 lines of one camera, which fly together.
    pub struct CameraConfig {
        /// Name of the line in tables of points.
        id: String = key(identifier()).required().example(r#""s1""#),
        /// Image support data (ISD) of the line, as written by ALE: the calibration starts from the mounting, focal
        /// length and detector geometry given there. The rotations `instrument_pointing` of all cameras must end in the
        /// same frame, that of the spacecraft, from which `constant_rotation` leads to each camera.
        #[serde(skip)]
        isd: PathBuf = key(FILE).required().example(r#""isd/s1.json""#),
        /// File with the pixels of the whole image: a level-2 archive file (`h….img`) of the HRSC, a greyscale TIFF or
        /// PNG of one band, or a cube. Only for ties.match.
        #[serde(skip)]
        pixels: Option<PathBuf> = key(FILE).unused(r#""images/s1.tif""#),
    }
}

declare_table! {
    /// Tie points in the images of several camera lines.
    pub struct CalibrationTiesConfig {
        /// Paths or globs of tables (.csv), one row per measurement: `point`, `camera`, `line`, `sample` (0 at the
        /// outer edge of the first line and sample) and, where known, `sigma_line`, `sigma_sample`.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(&["csv"])).or(Vec::new()).example(r#"["ties.csv"]"#),
        /// Whether areograph measures tie points itself, in the `pixels` of all cameras. Rounds of tie points, terrain
        /// model, laser control and calibration then follow until convergence, each with the cameras of the preceding
        /// round (Li et al. 2023).
        matched as "match": bool = key(Switch).or(false),
        /// Standard deviation of measured lines and samples, if missing from the table.
        sigma_px: f64 = key(from_to(SIGMA_MIN, 100.0)).or(0.2),
        /// Distance between the measurements of a tie point and the projections of one ground point with the
        /// uncalibrated cameras, beyond which the tie point is rejected.
        limit_px: f64 = key(from_to(1.0, 1e4)).or(100.0),
    }
    check something_measures
}

/// Without files and without matching there is no tie point.
fn something_measures(ties: &CalibrationTiesConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| {
        serde_json::json!({"anyOf": [
            {"required": ["files"]},
            {"required": ["match"], "properties": {"match": {"const": true}}},
        ]})
    });
    if !ties.matched && keys.span_of("files").is_none() {
        keys.missing(
            "files",
            "paths or globs of tables of tie points, or match = true",
        );
    }
}

declare_table! {
    /// Laser passes over the ground of the images. As in `areograph pedr match`, a terrain model from the two lines
    /// with the largest convergence locates control points in these passes. Only for ties.match.
    pub struct CalibrationLaserConfig {
        /// Paths or globs of PEDR files.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(PEDR_ENDINGS)).or(Vec::new()).unused(r#"["pedr/*.b"]"#),
        /// Edge of a cell of the terrain model, metres; at least the ground size of one pixel.
        cell_m: Option<f64> = key(above_to(0.0, 1e5)).unused("100.0"),
        /// Search radius for the shift of a unit of shots, cells: the largest possible error of orbit and mounting.
        search_cells: u32 = key(whole_from_to(1, 500)).or(70),
        /// Maximum number of shots in a segment.
        segment_points: u32 = key(whole_from_to(3, 1_000)).or(15),
        /// Drift of the images against the laser, metres per kilometre of ground. If given, segments are as long as a
        /// drift of one cell of the terrain model permits (Li et al. 2023, eq. 16); their maximum number of shots then does
        /// not apply.
        segment_drift_m_per_km: Option<f64> = key(above_to(0.0, 1e4)).unused("0.37"),
        /// Height variance that a segment must exceed, square metres.
        least_variance_m2: f64 = key(above_to(0.0, 1e9)).or(1_000.0),
        /// Similarity to the terrain model that a unit of shots must exceed.
        least_score: f64 = key(from_to(0.01, 0.999)).or(0.9),
        /// Largest root mean square of model minus laser heights, bias removed, at shots withheld from the search,
        /// metres.
        limit_m: f64 = key(above_to(0.0, 1e5)).or(60.0),
        /// Random seed for the clustering of shots and the choice of withheld ground.
        seed: u32 = key(whole_from_to(0, u32::MAX)).or(1),
        /// Maximum number of rounds; a calibration that has not converged after these rounds is invalid.
        rounds_max: u32 = key(whole_from_to(1, 100)).or(10),
        /// Shot radius used as the radius of the ground: corrected by the crossover residuals of the files, or raw.
        crossover: GroundRadius = key(ground_radius()).or(GroundRadius::Corrected),
        /// Shots to keep.
        filter: ShotFilter = table(),
    }
    check what_is_searched
}

/// A table without files or cells finds nothing.
fn what_is_searched(laser: &CalibrationLaserConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| serde_json::json!({"required": ["files", "cell_m"]}));
    if laser.files.is_empty() && keys.span_of("files").is_none() {
        keys.missing("files", "paths or globs of PEDR files");
    }
    if laser.cell_m.is_none() && keys.span_of("cell_m").is_none() {
        keys.missing("cell_m", "the edge of a cell in metres");
    }
}

declare_table! {
    /// Points located by the laser. Without such points, only differences between the cameras can be determined.
    pub struct CalibrationControlConfig {
        /// Paths or globs of tables (.csv), one row per measurement: `point`, `camera`, `line`, `sample`,
        /// `longitude_deg` (east), `latitude_deg` (areocentric) and `radius_m` (from the centre of the body, not a
        /// height above a datum). Where known: `sigma_line`, `sigma_sample`, `sigma_horizontal_m`, `sigma_vertical_m`,
        /// and the contributions of matching to the latter two, `sigma_matching_horizontal_m` and
        /// `sigma_matching_vertical_m`. Errors that all points of a laser profile share are part of `sigma_horizontal_m` and
        /// `sigma_vertical_m`; where known: `profile`, `sigma_shared_horizontal_m` and `sigma_shared_vertical_m`.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(&["csv"])).or(Vec::new()).example(r#"["control.csv"]"#),
        /// Standard deviation of measured lines and samples, if missing from the table.
        sigma_px: f64 = key(from_to(SIGMA_MIN, 100.0)).or(1.0),
        /// Standard deviation of a horizontal coordinate of a laser point, if missing from the table; the default
        /// applies to MOLA profiles. With `ties.match`, the uncertainty of matching is added. For larger values than
        /// those permitted, the ground departs from the plane in which errors are computed.
        sigma_horizontal_m: f64 = key(from_to(SIGMA_MIN, CONTROL_SIGMA_MAX_M)).or(100.0),
        /// Standard deviation of the radius of a laser point, used under the same conditions as `sigma_horizontal_m`.
        sigma_vertical_m: f64 = key(from_to(SIGMA_MIN, CONTROL_SIGMA_MAX_M)).or(10.0),
        /// Interval n of withheld control: every n-th control point along the flight is withheld for validation; with
        /// `ties.match`, all shots in every n-th 5 km by 10 km rectangle on the ground.
        held_back_every: u32 = key(whole_from_to(2, 100)).or(4),
        /// Distance between the measurement of a control point and its projection with the uncalibrated cameras, beyond
        /// which the point is rejected.
        limit_px: f64 = key(from_to(1.0, 1e4)).or(300.0),
    }
}

declare_table! {
    /// A priori standard deviations. `orbit_bias_m`, `orbit_drift_m_per_line` and `angle_deg` are from Li et al. 2023,
    /// Table 2.
    pub struct APrioriConfig {
        /// Standard deviation of an orbit coordinate. The error of the coordinate is not estimated, because the offset
        /// angles of the camera absorb it. Together with `angle_deg`, this key limits the shift of the image by a
        /// calibration.
        orbit_bias_m: f64 = key(from_to(1e-3, 1e5)).or(1_000.0),
        /// Standard deviation of the drift of an orbit coordinate per image line.
        orbit_drift_m_per_line: f64 = key(from_to(1e-6, 10.0)).or(0.01),
        /// Standard deviation of an offset angle in the solution from tie points alone.
        angle_rad as "angle_deg": f64 =
            key(from_to(1e-4, 10.0)).or(0.025).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Standard deviation of an offset angle in the solution with control: large, because the angle absorbs the
        /// remaining orbit error.
        control_angle_rad as "control_angle_deg": f64 =
            key(from_to(1e-3, 10.0)).or(1.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Standard deviation of the constant and linear terms of the look angles, at the edge of the image.
        look_px: f64 = key(from_to(1e-3, 1e4)).or(50.0),
        /// Standard deviation of the higher-order terms of the look angles, at the edge of the image.
        bend_px: f64 = key(from_to(1e-4, 1e4)).or(0.5),
    }
}

declare_table! {
    /// Solution of the calibration.
    pub struct SolutionConfig {
        /// Parameters estimated from tie points before control is used.
        mode: CalibrationMode = key(words([
            ("differential", CalibrationMode::Differential, "differences in roll and scale between the cameras, which tie points determine"),
            (
                "as_published",
                CalibrationMode::AsPublished,
                "all angles of all cameras; tie points determine some of their combinations weakly or not at all",
            ),
        ])).or(CalibrationMode::Differential),
        /// Order of the look angle polynomials.
        order: u32 = key(whole_from_to(2, 3)).or(2),
    }
}

declare_table! {
    /// Another orbit of the same camera, to which the result is applied unchanged.
    pub struct ValidationConfig {
        /// Name of the orbit.
        id: String = key(identifier()).required().example(r#""i818""#),
        /// Paths or globs of the image support data of this orbit, one file per camera, identified by `name_sensor`.
        #[serde(skip)]
        isd: Vec<PathBuf> = key(Globs(&["json"])).required_as("paths or globs of image support data").example(r#"["isd/i818_*.json"]"#),
        /// Tables of the tie points of this orbit.
        #[serde(skip)]
        ties: Vec<PathBuf> = key(Globs(&["csv"])).required_as("paths or globs of tables of tie points").example(r#"["i818_ties.csv"]"#),
        /// Tables of the laser points of this orbit.
        #[serde(skip)]
        control: Vec<PathBuf> = key(Globs(&["csv"])).required_as("paths or globs of tables of laser points")
            .example(r#"["i818_control.csv"]"#),
    }
}

/// Parameters estimated from tie points before control is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationMode {
    /// Differences in roll and scale between the cameras.
    Differential,
    /// All angles of all cameras.
    AsPublished,
}
