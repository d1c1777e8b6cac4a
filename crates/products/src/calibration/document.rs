//! Summary of a calibration, as JSON.

use schemars::JsonSchema;
use serde::Serialize;

use super::{CalibrationProducts, WriteCalibration};
use crate::{
    coordinates::degrees,
    files::write_json,
    product::{Content, Declaration, Role},
};
use areograph_base::schema::DocumentSchema;
use areograph_config::CalibrationMode;
use areograph_geom::calibration::{AngleCombination, TieSight};
use areograph_stages::{
    calibrate::{
        CalibrationRound, CalibrationStep, CameraResult, HeldBack, Looks, PixelsAndMetres, Rounds,
        Scatter, TieGround, ValidationResult, Value,
    },
    judge::Verdict,
};

pub(super) static DOCUMENT: Declaration<WriteCalibration> = Declaration {
    path: "calibration.json",
    what: "parameters with standard deviations; combinations that tie points do not determine; statistics after every \
           step, for withheld control and for other orbits; verdict",
    readers: "scripts",
    rows: "cameras",
    role: Role::Metadata,
    content: Content::Document(schema),
    write: |path, of| {
        write_json(path, &Document::of(of))?;
        Ok(of.result.cameras.len() as u64)
    },
    uses: &[],
};

/// The document.
#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Calibration of the lines of a camera",
    description = "calibration.json of areograph: offset angles and look angles after Li et al. 2023."
)]
struct Document<'a> {
    /// Always `areograph calibration 1`.
    #[schemars(extend("const" = "areograph calibration 1"))]
    format: &'static str,
    /// Identifier of the calibration.
    calibration: &'a str,
    /// The body that the camera observes, as named in `config/bodies`.
    body: &'static str,
    /// Parameters estimated from tie points before control is used.
    mode: CalibrationMode,
    /// Whether the result is usable.
    verdict: &'a Verdict,
    /// The lines of the camera.
    #[schemars(length(min = 2))]
    cameras: Vec<CameraDocument<'a>>,
    /// Drift of the orbit, body-fixed, metres per image line: estimated true orbit minus orbit in the given support
    /// data. The offset angles absorb the constant part of the orbit error.
    drift_m_per_line: [Value; 3],
    /// Look directions of all lines, compared by `areograph calibrate series`.
    looks: &'a Looks,
    /// Offset angles determined from tie points only.
    tie_sight: TieSightDocument,
    /// Test of the heights of tie points against the ground between laser points; absent if none could be tested.
    #[serde(skip_serializing_if = "Option::is_none")]
    tie_ground: Option<TieGround>,
    /// Statistics before the first step, and after every step.
    steps: &'a [CalibrationStep],
    /// The rounds of a calibration from pixels (other members refer to the last round); absent where points were read from
    /// tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    rounds: Option<RoundsDocument>,
    /// Results for withheld control; absent without control.
    #[serde(skip_serializing_if = "Option::is_none")]
    held_back: Option<&'a HeldBack>,
    /// Root mean square residuals of the control used, divided by their expected values.
    #[serde(skip_serializing_if = "Option::is_none")]
    control_scatter: Option<Scatter>,
    /// Other orbits.
    validation: &'a [ValidationResult],
}

/// A calibration in rounds.
#[derive(Serialize, JsonSchema)]
struct RoundsDocument {
    /// Whether the rounds converged: the median shift of the units was less than half a cell, and control residuals
    /// changed by less than 2 %.
    converged: bool,
    /// Maximum number of rounds.
    rounds_max: u32,
    /// Edge length of the terrain model cells, metres.
    cell_m: f64,
    /// The rounds in order.
    rounds: Vec<RoundDocument>,
}

/// Statistics of a round: terrain model and units with the cameras of the preceding round, then the cameras of this
/// round.
#[derive(Serialize, JsonSchema)]
struct RoundDocument {
    /// From 1.
    round: u32,
    /// Tie points.
    ties: u64,
    /// Root mean square residual of tie points in the worst camera line, with the cameras of the terrain model, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    model_tie_rms_px: Option<f64>,
    /// Root mean square residual of tie points in the worst camera line, with the cameras of this round, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    tie_rms_px: Option<f64>,
    /// Share of terrain model cells with a height.
    model_filled: f64,
    /// Number of kept units of shots for the calibration.
    units_kept: u64,
    /// Number of rejected units of shots for the calibration.
    units_refused: u64,
    /// Number of kept units of shots withheld for validation.
    judging_kept: u64,
    /// Number of rejected units of shots withheld for validation.
    judging_refused: u64,
    /// Median length of the shifts of kept calibration units, cells; absent if no unit was kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    shift_cells: Option<f64>,
    /// Median of model minus laser height, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_m: Option<f64>,
    /// Root mean square of the control residuals over all camera lines.
    control: PixelsAndMetres,
    /// Root mean square of the withheld-control residuals over all camera lines.
    held_back: PixelsAndMetres,
    /// Root mean square residuals of withheld control, divided by their expected values.
    #[serde(skip_serializing_if = "Option::is_none")]
    held_back_scatter: Option<Scatter>,
    /// φ, ω and κ of every line, degrees, in the order of `cameras`.
    angles_deg: Vec<[f64; 3]>,
    /// Drift of the orbit, body-fixed, metres per image line.
    drift_m_per_line: [f64; 3],
}

/// A line of the camera.
#[derive(Serialize, JsonSchema)]
struct CameraDocument<'a> {
    /// Its name.
    camera: &'a str,
    /// φ, rotation about the flight direction (roll), degrees.
    phi_deg: Value,
    /// ω, rotation about the axis across the flight (pitch), degrees.
    omega_deg: Value,
    /// κ, rotation about the downward axis (yaw), degrees.
    kappa_deg: Value,
    /// Look-angle tangent across the flight: coefficients of the powers of s′, which increases from −1 at the first
    /// edge of the image to 1 at the last.
    m: &'a [Value],
    /// Look-angle tangent along the flight: coefficients of the powers of s′.
    n: &'a [Value],
    /// Coefficients of both tangents in the given support data, across and along the flight.
    laboratory: &'a [Vec<f64>; 2],
    /// Largest residual of the `laboratory` tangents against the look directions of the given support data, pixels.
    #[schemars(range(min = 0.0))]
    laboratory_left_px: f64,
    /// Tangent of a pixel.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pixel_tangent: f64,
    /// Samples.
    samples: u32,
    /// Largest change of a look direction in the calibration, pixels.
    #[schemars(range(min = 0.0))]
    moved_px: f64,
    /// Largest residual of the calibrated support data against the calibrated look directions, pixels.
    #[schemars(range(min = 0.0))]
    isd_left_px: f64,
}

/// Offset angles determined from tie points only.
#[derive(Serialize, JsonSchema)]
struct TieSightDocument {
    /// Number of directions that tie points do not determine (standard deviation above one degree).
    unseen: u32,
    /// Names of these directions.
    unseen_directions: Vec<String>,
    /// Orthonormal directions, starting with the least determined direction.
    directions: Vec<DirectionDocument>,
}

/// A combination of all offset angles.
#[derive(Serialize, JsonSchema)]
struct DirectionDocument {
    /// Standard deviation from tie points only, degrees; absent if unbounded.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    sigma_deg: Option<f64>,
    /// Its larger components.
    components: Vec<Component>,
}

/// A component along a named combination of unit length.
#[derive(Serialize, JsonSchema)]
struct Component {
    /// Name of the combination, for example `common roll`.
    combination: String,
    /// The component.
    share: f64,
}

impl<'a> Document<'a> {
    fn of(of: &CalibrationProducts<'a>) -> Self {
        let result = of.result;
        Self {
            format: "areograph calibration 1",
            calibration: &of.config.calibration,
            body: of.config.body.word(),
            mode: of.config.solution.mode,
            verdict: &result.verdict,
            cameras: result.cameras.iter().map(camera).collect(),
            drift_m_per_line: result.drift_m_per_line,
            looks: &result.looks,
            tie_sight: tie_sight(&result.tie_sight),
            tie_ground: result.tie_ground,
            steps: &result.steps,
            rounds: result.rounds.as_ref().map(rounds),
            held_back: result.held_back.as_ref(),
            control_scatter: result.used,
            validation: &result.validation,
        }
    }
}

fn camera(of: &CameraResult) -> CameraDocument<'_> {
    let [phi_deg, omega_deg, kappa_deg] = of.angles_rad.map(|angle| Value {
        value: degrees(angle.value),
        sigma: degrees(angle.sigma),
    });
    CameraDocument {
        camera: &of.camera,
        phi_deg,
        omega_deg,
        kappa_deg,
        m: &of.m,
        n: &of.n,
        laboratory: &of.laboratory,
        laboratory_left_px: of.laboratory_left_px,
        pixel_tangent: of.pixel,
        samples: of.samples,
        moved_px: of.moved_px,
        isd_left_px: of.isd_left_px,
    }
}

fn rounds(of: &Rounds) -> RoundsDocument {
    let round = |round: &CalibrationRound| RoundDocument {
        round: round.round,
        ties: round.ties,
        model_tie_rms_px: round.model_tie_px,
        tie_rms_px: round.tie_px,
        model_filled: round.filled,
        units_kept: round.units[0],
        units_refused: round.units[1],
        judging_kept: round.judging[0],
        judging_refused: round.judging[1],
        shift_cells: round.shift_cells.is_finite().then_some(round.shift_cells),
        bias_m: round.bias_m,
        control: round.control,
        held_back: round.held_back,
        held_back_scatter: round.held_back_scatter,
        angles_deg: round.angles_rad.iter().map(|of| of.map(degrees)).collect(),
        drift_m_per_line: round.drift_m_per_line,
    };
    RoundsDocument {
        converged: of.is_converged(),
        rounds_max: of.rounds_max,
        cell_m: of.cell_m,
        rounds: of.rounds.iter().map(round).collect(),
    }
}

fn tie_sight(of: &TieSight) -> TieSightDocument {
    let words = |combination: &AngleCombination| combination.words();
    let directions = of.directions.iter().map(|direction| DirectionDocument {
        sigma_deg: direction.sigma_rad.map(degrees),
        components: (direction.shares.iter())
            .map(|(combination, share)| Component {
                combination: words(combination),
                share: *share,
            })
            .collect(),
    });
    TieSightDocument {
        unseen: of.unseen,
        unseen_directions: of.unseen_names.iter().map(words).collect(),
        directions: directions.collect(),
    }
}

fn schema() -> DocumentSchema {
    DocumentSchema::of::<Document>("calibration_result")
}
