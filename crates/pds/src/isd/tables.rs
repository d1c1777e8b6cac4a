//! Tables of support data: positions and rotations from J2000 at epochs, and their interpolation.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::document::{IsdError, Object};
use areograph_base::units::METRES_PER_KM;
use areograph_geom::attitude::{
    matrix_of_rotation_vector, matrix_of_spice_quaternion, rotation_vector,
};

/// NAIF code of J2000, the frame of all tables.
const NAIF_J2000: i64 = 1;
/// Tolerance of the length of a unit quaternion: files have fifteen digits, and damaged values differ widely.
const UNIT_TOLERANCE: f64 = 1e-6;
/// Tolerance of the length of the rows of a rotation matrix.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// Positions and velocities of a body relative to the centre of the target, J2000.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct States {
    /// Epochs, increasing, ET seconds.
    pub et_s: Vec<f64>,
    /// Positions, metres.
    pub position_m: Vec<Vector3<f64>>,
    /// Velocities, metres per second.
    pub velocity_m_s: Vec<Vector3<f64>>,
}

/// Rotations from J2000 at epochs, followed by a constant one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rotations {
    /// Epochs, increasing, ET seconds.
    pub et_s: Vec<f64>,
    /// J2000 to the rotating frame.
    pub turning: Vec<Matrix3<f64>>,
    /// Angular velocities of that frame, J2000, radians per second.
    pub rate_rad_s: Vec<Vector3<f64>>,
    /// From that frame to the last one.
    pub constant: Matrix3<f64>,
}

/// The row before an instant and the fraction of the way to the next one; before the first and after the last row the
/// same interval is extrapolated.
fn between(et_s: &[f64], at_s: f64) -> (usize, f64) {
    let after = et_s.partition_point(|row| *row <= at_s);
    let before = after.clamp(1, et_s.len() - 1) - 1;
    let step_s = et_s[before + 1] - et_s[before];
    (before, (at_s - et_s[before]) / step_s)
}

/// The interval of a table as text.
pub(super) fn span(et_s: &[f64]) -> [f64; 2] {
    [et_s[0], et_s[et_s.len() - 1]]
}

impl States {
    /// The table under `key`; positions must be at least `least_m` from the centre.
    pub(super) fn of(document: &Object<'_>, key: &str, least_m: f64) -> Result<Self, IsdError> {
        let table = document.object(key)?;
        is_inertial(&table)?;
        let et_s = table.epochs("ephemeris_times")?;
        let [position_m, velocity_m_s] = ["positions", "velocities"].map(|key| {
            let rows = table.rows::<3>(key)?;
            as_many(&table, key, rows.len(), et_s.len())?;
            let rows = rows.into_iter();
            Ok(rows
                .map(|row| Vector3::from(row) * METRES_PER_KM)
                .collect::<Vec<_>>())
        });
        let (position_m, velocity_m_s) = (position_m?, velocity_m_s?);
        if position_m.iter().any(|position| position.norm() < least_m) {
            let least_km = least_m / METRES_PER_KM;
            let expected =
                format!("positions at least {least_km} km from the centre of the target");
            return Err(table.refused("positions", expected));
        }
        Ok(Self {
            et_s,
            position_m,
            velocity_m_s,
        })
    }

    /// Position and velocity at an instant, by the cubic through two rows.
    ///
    /// # Accuracy
    /// `h⁴/384` times the fourth derivative: 1e-6 m between rows of a low orbit 2 s apart.
    #[must_use]
    pub fn at(&self, et_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (row, u) = between(&self.et_s, et_s);
        let step_s = self.et_s[row + 1] - self.et_s[row];
        let [p0, p1] = [self.position_m[row], self.position_m[row + 1]];
        let [v0, v1] = [self.velocity_m_s[row], self.velocity_m_s[row + 1]];
        let (u2, u3) = (u * u, u * u * u);
        let position_m = p0 * (2.0 * u3 - 3.0 * u2 + 1.0)
            + v0 * (step_s * (u3 - 2.0 * u2 + u))
            + p1 * (3.0 * u2 - 2.0 * u3)
            + v1 * (step_s * (u3 - u2));
        let velocity_m_s = (p1 - p0) * ((6.0 * u - 6.0 * u2) / step_s)
            + v0 * (3.0 * u2 - 4.0 * u + 1.0)
            + v1 * (3.0 * u2 - 2.0 * u);
        (position_m, velocity_m_s)
    }
}

impl Rotations {
    /// The table under `key`.
    pub(super) fn of(document: &Object<'_>, key: &str) -> Result<Self, IsdError> {
        let table = document.object(key)?;
        is_inertial(&table)?;
        let et_s = table.epochs("ephemeris_times")?;
        let quaternions = table.rows::<4>("quaternions")?;
        as_many(&table, "quaternions", quaternions.len(), et_s.len())?;
        for (row, quaternion) in quaternions.iter().enumerate() {
            let length = quaternion
                .iter()
                .map(|part| part * part)
                .sum::<f64>()
                .sqrt();
            // Written so that NaN is rejected too.
            if !((length - 1.0).abs() <= UNIT_TOLERANCE) {
                let expected = format!(
                    "unit quaternions (w, x, y, z); the quaternion of row {row} has length {length}"
                );
                return Err(table.refused("quaternions", expected));
            }
        }
        let rates = table.rows::<3>("angular_velocities")?;
        as_many(&table, "angular_velocities", rates.len(), et_s.len())?;
        Ok(Self {
            et_s,
            turning: quaternions
                .into_iter()
                .map(matrix_of_spice_quaternion)
                .collect(),
            rate_rad_s: rates.into_iter().map(Vector3::from).collect(),
            constant: constant(&table)?,
        })
    }

    /// Rotation from J2000 to the rotating frame at an instant, on the arc between two rows, and its angular velocity.
    #[must_use]
    pub fn at(&self, et_s: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let (row, share) = between(&self.et_s, et_s);
        let [before, after] = [&self.turning[row], &self.turning[row + 1]];
        let arc_rad = rotation_vector(&(after * before.transpose()));
        let turning = matrix_of_rotation_vector(&(arc_rad * share)) * before;
        let rate_rad_s = self.rate_rad_s[row].lerp(&self.rate_rad_s[row + 1], share);
        (turning, rate_rad_s)
    }
}

/// Angular velocities in J2000 by neighbouring rotations from J2000, two or more of them, radians per second.
pub(crate) fn neighbour_rates_rad_s(et_s: &[f64], turning: &[Matrix3<f64>]) -> Vec<Vector3<f64>> {
    let last = turning.len() - 1;
    let rate = |at: usize| {
        let [before, after] = [at.saturating_sub(1), (at + 1).min(last)];
        // The rotation of the axes, in J2000: the frame's matrix has its axes as rows.
        let turn = turning[after].transpose() * turning[before];
        rotation_vector(&turn) / (et_s[after] - et_s[before])
    };
    (0..turning.len()).map(rate).collect()
}

/// The constant rotation; the identity where the file has none.
fn constant(table: &Object<'_>) -> Result<Matrix3<f64>, IsdError> {
    const KEY: &str = "constant_rotation";
    if !table.has(KEY) {
        return Ok(Matrix3::identity());
    }
    let matrix = Matrix3::from_row_slice(&table.numbers::<9>(KEY)?);
    let skew = (matrix * matrix.transpose() - Matrix3::identity())
        .abs()
        .max();
    // Written so that NaN is rejected too.
    if !(skew <= ROTATION_TOLERANCE && matrix.determinant() > 0.0) {
        return Err(table.refused(KEY, "a rotation matrix, row by row"));
    }
    Ok(matrix)
}

fn is_inertial(table: &Object<'_>) -> Result<(), IsdError> {
    const KEY: &str = "reference_frame";
    if table.code(KEY)? != NAIF_J2000 {
        return Err(table.refused(KEY, format!("{NAIF_J2000}, J2000")));
    }
    Ok(())
}

fn as_many(table: &Object<'_>, key: &str, rows: usize, epochs: usize) -> Result<(), IsdError> {
    if rows == epochs {
        return Ok(());
    }
    let expected = format!("{epochs} rows, one per entry of ephemeris_times, not {rows}");
    Err(table.refused(key, expected))
}
