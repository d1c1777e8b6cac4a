//! Positions and rotations by the tables of a cube.
//!
//! A table has rows at epochs, between which positions follow the cubic of their velocities, and rotations the arc; or the
//! coefficients of polynomials, which are put on a grid of epochs. The former is how `SpicePosition` and `SpiceRotation` of
//! ISIS interpolate, and how [`States`] and [`Rotations`] do.
//!
//! # Source
//! `SpicePosition::LoadCache(Table)` and `SpiceRotation::LoadCache(Table)` of ISIS: fields, their order, the last record of
//! polynomials (base time, time scale, degree), and the axes 3, 1, 3 of their angles.

use nalgebra::{Matrix3, Vector3};

use super::{error::CubeError, table::Table};
use crate::isd::{Rotations, States, neighbour_rates_rad_s};
use areograph_base::units::METRES_PER_KM;
use areograph_geom::{
    attitude::matrix_of_spice_quaternion,
    body_rotation::{frame_rotation_1, frame_rotation_3},
};

/// NAIF code of J2000, the frame of all tables.
const NAIF_J2000: i64 = 1;
/// Tolerances of unit quaternions and rotation matrices: files have fifteen digits, and damaged values differ widely.
const UNIT_TOLERANCE: f64 = 1e-6;
/// Intervals of the grid of polynomials: a second of attitude that changes its rate by 1e-6 rad/s departs from an arc between
/// epochs 0.05 s apart by 3e-10 rad.
const STEP_S: f64 = 0.05;
const INTERVALS: [f64; 2] = [30.0, 20_000.0];
/// Highest degree of a polynomial.
const DEGREE_MAX: usize = 20;

/// Polynomials of three components over time.
struct Polynomials {
    /// Coefficients of each power.
    coefficients: Vec<Vector3<f64>>,
    base_s: f64,
    scale_s: f64,
}

impl Polynomials {
    /// The polynomials of a table with three fields.
    fn of(table: &Table) -> Result<Self, CubeError> {
        let rows: Vec<Vector3<f64>> = table
            .rows
            .iter()
            .map(|row| Vector3::new(row[0], row[1], row[2]))
            .collect();
        let expected = format!(
            "coefficients up to degree {DEGREE_MAX}, and a last record with base time, positive time scale and degree"
        );
        let refused = || table.refused("Records", rows.len(), &expected);
        let Some((time, coefficients)) = rows.split_last() else {
            return Err(refused());
        };
        let degree = coefficients.len().checked_sub(1).ok_or_else(refused)?;
        // Written so that NaN is rejected.
        if degree > DEGREE_MAX || !(time.y > 0.0) || !((time.z - degree as f64).abs() < 0.5) {
            return Err(refused());
        }
        Ok(Self {
            coefficients: coefficients.to_vec(),
            base_s: time.x,
            scale_s: time.y,
        })
    }

    /// Value and change per second.
    fn at(&self, et_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let t = (et_s - self.base_s) / self.scale_s;
        let (mut value, mut slope) = (Vector3::zeros(), Vector3::zeros());
        for coefficient in self.coefficients.iter().rev() {
            slope = slope * t + value;
            value = value * t + coefficient;
        }
        (value, slope / self.scale_s)
    }
}

/// First and last instant of a table: the stated ones of polynomials, the epochs of rows.
pub(super) fn span_s(table: &Table, prefix: &str) -> Result<[f64; 2], CubeError> {
    if table.fields.len() != 3 {
        let ends = [table.rows.first(), table.rows.last()];
        let [Some(&first), Some(&last)] = ends.map(|row| row.and_then(|row| row.last())) else {
            return Err(table.refused("Records", 0, "epochs"));
        };
        return Ok([first, last]);
    }
    let [first, last] = ["START", "END"].map(|end| {
        let key = format!("{prefix}TABLE{end}TIME");
        let stated = table.numbers(&key, 1)?;
        stated
            .map(|numbers| numbers[0])
            .ok_or_else(|| table.refused(&key, "missing", "the instant, ET seconds"))
    });
    let (first, last) = (first?, last?);
    if first < last {
        Ok([first, last])
    } else {
        Err(table.refused(
            "start and end",
            format!("{first} and {last}"),
            "two instants in order",
        ))
    }
}

fn grid([first_s, last_s]: [f64; 2]) -> Vec<f64> {
    let intervals = ((last_s - first_s) / STEP_S)
        .ceil()
        .clamp(INTERVALS[0], INTERVALS[1]);
    let step_s = (last_s - first_s) / intervals;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the limits checked above"
    )]
    let count = intervals as usize;
    (0..=count).map(|at| first_s + at as f64 * step_s).collect()
}

/// The epochs of a table with rows: two or more, increasing.
fn epochs(table: &Table) -> Result<Vec<f64>, CubeError> {
    let et_s: Vec<f64> = table
        .rows
        .iter()
        .filter_map(|row| row.last().copied())
        .collect();
    if et_s.len() >= 2 && et_s.windows(2).all(|pair| pair[0] < pair[1]) {
        return Ok(et_s);
    }
    Err(table.refused(
        "ET",
        format!("{et_s:.3?}").chars().take(60).collect::<String>(),
        "two or more increasing epochs",
    ))
}

/// Positions at epochs; `least_m` – distance from the centre that none is below.
pub(super) fn states(table: &Table, least_m: f64) -> Result<States, CubeError> {
    let kind = table.keyword("CACHETYPE").to_ascii_lowercase();
    if kind == "polyfunctionoverhermiteconstant" {
        return Err(table.refused("CacheType", kind, "HermiteSpline, Linear or PolyFunction"));
    }
    let vector =
        |row: &[f64], at: usize| Vector3::new(row[at], row[at + 1], row[at + 2]) * METRES_PER_KM;
    let states = match table.fields.len() {
        3 => {
            let polynomials = Polynomials::of(table)?;
            let et_s = grid(span_s(table, "SPK")?);
            let all = et_s.iter().map(|et_s| polynomials.at(*et_s));
            let (position_m, velocity_m_s) = all
                .map(|(km, km_s)| (km * METRES_PER_KM, km_s * METRES_PER_KM))
                .unzip();
            States {
                et_s,
                position_m,
                velocity_m_s,
            }
        }
        7 => States {
            et_s: epochs(table)?,
            position_m: table.rows.iter().map(|row| vector(row, 0)).collect(),
            velocity_m_s: table.rows.iter().map(|row| vector(row, 3)).collect(),
        },
        4 => {
            let et_s = epochs(table)?;
            let position_m: Vec<_> = table.rows.iter().map(|row| vector(row, 0)).collect();
            let velocity_m_s = slopes(&et_s, &position_m);
            States {
                et_s,
                position_m,
                velocity_m_s,
            }
        }
        other => {
            let expected = "X, Y, Z with or without velocities and ET, or three coefficients";
            return Err(table.refused("fields", other, expected));
        }
    };
    let mut positions = states.position_m.iter();
    match positions.find(|position_m| !(position_m.norm() >= least_m)) {
        None => Ok(states),
        Some(position_m) => {
            let expected = format!(
                "positions at least {} km from the centre of the target",
                least_m / METRES_PER_KM
            );
            let km = position_m.norm() / METRES_PER_KM;
            Err(table.refused(
                "J2000X, Y, Z",
                format!("{km:.1} km from the centre"),
                expected,
            ))
        }
    }
}

/// Changes per second of rows, by their neighbours.
fn slopes(et_s: &[f64], rows: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let last = rows.len() - 1;
    let slope = |at: usize| {
        let [before, after] = [at.saturating_sub(1), (at + 1).min(last)];
        (rows[after] - rows[before]) / (et_s[after] - et_s[before])
    };
    (0..rows.len()).map(slope).collect()
}

/// Rotations at epochs, and the constant one after them.
pub(super) fn rotations(table: &Table) -> Result<Rotations, CubeError> {
    let frames = table.codes("TIMEDEPENDENTFRAMES")?;
    if frames.last() != Some(&NAIF_J2000) {
        let expected = format!("a list of frames that ends with {NAIF_J2000}, J2000");
        return Err(table.refused("TimeDependentFrames", format!("{frames:?}"), expected));
    }
    let (et_s, turning) = match table.fields.len() {
        3 => {
            let polynomials = Polynomials::of(table)?;
            let et_s = grid(span_s(table, "CK")?);
            let turned = et_s.iter().map(|et_s| {
                let angles = polynomials.at(*et_s).0;
                frame_rotation_3(angles.z) * frame_rotation_1(angles.y) * frame_rotation_3(angles.x)
            });
            let turning = turned.collect();
            (et_s, turning)
        }
        5 | 8 => {
            let turning = table.rows.iter().enumerate().map(|(at, row)| {
                let quaternion = [row[0], row[1], row[2], row[3]];
                let length = quaternion
                    .iter()
                    .map(|part| part * part)
                    .sum::<f64>()
                    .sqrt();
                if (length - 1.0).abs() <= UNIT_TOLERANCE {
                    return Ok(matrix_of_spice_quaternion(quaternion));
                }
                let expected =
                    format!("unit quaternions; the quaternion of record {at} has length {length}");
                Err(table.refused("J2000Q0 to J2000Q3", format!("{quaternion:?}"), expected))
            });
            (epochs(table)?, turning.collect::<Result<Vec<_>, _>>()?)
        }
        other => {
            let expected =
                "a quaternion with or without angular velocity and ET, or three coefficients";
            return Err(table.refused("fields", other, expected));
        }
    };
    let rate_rad_s = if table.fields.len() == 8 {
        let rates = table.rows.iter();
        rates
            .map(|row| Vector3::new(row[4], row[5], row[6]))
            .collect()
    } else {
        neighbour_rates_rad_s(&et_s, &turning)
    };
    Ok(subdivided(&Rotations {
        et_s,
        turning,
        rate_rad_s,
        constant: constant(table)?,
    }))
}

/// The rotations with further rows on the arcs between sparse ones: interpolations of a higher order would overshoot where
/// one arc ends and another begins.
fn subdivided(rows: &Rotations) -> Rotations {
    let mut et_s = vec![rows.et_s[0]];
    for pair in rows.et_s.windows(2) {
        let length_s = pair[1] - pair[0];
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the limits checked above"
        )]
        let pieces = (length_s / STEP_S).ceil().clamp(1.0, INTERVALS[1]) as usize;
        et_s.extend((1..pieces).map(|piece| pair[0] + piece as f64 / pieces as f64 * length_s));
        et_s.push(pair[1]);
    }
    let (turning, rate_rad_s) = et_s.iter().map(|et_s| rows.at(*et_s)).unzip();
    Rotations {
        et_s,
        turning,
        rate_rad_s,
        constant: rows.constant,
    }
}

/// The constant rotation; the identity where the table has none.
fn constant(table: &Table) -> Result<Matrix3<f64>, CubeError> {
    const KEY: &str = "CONSTANTROTATION";
    let Some(numbers) = table.numbers(KEY, 9)? else {
        return Ok(Matrix3::identity());
    };
    let matrix = Matrix3::from_row_slice(&numbers);
    let skew = (matrix * matrix.transpose() - Matrix3::identity())
        .abs()
        .max();
    // Written so that NaN is rejected too.
    if skew <= UNIT_TOLERANCE && matrix.determinant() > 0.0 {
        Ok(matrix)
    } else {
        Err(table.refused(
            "ConstantRotation",
            table.keyword(KEY),
            "a rotation matrix, row by row",
        ))
    }
}
