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

use crate::common;
use areograph_testing::lunar_pair;

use std::path::{Path, PathBuf};

use areograph::geom::statistics::Summary;
use lunar_pair::{FOLDER, images, lidar_points, shots};

/// Measured minus projected line and sample of every measure of `file`, by image, and the number of points.
fn differences(folder: &Path, file: &str) -> ([Vec<[f64; 2]>; 2], usize) {
    let images = images(folder);
    let points = lidar_points(&folder.join(file));
    let mut found = [Vec::new(), Vec::new()];
    for point in &points {
        for (image, measured) in &point.measures {
            let [line, sample] = images[*image].place(&point.ground_m);
            found[*image].push([measured[0] - line, measured[1] - sample]);
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
