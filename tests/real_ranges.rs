//! Table 3 of the paper with real shots: LOLA ranges of a stereo pair (ISIS test data), through our range check.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

mod common;

use std::{fs, path::Path};

use areograph::{
    frames::{Frame, Position},
    geom::{
        attitude::matrix_of_spice_quaternion, ellipsoid::spherical_to_xyz_m, statistics::Summary,
    },
    stages::check_ranges::range_residual_m,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde_json::Value;

const FOLDER: &str = "isis_lidar/lidarObservationPair";

/// Moon mean-Earth frame of the LOLA file.
#[derive(Debug, Clone, Copy)]
struct MoonFixed;
impl Frame for MoonFixed {
    const NAME: &'static str = "MOON_ME";
}

struct Shot {
    et_s: f64,
    range_m: f64,
    footprint: Position<MoonFixed>,
    spacecraft: Position<MoonFixed>,
}

fn shots(path: &Path) -> Vec<Shot> {
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

fn vectors(value: &Value) -> Vec<Vec<f64>> {
    let numbers = |row: &Value| {
        row.as_array()
            .unwrap()
            .iter()
            .map(|n| n.as_f64().unwrap())
            .collect()
    };
    value.as_array().unwrap().iter().map(numbers).collect()
}

fn times(table: &Value) -> Vec<f64> {
    let times = table["ephemeris_times"].as_array().unwrap();
    times.iter().map(|time| time.as_f64().unwrap()).collect()
}

/// Cubic Hermite interpolation of the support data's positions and velocities, metres, J2000.
fn inertial_position(table: &Value, et_s: f64) -> Vector3<f64> {
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
fn moon_matrix(table: &Value, et_s: f64) -> Matrix3<f64> {
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

#[test]
fn the_files_own_spacecraft_gives_the_known_offset() {
    let test = "real ranges";
    let Some(folder) = common::real_data(FOLDER, test) else {
        return;
    };
    let residuals: Vec<f64> = shots(&folder.join("lidarPoints.csv"))
        .iter()
        .map(|shot| range_residual_m(shot.range_m, &shot.spacecraft, &shot.footprint))
        .collect();
    let summary = Summary::of(&residuals);
    assert_eq!(summary.n, 105);
    // Range − distance; the data's description states distance − range: 0.5450 m, 0.0007 m.
    assert!((summary.mean + 0.5450).abs() < 0.0005, "{} m", summary.mean); // half the last digit
    assert!(
        (summary.standard_deviation - 0.0007).abs() < 0.0001,
        "{} m",
        summary.standard_deviation
    );
}

#[test]
fn an_interpolated_trajectory_gives_the_known_offset() {
    let test = "real ranges along a support-data trajectory";
    let Some(folder) = common::real_data(FOLDER, test) else {
        return;
    };
    let text = fs::read_to_string(folder.join("lidarObservationImage1.isd")).unwrap();
    let support: Value = serde_json::from_str(&text).unwrap();
    let (position, rotation) = (&support["instrument_position"], &support["body_rotation"]);
    let span = times(position);
    let residuals: Vec<f64> = shots(&folder.join("lidarPoints.csv"))
        .iter()
        .filter(|shot| (span[0]..=span[span.len() - 1]).contains(&shot.et_s))
        .map(|shot| {
            let moon_fixed =
                moon_matrix(rotation, shot.et_s) * inertial_position(position, shot.et_s);
            range_residual_m(shot.range_m, &Position::new(moon_fixed), &shot.footprint)
        })
        .collect();
    let summary = Summary::of(&residuals);
    assert_eq!(summary.n, 54);
    assert!((summary.mean + 0.450).abs() < 0.001, "{} m", summary.mean); // as the issue demands
    assert!(
        (summary.standard_deviation - 0.001).abs() < 0.0005,
        "{} m",
        summary.standard_deviation
    );
}
