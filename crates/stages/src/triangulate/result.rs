//! The result of a triangulation, with names and in metres.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::judge::Verdict;

/// A triangulated net.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Triangulation {
    /// Every picture.
    pub pictures: Vec<PictureResult>,
    /// Every point that a picture shows.
    pub points: Vec<PointResult>,
    /// Every measurement.
    pub measurements: Vec<MeasurementResult>,
    /// Every control that a picture shows.
    pub controls: Vec<ControlResult>,
    /// The bricks.
    pub bricks: Vec<BrickResult>,
    /// Seams between the bricks; `None` for a single one.
    pub seams: Option<Seams>,
    /// Sums of the net.
    pub totals: Totals,
    /// Whether the result is to be used.
    pub verdict: Verdict,
    /// Rows that were excluded, one sentence each.
    pub complaints: Vec<String>,
    /// Number of all complaints.
    pub complaint_count: u64,
}

/// A picture on the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PictureResult {
    /// Its name.
    pub picture: String,
    /// The name of its brick.
    pub brick: String,
    /// `P`, `Q`, `A` and `B` of equation 3: metres per unit, and metres.
    pub coefficients: [f64; 4],
    /// Angle from east to the picture's x axis, anticlockwise, radians.
    pub angle_rad: f64,
    /// Middle of its measured points on the map, metres.
    pub centre_m: [f64; 2],
    /// East longitude in `-π..π` and latitude of this middle, radians.
    pub centre_rad: [f64; 2],
    /// Standard deviation of a coordinate of the middle, metres, where it is known.
    pub sigma_m: Option<f64>,
    /// Standard deviation of its scale relative to it, and of its angle in radians, where it is known.
    pub sigma_scale: Option<f64>,
    /// Points that it shares with other pictures.
    pub ties: u32,
    /// Root mean square of a coordinate of its deviations from the means of these ties, metres.
    pub deviation_rms_m: f64,
    /// Departure of an orthographic picture of its size from a similarity on this map, metres.
    pub projection_floor_m: f64,
}

/// A point on the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointResult {
    /// Its name.
    pub point: String,
    /// Pictures from which its place is taken.
    pub pictures: u32,
    /// Whether it is a control that was kept.
    pub is_control: bool,
    /// East and north on the map, metres.
    pub place_m: [f64; 2],
    /// East longitude in `-π..π` and areocentric latitude, radians.
    pub place_rad: [f64; 2],
    /// Standard deviation of a coordinate, metres on the map, where it is known.
    pub sigma_m: Option<f64>,
}

/// Offset of the image of a point from the mean of its images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// East, metres.
    pub x_m: f64,
    /// North, metres.
    pub y_m: f64,
}

/// A measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeasurementResult {
    /// The picture.
    pub picture: String,
    /// The point.
    pub point: String,
    /// Measured position, film corrected, units of the picture.
    pub at: [f64; 2],
    /// Position of its point on the map, metres.
    pub place_m: [f64; 2],
    /// Image minus the mean of the point, metres on the map.
    pub deviation: Deviation,
    /// Deviation within its brick, as BRICK reports it; `None` for a point on one picture of the brick.
    pub in_brick: Option<Deviation>,
    /// Share of its own error that shows in its deviation, 0 to 1.
    pub redundancy: f64,
    /// Whether it is beyond 3.5 robust standard deviations of its brick.
    pub flagged: bool,
    /// Whether it was rejected as a blunder.
    pub removed: bool,
}

impl MeasurementResult {
    /// Length of the deviation by which BRICK ranks it, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        let of = self.in_brick.unwrap_or(self.deviation);
        of.x_m.hypot(of.y_m)
    }
}

/// A control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ControlResult {
    /// The point.
    pub point: String,
    /// Place as given, metres on the map.
    pub given_m: [f64; 2],
    /// Given minus computed, metres.
    pub residual_m: [f64; 2],
    /// Given minus computed by SCALE of the free figure, metres; identifies gross errors.
    pub scale_residual_m: [f64; 2],
    /// Standard deviation with which it was used, metres.
    pub sigma_m: Option<f64>,
    /// Whether it was kept.
    pub kept: bool,
}

/// A brick, as a row of Table 1 of Arthur & McMacken 1977.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BrickResult {
    /// Its name.
    pub brick: String,
    /// Pictures.
    pub pictures: u32,
    /// Number of points on several pictures of the brick.
    pub ties: u32,
    /// Number of equations beyond the unknowns.
    pub redundancy: u32,
    /// Largest |δX| and |δY|, metres.
    pub largest_m: [f64; 2],
    /// Root mean square of δX and δY, metres.
    pub rms_m: [f64; 2],
    /// Robust standard deviation of a coordinate, from the median absolute deviation, metres.
    pub robust_sigma_m: f64,
    /// Number of measurements in use with deviations beyond 3.5 robust standard deviations.
    pub flagged: u32,
    /// Number of measurements that were rejected.
    pub removed: u32,
    /// Shrinkage caused by the two approximate points of a brick, before the shrinkage is removed.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub shrinkage: Option<ShrinkageResult>,
}

/// Shrinkage of the figure between two controls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShrinkageResult {
    /// Ratio of the computed to the given distance between the controls.
    pub factor: f64,
    /// Ratio according to the law 1 / (1 + 2T / (w L²)).
    pub law: f64,
}

/// Seams between bricks, as in the last row of Table 1 of Arthur & McMacken 1977.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Seams {
    /// Number of points on several bricks.
    pub points: u32,
    /// Largest |δX| and |δY| of a brick relative to the mean over the bricks, metres.
    pub largest_m: [f64; 2],
    /// Root mean square of δX and δY, metres.
    pub rms_m: [f64; 2],
    /// Root mean square of δX and δY after LOCAL, metres; absent if LOCAL did not run.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub local_rms_m: Option<[f64; 2]>,
    /// Shrinkage caused by the two controls of EXTEND, before the shrinkage is removed.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub shrinkage: Option<ShrinkageResult>,
}

/// Sums of the net.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Totals {
    /// Number of tie equations: two coordinates of `r − 1` images of every point on `r` pictures.
    pub tie_equations: u64,
    /// Number of equations of kept controls.
    pub control_equations: u64,
    /// Number of unknowns, four per picture.
    pub unknowns: u64,
    /// Number of equations beyond the unknowns.
    pub redundancy: u64,
    /// Standard deviation of a coordinate of the image of a tie, as used, metres; absent if not determined.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub tie_sigma_m: Option<f64>,
    /// Whether `tie_sigma_m` was given, not estimated.
    pub tie_sigma_given: bool,
    /// Standard deviation of a control coordinate from SCALE, metres; absent for two controls.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub scale_sigma_m: Option<f64>,
    /// Root mean square residuals of kept controls, X and Y, metres.
    pub control_rms_m: [f64; 2],
    /// Root mean square of the deviations in use, X and Y, metres.
    pub deviation_rms_m: [f64; 2],
    /// Number of measurements that were rejected.
    pub removed: u64,
    /// Number of flagged measurements in use.
    pub flagged: u64,
    /// Number of controls that were rejected.
    pub rejected_controls: u64,
    /// Largest standard deviation of a point coordinate, metres; absent if none is known.
    #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub largest_sigma_m: Option<f64>,
    /// Largest projection floor of a picture, metres.
    pub projection_floor_m: f64,
}
