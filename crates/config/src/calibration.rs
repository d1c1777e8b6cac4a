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
    document::Document,
    forms::{
        Switch, above_to, any_text, from_to, identifier, lower_case_identifier, whole_from_to,
        words,
    },
    paths::{FILE, Globs},
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
        /// Identifier, and the name of the folder of its products.
        calibration: String = key(lower_case_identifier()).required().example(r#""hrsc_i864""#),
        /// Free text for the report.
        description: String = key(any_text()).or(String::new()).example(r#""Stereo lines over orbit I864""#),
        /// The body; support data of a different body are refused.
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
# A calibration of the lines of a camera for `areograph calibrate`, every key with its unit, range and default.
#
# Only `calibration`, two [[cameras]] and [ties] are required; a key that is left out has the default given
# here. Without [control] absolute pointing is not determined, and the result is marked invalid. If every camera has
# `pixels`, ties.match and [laser] replace tables of points. Relative paths are relative to the folder of this file.
# Schema: ../schema/calibration.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Calibration of the lines of a camera by areograph",
        "The TOML file of one calibration as JSON. areograph checks more than a schema can: existence of files, \
         agreement between keys.",
    ];

    fn with_file(self, file: PathBuf, blake3: String, keys: BTreeMap<String, String>) -> Self {
        Self {
            file,
            blake3,
            keys,
            ..self
        }
    }
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
                "ties.match = true, since a table laser finds control points in a terrain model of matched pixels",
            );
        }
        return;
    }
    if keys.span_of("laser").is_none() {
        keys.missing(
            "laser",
            "a table laser with files and cell_m, since tie points are matched (ties.match)",
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
                "a file with the pixels of camera {id}, since tie points are matched (ties.match)"
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
                "no table of points: with ties.match points are measured in pixels",
            );
        }
    }
}

declare_table! {
    /// 2 to 9 lines of one camera, which fly together.
    pub struct CameraConfig {
        /// Name of the line in tables of points.
        id: String = key(identifier()).required().example(r#""s1""#),
        /// Image support data (ISD) of its image, as ALE writes them: the calibration starts from their mounting, focal
        /// length and pixels. `instrument_pointing` of all cameras must end in one frame, that of the spacecraft,
        /// before `constant_rotation` leads to each of them.
        #[serde(skip)]
        isd: PathBuf = key(FILE).required().example(r#""isd/s1.json""#),
        /// The pixels of the whole image: TIFF or PNG of one band of grey, or a cube. Only for ties.match.
        #[serde(skip)]
        pixels: Option<PathBuf> = key(FILE).unused(r#""images/s1.tif""#),
    }
}

declare_table! {
    /// Points that several lines of the camera see.
    pub struct CalibrationTiesConfig {
        /// Paths or globs of tables (.csv), one row per image of a point: `point`, `camera`, `line`, `sample` (0 at
        /// the outer edge of the first line and sample), and where known `sigma_line`, `sigma_sample`.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs).or(Vec::new()).example(r#"["ties.csv"]"#),
        /// Whether areograph measures tie points itself, in the `pixels` of all cameras. Tie points, terrain model,
        /// laser control and calibration then follow each other in rounds, each with the cameras of the preceding
        /// round (Li et al. 2023), until convergence.
        matched as "match": bool = key(Switch).or(false),
        /// Standard deviation of lines and samples, where the table has none.
        sigma_px: f64 = key(from_to(SIGMA_MIN, 100.0)).or(0.2),
        /// Distance between the images of a tie point and the projections of one ground point by the uncalibrated
        /// cameras, beyond which the tie point is rejected.
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
    /// Laser passes over the ground of the images, in which control points are found by a terrain model of the two
    /// lines with the largest convergence, as `areograph pedr match` does. Only for ties.match.
    pub struct CalibrationLaserConfig {
        /// Paths or globs of PEDR files.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs).or(Vec::new()).unused(r#"["pedr/*.b"]"#),
        /// Edge of a cell of the terrain model, metres. It is at least one pixel.
        cell_m: Option<f64> = key(above_to(0.0, 1e5)).unused("100.0"),
        /// Search radius of the shifts of a unit of shots, cells: the possible error of orbit and mounting.
        search_cells: u32 = key(whole_from_to(1, 500)).or(70),
        /// Maximum number of shots in a segment.
        segment_points: u32 = key(whole_from_to(3, 1_000)).or(15),
        /// Variance of heights that a segment must exceed, square metres.
        least_variance_m2: f64 = key(above_to(0.0, 1e9)).or(1_000.0),
        /// Similarity that a unit must exceed.
        least_score: f64 = key(from_to(0.01, 0.999)).or(0.9),
        /// Largest root mean square of model minus laser at shots withheld from the search, bias removed, metres.
        limit_m: f64 = key(above_to(0.0, 1e5)).or(60.0),
        /// Seed of the clusters of shots and of the withheld ground.
        seed: u32 = key(whole_from_to(0, u32::MAX)).or(1),
        /// Maximum number of rounds; a calibration that has not converged by then is invalid.
        rounds_max: u32 = key(whole_from_to(1, 100)).or(10),
        /// Shot radius that counts as the radius of the ground: corrected by the crossover residuals of the files, or
        /// raw.
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
    /// Points located by the laser. Without them only differences between the cameras can be determined.
    pub struct CalibrationControlConfig {
        /// Paths or globs of tables (.csv), one row per image of a point: `point`, `camera`, `line`, `sample`,
        /// `longitude_deg` (east), `latitude_deg` (areocentric), `radius_m` (from the centre of the body: heights
        /// have a datum), and where known `sigma_line`, `sigma_sample`, `sigma_horizontal_m`, `sigma_vertical_m`, and
        /// the contribution of matching to these, `sigma_matching_horizontal_m`, `sigma_matching_vertical_m`.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs).or(Vec::new()).example(r#"["control.csv"]"#),
        /// Standard deviation of lines and samples, where the table has none.
        sigma_px: f64 = key(from_to(SIGMA_MIN, 100.0)).or(1.0),
        /// Standard deviation of a horizontal coordinate of a laser point, where the table has none: the profiles of
        /// MOLA. With `ties.match` the uncertainty of matching is added to it. Beyond the permitted range, the ground
        /// departs from the plane in which errors are computed.
        sigma_horizontal_m: f64 = key(from_to(SIGMA_MIN, CONTROL_SIGMA_MAX_M)).or(100.0),
        /// Standard deviation of the radius of a laser point, under the same conditions.
        sigma_vertical_m: f64 = key(from_to(SIGMA_MIN, CONTROL_SIGMA_MAX_M)).or(10.0),
        /// Every n-th control point along the flight is withheld for validation; with `ties.match`, every n-th 5 km by
        /// 10 km rectangle on the ground, with all of its shots.
        held_back_every: u32 = key(whole_from_to(2, 100)).or(4),
        /// Distance between a control point and its projection by the uncalibrated cameras, beyond which the point is
        /// rejected.
        limit_px: f64 = key(from_to(1.0, 1e4)).or(300.0),
    }
}

declare_table! {
    /// A priori values, one standard deviation each. The first three are those of Li et al. 2023, table 2.
    pub struct APrioriConfig {
        /// Standard deviation of an orbit coordinate. It is not estimated, since offsets of the camera absorb it; with
        /// `angle_deg` it determines how far a calibration may move the image.
        orbit_bias_m: f64 = key(from_to(1e-3, 1e5)).or(1_000.0),
        /// Standard deviation of the drift of an orbit coordinate per image line.
        orbit_drift_m_per_line: f64 = key(from_to(1e-6, 10.0)).or(0.01),
        /// Standard deviation of an offset angle in the solution by tie points only.
        angle_rad as "angle_deg": f64 =
            key(from_to(1e-4, 10.0)).or(0.025).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Standard deviation of an offset angle in the solution with control: wide, since it absorbs the remaining
        /// error of the orbit.
        control_angle_rad as "control_angle_deg": f64 =
            key(from_to(1e-3, 10.0)).or(1.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Standard deviation of the constant and the slope of the look angles, at the edge of the image.
        look_px: f64 = key(from_to(1e-3, 1e4)).or(50.0),
        /// Standard deviation of the bending of the look angles (the higher coefficients), at the edge of the image.
        bend_px: f64 = key(from_to(1e-4, 1e4)).or(0.5),
    }
}

declare_table! {
    /// Solution of the calibration.
    pub struct SolutionConfig {
        /// Parameters that tie points estimate before control is used.
        mode: CalibrationMode = key(words([
            ("differential", CalibrationMode::Differential, "differences in roll and scale between the cameras, which tie points determine"),
            (
                "as_published",
                CalibrationMode::AsPublished,
                "all angles of all cameras; ties determine some combinations weakly or not at all, so that the camera can drift away",
            ),
        ])).or(CalibrationMode::Differential),
        /// Order of the polynomials of the look angles.
        order: u32 = key(whole_from_to(2, 3)).or(2),
    }
}

declare_table! {
    /// Another orbit of the same camera, to which the result is applied unchanged.
    pub struct ValidationConfig {
        /// Name of the orbit.
        id: String = key(identifier()).required().example(r#""i818""#),
        /// Paths or globs of its image support data, one file per camera, identified by `name_sensor`.
        #[serde(skip)]
        isd: Vec<PathBuf> = key(Globs).required_as("paths or globs of image support data").example(r#"["isd/i818_*.json"]"#),
        /// Tables of the tie points of this orbit.
        #[serde(skip)]
        ties: Vec<PathBuf> = key(Globs).required_as("paths or globs of tables of tie points").example(r#"["i818_ties.csv"]"#),
        /// Tables of the laser points of this orbit.
        #[serde(skip)]
        control: Vec<PathBuf> = key(Globs).required_as("paths or globs of tables of laser points")
            .example(r#"["i818_control.csv"]"#),
    }
}

/// Parameters that tie points estimate before control is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationMode {
    /// Differences in roll and scale between the cameras.
    Differential,
    /// All angles of all cameras.
    AsPublished,
}
