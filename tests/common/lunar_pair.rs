//! A stereo pair of the Moon with the laser shots of its spacecraft (ISIS test data).
#![allow(dead_code, reason = "each test program uses a part of this module")]

use std::path::Path;

use areograph::{
    frames::{Frame, Position},
    geom::{attitude::matrix_of_spice_quaternion, ellipsoid::spherical_to_xyz_m},
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde_json::Value;

pub(crate) const FOLDER: &str = "isis_lidar/lidarObservationPair";

/// Moon mean-Earth frame of the LOLA file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MoonFixed;
impl Frame for MoonFixed {
    const NAME: &'static str = "MOON_ME";
}

pub(crate) struct Shot {
    pub(crate) et_s: f64,
    pub(crate) range_m: f64,
    pub(crate) footprint: Position<MoonFixed>,
    pub(crate) spacecraft: Position<MoonFixed>,
}

pub(crate) fn shots(path: &Path) -> Vec<Shot> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_path(path)
        .unwrap();
    let records = reader.records().map(|record| {
        let record = record.unwrap();
        // Columns counted from 1, as the data's description does.
        let number = |column: usize| record[column - 1].parse::<f64>().unwrap();
        let position = |longitude: usize, radius_km: f64| {
            Position::new(spherical_to_xyz_m(
                number(longitude) * RADIANS_PER_DEGREE,
                number(longitude + 1) * RADIANS_PER_DEGREE,
                radius_km * METRES_PER_KM,
            ))
        };
        Shot {
            et_s: number(16),
            range_m: number(5) * METRES_PER_KM,
            footprint: position(2, number(4)),
            spacecraft: position(19, number(21)),
        }
    });
    records.collect()
}

pub(crate) fn vectors(value: &Value) -> Vec<Vec<f64>> {
    let numbers = |row: &Value| {
        row.as_array()
            .unwrap()
            .iter()
            .map(|n| n.as_f64().unwrap())
            .collect()
    };
    value.as_array().unwrap().iter().map(numbers).collect()
}

pub(crate) fn times(table: &Value) -> Vec<f64> {
    let times = table["ephemeris_times"].as_array().unwrap();
    times.iter().map(|time| time.as_f64().unwrap()).collect()
}

/// Cubic Hermite interpolation of the support data's positions and velocities, metres, J2000.
pub(crate) fn inertial_position(table: &Value, et_s: f64) -> Vector3<f64> {
    let times = times(table);
    let after = times
        .partition_point(|time| *time <= et_s)
        .clamp(1, times.len() - 1);
    let (t0, step) = (times[after - 1], times[after] - times[after - 1]);
    let read = |key: &str, row: usize| {
        METRES_PER_KM * Vector3::from_vec(vectors(&table[key])[row].clone())
    };
    let [p0, p1] = [read("positions", after - 1), read("positions", after)];
    let [v0, v1] = [read("velocities", after - 1), read("velocities", after)];
    let u = (et_s - t0) / step;
    let (u2, u3) = (u * u, u * u * u);
    p0 * (2.0 * u3 - 3.0 * u2 + 1.0)
        + v0 * step * (u3 - 2.0 * u2 + u)
        + p1 * (3.0 * u2 - 2.0 * u3)
        + v1 * step * (u3 - u2)
}

/// J2000 to the Moon frame: the two tabulated rotations, interpolated on the arc between them.
pub(crate) fn moon_matrix(table: &Value, et_s: f64) -> Matrix3<f64> {
    let times = times(table);
    let quaternion = |row: usize| {
        let components = vectors(&table["quaternions"])[row].clone();
        let matrix = matrix_of_spice_quaternion(components.try_into().unwrap());
        UnitQuaternion::from_matrix(&matrix)
    };
    let u = (et_s - times[0]) / (times[1] - times[0]);
    let constant: Vec<f64> = table["constant_rotation"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_f64().unwrap())
        .collect();
    Matrix3::from_row_slice(&constant)
        * quaternion(0)
            .slerp(&quaternion(1), u)
            .to_rotation_matrix()
            .into_inner()
}

/// J2000 to the camera: the tabulated attitudes, interpolated on the arc between two neighbours.
pub(crate) fn attitude(table: &Value, et_s: f64) -> Matrix3<f64> {
    let times = times(table);
    let after = times
        .partition_point(|time| *time <= et_s)
        .clamp(1, times.len() - 1);
    let quaternion = |row: usize| {
        let components = vectors(&table["quaternions"])[row].clone();
        let matrix = matrix_of_spice_quaternion(components.try_into().unwrap());
        UnitQuaternion::from_matrix(&matrix)
    };
    let u = (et_s - times[after - 1]) / (times[after] - times[after - 1]);
    quaternion(after - 1)
        .slerp(&quaternion(after), u)
        .to_rotation_matrix()
        .into_inner()
}
