//! The stage `register`, on a small site made by hand and on the synthetic mission.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;
use crate::common::products_site as fixture;

#[allow(dead_code, reason = "these tests make no products of the small site")]
use std::{fs::File, path::Path, sync::atomic::AtomicBool};

use areograph::{
    constants::SPEED_OF_LIGHT_M_S,
    geom::{
        pushbroom::{CameraModel, ExteriorOrientation},
        statistics::Summary,
    },
    stages::register::{ImageRegistration, Method, register},
};
use areograph_testing::replace;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt32Type};
use common::case::Case;
use fixture::{SHOTS, Site, line_offset, move_under_the_camera};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

fn registered(site: &Site) -> ImageRegistration {
    register(
        &site.times,
        &site.orientation,
        &site.model,
        &site.footprints,
        &site.profiles,
        &site.config.registration,
        &AtomicBool::new(false),
    )
    .unwrap()
}

/// The small site with its footprints where the camera looks.
fn under_the_camera() -> Site {
    let mut site = Site::small();
    move_under_the_camera(&mut site.footprints, &site.model);
    site
}

#[test]
fn footprints_under_the_boresight_come_back_to_their_lines() {
    let site = under_the_camera();
    for (_, model) in CameraModel::WORDS {
        let mut site_of_model = under_the_camera();
        site_of_model.model.model = model;
        let found = registered(&site_of_model);
        assert_eq!(found.points.len(), SHOTS as usize);
        assert!(found.rejected.is_empty());
        if model == CameraModel::FirstOrder {
            continue; // the path bends by 10 m, which it does not know
        }
        for (row, line) in found.points.line.iter().enumerate() {
            let line_offset = line_offset(row);
            let expected = line_offset + 0.5 * f64::from(site.times.line_times.lines());
            let extrapolated = line_offset.abs() > 768.0;
            assert_eq!(found.points.extrapolated.at(row), extrapolated);
            // Lines: polynomials and samples agree on a bend of 1e-6 rad to a few centimetres of 50 m lines
            // within the image; beyond it the samples go on straight.
            let tolerance = if extrapolated { 0.5 } else { 0.01 };
            assert!(
                (line - expected).abs() < tolerance,
                "{model:?}: {line} for {expected}"
            );
            assert!(found.points.residual_px.at(row).abs() < 1e-6); // pixels
        }
        // Detector 1024 lies on the boresight: sample 128 of 256 that sum eight.
        assert!((found.points.sample.at(20) - 128.0).abs() < 0.01);
        // 1280 of 1536 lines were delivered.
        let inside = found
            .points
            .line
            .iter()
            .filter(|line| (0.0..=1280.0).contains(line));
        assert_eq!(found.points.inside_count(), inside.count());
    }
}

#[test]
fn iterations_are_counted_for_every_point_within_the_lines() {
    let found = registered(&under_the_camera());
    for run in &found.methods {
        assert_eq!(run.points, 39); // 40 lines apart within 1536 lines
        assert!(run.rejected.is_empty());
        assert_eq!(u64::from(run.evaluations.n), run.points);
        let slowest = run.mean_step_lines.len() as f64;
        assert!((run.evaluations.max - slowest).abs() < 0.5); // whole numbers
        assert!(run.mean_step_lines.last().unwrap() < &0.1);
    }
    let second = |method: Method| {
        let mut runs = found.methods.iter();
        let run = runs.find(|run| run.method == method && run.model == CameraModel::SecondOrder);
        run.unwrap().evaluations.mean * 39.0
    };
    let points = &found.points;
    for (method, each) in [
        (Method::FrameFirst, &points.evaluations_frame_first),
        (Method::FixedPoint, &points.evaluations_fixed_point),
    ] {
        assert!((f64::from(each.iter().sum::<u32>()) - second(method)).abs() < 1e-9); // one count, told twice
        let untried = each.iter().zip(&points.extrapolated);
        assert!(
            untried
                .into_iter()
                .all(|(count, beyond)| (count == 0) == beyond)
        );
    }
}

#[test]
fn what_has_no_place_is_counted_by_reason() {
    let mut site = under_the_camera();
    // The other side of Mars, the sky, and no place at all.
    let of = &mut site.footprints;
    let here = of.row(3);
    let there_rad = here.longitude_rad + std::f64::consts::PI;
    replace(&mut of.longitude_rad, 3, there_rad);
    replace(&mut of.latitude_rad, 3, -here.latitude_rad);
    replace(&mut of.radius_crossover_m, 4, 4.5e6);
    replace(&mut of.radius_crossover_m, 5, f64::NAN);
    let found = registered(&site);
    assert_eq!(found.points.len(), SHOTS as usize - 3);
    let rejected: Vec<(&str, u64)> = found.rejected.iter().map(|(k, v)| (&**k, *v)).collect();
    assert_eq!(
        rejected,
        [
            ("behind the camera", 1),
            ("beyond the horizon", 1),
            ("not a finite number", 1)
        ]
    );
    assert!(!found.points.row.iter().any(|row| (3..6).contains(&row)));
    assert_eq!(found.profiles[0].points, SHOTS - 3);
}

#[test]
fn repeated_shots_and_empty_profiles_are_nothing_special() {
    let mut site = under_the_camera();
    site.profiles[0].rows.insert(8, 7);
    let mut empty = site.profiles[0].clone();
    empty.rows.clear();
    site.profiles.insert(0, empty);
    let found = registered(&site);
    assert_eq!(found.points.len(), SHOTS as usize + 1);
    assert_eq!(found.profiles[0].points, 0);
    assert_eq!(found.profiles[0].shot_spacing_lines, None);
    let twice: Vec<f64> = (7..9).map(|index| found.points.line.at(index)).collect();
    assert!(twice[0].to_bits() == twice[1].to_bits());
    site.profiles.clear();
    let none = registered(&site);
    assert!(none.points.is_empty() && none.rejected.is_empty());
    assert!(none.methods.iter().all(|run| run.points == 0));
}

#[test]
fn every_profile_is_tried_in_an_image_that_sees_nothing() {
    let mut site = under_the_camera();
    for sample in &mut site.orientation.samples {
        sample.position.xyz_m = site
            .model
            .rotation_vector_orientation()
            .pose(0.0)
            .position_m;
    }
    // A camera that stands still has no lines.
    site.model = areograph::stages::fit_sensor_model::fit_sensor_model(
        &site.orientation,
        &site.config.orientation,
        None,
    )
    .unwrap();
    for fit in &mut site.model.second_order.position_m {
        let constant = fit.polynomial.value(0.0);
        fit.polynomial = areograph::geom::polynomial::Polynomial::new(vec![constant]);
    }
    let found = registered(&site);
    assert!(found.points.is_empty());
    let reasons: Vec<&String> = found.rejected.keys().collect();
    assert_eq!(reasons, ["the camera moves along its detector line"]);
    assert_eq!(found.rejected.values().sum::<u64>(), u64::from(SHOTS));
}

fn table(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    builder.build().unwrap().next().unwrap().unwrap()
}

/// The laser of the mission looks along the bus, the camera 1.25 mrad ahead of it: every shot of an image's
/// own profile lies the same number of lines before the line that is exposed when it is fired.
#[test]
fn shots_lie_on_the_lines_of_their_times() {
    let case = Case::new();
    case.replace("site.toml", "nav.tm", "gsfc.tm"); // the mission's true orbit
    case.stages_run();
    let found = table(&case.path("out/case/registration.parquet"));
    let footprints = table(&case.path("out/case/footprints.parquet"));
    let orientation: Value =
        serde_json::from_slice(&case.read("out/case/images/image/orientation.json")).unwrap();
    let times = &orientation["times"];
    let start_s = times["start_et_s"].as_f64().unwrap();
    let period_s = times["line_period_s"].as_f64().unwrap();
    let numbers = |table: &RecordBatch, name: &str| -> Vec<f64> {
        let column = table.column_by_name(name).unwrap();
        column.as_primitive::<Float64Type>().values().to_vec()
    };
    let rows = found.column_by_name("footprint_row").unwrap();
    let rows = rows.as_primitive::<UInt32Type>().values();
    let shot_s = numbers(&footprints, "et_s");
    let inside = found.column_by_name("inside").unwrap().as_boolean().clone();
    let apart: Vec<f64> = numbers(&found, "line")
        .iter()
        .zip(rows)
        .zip(&inside)
        .filter(|(_, inside)| inside.unwrap())
        .map(|((line, row), _)| line - (shot_s[*row as usize] - start_s) / period_s)
        .collect();
    let apart = Summary::of(&apart);
    assert!(apart.n > 100);
    assert!(apart.standard_deviation < 0.05); // lines: records round coordinates to 0.06 m, lines are 4.4 m long
    let range_m = Summary::of(&numbers(&found, "range_m")).mean;
    // The line's plane leans forward by 1.256 mrad (mounting in the addendum of the instrument kernel). A circular
    // orbit of radius 3773 km flies 3369 m/s, 13 m/s more against the turning ground, and turns by 0.893 mrad/s.
    let (ahead_rad, speed_m_s) = (0.001_256, 3_382.0 - 0.000_893 * range_m);
    // Light needs 0.9 lines from the ground to the camera.
    let expected = (range_m / SPEED_OF_LIGHT_M_S - ahead_rad * range_m / speed_m_s) / period_s;
    // Lines: four digits each of lean and speed, 0.1 % of 107 lines both.
    assert!(
        (apart.mean - expected).abs() < 0.25,
        "{} for {expected}",
        apart.mean
    );
}

/// The shots that the site's registration lists, and how many of them lie inside the image.
fn listed(case: &Case) -> [usize; 2] {
    let table = table(&case.path("out/case/registration.parquet"));
    let inside = table.column_by_name("inside").unwrap().as_boolean().clone();
    [table.num_rows(), inside.true_count()]
}

/// Outlines come from the edges of the image on the ellipsoid, lines and samples of shots from the camera model.
#[test]
fn a_window_of_an_image_holds_the_shots_that_the_image_sees() {
    let case = Case::new();
    case.stages_run();
    let [listed_of_box, inside_of_box] = listed(&case);
    let edges = "longitude_deg = [87.5, 88.5]\nlatitude_deg = [4.0, 5.0]\n";
    case.replace("site.toml", edges, "image = \"image\"\n");
    assert!(case.stages_run().contains(&"outline_windows".to_owned()));
    assert_eq!(case.stages_run(), [""; 0]);
    let [listed_of_image, inside_of_image] = listed(&case);
    // Shots are 300 m apart along the track: terrain of some kilometres, seen 20° off nadir, moves either end of the image
    // by four of them.
    assert!(inside_of_box > 50 && inside_of_image.abs_diff(inside_of_box) <= 8);
    assert!(
        listed_of_image < inside_of_image + 8,
        "{listed_of_image} for {inside_of_image}"
    );
    case.replace(
        "site.toml",
        "image = \"image\"\n",
        "image = \"image\"\nmargin_km = 6.0\n",
    );
    case.stages_run();
    let [listed_of_margin, inside_of_margin] = listed(&case);
    assert!(listed_of_margin > listed_of_image + 20 && listed_of_margin < listed_of_box);
    // With a margin nothing is lost at the ends.
    assert_eq!(inside_of_margin, inside_of_box);
}
