//! What `areograph report diff` says of two runs, and that it says it of what was really injected.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;
use crate::common::page;

pub(crate) mod fixture;

use std::fs;

use areograph::units::RADIANS_PER_ARCSECOND;
use common::{case::Case, number};
use fixture::{TURN_ARCSEC, after_a_first_run, copy_products, diff, turn_attitudes};
use serde_json::Value;

/// The image of the case.
const IMAGE: &str = "E02-02016";

/// The one site's difference between `before` and `out`.
fn difference(case: &Case) -> Value {
    let mut command = case.areograph();
    command.args(["report", "diff", "before", "out", "--json"]);
    let answer = common::mission::succeed(&mut command).stdout;
    let text = String::from_utf8(answer).unwrap();
    assert!(!text.contains("null"), "what is unknown is left out");
    let mut answer: Value = serde_json::from_str(&text).unwrap();
    common::assert_keeps_schema(&answer, "difference");
    assert_eq!(answer["sites"].as_array().unwrap().len(), 1);
    answer["sites"][0].take()
}

fn names(items: &Value) -> Vec<&str> {
    let items = items.as_array().unwrap().iter();
    items.map(|item| item["name"].as_str().unwrap()).collect()
}

fn assert_near(found: &Value, expected: f64, tolerance: f64) {
    let found = number(found);
    assert!(
        (found - expected).abs() <= tolerance,
        "{found}, expected {expected} ± {tolerance}"
    );
}

#[test]
fn a_turned_ck_is_found_and_nothing_else() {
    let case = after_a_first_run();
    turn_attitudes(&case);
    let ran = [
        "sample_orientation/image",
        "describe_kernels",
        "fit_sensor_model/image",
        "register/image",
        "check_beam",
        "publish",
    ];
    assert_eq!(case.stages_run(), ran);

    let found = difference(&case);
    assert_eq!(found["outcome"], "moved");
    assert_eq!(names(&found["kernels"]["changed"]), ["mgs_sc_scene.bc"]);
    assert_eq!(found["kernels"]["changed"][0]["role"], "CK");
    assert_eq!(names(&found["stages"]["changed"]), ran);
    assert_eq!(found["stages"]["unchanged"], 8);
    assert_eq!(found["configuration_changed"], false);
    assert_eq!(found["footprints"]["only_in_a"], 0);
    assert_eq!(found["footprints"]["only_in_b"], 0);
    let footprints = &found["footprints"]["movement"];
    assert_eq!(footprints["moved"], 0);
    assert_near(&footprints["distance_m"]["max"], 0.0, 0.0);
    assert!(
        found["profiles"]
            .as_array()
            .unwrap()
            .iter()
            .all(|profile| profile["changed"] == false)
    );

    let movement = &found["images"][0]["movement"];
    assert_eq!(movement["samples"].as_array().unwrap().len(), 31);
    assert_near(&movement["distance_m"]["max"], 0.0, 0.0);
    // 1 % is what the command is meant to be good for; clock ticks of 1/256 s leave 1e-4 arcsec.
    assert_near(
        &movement["turn_arcsec"]["mean"],
        TURN_ARCSEC,
        0.01 * TURN_ARCSEC,
    );
    assert_near(
        &movement["about_x_arcsec"]["mean"],
        TURN_ARCSEC,
        0.01 * TURN_ARCSEC,
    );
    assert_near(&movement["about_y_arcsec"]["max_abs"], 0.0, 0.01);
    assert_near(&movement["about_z_arcsec"]["max_abs"], 0.0, 0.01);
    // The image looks at nadir from this height, by the range of its boresight.
    let expected_m = TURN_ARCSEC * RADIANS_PER_ARCSECOND * boresight_range_m(&case);
    assert_near(
        &movement["pointing_ground_m"]["mean"],
        expected_m,
        0.01 * expected_m,
    );
    assert_near(
        &movement["boresight_ground_m"]["mean"],
        expected_m,
        0.01 * expected_m,
    );
}

/// Range of the middle of the image, from the product.
fn boresight_range_m(case: &Case) -> f64 {
    let path = case.path("before/case/images/image/orientation.parquet");
    let rows = areograph::products::read::read_samples(&path).unwrap();
    rows[15].boresight_range_m.unwrap()
}

#[test]
fn denser_sampling_moves_nothing_and_is_told() {
    let case = after_a_first_run();
    case.replace(
        "site.toml",
        "[orientation]",
        "[orientation]\nintervals = 60",
    );
    case.stages_run();
    let found = difference(&case);
    assert_eq!(found["outcome"], "nothing_moved");
    assert_eq!(found["images"][0]["samples_only_in_b"], 30);
    let limits = ["before", "out", "--limit-m", "0", "--limit-arcsec", "0"];
    let printed = diff(&case, &limits);
    assert!(
        printed.starts_with("exit 0\ncase: nothing moved\n"),
        "{printed}"
    );
    for told in [
        "\n  image image: not moved; not turned; 30 samples only in B\n",
        "\n  configuration: orientation.intervals – → 60\n",
        // The residuals of more samples have another root mean square.
        "\n  figures: pointing_rmse_rad ",
    ] {
        assert!(printed.contains(told), "{printed}");
    }
}

#[test]
fn another_order_of_images_is_told_by_the_configuration() {
    const FIRST: &str = "[[images]]\nid = \"image\"\nlabel = \"image.lbl\"\n";
    const SECOND: &str = "[[images]]\nid = \"second\"\nlabel = \"image.lbl\"\n";
    let case = Case::new();
    case.replace("site.toml", FIRST, &[FIRST, SECOND].concat());
    case.stages_run();
    copy_products(&case.path("out/case"), &case.path("before/case"));
    case.replace(
        "site.toml",
        &[FIRST, SECOND].concat(),
        &[SECOND, FIRST].concat(),
    );
    case.stages_run();
    let printed = diff(&case, &["before", "out"]);
    let told = "\n  configuration: images [\"image\", \"second\"] → [\"second\", \"image\"]\n";
    assert!(printed.contains(told), "{printed}");
}

#[test]
fn limits_on_the_movement_give_exit_code_5() {
    let case = after_a_first_run();
    turn_attitudes(&case);
    case.stages_run();
    let printed = diff(&case, &["before", "out", "--limit-arcsec", "19"]);
    assert!(
        printed.starts_with(
            "exit 5\ncase: BEYOND THE LIMIT: image image: the camera rotated by up to 20."
        ),
        "{printed}"
    );
    let printed = diff(&case, &["before", "out", "--limit-m", "30"]);
    assert!(printed.starts_with("exit 5\ncase: BEYOND THE LIMIT: image image: the boresight's ground point moved by up to 3"), "{printed}");
    let printed = diff(
        &case,
        &["before", "out", "--limit-m", "40", "--limit-arcsec", "21"],
    );
    assert!(
        printed.starts_with("exit 0\ncase: moved: pointing by up to 20."),
        "{printed}"
    );
    let printed = diff(&case, &["before", "out", "--limit-m", "-1"]);
    assert!(printed.starts_with("exit 2\n"), "{printed}");
}

#[test]
fn another_orbit_moves_the_camera_by_the_injected_difference() {
    let case = Case::new();
    case.replace("site.toml", "nav.tm", "gsfc.tm");
    case.stages_run();
    copy_products(&case.path("out/case"), &case.path("before/case"));
    case.replace("site.toml", "gsfc.tm", "nav.tm");
    let ran = [
        "check_ranges",
        "sample_orientation/image",
        "describe_kernels",
        "fit_sensor_model/image",
        "register/image",
        "check_beam",
        "publish",
    ];
    assert_eq!(case.stages_run(), ran);

    let found = difference(&case);
    assert_eq!(found["outcome"], "moved");
    assert_eq!(names(&found["kernels"]["added"]), ["mgs_nav_scene.bsp"]);
    assert_eq!(names(&found["kernels"]["removed"]), ["mgs_gsfc_scene.bsp"]);
    assert_eq!(found["configuration_changed"], true);
    assert_eq!(found["footprints"]["movement"]["moved"], 0);

    let truth = fs::read(common::mission::mission().join("truth.json")).unwrap();
    let truth: Value = serde_json::from_slice(&truth).unwrap();
    let mut profiles = truth["profiles"].as_array().unwrap().iter();
    let truth =
        &profiles.find(|profile| profile["image"] == IMAGE).unwrap()["orbit_differences"]["nav"];
    let movement = &found["images"][0]["movement"];
    for (index, axis) in ["radial_m", "along_m", "cross_m"].iter().enumerate() {
        let expected_m = number(&truth["radial_along_cross_m"][index]);
        // The truth holds in the middle; Hermite interpolation over 60 s leaves less than 1 mm. Over the
        // image's 12 s the difference swings by 0.1 sin(0.9e-3 · 6 s), 0.05 % of at most 18 m.
        assert_near(&movement["samples"][15][axis], expected_m, 1e-3);
        assert_near(&movement[axis]["mean"], expected_m, 1e-3);
        assert_near(&movement[axis]["max_abs"], expected_m.abs(), 0.01);
    }
    assert_near(&movement["turn_arcsec"]["max"], 0.0, 1e-6); // rounding of quaternions
    // With the other orbit the profile's residuals are those of the truth: half a decimetre for the ranges.
    let profile = found["profiles"]
        .as_array()
        .unwrap()
        .iter()
        .find(|profile| profile["changed"] == true)
        .unwrap();
    let mean_m = |run: &str| number(&profile[run]["range_minus_distance_m"]["mean"]);
    let expected_m = number(&truth["expected_range_minus_distance_mean_m"]);
    assert!((mean_m("b") - mean_m("a") - expected_m).abs() < 0.05);
}

#[test]
fn equal_runs_say_so() {
    let case = after_a_first_run();
    let mut command = case.run();
    command.arg("--force");
    assert!(case.outcome(command).starts_with("exit 0"));
    let printed = diff(
        &case,
        &["before", "out", "--limit-m", "0", "--limit-arcsec", "0"],
    );
    assert!(
        printed.starts_with("exit 0\ncase: nothing changed\n"),
        "{printed}"
    );
    assert_eq!(printed.lines().count(), 4, "{printed}");
    assert_eq!(difference(&case)["outcome"], "nothing_changed");
    // The folder of the site, instead of the one that holds it.
    assert_eq!(diff(&case, &["before/case", "out/case"]), printed);
}

#[test]
fn a_clock_correction_that_turns_mars_moves_footprints_and_names_its_key() {
    let case = after_a_first_run();
    case.replace(
        "site.toml",
        "[pedr]",
        "[altimeter_clock]\nscope = \"both\"\n[pedr]",
    );
    case.stages_run();
    let found = difference(&case);
    let keys = serde_json::json!([{"what": "altimeter_clock.scope", "b": "\"both\""}]);
    assert_eq!(found["configuration"], keys);
    assert_eq!(found["biases"][0]["what"], "mola_clock.scope");
    let movement = &found["footprints"]["movement"];
    assert_eq!(movement["moved"], found["footprints"]["matched"]);
    // 117 ms of Mars' rotation at 4° to 5° north, 3394 to 3396 km from the centre: 28.09 m ± 0.04 m.
    assert_near(&movement["distance_m"]["mean"], 28.09, 0.05);
    assert_near(&movement["topography_m"]["max_abs"], 0.0, 0.0);
    assert_eq!(found["images"][0]["movement"]["distance_m"]["max"], 0.0);
    let printed = diff(&case, &["before", "out", "--limit-m", "28"]);
    assert!(
        printed.starts_with("exit 5\ncase: BEYOND THE LIMIT: footprints moved by up to 28."),
        "{printed}"
    );
}

#[test]
fn what_is_in_one_run_only_is_counted_and_keeps_no_limit() {
    let case = after_a_first_run();
    case.replace("site.toml", "[4.0, 5.0]", "[4.5, 5.5]");
    case.replace("site.toml", "id = \"image\"", "id = \"renamed\"");
    case.stages_run();
    let found = difference(&case);
    assert_eq!(found["outcome"], "moved");
    let footprints = &found["footprints"];
    let count = |key: &str| footprints[key].as_u64().unwrap();
    // The windows are equally high and share a half.
    assert!(
        count("matched") > 50 && count("only_in_a") > 50 && count("only_in_b") > 50,
        "{footprints}"
    );
    assert_eq!(footprints["movement"]["moved"], 0);
    assert_eq!(names(&found["stages"]["added"]).len(), 4);
    assert_eq!(found["images"][0]["valid_in_a"], true);
    assert_eq!(found["images"][1]["samples_only_in_b"], 31);
    assert!(found["images"][0]["valid_in_b"].is_null());
    let printed = diff(&case, &["before", "out", "--limit-arcsec", "1"]);
    let expected = "exit 5\ncase: BEYOND THE LIMIT: image image: no sample of A is in B: limits cannot be applied\n";
    assert!(printed.starts_with(expected), "{printed}");
    assert!(
        printed.contains("\n  image renamed: only in B\n"),
        "{printed}"
    );
}

#[test]
fn another_adjustment_moves_what_it_adjusts() {
    let case = Case::pair();
    case.stages_run();
    copy_products(&case.path("out/isidis"), &case.path("before/isidis"));
    case.replace("site.toml", "[1.6, 1.0]", "[1.6, 5.0]");
    case.stages_run();
    let found = difference(&case);
    assert_eq!(found["outcome"], "moved");
    let images = found["images"].as_array().unwrap();
    let moved = |image: &Value| number(&image["movement"]["turn_arcsec"]["max"]) > 1e-3;
    let of = |name: &str| images.iter().find(|image| image["image"] == name).unwrap();
    assert!(!moved(of(IMAGE)) && moved(of("E02-02016, adjusted")));
    let printed = diff(&case, &["before", "out", "--limit-arcsec", "0.001"]);
    assert!(
        printed.starts_with(
            "exit 5\nisidis: BEYOND THE LIMIT: image E02-01301, adjusted: the camera rotated"
        ),
        "{printed}"
    );
}

#[test]
fn the_page_opens_with_the_outcome_and_needs_nothing_from_outside() {
    let case = after_a_first_run();
    turn_attitudes(&case);
    case.stages_run();
    let arguments = [
        "before",
        "out",
        "--limit-arcsec",
        "19",
        "--page",
        "diff.html",
    ];
    assert!(diff(&case, &arguments).starts_with("exit 5\n"));
    let page = String::from_utf8(case.read("diff.html")).unwrap();
    let outcome =
        page.find("case: BEYOND THE LIMIT: image image: the camera rotated by up to 20.000 arcsec");
    assert!(outcome.unwrap() < page.find("<table").unwrap());
    assert!(page.contains("mgs_sc_scene.bc (CK) changed; 6 unchanged"));
    assert_eq!(page.matches("<svg").count(), 2); // the camera rotated and did not move; a map of the ground
    // On the map only the boresight has moved, by turn times range, in kilometres.
    let map = page::csv(&page, "case-movements-on-the-ground");
    let moved_m: Vec<f64> = map
        .iter()
        .filter(|row| row.join(",").contains("boresights of images, B − A"))
        .map(|row| {
            let [east, north] = [2, 1].map(|from_end| page::number(&row[row.len() - from_end]));
            1e3 * east.hypot(north)
        })
        .collect();
    assert_eq!(moved_m.len(), 31);
    let expected_m = TURN_ARCSEC * RADIANS_PER_ARCSECOND * boresight_range_m(&case);
    for metres in moved_m {
        // As much as the table of movements is held to: heights of the spacecraft change along the image.
        assert_near(&metres.into(), expected_m, 0.01 * expected_m);
    }
    let still = |row: &&Vec<String>| row.join(",").contains("footprints, B − A");
    for row in map.iter().filter(still) {
        assert_eq!(row[row.len() - 2..], ["0", "0"]);
    }
    assert!(page.contains("camera%20rotation,%20arcsec") && !page.contains("camera%20moved"));
    for outside in ["<script", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
}
