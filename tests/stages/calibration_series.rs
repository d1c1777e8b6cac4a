//! `areograph calibrate series` as its user has it: calibrations of several orbits of a camera that ages, or does not, against
//! the true look directions.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    config::{CalibrationConfig, Document as _},
    flow::{Task, calibration_series, series_answer},
    geom::ellipsoid::{local_axes, spherical_to_xyz_m},
    report::{CalibrationSeries, calibration_series_page},
    scene::{OrbitsScene, write_calibration_orbits, write_calibration_scene},
};
use common::{flows::run_into, json};
use nalgebra::Vector3;
use serde_json::Value;

/// A pixel of the scene as a tangent.
const PIXEL: f64 = 8e-5;
/// Seeds of a short and of a long run.
const SEEDS: [u64; 2] = [3, 25];

/// Calibrations of a scene's orbits, in order, and its truth.
struct Calibrated {
    folder: tempfile::TempDir,
    orbits: Vec<PathBuf>,
}

impl Calibrated {
    fn of(seed: u64, orbits: u32, ageing_px_per_year: f64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let scene = OrbitsScene {
            seed,
            orbits,
            orbit_errors: 1.0,
            ageing_px_per_year,
        };
        write_calibration_orbits(&folder.path().join("scene"), &scene).unwrap();
        let name = |number| format!("o{number:02}");
        let out = folder.path().join("out");
        for number in 1..=orbits {
            let file = folder.path().join(format!("scene/{}.toml", name(number)));
            let config = CalibrationConfig::load(&file).unwrap().config;
            run_into(Task::Calibration(&config), &out, false).unwrap();
        }
        let orbits = (1..=orbits).map(|number| out.join(name(number)));
        Self {
            orbits: orbits.collect(),
            folder,
        }
    }

    fn series(&self) -> CalibrationSeries {
        calibration_series(&self.orbits).unwrap()
    }

    fn truth(&self) -> Value {
        json(&self.folder.path().join("scene/truth.json"))
    }
}

/// True look parameters of both lines in an orbit.
fn true_looks(truth: &Value, orbit: &str) -> [[f64; 6]; 2] {
    ["s1", "s2"].map(|line| {
        let of = truth["orbits"][orbit]["looks"][line].as_array().unwrap();
        std::array::from_fn(|at| of[at].as_f64().unwrap())
    })
}

/// Errors of all changes in standard deviations, by parameter: common and relative ones.
fn errors(of: &CalibrationSeries, truth: &Value, sums: &mut [Vec<f64>; 12]) {
    let in_use = true_looks(truth, &of.orbits[0].calibration);
    for (orbit, change) in of.orbits.iter().zip(&of.series.orbits).skip(1) {
        let now = true_looks(truth, &orbit.calibration);
        for at in 0..6 {
            let [s1, s2] = [0, 1].map(|line| now[line][at] - in_use[line][at]);
            for (index, expected) in [(at, 0.5 * (s1 + s2)), (at + 6, s2 - s1)] {
                let found = change.changes[index];
                sums[index].push((found.value - expected) / found.sigma);
            }
        }
    }
}

fn rms(of: &[f64]) -> f64 {
    (of.iter().map(|of| of * of).sum::<f64>() / of.len() as f64).sqrt()
}

fn seeds(first: u64) -> std::ops::Range<u64> {
    first..first + SEEDS[usize::from(common::long())]
}

/// Orbits are wrong by 1000 m and 25 mdeg, profiles share laser errors, and standard deviations are true.
#[test]
fn an_unchanged_camera_is_not_recalibrated() {
    let mut sums: [Vec<f64>; 12] = Default::default();
    let mut disagree = 0;
    for seed in seeds(1) {
        let of = Calibrated::of(seed, 6, 0.0);
        let series = of.series();
        assert!(!series.recalibrate(), "{seed}: {:?}", series.findings());
        let answer = series_answer(&series);
        let orbits = answer["orbits"].as_array().unwrap();
        disagree += orbits
            .iter()
            .filter(|of| of["agreement"] != "agrees")
            .count();
        errors(&series, &of.truth(), &mut sums);
    }
    assert_eq!(disagree, 0);
    for (index, of) in sums.iter().enumerate() {
        let (rms, count) = (rms(of), of.len());
        let largest = of.iter().fold(0.0_f64, |most, of| most.max(of.abs()));
        // Orbits of one seed share the errors of the calibration in use: their root mean square scatters widely.
        let limits = if common::long() { 0.3..1.5 } else { 0.2..2.2 };
        assert!(limits.contains(&rms), "{index}: {rms} of {count}");
        assert!(largest < 4.5, "{index}: {largest}");
    }
}

/// A camera that ages by 4 pixels a year, over 1.75 years.
#[test]
fn an_ageing_camera_is_recalibrated_and_its_drift_is_right() {
    let mut sums: [Vec<f64>; 12] = Default::default();
    for seed in seeds(101) {
        let of = Calibrated::of(seed, 8, 4.0);
        let series = of.series();
        assert!(series.recalibrate(), "{seed}: {}", series.headline());
        let (truth, last) = (of.truth(), &series.orbits[7].calibration);
        let years = truth["orbits"][last]["years"].as_f64().unwrap();
        let [before, after] = ["o01", last].map(|orbit| true_looks(&truth, orbit));
        // Relative roll, yaw and scale: 4, 2 and 2 pixels a year.
        for (at, px_per_year) in [(0, 4.0), (2, 2.0), (3, 2.0)] {
            let change = |line: usize| after[line][at] - before[line][at];
            let rate = (change(1) - change(0)) / years;
            assert!(
                (rate / PIXEL - px_per_year).abs() < 0.25,
                "{}",
                rate / PIXEL
            );
            let found = series.series.drifts[6 + at].rate;
            let sigmas = (found.value * CalibrationSeries::YEAR_S - rate)
                / (found.sigma * CalibrationSeries::YEAR_S);
            assert!(sigmas.abs() < 4.0, "{seed}, {at}: {sigmas}");
        }
        errors(&series, &truth, &mut sums);
        // The date lies between the first orbits: 0.3 pixels are a fraction of a year.
        assert!(
            series.findings().iter().any(|of| of.contains("drift of")
                && of.contains("reaches 0.3 px on 2018-1")
                || of.contains("on 2019-0")),
            "{:?}",
            series.findings()
        );
        let page = calibration_series_page(&series).unwrap();
        assert!(page.contains("recalibrate") && page.contains("Drift of all parameters"));
    }
    for (index, of) in sums.iter().enumerate() {
        let largest = of.iter().fold(0.0_f64, |most, of| most.max(of.abs()));
        assert!(largest < 4.5, "{index}: {largest}");
    }
}

/// Errors of tie points in the calibrated orbit over their stated standard deviations: east, north, up.
fn place_errors(of: &Calibrated, sums: &mut [Vec<f64>; 3]) {
    let truth = of.truth();
    let text = fs::read_to_string(of.orbits[0].join("points.csv")).unwrap();
    let mut rows = text.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let at = |name: &str| header.iter().position(|of| *of == name).unwrap();
    for row in rows.filter(|row| row[at("kind")] == "tie" && !row[at("sigma_up_m")].is_empty()) {
        let number = |name: &str| row[at(name)].parse::<f64>().unwrap();
        let [longitude, latitude] =
            ["longitude_deg", "latitude_deg"].map(|name| number(name).to_radians());
        let place_m = spherical_to_xyz_m(longitude, latitude, number("radius_m"));
        let true_m = truth["orbits"]["o01"]["points_m"][row[at("point")]].clone();
        let true_m: [f64; 3] = serde_json::from_value(true_m).unwrap();
        let off_m = local_axes(&place_m) * (place_m - Vector3::from(true_m));
        for (axis, name) in ["sigma_east_m", "sigma_north_m", "sigma_up_m"]
            .iter()
            .enumerate()
        {
            sums[axis].push(off_m[axis] / number(name));
        }
    }
}

/// Eight seeds: errors of 1000 m and 25 mdeg, tie points that scatter by 0.3 pixels, and profiles with shared errors.
#[test]
fn tie_points_are_as_near_the_truth_as_stated() {
    let mut sums: [Vec<f64>; 3] = Default::default();
    for seed in 1..=8 {
        let of = Calibrated::of(seed, 1, 0.0);
        place_errors(&of, &mut sums);
        let result = json(&of.orbits[0].join("calibration.json"));
        let steps = result["steps"].as_array().unwrap();
        let across_px = |step: &Value| {
            let cameras = step["figures"]["ties"]["cameras_px"].as_array().unwrap();
            let across = cameras.iter().map(|of| of[0].as_f64().unwrap());
            across.fold(0.0, f64::max)
        };
        let [before, after] = [&steps[0], &steps[steps.len() - 1]].map(across_px);
        // Half of 0.3 pixels times √2 are left in each of two lines.
        assert!(
            after < 0.3 && before > 5.0 * after,
            "{seed}: {before} {after}"
        );
    }
    let [east, north, up] = sums.map(|of| rms(&of));
    let plan = (0.5 * (east * east + north * north)).sqrt();
    println!("east {east:.2}, north {north:.2}, up {up:.2}");
    assert!((0.8..1.25).contains(&plan), "{east} {north}");
    assert!((0.8..1.25).contains(&up), "{up}");
}

fn refused(folders: &[PathBuf], words: &[&str]) {
    let error = calibration_series(folders).unwrap_err().to_string();
    for word in words {
        assert!(error.contains(word), "{error}");
    }
}

/// A calibration of a scene's file, below a folder.
fn calibrate(file: &Path, out: &Path) -> PathBuf {
    let config = CalibrationConfig::load(file).unwrap().config;
    run_into(Task::Calibration(&config), out, false).unwrap();
    out.join(&config.calibration)
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let of = Calibrated::of(7, 2, 0.0);
    let [first, second] = [0, 1].map(|at| of.orbits[at].clone());
    refused(
        std::slice::from_ref(&first),
        &["only one valid calibration"],
    );
    refused(
        &[first.clone(), first.clone()],
        &["out/o01", "the same orbit as those of o01"],
    );
    let empty = of.folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    refused(&[first.clone(), empty], &["empty"]);

    // An invalid one: no laser control.
    let scene = of.folder.path().join("scene");
    let text = fs::read_to_string(scene.join("o02.toml")).unwrap();
    let at = text.find("[control]").unwrap();
    let blind = text[..at].replace("\"o02\"", "\"blind\"");
    fs::write(scene.join("blind.toml"), blind).unwrap();
    let blind = calibrate(&scene.join("blind.toml"), &of.folder.path().join("out"));
    refused(&[blind.clone(), first.clone()], &["blind", "invalid"]);
    let series = calibration_series(&[first.clone(), blind, second.clone()]).unwrap();
    assert_eq!(
        series.not_used,
        [("blind".to_owned(), "the calibration is invalid")]
    );

    // Lines of another camera: other names in the support data.
    let other = of.folder.path().join("other");
    write_calibration_scene(&other, 1).unwrap();
    for file in ["i864_s1", "i864_s2", "i818_s1", "i818_s2"] {
        let path = other.join(format!("isd/{file}.json"));
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace("STEREO LINE", "OTHER LINE")).unwrap();
    }
    let other = calibrate(
        &other.join("calibration.toml"),
        &of.folder.path().join("out"),
    );
    refused(
        &[first.clone(), other],
        &["OTHER LINE S1, OTHER LINE S2", "STEREO LINE S1"],
    );

    // A changed file.
    let path = second.join("calibration.json");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        text.replacen("\"valid\": true", "\"valid\": false", 1),
    )
    .unwrap();
    refused(&[first, second], &["calibration.json"]);
}
