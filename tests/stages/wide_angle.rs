//! The wide-angle images of the synthetic mission: orientation and places of laser shots against its truth,
//! which comes from the formula of the instrument kernel and from no camera model of the program.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{collections::BTreeMap, fs, path::Path};

use areograph::{
    config::{Document as _, SiteConfig},
    geom::{
        attitude::{matrix_of_spice_quaternion, rotation_vector},
        light_time::LightTime,
    },
    spice::{KernelSet, Session},
    stages::{
        fit_sensor_model::fit_sensor_model,
        oriented::OrientedImage,
        sample_orientation::{Orientation, sample_orientation},
        tag_times::{ImageTimes, tag_times},
    },
};
use common::mission::{mission, site_run};
use nalgebra::Vector3;
use serde_json::Value;

fn site() -> SiteConfig {
    let path = mission().join("sites/gusev_context.toml");
    SiteConfig::load(&path).unwrap().config
}

fn truth() -> Value {
    serde_json::from_slice(&fs::read(mission().join("truth.json")).unwrap()).unwrap()
}

/// The images with their orientation by the true orbit.
fn images(site: &SiteConfig) -> Vec<(ImageTimes, Orientation)> {
    let metakernel = mission().join("kernels/gsfc_wa.tm");
    let session = Session::open(&KernelSet::from_metakernel(&metakernel).unwrap()).unwrap();
    let times = tag_times(&site.images, &session).unwrap();
    times
        .into_iter()
        .map(|image| {
            let orientation = sample_orientation(
                &session,
                &image,
                &site.kernels,
                &site.pointing,
                &site.orientation,
            );
            (image, orientation.unwrap())
        })
        .collect()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| value[axis].as_f64().unwrap())
}

#[test]
fn orientation_comes_back() {
    let truth = truth();
    let mut site = site();
    site.orientation.light_time = LightTime::None; // the truth tells where the bus was
    let images = images(&site);
    let cameras: Vec<&str> = images
        .iter()
        .map(|(image, _)| &*image.instrument.id)
        .collect();
    assert_eq!(cameras, ["moc_wa_red", "moc_wa_blue", "moc_wa_red"]);
    for ((_, orientation), truth) in images.iter().zip(truth["wide_angle"].as_array().unwrap()) {
        assert_eq!(truth["id"], orientation.image.as_str());
        for (k, sample) in orientation.samples.iter().enumerate() {
            let apart_s = sample.et.seconds() - truth["epochs_et_s"][k].as_f64().unwrap();
            assert!(apart_s.abs() < 1e-6, "{apart_s} s"); // the clock count of 1/256 s is exact
            let true_m = vector(&truth["position_iau2000_m"][k]);
            let apart_m = (sample.position.xyz_m - true_m).norm();
            assert!(apart_m < 1e-3, "{} {k}: {apart_m} m", orientation.image);
            let quaternion = &truth["camera_to_mars_quaternion_wxyz"][k];
            let components = std::array::from_fn(|i| quaternion[i].as_f64().unwrap());
            let turned =
                sample.camera_to_mars.matrix() * matrix_of_spice_quaternion(components).transpose();
            let apart_rad = rotation_vector(&turned).norm();
            assert!(
                apart_rad < 1e-8,
                "{} {k}: {apart_rad} rad",
                orientation.image
            );
        }
    }
}

/// Samples of an ISD look where ours do, by the formulas of usgscsm (`computeDistortedFocalPlaneCoordinates`,
/// `removeDistortion`, `createCameraLookVector`).
fn camera_model_looks_there(isd: &Value, image: &ImageTimes) {
    let value = |pointer: &str| isd.pointer(pointer).and_then(Value::as_f64).unwrap();
    let detector = image.detector();
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let sample = share * value("/image_samples");
        let pixel = sample * value("/detector_sample_summing") + value("/starting_detector_sample");
        let x_mm = (0.0 - value("/detector_center/line")) / value("/focal2pixel_lines/1");
        let y_mm = (pixel - value("/detector_center/sample")) / value("/focal2pixel_samples/2");
        let square = x_mm * x_mm + y_mm * y_mm;
        let [k0, k1, k2] =
            [0, 1, 2].map(|k| value(&format!("/optical_distortion/radial/coefficients/{k}")));
        let kept = 1.0 - (k0 + square * (k1 + square * k2));
        let focal_length_mm = value("/focal_length_model/focal_length");
        let look = Vector3::new(x_mm * kept, y_mm * kept, focal_length_mm) / focal_length_mm;
        let off_px = (look - detector.look(sample)).norm() * detector.focal_length_px;
        assert!(
            off_px < 0.01,
            "{}: {off_px} px at sample {sample}",
            image.id
        ); // what three coefficients leave
    }
}

/// Ground points of the shots of `file`, by record and shot.
fn ground_m(products: &Path, file: &str) -> BTreeMap<(u64, u64), Vector3<f64>> {
    let table = fs::read_to_string(products.join("footprints.csv")).unwrap();
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| header.iter().position(|column| *column == name).unwrap();
    let columns = ["source_file", "record", "shot", "x_m", "y_m", "z_m"].map(at);
    lines
        .map(|line| line.split(',').collect::<Vec<&str>>())
        .filter(|row| row[columns[0]] == file)
        .map(|row| {
            let [_, record, shot, x, y, z] = columns.map(|column| row[column]);
            let place = [x, y, z].map(|value| value.parse().unwrap());
            (
                (record.parse().unwrap(), shot.parse().unwrap()),
                Vector3::from(place),
            )
        })
        .collect()
}

/// The site chooses the orbit nearest to the mean of three, and knows which profile no image goes with.
fn chooses_among_rivals(products: &Path) {
    let manifest: Value =
        serde_json::from_slice(&fs::read(products.join("manifest.json")).unwrap()).unwrap();
    let sets = manifest["kernel_choice"].as_array().unwrap();
    let names: Vec<&str> = sets
        .iter()
        .map(|set| set["set"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["nav", "gsfc", "ipng"]);
    let distance_m = |set: &Value| set["distance_rms_m"].as_f64().unwrap();
    let nearest = sets
        .iter()
        .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))
        .unwrap();
    for set in sets {
        assert_eq!(set["chosen"] == true, set == nearest, "{set}");
    }
    let ranges: Value =
        serde_json::from_slice(&fs::read(products.join("ranges.json")).unwrap()).unwrap();
    let simultaneous: Vec<usize> = ranges["profiles"]
        .as_array()
        .unwrap()
        .iter()
        .map(|profile| profile["simultaneous"].as_array().unwrap().len())
        .collect();
    // Two images of the first day, none of the second, one of the third.
    assert_eq!(simultaneous, [2, 0, 1]);
}

#[test]
fn shots_lie_where_the_instrument_kernel_sees_them() {
    let run = site_run("gusev_context");
    let (site, truth) = (site(), truth());
    chooses_among_rivals(&run);
    for (image, orientation) in images(&site) {
        let model = fit_sensor_model(&orientation, &site.orientation, None).unwrap();
        let oriented = OrientedImage::of(&image, &orientation, &model).unwrap();
        let told = truth["wide_angle"].as_array().unwrap();
        let told = told
            .iter()
            .find(|told| told["id"] == image.id.as_str())
            .unwrap();
        let file = if image.id == "E02-01454" {
            "ap19043k.b"
        } else {
            "ap18933l.b"
        };
        let ground_m = ground_m(&run, file);
        let mut compared = 0;
        for shot in told["shots"].as_array().unwrap() {
            let number = |key: &str| shot[key].as_f64().unwrap();
            let key = (
                shot["record"].as_u64().unwrap(),
                shot["shot"].as_u64().unwrap(),
            );
            let Some(point_m) = ground_m.get(&key) else {
                continue;
            };
            let projector = oriented.projector().unwrap();
            let seen = projector.project(point_m).unwrap();
            let y_px = oriented.detector.focal_px(&seen.camera_m).unwrap().y;
            let line = seen.x + 0.5 * oriented.lines();
            let off_px = [
                line - number("line"),
                oriented.detector.sample(y_px) - number("sample"),
            ];
            // Pixels of 240 to 480 m: footprints in frames are good to some decimetres, and their files to
            // 1e-6 degrees; polynomials of second order leave a metre over these 34 s.
            let limit_px = 0.02;
            assert!(
                off_px.iter().all(|px| px.abs() < limit_px),
                "{} {off_px:?}",
                image.id
            );
            compared += 1;
        }
        assert!(compared > 100, "{}: {compared} shots", image.id);
        let isd = run.join(format!("images/{}/isd.json", image.id));
        camera_model_looks_there(
            &serde_json::from_slice(&fs::read(isd).unwrap()).unwrap(),
            &image,
        );
    }
}
