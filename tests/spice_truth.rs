//! Times, states and attitudes against numbers of an independent CSPICE run on real kernels.

mod common;

use areograph::{
    constants::MGS_POINTING_BIAS,
    spice::{KernelSet, Session},
    time::Et,
};
use common::real_data;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The kernels of MOC image M04/02852, in load order.
const KERNELS: [&str; 9] = [
    "naif0012.tls",
    "MGS_SCLKSCET.00061.tsc",
    "pck00009.tpc",
    "moc20.ti",
    "mocAddendum004.ti",
    "m0402852.ale_0.bsp",
    "m0402852.ale_1.bsp",
    "mgs_sc_map2_0_sliced_-94000.bc",
    "mgs_sc_map2_1_sliced_-94000.bc",
];

fn kernels(folder: &Path) -> KernelSet {
    let files: Vec<PathBuf> = KERNELS.iter().map(|name| folder.join(name)).collect();
    KernelSet::from_files(&files).unwrap()
}

fn truth(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().unwrap().iter().map(number))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_row_iterator(value.as_array().unwrap().iter().map(number))
}

#[test]
fn clock_strings_and_utc_become_the_same_instants() {
    let (Some(folder), Some(truth_file)) = (
        real_data("ale_mgs/m0402852", "clock strings"),
        real_data("derived/cspice_truth.json", "clock strings"),
    ) else {
        return;
    };
    let session = Session::open(&kernels(&folder)).unwrap();
    let truth = truth(&truth_file);
    for case in truth["sclk_to_et"].as_array().unwrap() {
        let et = session.sclk_to_et(case["sclk"].as_str().unwrap()).unwrap();
        let difference_s = et.seconds() - number(&case["et"]);
        assert!(difference_s.abs() <= 1e-9, "{case}: {et}"); // nanosecond, as the task demands
    }
    for case in truth["utc_to_et"].as_array().unwrap() {
        let et = session.utc_to_et(case["utc"].as_str().unwrap()).unwrap();
        let difference_s = et.seconds() - number(&case["et"]);
        assert!(difference_s.abs() <= 1e-9, "{case}: {et}");
    }
    let moc = session.sclk_to_et("610472061:131").unwrap();
    assert!((moc.seconds() - -20_723_097.688_171).abs() < 5e-7); // printed to a microsecond
    let node = session.sclk_to_et("1/0844996544.086").unwrap();
    assert_eq!(session.et_to_sclk(node).unwrap(), "1/0844996544.086");
    let start = session.sclk_to_et("619971158:28").unwrap();
    assert_eq!(session.et_to_utc(start).unwrap(), "1999-08-24T14:12:13.635");
}

#[test]
fn orientation_samples_of_a_real_image_are_met() {
    let (Some(folder), Some(truth_file)) = (
        real_data("ale_mgs/m0402852", "orientation samples"),
        real_data("derived/cspice_truth.json", "orientation samples"),
    ) else {
        return;
    };
    let session = Session::open(&kernels(&folder)).unwrap();
    let truth = truth(&truth_file);
    for sample in truth["eo_m0402852"]["samples"].as_array().unwrap() {
        let et = Et::from_seconds(number(&sample["et"]));
        let state = session.state(et).unwrap();
        let km = state.position.xyz_m / 1_000.0;
        assert!((km - vector(&sample["mgs_j2000_pos_geometric"])).norm() < 1e-6);
        let attitude = session
            .attitude(MGS_POINTING_BIAS.lookup(et), et, 0.0)
            .unwrap();
        let to_bus = matrix(&sample["r_j2000_to_spacecraft_at_et_minus_1.15"]);
        assert!((attitude.inertial_to_bus.matrix() - to_bus).abs().max() < 1e-11);
    }
}
