//! The columns *Initial* of `bundleout_images.csv`: the camera of the run over the camera that ISIS reads.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::{fs, path::Path};

use crate::common::{json, mission::site_run, number};
use areograph::geom::attitude::{matrix_of_spice_quaternion, rotation_vector};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

/// Body-fixed position, metres, and rotation from the body to the bus at every node of support data, over ET.
fn cameras(path: &Path) -> Vec<(f64, Vector3<f64>, Matrix3<f64>)> {
    let support = json(path);
    let list =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().map(number).collect() };
    let rows = |block: &str, key: &str| -> Vec<Vec<f64>> {
        let rows = support[block][key].as_array().unwrap();
        rows.iter().map(list).collect()
    };
    let turns = |block: &str| {
        let rows = rows(block, "quaternions").into_iter();
        rows.map(|row| matrix_of_spice_quaternion(row.try_into().unwrap()))
    };
    let epochs = list(&support["instrument_position"]["ephemeris_times"]).into_iter();
    let positions = rows("instrument_position", "positions").into_iter();
    let turned = turns("body_rotation").zip(turns("instrument_pointing"));
    let nodes = epochs.zip(positions).zip(turned);
    let camera =
        |((et_s, position_km), (to_body, to_bus)): ((f64, Vec<f64>), (Matrix3<f64>, _))| {
            let position_m = to_body * Vector3::from_vec(position_km) * 1e3;
            (et_s, position_m, to_bus * to_body.transpose())
        };
    nodes.map(camera).collect()
}

/// Both support files of an image were written from tables; the columns are polynomials fitted to their difference.
#[test]
fn initial_values_lead_from_the_camera_of_isis_to_that_of_the_run() {
    let site = site_run("isidis");
    let text = fs::read_to_string(site.join("exchange/bundleout_images.csv")).unwrap();
    for row in text.lines().skip(2) {
        let fields: Vec<&str> = row.split(',').collect();
        let image = fields[0].trim_end_matches(".cub");
        let column =
            |unknown: usize, of: usize| -> f64 { fields[4 + 5 * unknown + of].parse().unwrap() };
        let own = json(&site.join(format!("images/{image}/isd.json")));
        let provenance = &own["areograph"];
        let half_s =
            0.5 * number(&provenance["lines_header"]) * number(&provenance["line_period_s"]);
        let start_s = number(&own["starting_ephemeris_time"]);
        let of_run = cameras(&site.join(format!("images/{image}/isd.json")));
        let of_isis = cameras(&site.join(format!("exchange/centre/{image}_isd.json")));
        let (mut worst_m, mut worst_rad, mut least_m) = (0.0_f64, 0.0_f64, f64::INFINITY);
        for ((et_s, own_m, own), (_, isis_m, isis)) in of_run.iter().zip(&of_isis) {
            let t = (et_s - start_s) / half_s - 1.0;
            if t.abs() > 1.0 {
                continue;
            }
            let value = |quantity: usize| {
                let [constant, linear, square] =
                    [0, 1, 2].map(|power| column(3 * quantity + power, 0));
                constant + (linear + square * t) * t
            };
            let apart_m = own_m - isis_m;
            least_m = least_m.min(apart_m.norm());
            let told_m = Vector3::from_fn(|axis, _| 1e3 * value(axis));
            worst_m = worst_m.max((told_m - apart_m).norm());
            let turned_rad = rotation_vector(&(own * isis.transpose())).norm();
            let told_rad = Vector3::from_fn(|axis, _| value(3 + axis).to_radians()).norm();
            worst_rad = worst_rad.max((told_rad - turned_rad).abs());
        }
        println!("{image}: {least_m:.0} m apart, told within {worst_m:.1e} m, {worst_rad:.1e} rad");
        // Metres: a millimetre of the parabola, of a displacement of more than a hundred.
        assert!(
            worst_m < 1e-3 && least_m > 100.0,
            "{worst_m} m of {least_m} m"
        );
        // Radians: Mars turns by 9e-8 in the 1.3 ms from the ground.
        assert!(worst_rad < 1e-9, "{worst_rad}");
        for unknown in 0..18 {
            let [initial, correction, last] = [0, 1, 2].map(|of| column(unknown, of));
            assert!((initial + correction - last).abs() < 2e-12); // printed to 12 decimals
        }
    }
    assert_eq!(text.lines().count(), 4);
}
