//! What a calibration gives, with names, in metres, radians and pixels.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{geom::calibration::TieSight, stages::judge::Verdict};

/// A calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The lines of the camera.
    pub cameras: Vec<CameraResult>,
    /// Drift of the orbit from line to line, body-fixed, metres: the calibrated support data hold it.
    pub drift_m_per_line: [Value; 3],
    /// What ties alone see of the offset angles.
    pub tie_sight: TieSight,
    /// The figures after every step, the first before any.
    pub steps: Vec<CalibrationStep>,
    /// What the control that was used says; none without control.
    pub used: Option<Scatter>,
    /// What the control that was held back says; none without control.
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
    /// Rows and points that were left out, one sentence each.
    pub complaints: Vec<String>,
    /// All of them.
    pub complaint_count: u64,
}

/// A number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Value {
    /// The number.
    pub value: f64,
    /// Its standard deviation; 0 for one that was not free.
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
    /// The same of the laboratory.
    pub laboratory: [Vec<f64>; 2],
    /// What those leave of the laboratory's look directions at most, pixels.
    pub laboratory_left_px: f64,
    /// Tangent of a pixel.
    pub pixel: f64,
    /// Samples.
    pub samples: u32,
    /// Largest change of a look direction by the calibration, pixels.
    pub moved_px: f64,
    /// The calibrated support data.
    pub isd: String,
    /// What they leave of the calibrated look directions at most, pixels: support data hold a straight line of equal samples.
    pub isd_left_px: f64,
}

/// Figures of points after a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CalibrationStep {
    /// `before`, `ties`, `external`, `internal` or `joint`.
    pub step: String,
    /// What was free, in words.
    pub free: String,
    /// Steps of the adjustment; 0 before any.
    pub steps: u32,
    /// The figures.
    pub figures: Figures,
}

/// Root mean squares, as tables 5 to 7 of Li et al. 2023 have them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Tie points after intersection.
    pub ties: TieFigures,
    /// Control points that the calibration uses, and those that were held back; none without control, and in other orbits
    /// none that were held back.
    pub control: Vec<ControlFigures>,
}

impl Figures {
    /// Those of control points of a kind.
    #[must_use]
    pub fn of(&self, kind: PointKind) -> Option<&ControlFigures> {
        self.control.iter().find(|of| of.kind == kind)
    }
}

/// Tie points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TieFigures {
    /// Points.
    pub points: u64,
    /// Of every camera: root mean square across and along the flight, pixels; none of a camera without tie points.
    pub cameras_px: Vec<[Option<f64>; 2]>,
}

impl TieFigures {
    /// The largest of the cameras, across or along, pixels; none where a camera has none.
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
    /// What they are for.
    pub kind: PointKind,
    /// Points.
    pub points: u64,
    /// Of every camera: where it sees the laser's place against where the place is measured.
    pub cameras: Vec<PixelsAndMetres>,
    /// Points in two cameras or more.
    pub heights: u64,
    /// Root mean square of their intersected height minus the laser's, metres; none where there is no such point.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub height_m: Option<f64>,
}

/// In the focal plane, and on the ground; none of a camera without points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PixelsAndMetres {
    /// Root mean square distance, pixels.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub plane_px: Option<f64>,
    /// Root mean square distance of the ray at the laser's radius from the laser's place, metres.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub plane_m: Option<f64>,
}

/// What the control that was held back says of the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldBack {
    /// Points.
    pub points: u64,
    /// What they miss over what is expected.
    pub scatter: Scatter,
    /// How many of them are in two cameras or more, whose places are intersected.
    pub intersected: u64,
    /// Root mean square of intersected minus laser's place, horizontally, metres: errors of the laser and of the measurement
    /// are in it. None where nothing is intersected, as of the next two.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub plane_m: Option<f64>,
    /// Likewise of the height, metres.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub height_m: Option<f64>,
    /// Mean of the same east, north and up, metres.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub mean_m: Option<[f64; 3]>,
    /// Stated accuracy of a tie point in the plane, metres: root mean square of the standard deviations, so many times larger as
    /// control scatters, used or held back, beyond what is expected of it in the plane.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub accuracy_plane_m: Option<f64>,
    /// Likewise of its height, metres.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub accuracy_height_m: Option<f64>,
}

/// Root mean square of what control misses over what measurement, laser and calibration let expect: near 1 when standard deviations are
/// true. In the plane and in height apart, as errors of the one hide behind too large standard deviations of the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scatter {
    /// East and north; none where the calibration follows the points.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub plane: Option<Scattered>,
    /// Up, of points in two cameras or more; none without such a point.
    #[serde(skip_serializing_if = "crate::stored::is_left_out")]
    pub height: Option<Scattered>,
}

/// A root mean square over what is expected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scattered {
    /// Root mean square of what is missed over what is expected.
    #[schemars(range(min = 0.0))]
    pub sigmas: f64,
    /// How many coordinates are free to differ; of points that were used fewer, as the calibration follows them.
    #[schemars(range(min = 0.0))]
    pub coordinates: f64,
}

/// A calibration in rounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rounds {
    /// The rounds in order.
    pub rounds: Vec<CalibrationRound>,
    /// Most that were allowed.
    pub rounds_max: u32,
    /// Edge of a cell of the terrain models, metres.
    pub cell_m: f64,
}

/// The numbers of a round: terrain model and units as the cameras of the round before see them, then the cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibrationRound {
    /// From 1.
    pub round: u32,
    /// Tie points.
    pub ties: u64,
    /// Their residuals in the worst line, root mean square, pixels, with the cameras that the terrain model was made with.
    pub model_tie_px: Option<f64>,
    /// The same with the cameras of this round.
    pub tie_px: Option<f64>,
    /// Share of the cells of the terrain model with a height.
    pub filled: f64,
    /// Units that calibrate: kept, and refused.
    pub units: [u64; 2],
    /// Units that judge: kept, and refused.
    pub judging: [u64; 2],
    /// Median length of the shifts of kept units that calibrate, cells.
    pub shift_cells: f64,
    /// Median of model minus laser, metres.
    pub bias_m: Option<f64>,
    /// Residuals of control, root mean square over all lines, pixels and metres on the ground.
    pub control: PixelsAndMetres,
    /// The same of control that was held back.
    pub held_back: PixelsAndMetres,
    /// Residuals of control in the lines that see it, root mean square, pixels, by the number of its unit.
    pub unit_px: BTreeMap<usize, f64>,
    /// What control that was held back misses over what is expected.
    pub held_back_scatter: Option<Scatter>,
    /// φ, ω and κ of every line, radians.
    pub angles_rad: Vec<[f64; 3]>,
    /// Drift of the orbit, metres a line.
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
}

/// What a point is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PointKind {
    /// Its place is unknown.
    Tie,
    /// The laser knows it.
    Control,
    /// Likewise, and it was not used.
    HeldBack,
}

impl PointKind {
    /// The word of tables.
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
    /// What it is for.
    pub kind: PointKind,
    /// Whether it was left out.
    pub left_out: bool,
    /// East longitude, latitude, radians, and radius, metres, intersected from its images; none where they are too few.
    pub place: Option<[f64; 3]>,
    /// Standard deviations east, north and up, metres.
    pub sigma_m: Option<[f64; 3]>,
    /// Of a laser point: intersected minus the laser's, east, north and up, metres.
    pub off_m: Option<[f64; 3]>,
}

/// An image of a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageResult {
    /// The point.
    pub point: String,
    /// What it is for.
    pub kind: PointKind,
    /// The camera.
    pub camera: String,
    /// Line and sample.
    pub place: [f64; 2],
    /// Whether it was left out.
    pub left_out: bool,
    /// Residual across and along the flight with the laboratory's geometry, pixels: at the intersected place, of a laser point
    /// at the laser's.
    pub before_px: Option<[f64; 2]>,
    /// The same with the calibration.
    pub after_px: Option<[f64; 2]>,
}
