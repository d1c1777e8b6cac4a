//! Look directions of the lines of a camera as six parameters of each line, with their covariance, and the errors of an orbit
//! in these parameters.
//!
//! Offset angles and coefficients of look angles depend on each other (decision 0025); look directions do not. The direction of
//! a line at its first, middle and last sample gives its roll, pitch, yaw, scale and two bends, as tangents: roll and pitch in
//! the middle, the others at the edges of the image.

use nalgebra::{DMatrix, DVector, Matrix2x3, Vector2, Vector3};

use super::camera::{CalibrationState, LineCamera};

/// Samples `s′` at which look directions are compared: the edges and the middle.
pub const LOOKS_AT: [f64; 3] = [-1.0, 0.0, 1.0];
/// Step of a numeric derivative in units of a parameter's standard deviation: look directions are linear over a thousandth of
/// it, and differences remain far above rounding.
const STEP: f64 = 1e-3;

/// A parameter of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LookParameter {
    /// Direction across the flight in the middle.
    Roll,
    /// Direction along the flight in the middle.
    Pitch,
    /// Half the difference of the edges along the flight.
    Yaw,
    /// Half the difference of the edges across the flight.
    Scale,
    /// Mean of the edges minus the middle, across the flight.
    BendAcross,
    /// Mean of the edges minus the middle, along the flight.
    BendAlong,
}

impl LookParameter {
    /// All parameters of a line, in the order of tables.
    pub const ALL: [Self; 6] = [
        Self::Roll,
        Self::Pitch,
        Self::Yaw,
        Self::Scale,
        Self::BendAcross,
        Self::BendAlong,
    ];

    /// Its name.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Roll => "roll",
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
            Self::Scale => "scale",
            Self::BendAcross => "bend across",
            Self::BendAlong => "bend along",
        }
    }
}

/// The parameters of a line from its tangents at [`LOOKS_AT`].
fn look_parameters([first, middle, last]: [Vector2<f64>; 3]) -> [f64; 6] {
    let half = 0.5 * (last - first);
    let bend = 0.5 * (last + first) - middle;
    [middle.x, middle.y, half.y, half.x, bend.x, bend.y]
}

impl LineCamera {
    /// Tangents of a sample `s'` in the axes of the spacecraft, with the offset.
    #[must_use]
    pub fn turned(&self, s: f64) -> Vector2<f64> {
        let look = self.look(s);
        look.xy() / look.z
    }

    /// The parameters of the look directions.
    #[must_use]
    pub fn look_parameters(&self) -> [f64; 6] {
        look_parameters(LOOKS_AT.map(|s| self.turned(s)))
    }
}

/// The parameters of all lines, line by line.
fn all(state: &CalibrationState) -> DVector<f64> {
    let lines = state.cameras.iter();
    let values = lines.flat_map(LineCamera::look_parameters);
    DVector::from_iterator(state.cameras.len() * LookParameter::ALL.len(), values)
}

/// Changes of the parameters of all lines from `laboratory` to `state`, and their covariance.
///
/// * `covariance` – of the parameters of `state`, in their order
#[must_use]
pub fn look_changes(
    laboratory: &CalibrationState,
    state: &CalibrationState,
    covariance: &DMatrix<f64>,
) -> (DVector<f64>, DMatrix<f64>) {
    let changes = all(state) - all(laboratory);
    let mut derivative = DMatrix::zeros(changes.len(), covariance.ncols());
    for index in 0..covariance.ncols() {
        let sigma = covariance[(index, index)].max(0.0).sqrt();
        // A parameter that was not free has no share in the covariance.
        if !(sigma > 0.0) {
            continue;
        }
        let at = |sense: f64| {
            let mut by = DVector::zeros(covariance.ncols());
            by[index] = sense * STEP * sigma;
            all(&state.moved(&by))
        };
        derivative.set_column(index, &((at(1.0) - at(-1.0)) / (2.0 * STEP * sigma)));
    }
    let covariance = &derivative * covariance * derivative.transpose();
    (changes, covariance)
}

/// Changes of the parameters of a line that errors of the orbit imitate, columns: shifts of the spacecraft across, along and
/// down, per metre; rotations about these axes, per radian.
///
/// * `looks` – tangents at [`LOOKS_AT`]
/// * `depth_m` – distance of the ground below the spacecraft there
#[must_use]
pub fn orbit_in_looks(looks: [Vector2<f64>; 3], depth_m: [f64; 3]) -> [[f64; 6]; 6] {
    let by_error = |index: usize| {
        let of = [0, 1, 2].map(|at| {
            let look: Vector3<f64> = looks[at].push(1.0);
            let moved = match index {
                0..3 => Vector3::ith(index, depth_m[at].recip()),
                _ => Vector3::ith(index - 3, 1.0).cross(&look),
            };
            // Of the tangents by the direction.
            Matrix2x3::new(1.0, 0.0, -look.x, 0.0, 1.0, -look.y) * moved
        });
        look_parameters(of)
    };
    [0, 1, 2, 3, 4, 5].map(by_error)
}
