//! Corners of an index held against kernels.

use std::{fs, path::Path, process::Command};

use areograph::{
    config::usual_instrument,
    geom::{attitude::matrix_of_spice_quaternion, pushbroom::Detector},
};
use nalgebra::Vector3;
use serde_json::Value;

use super::{
    common::{json, mission::mission},
    stdout, text,
};

/// Radius of Mars where the images are, metres: to 2 km, which is 1 km aside 22° off nadir.
const RADIUS_M: f64 = 3_393_000.0;

/// Longitude and latitude of the ground that a pose of the truth sees in a direction, degrees.
fn seen_deg(image: &Value, epoch: usize, look: &Vector3<f64>) -> [f64; 2] {
    let number = |value: &Value| value.as_f64().unwrap();
    let position_m = Vector3::from_fn(|axis, _| number(&image["position_iau2000_m"][epoch][axis]));
    let quaternion = &image["camera_to_mars_quaternion_wxyz"][epoch];
    let to_mars = matrix_of_spice_quaternion([0, 1, 2, 3].map(|part| number(&quaternion[part])));
    let direction = (to_mars * look).normalize();
    let along_m = position_m.dot(&direction);
    let inside = along_m.powi(2) - position_m.norm_squared() + RADIUS_M.powi(2);
    let ground_m = position_m - direction * (along_m + inside.sqrt());
    let ground = ground_m.normalize();
    [
        ground.y.atan2(ground.x).to_degrees().rem_euclid(360.0),
        ground.z.asin().to_degrees(),
    ]
}

/// A row of the index for an image of the mission, its corners moved north.
fn row(image: &Value, north_deg: f64) -> String {
    let detector = Detector::new(usual_instrument(), 2, 0, 1024);
    let looks = [0.0, detector.samples].map(|sample| detector.look(sample));
    let last = image["position_iau2000_m"].as_array().unwrap().len() - 1;
    let corner = |epoch, edge: usize| {
        let [longitude, latitude] = seen_deg(image, epoch, &looks[edge]);
        format!("{:.2},{:.2}", 360.0 - longitude, latitude + north_deg)
    };
    let [ul, ur, ll, lr] =
        [(0, 0), (0, 1), (last, 0), (last, 1)].map(|(epoch, edge)| corner(epoch, edge));
    let centre = corner(last / 2, 0);
    let id = image["id"].as_str().unwrap().replace('-', "/");
    let clock = if id == "E02/01301" {
        "669166528:118"
    } else {
        "669788295:103"
    };
    format!(
        "\"MGSC_1001\",\"X/X.IMQ\",\"{id}\",\"2001-03-15T23:34:57.72\",\"MOC-NA\",\"N/A \",1024,8064,2,2,3.0,1.0,10.0,40.0,\
         45.0,{centre},{ul},{ur},{ll},{lr},\"MAPPING\",\"MARS\",\"{clock}\",245.0,{},\
         \"6A\",\"30\",0,\"MOC-PRED-X-5\",3.0,24.0,380.0,3770.0,380.0,\"\",90.0,40.0,100.0,5.0,{centre},2e8,150.0,14.0,90.0,\"\",\"OK\",717\n",
        if id == "E02/01301" { 0.4821 } else { 0.7231 },
    )
}

fn searched(folder: &Path, rows: &str) -> (Vec<Value>, String) {
    let index = folder.join("cumindex.tab");
    fs::write(&index, rows).unwrap();
    let metakernel = mission().join("kernels/gsfc.tm");
    // Not quiet: warnings count.
    let mut search = Command::new(env!("CARGO_BIN_EXE_areograph"));
    search.args(["image", "search", text(&index), "--box", "80,100,-10,20"]);
    search.args(["--kernels", text(&metakernel), "--format", "geojson"]);
    let output = search.output().unwrap();
    let told = String::from_utf8(output.stderr.clone()).unwrap();
    let answer: Value = serde_json::from_str(&stdout(&output)).unwrap();
    (answer["features"].as_array().unwrap().clone(), told)
}

#[test]
fn corners_of_the_index_are_held_against_kernels_and_a_wrong_one_is_told() {
    let truth = json(&mission().join("truth.json"));
    let images = truth["images"].as_array().unwrap();
    let image = images
        .iter()
        .find(|image| image["id"] == "E02-01301")
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (right, told) = searched(folder.path(), &row(image, 0.0));
    // The index has hundredths of a degree, 0.6 km.
    let off_km = right[0]["properties"]["off_kernels_km"].as_f64().unwrap();
    assert!(off_km < 2.0, "{off_km} km; {told}");
    assert!(!told.contains("lie up to"), "{told}");
    let (wrong, told) = searched(folder.path(), &row(image, 0.6));
    // 0.6° of latitude are 35.5 km.
    let off_km = wrong[0]["properties"]["off_kernels_km"].as_f64().unwrap();
    assert!((off_km - 35.5).abs() < 2.0, "{off_km} km");
    assert!(
        told.contains("E02/01301: the corners are up to 3")
            && told.contains("the search allows 27.3 km"),
        "{told}"
    );
    // Another time than the kernels have.
    let (uncovered, told) = searched(
        folder.path(),
        &row(image, 0.0).replace("669166528", "679166528"),
    );
    assert_eq!(uncovered[0]["properties"]["off_kernels_km"], "");
    assert!(
        told.contains("the kernels cover none of the images"),
        "{told}"
    );
}
