//! What `areograph report diff` says of two runs, and that it says it of what was really injected.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

mod common;

use std::{fs, path::Path};

use areograph::{
    frames::{J2000, MgsBus, Rotation},
    geom::{
        attitude::{make_continuous, spice_quaternion},
        mars_rotation::frame_rotation_1,
    },
    spice::{CkSegment, KernelSet, Session, write_ck},
    time::{Et, Interval, PointingBias},
    units::RADIANS_PER_ARCSECOND,
};
use common::case::Case;
use serde_json::Value;

/// The image of the case.
const IMAGE: &str = "E02-02016";
const TURN_ARCSEC: f64 = 20.0;

/// A case that has run once, its products kept in `before/case`.
fn after_a_first_run() -> Case {
    let case = Case::new();
    case.stages_run();
    copy_products(&case.path("out/case"), &case.path("before/case"));
    case
}

/// Copies what was published; the cache stays behind.
fn copy_products(from: &Path, to: &Path) {
    for (relative, _) in common::mission::products(from) {
        let target = to.join(&relative);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::copy(from.join(&relative), target).unwrap();
    }
}

/// Exit code and everything printed by the command with these further arguments.
fn diff(case: &Case, arguments: &[&str]) -> String {
    let mut command = case.areograph();
    command.args(["--quiet", "report", "diff"]).args(arguments);
    case.outcome(command)
}

/// The one site's difference between `before` and `out`.
fn difference(case: &Case) -> Value {
    let mut command = case.areograph();
    command.args(["report", "diff", "before", "out", "--json"]);
    let answer = common::mission::succeed(&mut command).stdout;
    let text = String::from_utf8(answer).unwrap();
    assert!(!text.contains("null"), "what is unknown is left out");
    let mut answer: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(answer["sites"].as_array().unwrap().len(), 1);
    answer["sites"][0].take()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("no number: {value}"))
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

/// Replaces the case's C-kernel by a copy with every attitude turned about the camera's x axis.
fn turn_attitudes(case: &Case) {
    let path = case.path("kernels/mgs_sc_scene.bc");
    let turned = case.path("kernels/turned.bc");
    let kernels = KernelSet::from_metakernel(&case.path("kernels/nav.tm")).unwrap();
    let session = Session::open(&kernels).unwrap();
    let columns: Vec<_> = session
        .coverage()
        .unwrap()
        .ck
        .as_slice()
        .iter()
        .map(|interval| {
            // The scene's samples, 4 s apart: between them both kernels turn evenly.
            turned_attitudes(&session, *interval)
        })
        .collect();
    let segments: Vec<CkSegment> = columns
        .iter()
        .map(|(instants, quaternions, rates)| CkSegment {
            name: "turned",
            instants,
            quaternions,
            angular_velocities_rad_s: rates,
            interval_starts: &instants[..1],
        })
        .collect();
    write_ck(&turned, &session, &segments, "every attitude turned").unwrap();
    drop(session);
    fs::rename(turned, path).unwrap();
}

type Attitudes = (Vec<Et>, Vec<[f64; 4]>, Vec<[f64; 3]>);

/// Attitudes of an interval as the kernel counts time, turned; rates in J2000 stay as they are.
fn turned_attitudes(session: &Session, interval: Interval) -> Attitudes {
    let turn = frame_rotation_1(TURN_ARCSEC * RADIANS_PER_ARCSECOND);
    let unbiased = PointingBias::from_seconds(0.0);
    let (mut instants, mut quaternions, mut rates) = (Vec::new(), Vec::new(), Vec::new());
    // The last sample may be a rounding of the clock beyond the interval's end.
    let samples = (0..).map(|index| interval.start.plus(4.0 * f64::from(index)));
    for at in samples.take_while(|at| at.since(interval.stop) < 0.01) {
        let attitude = session.attitude(unbiased.lookup(at), at, 0.01).unwrap();
        let mounting = *session.mounting(at).unwrap().matrix();
        let turned = mounting.transpose() * turn * mounting * attitude.inertial_to_bus.matrix();
        let turned: Rotation<J2000, MgsBus> = Rotation::new(turned, at);
        instants.push(at);
        quaternions.push(spice_quaternion(turned.matrix()));
        rates.push(attitude.angular_velocity_rad_s.into());
    }
    make_continuous(&mut quaternions);
    (instants, quaternions, rates)
}

#[test]
fn a_turned_ck_is_found_and_nothing_else() {
    let case = after_a_first_run();
    turn_attitudes(&case);
    let ran = [
        "sample_orientation/image",
        "fit_sensor_model/image",
        "register/image",
        "publish",
    ];
    assert_eq!(case.stages_run(), ran);

    let found = difference(&case);
    assert_eq!(found["outcome"], "moved");
    assert_eq!(names(&found["kernels"]["changed"]), ["mgs_sc_scene.bc"]);
    assert_eq!(found["kernels"]["changed"][0]["role"], "CK");
    assert_eq!(names(&found["stages"]["changed"]), ran);
    assert_eq!(found["stages"]["unchanged"], 5);
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
fn limits_on_the_movement_give_exit_code_5() {
    let case = after_a_first_run();
    turn_attitudes(&case);
    case.stages_run();
    let printed = diff(&case, &["before", "out", "--limit-arcsec", "19"]);
    assert!(
        printed.starts_with(
            "exit 5\ncase: BEYOND THE LIMIT: image image: the camera turned by up to 20."
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
        "fit_sensor_model/image",
        "register/image",
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
        "[mola_clock]\nscope = \"both\"\n[pedr]",
    );
    case.stages_run();
    let found = difference(&case);
    let keys = serde_json::json!([{"what": "mola_clock.scope", "a": "spk_lookup", "b": "both"}]);
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
    assert_eq!(names(&found["stages"]["added"]).len(), 3);
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
        "pages/diff.html",
    ];
    assert!(diff(&case, &arguments).starts_with("exit 5\n"));
    let page = String::from_utf8(case.read("pages/diff.html")).unwrap();
    let outcome =
        page.find("case: BEYOND THE LIMIT: image image: the camera turned by up to 20.000 arcsec");
    assert!(outcome.unwrap() < page.find("<table").unwrap());
    assert!(page.contains("mgs_sc_scene.bc (CK) changed; 6 unchanged"));
    assert_eq!(page.matches("<svg").count(), 1); // the camera turned and did not move
    assert!(page.contains("camera%20turned,%20arcsec") && !page.contains("camera%20moved"));
    for outside in ["<script", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn every_site_of_two_outputs_is_compared() {
    let case = after_a_first_run();
    for (folder, site) in [("before", "gone"), ("out", "new")] {
        copy_products(&case.path("before/case"), &case.path(folder).join(site));
    }
    let printed = diff(&case, &["before", "out"]);
    assert!(
        printed.starts_with("exit 0\ncase: nothing changed\n"),
        "{printed}"
    );
    assert!(
        printed.ends_with("gone: only in A, not compared\nnew: only in B, not compared\n"),
        "{printed}"
    );
    assert!(diff(&case, &["before", "out", "--limit-m", "1"]).starts_with("exit 5\n"));
    // A site that cannot be read does not hide the others.
    copy_products(&case.path("before/case"), &case.path("out/gone"));
    case.write("out/gone/kernels.tm", "mine");
    let printed = diff(&case, &["before", "out"]);
    assert!(
        printed.starts_with("exit 3\ncase: nothing changed\n"),
        "{printed}"
    );
    assert!(
        printed.contains("error: out/gone/kernels.tm: has 4 bytes"),
        "{printed}"
    );
}

type Spoil = fn(&Case);

#[test]
fn outputs_that_cannot_be_compared_are_refused() {
    let case = after_a_first_run();
    let refusals: [(&str, Spoil, &str); 8] = [
        (
            "no folder",
            |case| fs::remove_dir_all(case.path("out")).unwrap(),
            NO_FOLDER,
        ),
        (
            "empty folder",
            |case| {
                fs::remove_dir_all(case.path("out")).unwrap();
                fs::create_dir(case.path("out")).unwrap();
            },
            EMPTY,
        ),
        (
            "no manifest",
            |case| fs::remove_file(case.path("out/case/manifest.json")).unwrap(),
            EMPTY,
        ),
        (
            "stopped early",
            |case| {
                fs::remove_file(case.path("out/case/manifest.json")).unwrap();
                fs::create_dir(case.path("out/case/.cache")).unwrap();
            },
            STOPPED_EARLY,
        ),
        (
            "half-made",
            |case| case.write("out/case/.publishing", "kernels.tm"),
            HALF_MADE,
        ),
        (
            "no JSON",
            |case| case.write("out/case/manifest.json", "{"),
            NO_JSON,
        ),
        (
            "another site",
            |case| {
                case.replace(
                    "out/case/manifest.json",
                    "\"site\": \"case\"",
                    "\"site\": \"other\"",
                );
            },
            ANOTHER_SITE,
        ),
        (
            "no common site",
            |case| fs::rename(case.path("out/case"), case.path("out/other")).unwrap(),
            NO_COMMON_SITE,
        ),
    ];
    for (what, spoil, expected) in refusals {
        let _ = fs::remove_dir_all(case.path("out"));
        copy_products(&case.path("before/case"), &case.path("out/case"));
        spoil(&case);
        assert_eq!(diff(&case, &["before", "out"]), expected, "{what}");
    }
    assert_eq!(diff(&case, &["before", "before/../before"]), ONE_FOLDER);
    let _ = fs::remove_dir_all(case.path("out"));
    copy_products(&case.path("before/case"), &case.path("out/case"));
    assert_eq!(diff(&case, &["before/case", "out"]), ONE_AND_SEVERAL);
}

#[test]
fn products_that_contradict_the_manifest_are_refused() {
    let case = after_a_first_run();
    copy_products(&case.path("before/case"), &case.path("aside/case"));
    let manifest: Value = serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap();
    let message = |path: &str, found: &str| {
        let mut products = manifest["products"].as_array().unwrap().iter();
        let product = products.find(|product| product["path"] == path).unwrap();
        let hash = &product["blake3"].as_str().unwrap()[..12];
        let bytes = &product["bytes"];
        format!(
            "exit 3\nerror: aside/case/{path}: {found}; expected {bytes} bytes with the BLAKE3 hash {hash} of \
             manifest.json\n  what to do: run the site again, which makes damaged products anew\n"
        )
    };
    case.write("aside/case/footprints.csv", "mine");
    let hash = &blake3::hash(b"mine").to_hex()[..12];
    let expected = message(
        "footprints.csv",
        &format!("has 4 bytes with the hash {hash}"),
    );
    assert_eq!(diff(&case, &["aside", "out"]), expected);
    fs::remove_file(case.path("aside/case/footprints.csv")).unwrap();
    let expected = message("footprints.csv", "is missing");
    assert_eq!(diff(&case, &["out", "aside"]), expected);
    // What the manifest vouches for may still be of another version.
    copy_products(&case.path("before/case"), &case.path("aside/case"));
    let product = fs::read(case.path("aside/case/ranges.json")).unwrap();
    let hash = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
    case.write("aside/case/ranges.json", "{}");
    case.replace("aside/case/manifest.json", &hash(&product), &hash(b"{}"));
    let expected = "exit 3\nerror: case: aside/case/ranges.json: cannot be read as range statistics: missing field \
                    `mola_clock` at line 1 column 2\n  what to do: products of another version of areograph have \
                    to be made again by this one\n";
    assert_eq!(diff(&case, &["before", "aside"]), expected);
}

const NO_FOLDER: &str = "exit 6\nerror: out: cannot read the folder: No such file or directory (os error 2)\n  what to do: check the path; relative paths in a configuration count from that file's folder\n";
const EMPTY: &str = "exit 3\nerror: out: there is no manifest.json in it or in a folder below; expected products of `areograph run`\n  what to do: name the folder given to --out, or a site's folder in it\n";
const STOPPED_EARLY: &str = "exit 3\nerror: out/case: there is no manifest.json, so there are no products\n  what to do: name a site's folder of products, and run the site to the end\n";
const HALF_MADE: &str = "exit 3\nerror: out/case: the publication of products into this folder was not finished\n  what to do: wait for the run that is at work, or run the site again to mend it\n";
const NO_JSON: &str = "exit 3\nerror: out/case/manifest.json: this is no manifest of areograph 0.1.0: EOF while parsing an object at line 1 column 1\n  what to do: run the site again, which makes damaged products anew\n";
const ANOTHER_SITE: &str = "exit 2\nerror: out/case: these are products of site \"other\", the others of site \"case\"; expected one site\n  what to do: compare runs of the same site\n";
const NO_COMMON_SITE: &str = "exit 2\nerror: no site is in both: A has case; B has other\n  what to do: compare runs of the same site\n";
const ONE_FOLDER: &str = "exit 2\nerror: before/../before: A and B are one folder; expected the products of two runs\n  what to do: copy the first products aside before running again, or run into another --out\n";
const ONE_AND_SEVERAL: &str = "exit 2\nerror: before/case: it holds the products of one site, the other folder those of several\n  what to do: name two folders of one site, or two output folders with sites\n";
