//! Registration of real laser shots: LOLA footprints in the LROC pair of ISIS's lidar tests.
//!
//! The data hold three sets of measures of the same shots in the same two images. Those of
//! `LidarTest_MultipleCsv.json` belong to the support data of the pair. Those of `lidarData.json`, the network
//! of the bundle test, were computed with another pointing, which differs by one constant shift in each
//! image: the support data cannot give that shift, only its constancy.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

mod common;
#[path = "common/lunar_pair.rs"]
mod lunar_pair;

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    geom::{
        ellipsoid::spherical_to_xyz_m,
        pushbroom::{Detector, Pose, Projector, SampledOrientation},
        statistics::Summary,
    },
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use lunar_pair::{FOLDER, attitude, inertial_position, moon_matrix, shots, times};
use nalgebra::Vector3;
use serde_json::Value;

const SERIALS: [&str; 2] = ["LRO/1/286265995:36824/NACL", "LRO/1/286272781:34203/NACL"];

/// One image of the pair with what its support data say.
struct Image {
    orientation: SampledOrientation,
    detector: Detector,
    lines: f64,
    distortion_per_mm2: f64,
    pixels_per_mm: f64,
}

impl Image {
    fn read(path: &Path) -> Self {
        let support: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        let number = |pointer: &str| support.pointer(pointer).unwrap().as_f64().unwrap();
        let (start_s, period_s) = (
            number("/starting_ephemeris_time"),
            number("/line_scan_rate/0/2"),
        );
        let lines = number("/image_lines");
        let pointing = &support["instrument_pointing"];
        let samples: Vec<(f64, Pose)> = times(pointing)
            .iter()
            .map(|et_s| {
                let to_moon = moon_matrix(&support["body_rotation"], *et_s);
                let pose = Pose {
                    position_m: to_moon * inertial_position(&support["instrument_position"], *et_s),
                    mars_to_camera: attitude(pointing, *et_s) * to_moon.transpose(),
                };
                ((et_s - start_s) / period_s - 0.5 * lines, pose)
            })
            .collect();
        let pixels_per_mm = number("/focal2pixel_samples/2");
        Self {
            orientation: SampledOrientation::new(&samples).unwrap(),
            detector: Detector {
                focal_length_px: number("/focal_length_model/focal_length") * pixels_per_mm,
                // The centre of the first pixel is 0.5 there, as here.
                boresight_sample: number("/detector_center/sample"),
                sample_sense: -1.0,
                samples: number("/image_samples"),
            },
            lines,
            distortion_per_mm2: number("/optical_distortion/lrolrocnac/coefficients/0"),
            pixels_per_mm,
        }
    }

    /// Line and sample as ISIS counts them: 1 at the centre of the first pixel.
    fn place(&self, point_m: &Vector3<f64>) -> [f64; 2] {
        let projector = Projector::new(&self.orientation, self.lines).unwrap();
        let solution = projector.project(point_m).unwrap();
        let y_px = self.detector.focal_px(&solution.camera_m).unwrap().y;
        // The camera's own distortion: undistorted = distorted / (1 + k · distorted²), in millimetres.
        let ideal_mm = y_px / self.pixels_per_mm;
        let distorted_mm = (0..20).fold(ideal_mm, |seen: f64, _| {
            ideal_mm * (1.0 + self.distortion_per_mm2 * seen * seen)
        });
        let sample = self.detector.sample(distorted_mm * self.pixels_per_mm);
        [solution.x + 0.5 * self.lines + 0.5, sample + 0.5]
    }

    fn shows(&self, [line, sample]: [f64; 2]) -> bool {
        (0.5..=self.lines + 0.5).contains(&line)
            && (0.5..=self.detector.samples + 0.5).contains(&sample)
    }
}

fn images(folder: &Path) -> [Image; 2] {
    ["lidarObservationImage1.isd", "lidarObservationImage2.isd"]
        .map(|name| Image::read(&folder.join(FOLDER).join(name)))
}

/// Measured minus projected line and sample of every measure of `file`, by image, and the number of points.
fn differences(folder: &Path, file: &str) -> ([Vec<[f64; 2]>; 2], usize) {
    let images = images(folder);
    let document: Value =
        serde_json::from_str(&fs::read_to_string(folder.join(file)).unwrap()).unwrap();
    let points = document["points"].as_array().unwrap();
    let mut found = [Vec::new(), Vec::new()];
    for point in points {
        let number = |key: &str| point[key].as_f64().unwrap();
        let point_m = spherical_to_xyz_m(
            number("longitude") * RADIANS_PER_DEGREE,
            number("latitude") * RADIANS_PER_DEGREE,
            number("radius") * METRES_PER_KM,
        );
        for measure in point["measures"].as_array().unwrap() {
            let serial = measure["serialNumber"].as_str().unwrap();
            let image = SERIALS.iter().position(|known| *known == serial).unwrap();
            let [line, sample] = images[image].place(&point_m);
            let read = |key: &str| measure[key].as_f64().unwrap();
            found[image].push([read("line") - line, read("sample") - sample]);
        }
    }
    (found, points.len())
}

fn column(differences: &[[f64; 2]], index: usize) -> Summary {
    let values: Vec<f64> = differences.iter().map(|pair| pair[index]).collect();
    Summary::of(&values)
}

fn data(test: &str) -> Option<PathBuf> {
    let folder = common::real_data(FOLDER, test)?;
    folder.ancestors().nth(2).map(Path::to_path_buf)
}

fn largest(differences: &[[f64; 2]], index: usize) -> f64 {
    let sizes = differences.iter().map(|pair| pair[index].abs());
    sizes.fold(0.0, f64::max)
}

#[test]
fn shots_fall_on_the_measures_that_belong_to_the_support_data() {
    let Some(root) = data("real registration") else {
        return;
    };
    let (found, shots) = differences(&root, "isis_lidar/lrolola2isis/LidarTest_MultipleCsv.json");
    assert_eq!(shots, 53);
    for differences in &found {
        assert_eq!(differences.len(), 53);
        // Lines and pixels: attitudes 0.2 s apart, joined by arcs there and by cubics here.
        assert!(largest(differences, 0) < 0.05 && largest(differences, 1) < 0.05);
    }
    // The other file of the same shots has nine measures in the second image up to 1.8 samples away.
    let (found, _) = differences(&root, "isis_lidar/lrolola2isis/Lrolola2isisTruth.json");
    assert!(found.iter().all(|image| largest(image, 0) < 0.05)); // lines, as above
    assert!(largest(&found[0], 1) < 0.05);
    let within_a_pixel = found[1].iter().filter(|pair| pair[1].abs() < 1.0);
    assert_eq!(within_a_pixel.count(), 44);
    assert!(largest(&found[1], 1) < 1.9);
}

#[test]
fn shots_fall_on_the_measures_of_the_network_but_for_one_shift_in_each_image() {
    let Some(root) = data("real registration of the network") else {
        return;
    };
    let (found, shots) = differences(&root, "isis_lidar/LidarNetwork/lidarData.json");
    assert_eq!(shots, 52);
    // Lines and samples by which the network's pointing differs from that of the support data.
    for (differences, shift) in found.iter().zip([[-13.223, -2.796], [-18.615, -2.533]]) {
        let summaries = [0, 1].map(|index| column(differences, index));
        for (summary, shift) in summaries.iter().zip(shift) {
            assert!((summary.mean - shift).abs() < 0.005, "{summary:?}"); // three printed digits
            let farthest = (summary.max - summary.mean).max(summary.mean - summary.min);
            assert!(farthest < 0.05, "{summary:?}"); // arcs against cubics, as above
        }
    }
}

#[test]
fn the_images_show_the_shots_that_were_measured() {
    let Some(root) = data("real registration, all shots") else {
        return;
    };
    let (_, measured) = differences(&root, "isis_lidar/lrolola2isis/LidarTest_MultipleCsv.json");
    let shots = shots(&root.join(FOLDER).join("lidarPoints.csv"));
    assert_eq!(shots.len(), 105);
    for image in images(&root) {
        let shown = shots
            .iter()
            .filter(|shot| image.shows(image.place(&shot.footprint.xyz_m)));
        assert_eq!(shown.count(), measured);
    }
}
