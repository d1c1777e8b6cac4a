//! Table 3 of the paper with real shots: LOLA ranges of a stereo pair (ISIS test data), through our range check.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;
use areograph_testing::lunar_pair;

use std::fs;

use areograph::{
    frames::Position, geom::range_residuals::range_residual_m, geom::statistics::Summary,
};
use lunar_pair::{FOLDER, inertial_position, moon_matrix, shots, times};
use serde_json::Value;

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
