//! Image M04/02852 on real kernels: orientation and polynomial fits against CSPICE's own numbers.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{fs, path::PathBuf};

use areograph::{
    config::{ImageConfig, KernelsConfig, OrientationConfig, PointingConfig, usual_instrument},
    geom::light_time::LightTime,
    kernel_source::{KernelList, KernelSource},
    spice::{KernelSet, Session},
    stages::{
        fit_sensor_model::fit_sensor_model,
        sample_orientation::{Orientation, sample_orientation},
        tag_times::{ImageTimes, StartFrom, tag_times},
    },
    units::METRES_PER_KM,
};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

fn image(id: &str, label: PathBuf) -> ImageConfig {
    ImageConfig {
        id: id.to_owned(),
        label: Some(label),
        ..ImageConfig::default()
    }
}

const SAMPLING: OrientationConfig = OrientationConfig {
    intervals: 30,
    light_time: LightTime::None, // as the numbers beside
    position_rmse_max_m: 1.0,
    pointing_rmse_max_rad: 1e-3,
};

fn m0402852(test: &str) -> Option<(ImageTimes, Orientation, Value)> {
    let folder = common::real_data("ale_mgs/m0402852", test)?;
    let truth = common::real_data("derived/cspice_truth.json", test)?;
    let truth: Value = serde_json::from_str(&fs::read_to_string(truth).unwrap()).unwrap();
    let files = common::m0402852_files(&folder);
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    let image = image("M04-02852", folder.join("m0402852_isis.lbl"));
    let times = tag_times(&[image], &session).unwrap().remove(0);
    let kernels = KernelsConfig {
        source: KernelSource::Listed(KernelList::Files(files)),
        ..KernelsConfig::default()
    };
    let pointing = PointingConfig {
        ck_bias: Some(usual_instrument().pointing_bias()),
        source: None,
    };
    let orientation = sample_orientation(&session, &times, &kernels, &pointing, &SAMPLING).unwrap();
    Some((times, orientation, truth["eo_m0402852"].clone()))
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_f64().unwrap())
        .collect()
}

#[test]
fn line_times_come_from_the_clock_and_the_summed_exposure() {
    let Some((times, _, truth)) = m0402852("real line times") else {
        return;
    };
    assert_eq!(times.start_from, StartFrom::Sclk);
    assert_eq!(
        (
            times.line_times.lines(),
            times.samples,
            times.first_detector
        ),
        (1536, 256, 0)
    );
    let start_s = truth["start_et"].as_f64().unwrap();
    assert!((times.line_times.start().seconds() - start_s).abs() < 1e-9); // seconds, as the issue demands
    assert!((times.line_times.mean_period_s() - 0.003_856_8).abs() < 1e-12); // 0.4821 ms x 8
    assert!((times.duration_s() - 5.924_044_8).abs() < 1e-9);
    // The first line's centre is half a line after the start; the last line's centre mirrors it.
    let first = times.line_offset(times.line_centre(0));
    let last = times.line_offset(times.line_centre(1535));
    assert!((first + 767.5).abs() < 1e-5 && (last - 767.5).abs() < 1e-5); // lines; ET resolves 2e-9 s
}

#[test]
fn orientation_equals_cspice() {
    let Some((_, orientation, truth)) = m0402852("real orientation") else {
        return;
    };
    let samples = truth["samples"].as_array().unwrap();
    assert_eq!(orientation.samples.len(), samples.len());
    for (sample, truth) in orientation.samples.iter().zip(samples) {
        assert!((sample.et.seconds() - truth["et"].as_f64().unwrap()).abs() < 5e-9); // two ulp of ET
        let position_m = METRES_PER_KM * Vector3::from_vec(numbers(&truth["mgs_iau_mars_pos"]));
        let apart_m = (sample.position.xyz_m - position_m).norm();
        assert!(apart_m < 1e-3, "{apart_m} m"); // 1e-6 km, as the issue demands
        let matrix = sample.camera_to_mars.matrix();
        let truth = Matrix3::from_row_slice(&numbers(&truth["r_camera_to_iau_mars"]));
        let apart = (matrix - truth).abs().max();
        assert!(apart < 1e-11, "{apart}"); // matrix elements, as the issue demands
        let from_angles = (sample.angles.camera_to_mars() - matrix).abs().max();
        assert!(from_angles < 1e-14); // rounding: the same rotation written twice
    }
}

#[test]
fn position_rmse_equals_cspice() {
    let Some((_, orientation, truth)) = m0402852("real polynomial fits") else {
        return;
    };
    let model = fit_sensor_model(&orientation, &SAMPLING, None).unwrap();
    assert!(model.invalid_because.is_empty());
    for (degree, model, tolerance) in [
        ("degree_1", &model.first_order, 1e-6), // relative, as the issue demands
        ("degree_2", &model.second_order, 1e-3),
    ] {
        let truth = numbers(&truth["position_fit_rms_km_xyz"][degree]);
        for (fit, truth_km) in model.position_m.iter().zip(truth) {
            let share = fit.rmse / (truth_km * METRES_PER_KM) - 1.0;
            assert!(share.abs() < tolerance, "{degree}: {share}");
        }
    }
}

/// What real labels say twice agrees: the limits of remarks are above all that occurs.
#[test]
fn real_labels_are_not_remarked_on() {
    let test = "clock, UTC, stop time and mounting of real labels";
    let Some(folder) = common::real_data("ale_mgs/m0402852", test) else {
        return;
    };
    let files = common::m0402852_files(&folder);
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    let labels = [
        ("M04-02852", "ale_mgs/m0402852/m0402852_isis.lbl"),
        ("M01-00115", "asp_moc/M0100115.imq"),
        ("M13-01260", "isis_moc/m1301260_isis.lbl"),
    ];
    for (id, label) in labels {
        let Some(label) = common::real_data(label, test) else {
            return;
        };
        let times = tag_times(&[image(id, label)], &session).unwrap().remove(0);
        assert!(times.remarks.is_empty(), "{id}: {:?}", times.remarks);
    }
}

#[test]
fn m0100115_starts_when_ames_stereo_pipeline_says() {
    let test = "real label of M01/00115";
    let Some(label) = common::real_data("asp_moc/M0100115.imq", test) else {
        return;
    };
    let Some(clock) = common::real_data("mgs_text/MGS_SCLKSCET.00061.tsc", test) else {
        return;
    };
    let Some(leap) = common::real_data("mgs_text/naif0012.tls", test) else {
        return;
    };
    let session = Session::open(&KernelSet::from_files(&[leap, clock]).unwrap()).unwrap();
    let times = tag_times(&[image("M01-00115", label)], &session)
        .unwrap()
        .remove(0);
    assert!((times.line_times.start().seconds() + 20_723_097.688_171).abs() < 1e-6); // printed to a microsecond
    assert!((times.duration_s() - 7.034_803_2).abs() < 1e-9); // 4864 x 0.4821 ms x 3
}
