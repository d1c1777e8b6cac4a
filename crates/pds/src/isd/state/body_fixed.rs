//! Positions and attitudes of a state, in the frame of the body and in J2000.

use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

use super::NUMBERS_MAX;
use crate::isd::{
    ET_S, RADIUS_KM,
    document::{IsdError, Object},
    tables::neighbour_rates_rad_s,
    target::RADIUS_TOLERANCE_M,
};
use areograph_base::{body::Body, time::Et, units::METRES_PER_KM};
use areograph_geom::{
    attitude::{matrix_of_spice_quaternion, spice_quaternion},
    body_rotation::{body_rotation, spin_rad_s},
};

/// NAIF code of no spacecraft.
const UNKNOWN_BUS: i64 = 0;
/// Steps of epochs, seconds.
const STEP_S: [f64; 2] = [1e-6, 1e6];
/// Tolerance of the length of a unit quaternion: states have seventeen digits.
const UNIT_TOLERANCE: f64 = 1e-6;

/// Positions and attitudes in the frame of the body.
pub(super) struct BodyFixed {
    body: Body,
    /// Epochs of positions, ET seconds.
    position_et_s: Vec<f64>,
    position_m: Vec<Vector3<f64>>,
    velocity_m_s: Vec<Vector3<f64>>,
    /// Epochs of attitudes, ET seconds.
    attitude_et_s: Vec<f64>,
    camera_to_body: Vec<Matrix3<f64>>,
}

impl BodyFixed {
    pub(super) fn of(document: &Object<'_>, centre_s: f64) -> Result<Self, IsdError> {
        let radii_m = radii_m(document)?;
        let positions = counted_rows(document, "m_positions", "m_numPositions")?;
        let velocities = counted_rows(document, "m_velocities", "m_numPositions")?;
        let quaternions = counted_rows::<4>(document, "m_quaternions", "m_numQuaternions")?;
        let position_m = positions.into_iter().map(Vector3::from);
        let position_m: Vec<Vector3<f64>> = position_m.collect();
        if let Some(row) = position_m.iter().position(|at| !(at.norm() >= radii_m[1])) {
            let expected = format!(
                "positions at least {} m from the centre of the target; at epoch {row} the distance is {:.1} m",
                radii_m[1],
                position_m[row].norm()
            );
            return Err(document.refused("m_positions", expected));
        }
        let camera_to_body = quaternions.iter().enumerate().map(|(row, [x, y, z, w])| {
            let quaternion = [*w, *x, *y, *z];
            let squares = quaternion.iter().map(|part| part * part);
            let length = squares.sum::<f64>().sqrt();
            // Written so that NaN is rejected too.
            if !((length - 1.0).abs() <= UNIT_TOLERANCE) {
                let expected = format!(
                    "unit quaternions (x, y, z, w); the quaternion of epoch {row} has length {length}"
                );
                return Err(document.refused("m_quaternions", expected));
            }
            Ok(matrix_of_spice_quaternion(quaternion))
        });
        let camera_to_body = camera_to_body.collect::<Result<Vec<_>, _>>()?;
        let epochs = |first: &str, step: &str, count: usize| {
            let first_s = centre_s + document.number(first, ET_S)?;
            let step_s = document.number(step, STEP_S)?;
            Ok((0..count)
                .map(|row| first_s + row as f64 * step_s)
                .collect())
        };
        Ok(Self {
            body: body_of(document, radii_m)?,
            position_et_s: epochs("m_t0Ephem", "m_dtEphem", position_m.len())?,
            velocity_m_s: velocities.into_iter().map(Vector3::from).collect(),
            position_m,
            attitude_et_s: epochs("m_t0Quat", "m_dtQuat", camera_to_body.len())?,
            camera_to_body,
        })
    }

    /// J2000 to the body at an instant.
    fn to_body(&self, et_s: f64) -> Matrix3<f64> {
        *body_rotation(self.body, Et::from_seconds(et_s)).matrix()
    }

    /// Position and velocity in J2000, kilometres, of one in the frame of the body at an instant, metres.
    fn inertial_km(
        &self,
        et_s: f64,
        position_m: &Vector3<f64>,
        velocity_m_s: &Vector3<f64>,
    ) -> [[f64; 3]; 2] {
        let to_body = self.to_body(et_s);
        let carried_m_s = spin_rad_s(self.body.model()).cross(position_m);
        [*position_m, velocity_m_s + carried_m_s]
            .map(|vector| (to_body.tr_mul(&vector) / METRES_PER_KM).into())
    }

    pub(super) fn instrument_position(&self) -> Value {
        let states = self.position_m.iter().zip(&self.velocity_m_s);
        let states = states.zip(&self.position_et_s);
        let (positions, velocities): (Vec<_>, Vec<_>) = states
            .map(|((position_m, velocity_m_s), et_s)| {
                let [position, velocity] = self.inertial_km(*et_s, position_m, velocity_m_s);
                (position, velocity)
            })
            .unzip();
        states_value(&self.position_et_s, &positions, &velocities)
    }

    /// Attitudes of the camera with this NAIF code, whose bus is unknown.
    pub(super) fn instrument_pointing(&self, camera: i64) -> Value {
        let attitudes = self.camera_to_body.iter().zip(&self.attitude_et_s);
        let turning: Vec<Matrix3<f64>> = attitudes
            .map(|(camera_to_body, et_s)| camera_to_body.transpose() * self.to_body(*et_s))
            .collect();
        let rates: Vec<[f64; 3]> = if turning.len() < 2 {
            vec![[0.0; 3]; turning.len()]
        } else {
            let rates = neighbour_rates_rad_s(&self.attitude_et_s, &turning);
            rates.into_iter().map(Into::into).collect()
        };
        let mut value = rotations_value(&self.attitude_et_s, &turning, &rates);
        value["time_dependent_frames"] = json!([UNKNOWN_BUS, 1]);
        value["constant_frames"] = json!([camera, UNKNOWN_BUS]);
        value
    }

    /// From the first to the last epoch of positions and attitudes; in between, the rotation is uniform.
    pub(super) fn body_rotation(&self) -> Value {
        let all = || {
            self.position_et_s
                .iter()
                .chain(&self.attitude_et_s)
                .copied()
        };
        let ends = [
            all().fold(f64::INFINITY, f64::min),
            all().fold(f64::NEG_INFINITY, f64::max),
        ];
        let turning = ends.map(|et_s| self.to_body(et_s));
        let spin = spin_rad_s(self.body.model());
        let rates = turning.map(|to_body| to_body.tr_mul(&spin).into());
        rotations_value(&ends, &turning, &rates)
    }

    /// The Sun: one position of the middle, or several from the first to the last epoch of positions.
    pub(super) fn sun(&self, document: &Object<'_>, centre_s: f64) -> Result<Value, IsdError> {
        let positions_m = rows::<3>(document, "m_sunPosition")?;
        let velocities_m_s = rows::<3>(document, "m_sunVelocity")?;
        as_many(
            document,
            "m_sunVelocity",
            velocities_m_s.len(),
            ("m_sunPosition", positions_m.len()),
        )?;
        let states = positions_m.into_iter().zip(velocities_m_s);
        let states: Vec<[Vector3<f64>; 2]> = states
            .map(|(position_m, velocity_m_s)| [position_m.into(), velocity_m_s.into()])
            .collect();
        let all = &self.position_et_s;
        let span_s = [all.first(), all.last()].map(|end| end.copied().unwrap_or(centre_s));
        let inertial = |et_s: f64, [position_m, velocity_m_s]: &[Vector3<f64>; 2]| {
            self.inertial_km(et_s, position_m, velocity_m_s)
        };
        if let [only] = &*states {
            let [position_km, velocity_km_s] = inertial(centre_s, only).map(Vector3::from);
            let positions = span_s.map(|et_s| position_km + velocity_km_s * (et_s - centre_s));
            return Ok(states_value(
                &span_s,
                &positions.map(Into::into),
                &[velocity_km_s.into(); 2],
            ));
        }
        let intervals = states.len().saturating_sub(1) as f64;
        let epochs = (0..states.len())
            .map(|row| span_s[0] + row as f64 / intervals * (span_s[1] - span_s[0]));
        let et_s: Vec<f64> = epochs.collect();
        let inertial = et_s.iter().zip(&states).map(|(et_s, state)| {
            let [position, velocity] = inertial(*et_s, state);
            (position, velocity)
        });
        let (positions, velocities): (Vec<_>, Vec<_>) = inertial.unzip();
        Ok(states_value(&et_s, &positions, &velocities))
    }
}

fn states_value(et_s: &[f64], positions_km: &[[f64; 3]], velocities_km_s: &[[f64; 3]]) -> Value {
    json!({
        "reference_frame": 1,
        "ephemeris_times": et_s,
        "positions": positions_km,
        "velocities": velocities_km_s,
    })
}

fn rotations_value(et_s: &[f64], turning: &[Matrix3<f64>], rate_rad_s: &[[f64; 3]]) -> Value {
    let quaternions: Vec<[f64; 4]> = turning.iter().map(spice_quaternion).collect();
    json!({
        "reference_frame": 1,
        "ephemeris_times": et_s,
        "quaternions": quaternions,
        "angular_velocities": rate_rad_s,
    })
}

/// Equatorial and polar radius.
pub(super) fn radii_m(document: &Object<'_>) -> Result<[f64; 2], IsdError> {
    let limits = RADIUS_KM.map(|km| km * METRES_PER_KM);
    let equatorial_m = document.number("m_majorAxis", limits)?;
    let polar_m = document.number("m_minorAxis", [limits[0], equatorial_m])?;
    Ok([equatorial_m, polar_m])
}

/// The body with these radii: the state uses its frame, but does not name it.
fn body_of(document: &Object<'_>, radii_m: [f64; 2]) -> Result<Body, IsdError> {
    let has_them = |body: &Body| {
        let model = body.model();
        let expected_m = [model.equatorial_radius_m, model.polar_radius_m];
        let mut pairs = radii_m.iter().zip(expected_m);
        pairs.all(|(found, expected)| (found - expected).abs() <= RADIUS_TOLERANCE_M)
    };
    let mut bodies = [Body::Mars, Body::Moon].into_iter();
    bodies.find(has_them).ok_or_else(|| {
        let [mars, moon] = [Body::Mars, Body::Moon].map(Body::model);
        let expected = format!(
            "together with m_minorAxis, the radii of Mars ({} and {} m) or of the Moon ({} m), within {RADIUS_TOLERANCE_M} m",
            mars.equatorial_radius_m, mars.polar_radius_m, moon.equatorial_radius_m
        );
        document.refused("m_majorAxis", expected)
    })
}

/// Rows of a list of numbers, one after the other.
fn rows<const N: usize>(document: &Object<'_>, key: &str) -> Result<Vec<[f64; N]>, IsdError> {
    let numbers = document.list(key, NUMBERS_MAX)?;
    let (rows, rest) = numbers.as_chunks::<N>();
    if rest.is_empty() {
        return Ok(rows.to_vec());
    }
    let expected = format!("{N} numbers per epoch, not {} in total", numbers.len());
    Err(document.refused(key, expected))
}

/// The rows, with as many numbers as the state declares under `count`.
fn counted_rows<const N: usize>(
    document: &Object<'_>,
    key: &str,
    count: &str,
) -> Result<Vec<[f64; N]>, IsdError> {
    let rows = rows::<N>(document, key)?;
    let numbers = N * rows.len();
    let stated = document.whole(count, [1, u32::MAX])?;
    if usize::try_from(stated) == Ok(numbers) {
        return Ok(rows);
    }
    let expected = format!("{numbers}, the count of numbers in {key}");
    Err(document.refused(count, expected))
}

pub(super) fn as_many(
    document: &Object<'_>,
    key: &str,
    found: usize,
    (other, expected): (&str, usize),
) -> Result<(), IsdError> {
    if found == expected {
        return Ok(());
    }
    let expected = format!("{expected} entries, one per entry of {other}, not {found}");
    Err(document.refused(key, expected))
}
