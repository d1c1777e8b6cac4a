//! The result of a calibration, with names, in metres, radians and pixels.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::judge::Verdict;
use areograph_geom::calibration::TieSight;

/// A calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The lines of the camera.
    pub cameras: Vec<CameraResult>,
    /// Drift of the orbit, body-fixed, metres per image line; the calibrated support data contain it.
    pub drift_m_per_line: [Value; 3],
    /// Look directions of all lines, for the comparison with calibrations of other orbits.
    pub looks: Looks,
    /// Sensitivity of tie points to the offset angles.
    pub tie_sight: TieSight,
    /// The test of tie points against the ground between laser points; `None` where these are too few.
    pub tie_ground: Option<TieGround>,
    /// The figures before the first and after every step.
    pub steps: Vec<CalibrationStep>,
    /// Scatter of the control that was used; `None` without control.
    pub used: Option<Scatter>,
    /// Statistics of withheld control; `None` without control.
    pub held_back: Option<HeldBack>,
    /// The rounds of a calibration from pixels, of which this is the last.
    pub rounds: Option<Rounds>,
    /// Other orbits.
    pub validation: Vec<ValidationResult>,
    /// Every point.
    pub points: Vec<PointResult>,
    /// Every image of a point.
    pub images: Vec<ImageResult>,
    /// Whether the result is to be used.
    pub verdict: Verdict,
    /// Rows and points that were excluded, one sentence each.
    pub complaints: Vec<String>,
    /// Number of all complaints.
    pub complaint_count: u64,
}

/// Test of the heights of tie points against the ground between laser points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TieGround {
    /// Number of tie points in the last test.
    pub tested: u64,
    /// Limit of the height above or below the ground, standard deviations; tie points beyond this limit are rejected.
    #[schemars(range(min = 0.0))]
    pub limit_sigmas: f64,
    /// Median, over the tie points, of the limit of the height above or below the ground, metres; height errors below
    /// this limit, which result from measurement errors along the flight, are not identified.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub limit_m: Option<f64>,
}

/// A number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Value {
    /// The number.
    pub value: f64,
    /// Standard deviation of the number; 0 for a parameter that was not free.
    #[schemars(range(min = 0.0))]
    pub sigma: f64,
}

/// A line of the camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraResult {
    /// Its name.
    pub camera: String,
    /// φ, ω and κ, radians.
    pub angles_rad: [Value; 3],
    /// Coefficients of the tangent across the flight, powers of s′.
    pub m: Vec<Value>,
    /// Coefficients of the tangent along the flight.
    pub n: Vec<Value>,
    /// Coefficients of both tangents by the laboratory.
    pub laboratory: [Vec<f64>; 2],
    /// Their largest residual against the laboratory's look directions, pixels.
    pub laboratory_left_px: f64,
    /// Tangent of a pixel.
    pub pixel: f64,
    /// Samples.
    pub samples: u32,
    /// Largest change of a look direction by the calibration, pixels.
    pub moved_px: f64,
    /// The calibrated support data.
    pub isd: String,
    /// Their largest residual against the calibrated look directions, pixels: support data hold a straight line of
    /// equal samples with a distortion of third degree.
    pub isd_left_px: f64,
}

/// Changes of look directions from the laboratory, as six parameters of each line: roll, pitch, yaw, scale, bend across and
/// bend along the flight. Unlike offset angles and coefficients, these do not depend on each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Looks {
    /// Middle of the images, seconds of ephemeris time (TDB after J2000).
    pub middle_et_s: f64,
    /// The lines, in the order of `cameras`.
    pub lines: Vec<LineLooks>,
    /// Covariance of all parameters from measurements, line by line, tangents squared.
    pub covariance: Vec<Vec<f64>>,
    /// Changes of all parameters by one a priori standard deviation of each error of the orbit, tangents: shifts across,
    /// along and down, and rotations about these axes.
    pub by_orbit: Vec<Vec<f64>>,
}

/// Look directions of a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LineLooks {
    /// Name of the line in support data.
    pub sensor: String,
    /// Changes from the laboratory, tangents: roll and pitch in the middle of the image, yaw and scale as half the
    /// difference of its edges, bends as the mean of its edges minus its middle.
    pub changes: [f64; 6],
}

/// Statistics of the points after a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CalibrationStep {
    /// Name of the step: `before`, `ties`, `external`, `internal` or `joint`.
    pub step: String,
    /// Free parameters, in words.
    pub free: String,
    /// Number of iterations of the adjustment; 0 for `before`.
    pub steps: u32,
    /// The figures.
    pub figures: Figures,
}

/// Root mean squares, as in Tables 5 to 7 of Li et al. 2023.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Tie points after intersection.
    pub ties: TieFigures,
    /// Control points that the calibration uses, and withheld control points; empty without control. Other orbits have
    /// no withheld points.
    pub control: Vec<ControlFigures>,
}

impl Figures {
    /// Figures of control points of this kind.
    #[must_use]
    pub fn of(&self, kind: PointKind) -> Option<&ControlFigures> {
        self.control.iter().find(|control| control.kind == kind)
    }
}

/// Tie points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TieFigures {
    /// Points.
    pub points: u64,
    /// Root mean square residuals of every camera, across and along the flight, pixels; missing for a camera without
    /// tie points.
    pub cameras_px: Vec<[Option<f64>; 2]>,
}

impl TieFigures {
    /// The largest of the cameras, across or along, pixels; `None` where a camera has no value.
    #[must_use]
    pub fn worst_px(&self) -> Option<f64> {
        let all = self.cameras_px.iter().flatten();
        all.copied()
            .try_fold(0.0, |worst: f64, of| of.map(|of| worst.max(of)))
    }
}

/// Control points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ControlFigures {
    /// Their use.
    pub kind: PointKind,
    /// Points.
    pub points: u64,
    /// Root mean square distances between projected and measured image positions of the laser points, for every camera.
    pub cameras: Vec<PixelsAndMetres>,
    /// Number of points in two cameras or more.
    pub heights: u64,
    /// Root mean square of intersected minus laser height of points in two cameras or more, metres; missing if there
    /// are none.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub height_m: Option<f64>,
}

/// Root mean square distances in the focal plane and on the ground; missing for a camera without points.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct PixelsAndMetres {
    /// Root mean square distance in the focal plane, pixels.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub plane_px: Option<f64>,
    /// Root mean square distance between the laser position and the ray at the radius of the laser point, metres.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub plane_m: Option<f64>,
}

/// Statistics of withheld control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldBack {
    /// Points.
    pub points: u64,
    /// Ratio of the root mean square residual of withheld control to its expected value.
    pub scatter: Scatter,
    /// Number of withheld points in two cameras or more, whose positions are intersected.
    pub intersected: u64,
    /// Root mean square horizontal distance between intersected and laser positions, metres, which contains laser and
    /// measurement errors; missing if no point is intersected.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub plane_m: Option<f64>,
    /// Root mean square of intersected minus laser height, metres; missing if no point is intersected.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub height_m: Option<f64>,
    /// Mean of intersected minus laser position, east, north and up, metres; missing if no point is intersected.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub mean_m: Option<[f64; 3]>,
    /// Stated accuracy of a tie point in plan, metres: root mean square of the standard deviations, scaled by the
    /// scatter of used or withheld control in plan if this scatter exceeds 1.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub accuracy_plane_m: Option<f64>,
    /// Stated accuracy of a tie point in height, metres.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub accuracy_height_m: Option<f64>,
}

/// Ratio of the root mean square residual of control to the value expected from measurement, laser and calibration:
/// near 1 if standard deviations are correct. Plane and height are separate, because overestimated standard deviations
/// in one would hide errors in the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scatter {
    /// Scatter in east and north; missing if the points have no redundancy.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub plane: Option<Scattered>,
    /// Scatter in height of points in two cameras or more; missing if there are none.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub height: Option<Scattered>,
}

/// Ratio of a root mean square to its expected value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scattered {
    /// Ratio of the root mean square residual to its expected value.
    #[schemars(range(min = 0.0))]
    pub sigmas: f64,
    /// Number of coordinates that are free to differ; smaller for used points, because the calibration follows these
    /// points.
    #[schemars(range(min = 0.0))]
    pub coordinates: f64,
}

/// A calibration in rounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rounds {
    /// The rounds in order.
    pub rounds: Vec<CalibrationRound>,
    /// Maximum number of rounds.
    pub rounds_max: u32,
    /// Edge of a cell of the terrain models, metres.
    pub cell_m: f64,
    /// Standard deviation of the horizontal coordinates of the laser, each, metres.
    pub laser_sigma_m: f64,
}

/// The numbers of a round: terrain model and units with the cameras of the previous round, then the cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibrationRound {
    /// From 1.
    pub round: u32,
    /// Round in which the shots of its units were selected.
    pub units_of: u32,
    /// Tie points.
    pub ties: u64,
    /// Their residuals in the worst line, root mean square, pixels, with the cameras that the terrain model was made with.
    pub model_tie_px: Option<f64>,
    /// Their residuals in the worst line, root mean square, pixels, with the cameras of this round.
    pub tie_px: Option<f64>,
    /// Share of the cells of the terrain model with a height.
    pub filled: f64,
    /// Units that calibrate: kept, and rejected.
    pub units: [u64; 2],
    /// Withheld units: kept, and rejected.
    pub judging: [u64; 2],
    /// Median length of the shifts of kept units that calibrate, cells.
    pub shift_cells: f64,
    /// Length of the median of these shifts, cells.
    pub common_shift_cells: f64,
    /// Median of model minus laser height, metres.
    pub bias_m: Option<f64>,
    /// Residuals of control, root mean square over all lines, pixels and metres on the ground.
    pub control: PixelsAndMetres,
    /// Residuals of withheld control, root mean square over all lines, pixels and metres on the ground.
    pub held_back: PixelsAndMetres,
    /// Residuals of control in the lines that see it, root mean square, pixels, by the number of its unit.
    pub unit_px: BTreeMap<usize, f64>,
    /// Scatter of withheld control.
    pub held_back_scatter: Option<Scatter>,
    /// φ, ω and κ of every line, radians.
    pub angles_rad: Vec<[f64; 3]>,
    /// Drift of the orbit, body-fixed, metres per image line.
    pub drift_m_per_line: [f64; 3],
}

/// Another orbit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ValidationResult {
    /// Its name.
    pub orbit: String,
    /// With the laboratory's geometry.
    pub before: Figures,
    /// With the calibration, unchanged.
    pub after: Figures,
    /// Mean offsets of the control of the orbit, computed with the calibrated cameras, in plan in every camera and
    /// in height.
    pub offsets: Vec<ControlOffset>,
}

/// Mean offset of the control of another orbit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ControlOffset {
    /// Camera in whose plane the offset is measured; absent for an offset in height.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub camera: Option<String>,
    /// Length of the mean offset in plan, or absolute value of the mean height above the laser points, metres.
    #[schemars(range(min = 0.0))]
    pub offset_m: f64,
    /// Standard deviation of one control point due to errors of measurement and laser, metres.
    #[schemars(range(min = 0.0))]
    pub point_sigma_m: f64,
    /// Standard deviation of the mean offset due to errors of measurement and laser, metres, without errors of the
    /// orbit and of the calibration.
    #[schemars(range(min = 0.0))]
    pub mean_sigma_m: f64,
    /// Standard deviation of the mean offset due to errors of the calibration, metres.
    #[schemars(range(min = 0.0))]
    pub calibration_sigma_m: f64,
    /// Largest permitted offset, metres.
    #[schemars(range(min = 0.0))]
    pub limit_m: f64,
}

/// Use of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PointKind {
    /// Tie point.
    Tie,
    /// Laser point.
    Control,
    /// Laser point, withheld for validation.
    HeldBack,
}

impl PointKind {
    /// Its name in tables.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Tie => "tie",
            Self::Control => "control",
            Self::HeldBack => "held_back",
        }
    }
}

/// A point on the ground, by the calibrated cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointResult {
    /// Its name.
    pub point: String,
    /// Its use.
    pub kind: PointKind,
    /// Whether it was rejected.
    pub left_out: bool,
    /// East longitude, latitude, radians, and radius, metres, intersected from its images; `None` where they are too
    /// few, and for a point that was left out.
    pub place: Option<[f64; 3]>,
    /// Standard deviations east, north and up, metres; `None` without a place, and for a tie point whose height is not
    /// tested for errors such as those found at other points.
    pub sigma_m: Option<[f64; 3]>,
    /// Intersected minus laser position of a laser point, east, north and up, metres.
    pub off_m: Option<[f64; 3]>,
}

/// An image of a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageResult {
    /// The point.
    pub point: String,
    /// Its use.
    pub kind: PointKind,
    /// The camera.
    pub camera: String,
    /// Line and sample.
    pub place: [f64; 2],
    /// Whether it was rejected.
    pub left_out: bool,
    /// Residual across and along the flight with the laboratory's geometry, pixels: at the intersected position, or at
    /// the laser's for a laser point.
    pub before_px: Option<[f64; 2]>,
    /// Residual across and along the flight with the calibration, pixels.
    pub after_px: Option<[f64; 2]>,
}
