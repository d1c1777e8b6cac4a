//! Rival kernels: injected differences come back, and a site with several sets takes the closest to
//! their mean.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{fs, path::Path, process::Command};

use areograph::{
    body::Body,
    config::usual_instrument,
    frames::{BodyFixed, Position},
    geom::{
        attitude::{matrix_of_rotation_vector, spice_quaternion},
        body_rotation::body_rotation,
        ellipsoid::ray_meets_ellipsoid,
        orbit_axes::radial_along_cross,
    },
    spice::{CkSegment, KernelSet, Session, write_ck},
    stages::compare_kernels::compare_orbits,
    time::Et,
    units::RADIANS_PER_ARCSECOND,
};
use common::{
    case::Case,
    mission::{areograph, mission, succeed},
};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

const FAMILIES: [&str; 3] = ["nav", "gsfc", "ipng"];
/// The image of [`Case`].
const IMAGE: &str = "E02-02016";

fn truth_of_images() -> Vec<Value> {
    let truth = fs::read(mission().join("truth.json")).unwrap();
    let truth: Value = serde_json::from_slice(&truth).unwrap();
    truth["images"].as_array().unwrap().clone()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| value[axis].as_f64().unwrap())
}

/// What `truth` tells of a family's orbit at one epoch, metres.
fn injected_m(truth: &Value, family: &str, epoch: usize) -> Vector3<f64> {
    vector(&truth["orbit_radial_along_cross_m"][family][epoch])
}

/// Distance of each family from the mean of all at one epoch, by the truth, metres.
fn injected_distances_m(truth: &Value, epoch: usize) -> [f64; 3] {
    let injected = FAMILIES.map(|family| injected_m(truth, family, epoch));
    let mean: Vector3<f64> = injected.iter().sum::<Vector3<f64>>() / 3.0;
    injected.map(|one| (one - mean).norm())
}

fn session(family: &str) -> Session {
    let metakernel = mission().join(format!("kernels/{family}.tm"));
    Session::open(&KernelSet::from_metakernel(&metakernel).unwrap()).unwrap()
}

fn answer(command: &mut Command) -> Value {
    let answer = serde_json::from_slice(&succeed(command).stdout).unwrap();
    common::assert_keeps_schema(&answer, "kernel_comparison");
    answer
}

/// The command over the scene's three families, with further arguments.
fn compare(arguments: &[&str]) -> Command {
    let mut command = areograph();
    command.args(["--quiet", "kernels", "compare"]);
    command.args(FAMILIES.map(|family| mission().join(format!("kernels/{family}.tm"))));
    command.args(arguments);
    command
}

#[test]
fn injected_orbit_differences_come_back_at_every_epoch() {
    let images = truth_of_images();
    assert_eq!(images.len(), 6);
    for truth in images {
        let epochs = truth["epochs_et_s"].as_array().unwrap();
        let epochs = epochs
            .iter()
            .map(|et| Et::from_seconds(et.as_f64().unwrap()));
        let epochs: Vec<Et> = epochs.collect();
        let orbits = FAMILIES.map(|family| {
            let session = session(family);
            let states = epochs.iter().map(|et| session.state(*et).unwrap());
            (family.to_owned(), states.collect())
        });
        let found = compare_orbits(&epochs, &orbits);
        for epoch in 0..epochs.len() {
            let injected = FAMILIES.map(|family| injected_m(&truth, family, epoch));
            let mean = injected.iter().sum::<Vector3<f64>>() / 3.0;
            for (deviation, injected) in found.deviations.iter().zip(injected) {
                let found_m = Vector3::from(deviation.radial_along_cross[epoch]);
                let apart_m = (found_m - (injected - mean)).norm();
                // The axes of the mean orbit are turned from the true ones by some 10 m in 3770 km.
                assert!(apart_m < 1e-3, "{} {epoch}: {apart_m} m", truth["id"]);
            }
        }
    }
}

#[test]
fn the_command_finds_differences_and_the_closest_of_an_image() {
    let middle = 15;
    for truth in truth_of_images() {
        let epochs = truth["epochs_et_s"].as_array().unwrap();
        let utc = {
            let session = session("nav");
            [0, 30].map(|epoch| {
                let et = Et::from_seconds(epochs[epoch].as_f64().unwrap());
                session.et_to_utc(et).unwrap()
            })
        };
        let found = answer(&mut compare(&["--json", "--time", &utc.join("..")]));
        let orbit = &found["orbit"];
        for difference in orbit["differences"].as_array().unwrap() {
            let [of, minus] = ["set", "minus"].map(|key| difference[key].as_str().unwrap());
            let injected_m = injected_m(&truth, of, middle) - injected_m(&truth, minus, middle);
            for (axis, key) in ["radial_m", "along_track_m", "cross_track_m"]
                .iter()
                .enumerate()
            {
                // Differences swing evenly about the middle of the image: their mean is the value there.
                let apart_m = difference[key]["mean"].as_f64().unwrap() - injected_m[axis];
                assert!(
                    apart_m.abs() < 1e-3,
                    "{} {of} {key}: {apart_m} m",
                    truth["id"]
                );
            }
        }
        let distances = injected_distances_m(&truth, middle);
        let closest = (0..3).min_by(|a, b| distances[*a].total_cmp(&distances[*b]));
        assert_eq!(
            orbit["closest"],
            FAMILIES[closest.unwrap()],
            "{}",
            truth["id"]
        );
        assert_eq!(orbit["equally_close"], Value::Array(Vec::new()));
    }
}

#[test]
fn what_one_set_does_not_hold_is_left_out_with_its_span() {
    let text = succeed(&mut compare(&[
        "--time",
        "2001-03-23T05:00..2001-03-23T06:00",
    ]))
    .stdout;
    let text = String::from_utf8(text).unwrap();
    let spans = text.matches(" has no position for 2517.593 s: ").count();
    assert_eq!(spans, 3, "{text}");
    assert!(text.contains(".. 2001-03-23T06:00:00.000 UTC"), "{text}");
    let all = answer(&mut compare(&["--json"]));
    assert_eq!(
        all["orbit"]["epochs_et_s"].as_array().unwrap().len(),
        10_000
    );
    assert_eq!(all["left_out"], Value::Array(Vec::new()));
    assert!(all["notes"][0].as_str().unwrap().contains("same C-kernels"));
    assert!(all.get("attitude").is_none());
}

/// The case with rival sets in this order.
fn rival_case(families: [&str; 3]) -> Case {
    let case = Case::new();
    let sets = families.map(|family| {
        format!("[[kernels.sets]]\nid = \"{family}\"\nmetakernel = \"kernels/{family}.tm\"\n")
    });
    let one = "[kernels]\nmetakernel = \"kernels/nav.tm\"\n";
    case.replace("site.toml", one, &sets.concat());
    case
}

/// What the manifest's schema says of the choice.
fn schema_of_choice() -> jsonschema::Validator {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/schema/manifest.schema.json");
    let mut schema: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    let mut choice = schema["properties"]["kernel_choice"].take();
    choice["$defs"] = schema["$defs"].take();
    jsonschema::validator_for(&choice).unwrap()
}

fn manifest(case: &Case) -> Value {
    serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap()
}

#[test]
fn a_site_with_three_sets_takes_the_closest_to_their_mean() {
    let images = truth_of_images();
    let truth = images.iter().find(|image| image["id"] == IMAGE).unwrap();
    let distances = injected_distances_m(truth, 15);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| distances[*b].total_cmp(&distances[*a]));
    // The closest is neither first nor alone.
    for order in [order, [order[0], order[2], order[1]]] {
        let case = rival_case(order.map(|index| FAMILIES[index]));
        assert!(case.outcome(case.run()).starts_with("exit 0"));
        let manifest = manifest(&case);
        let closest = (0..3)
            .min_by(|a, b| distances[*a].total_cmp(&distances[*b]))
            .unwrap();
        for (entry, index) in manifest["kernel_choice"]
            .as_array()
            .unwrap()
            .iter()
            .zip(order)
        {
            assert_eq!(entry["set"], FAMILIES[index]);
            assert_eq!(entry["chosen"], index == closest);
            let share = entry["distance_rms_m"].as_f64().unwrap() / distances[index];
            // The site needs half a minute round the image; a tenth of a difference swings in 2 hours.
            assert!((share - 1.0).abs() < 0.01, "{share}");
        }
        assert!(schema_of_choice().is_valid(&manifest["kernel_choice"]));
        let notes = manifest["notes"].to_string();
        let chosen = FAMILIES[closest];
        assert!(
            notes.contains(&format!("kernel set {chosen} is used")),
            "{notes}"
        );
        let orbit = format!("mgs_{chosen}_scene.bsp");
        let kernels = String::from_utf8(case.read("out/case/kernels.tm")).unwrap();
        assert!(kernels.contains(&orbit), "{kernels}");
        let names: Vec<&str> = manifest["kernels"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|kernel| kernel["name"].as_str())
            .collect();
        let rivals = names
            .iter()
            .filter(|name| FAMILIES.iter().any(|family| name.contains(family)));
        assert_eq!(rivals.collect::<Vec<_>>(), [&orbit]);
    }
}

#[test]
fn a_change_of_any_set_is_seen_and_may_change_the_choice() {
    let case = rival_case(FAMILIES);
    let planned = |case: &Case| {
        let mut command = case.areograph();
        command.args(["-v", "plan", "site.toml", "--out", "out"]);
        let listed = common::mission::succeed(&mut command).stdout;
        String::from_utf8(listed).unwrap()
    };
    let first = planned(&case);
    assert!(first.contains("run   choose_kernels"), "{first}");
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    assert!(!planned(&case).contains("  run"), "{}", planned(&case));
    let chosen = |case: &Case| -> Vec<String> {
        let manifest = manifest(case);
        let entries = manifest["kernel_choice"].as_array().unwrap().clone();
        let chosen = entries.iter().filter(|entry| entry["chosen"] == true);
        chosen
            .map(|entry| entry["set"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(chosen(&case), ["gsfc"]);
    // Two of three sets agree now: the mean is nearer to them than to the third.
    fs::copy(
        case.path("kernels/mgs_nav_scene.bsp"),
        case.path("kernels/mgs_ipng_scene.bsp"),
    )
    .unwrap();
    let after = planned(&case);
    let because = "kernel of set ipng mgs_ipng_scene.bsp changed";
    assert!(after.contains(because), "{after}");
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    assert_eq!(chosen(&case), ["nav"]);
    assert!(
        manifest(&case)["notes"]
            .to_string()
            .contains("equally close: ipng")
    );
    // A frame of an ephemeris may stand in any text kernel: the sets are compared again, and the choice stands.
    case.replace("kernels/ipng.tm", "'moc.ti'", "'moc2.ti'");
    fs::copy(case.path("kernels/moc.ti"), case.path("kernels/moc2.ti")).unwrap();
    case.replace("kernels/moc2.ti", "KPL/IK", "KPL/IK\n");
    assert!(
        planned(&case).contains("run   choose_kernels"),
        "{}",
        planned(&case)
    );
    assert_eq!(case.stages_run(), ["choose_kernels", "publish"]);
}

#[test]
fn the_command_takes_the_sets_of_a_site() {
    let case = rival_case(FAMILIES);
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    let mut command = case.areograph();
    command.args([
        "--quiet",
        "kernels",
        "compare",
        "--site",
        "site.toml",
        "--json",
    ]);
    let found = answer(&mut command);
    for (index, entry) in manifest(&case)["kernel_choice"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
    {
        let found_m = found["orbit"]["sets"][index]["rms_m"].as_f64().unwrap();
        let apart_m = found_m - entry["distance_rms_m"].as_f64().unwrap();
        assert!(apart_m.abs() < 1e-9, "{apart_m}"); // the same sums
    }
    let mut check = case.areograph();
    check.args(["--quiet", "check", "site.toml"]);
    let checked = case.outcome(check);
    for family in FAMILIES {
        let line = format!("kernel set {family}: image image: ");
        assert!(checked.contains(&line), "{checked}");
    }
}

#[test]
fn of_rival_orbits_in_one_list_only_the_later_is_claimed() {
    let case = Case::new();
    let rivals = "'mgs_ipng_scene.bsp', 'mgs_nav_scene.bsp'";
    case.replace("kernels/nav.tm", "'mgs_nav_scene.bsp'", rivals);
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    let manifest = manifest(&case);
    let used = |name: &str| {
        let kernels = manifest["kernels"].as_array().unwrap();
        let kernel = kernels
            .iter()
            .find(|kernel| kernel["name"] == name)
            .unwrap();
        kernel["coverage_used"].as_array().unwrap().len()
    };
    assert_eq!(used("mgs_ipng_scene.bsp"), 0);
    assert!(used("mgs_nav_scene.bsp") > 0);
}

/// Writes a C-kernel whose attitudes over the image are those of the scene, turned by `turn_rad` about
/// the along-track axis, and a metakernel that loads it. Gives the range to the ground in the middle.
fn write_turned(case: &Case, exposed: [Et; 2], turn_rad: f64) -> f64 {
    let metakernel = case.path("kernels/nav.tm");
    let session = Session::open(&KernelSet::from_metakernel(&metakernel).unwrap()).unwrap();
    let [start, stop] = exposed;
    let step_s = 0.25;
    let (first, length_s) = (start.plus(-2.0), stop.since(start) + 4.0);
    let exposures: Vec<Et> = (0..10_000)
        .map(|index| first.plus(step_s * f64::from(index)))
        .take_while(|et| et.since(first) < length_s)
        .collect();
    let lookups: Vec<Et> = exposures
        .iter()
        .map(|et| usual_instrument().pointing_bias().lookup(*et).kernel_time())
        .collect();
    let (mut quaternions, mut rates_rad_s) = (Vec::new(), Vec::new());
    let mut range_m = 0.0;
    for (index, et) in exposures.iter().enumerate() {
        let attitude = session
            .attitude(usual_instrument().pointing_bias().lookup(*et), *et, 0.0)
            .unwrap();
        let bus = *attitude.inertial_to_bus.matrix();
        let state = session.state(*et).unwrap();
        let along = radial_along_cross(&state.position.xyz_m, &state.velocity_m_s)
            .column(1)
            .into_owned();
        let turn: Matrix3<f64> = matrix_of_rotation_vector(&(turn_rad * along));
        quaternions.push(spice_quaternion(&(bus * turn.transpose())));
        rates_rad_s.push(attitude.angular_velocity_rad_s.into());
        if index == exposures.len() / 2 {
            let to_mars = body_rotation(Body::Mars, *et);
            let origin: Position<BodyFixed> = to_mars.apply(&state.position);
            let direction = to_mars.matrix() * bus.row(2).transpose();
            range_m = ray_meets_ellipsoid(Body::Mars.model(), &origin, &direction)
                .unwrap()
                .distance_m(&origin);
        }
    }
    areograph::geom::attitude::make_continuous(&mut quaternions);
    let segment = CkSegment {
        name: "turned",
        instants: &lookups,
        quaternions: &quaternions,
        angular_velocities_rad_s: &rates_rad_s,
        interval_starts: &lookups[..1],
    };
    write_ck(
        &case.path("kernels/turned.bc"),
        &session,
        &[segment],
        "turned",
    )
    .unwrap();
    let text = String::from_utf8(case.read("kernels/nav.tm")).unwrap();
    case.write(
        "kernels/turned.tm",
        text.replace("mgs_sc_scene.bc", "turned.bc"),
    );
    range_m
}

#[test]
fn a_c_kernel_turned_by_a_known_angle_is_told_in_arcseconds_and_metres() {
    let case = Case::new();
    let images = truth_of_images();
    let truth = images.iter().find(|image| image["id"] == IMAGE).unwrap();
    let ends = [0, 30].map(|epoch| Et::from_seconds(truth["epochs_et_s"][epoch].as_f64().unwrap()));
    let turn_arcsec = 200.0;
    let range_m = write_turned(&case, ends, turn_arcsec * RADIANS_PER_ARCSECOND);
    let mut command = case.areograph();
    command.args([
        "--quiet",
        "kernels",
        "compare",
        "kernels/nav.tm",
        "kernels/turned.tm",
        "--json",
    ]);
    command.args(["--page", "index.html"]);
    let found = answer(&mut command);
    let page = String::from_utf8(case.read("index.html")).unwrap();
    assert!(page.contains("Two kernel sets, 0.000 m apart"));
    assert!(page.contains("Attitudes against their mean") && page.contains("on the ground, m"));
    let attitude = &found["attitude"];
    let difference = &attitude["differences"][0];
    for (key, expected) in [
        ("radial_arcsec", 0.0),
        ("along_track_arcsec", turn_arcsec),
        ("cross_track_arcsec", 0.0),
    ] {
        for statistic in ["min", "max"] {
            let apart = difference[key][statistic].as_f64().unwrap() - expected;
            // Straight interpolation between samples, 4 s apart in one kernel and 0.25 s in the other,
            // of a body that turns evenly; a thousandth of an arcsecond is 2 mm on the ground.
            assert!(apart.abs() < 1e-3, "{key} {statistic}: {apart} arcsec");
        }
    }
    // Each is half of it away from the mean; the range changes by some 10 m in half an image.
    let ground_m = attitude["sets"][1]["ground_rms_m"].as_f64().unwrap();
    let expected_m = 0.5 * turn_arcsec * RADIANS_PER_ARCSECOND * range_m;
    assert!(
        (ground_m / expected_m - 1.0).abs() < 1e-3,
        "{ground_m} {expected_m}"
    );
    // Attitudes beyond the image are in one kernel only.
    let left_out = found["left_out"].as_array().unwrap();
    assert!(!left_out.is_empty());
    let of_turned = |one: &Value| one["set"] == "turned" && one["what"] == "attitude";
    assert!(left_out.iter().all(of_turned), "{left_out:?}");
}
