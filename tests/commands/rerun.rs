//! A second run does what a change touches, says why, and nothing else.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{collections::BTreeMap, fs::File, time::SystemTime};

use common::{case::Case, mission::succeed};

/// Stages that would run, with the reason.
fn plan(case: &Case) -> BTreeMap<String, String> {
    let mut command = case.areograph();
    command.args(["--quiet", "plan", "site.toml", "--out", "out", "--json"]);
    let answer = common::mission::succeed(&mut command).stdout;
    let answer: serde_json::Value = serde_json::from_slice(&answer).unwrap();
    let stages = answer[0]["stages"].as_array().unwrap().clone();
    stages
        .iter()
        .filter(|stage| stage["runs"] == true)
        .map(|stage| {
            let text = |key: &str| stage[key].as_str().unwrap().to_owned();
            (text("stage"), text("because"))
        })
        .collect()
}

/// Runs, and gives the stages that the log says ran.
fn run(case: &Case) -> Vec<String> {
    case.stages_run()
}

fn fresh() -> Case {
    let case = Case::new();
    assert_eq!(run(&case).len(), 14);
    assert_eq!(plan(&case), BTreeMap::new());
    assert_eq!(run(&case), [""; 0]);
    case
}

fn assert_plan(case: &Case, expected: &[(&str, &str)]) {
    let expected = expected
        .iter()
        .map(|(stage, why)| ((*stage).to_owned(), (*why).to_owned()));
    assert_eq!(plan(case), expected.collect());
}

#[test]
fn a_limit_of_the_range_check_touches_the_range_check() {
    let case = fresh();
    case.replace(
        "site.toml",
        "[[images]]",
        "[range_check]\nmean_max_m = 9.0\n[[images]]",
    );
    let publish = "inputs of check_ranges may change, key range_check.mean_max_m is new, \
                   output of check_ranges may change";
    assert_plan(
        &case,
        &[
            ("check_ranges", "key range_check.mean_max_m changed"),
            ("publish", publish),
        ],
    );
    // The statistics come out the same, so only the manifest's configuration hash is new.
    assert_eq!(run(&case), ["check_ranges", "publish"]);
}

#[test]
fn the_page_over_all_sites_tells_what_moved_since_the_run_before() {
    let case = fresh();
    let page = || String::from_utf8(case.read("out/index.html")).unwrap();
    let products = |name: &str| {
        let manifest: serde_json::Value = serde_json::from_slice(&case.read(name)).unwrap();
        manifest["products"].clone()
    };
    let first = products("out/case/manifest.json");
    assert!(!page().contains("<small>since "));
    case.replace(
        "site.toml",
        "[[images]]",
        "[range_check]\nmean_max_m = 1e-6\n[[images]]",
    );
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 5"), "{told}");
    assert!(page().contains(" → INVALID<br><small><span data-from="));
    assert_eq!(products("out/case/.previous.json"), first);
    // A run that finds nothing changed leaves what it is compared with.
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 5"), "{told}");
    assert_eq!(products("out/case/.previous.json"), first);
}

#[test]
fn a_comment_touches_nothing() {
    let case = fresh();
    case.replace("site.toml", "[pedr]", "# the archive\n[pedr]");
    let file = File::open(case.path("pedr/ap19117l.b")).unwrap();
    file.set_modified(SystemTime::now()).unwrap();
    assert_plan(&case, &[]);
}

#[test]
fn a_new_leap_second_kernel_with_the_same_seconds_stops_at_the_times() {
    let case = fresh();
    let mut text = case.read("kernels/leapseconds.tls");
    text.extend(b"\nA remark after the last table.\n");
    case.write("kernels/leapseconds.tls", text);
    let planned = plan(&case);
    assert_eq!(planned["tag_times/image"], "kernel leapseconds.tls changed");
    assert_eq!(
        planned["group_profiles"],
        "output of tag_times/image may change"
    );
    assert!(!planned.contains_key("search_footprints"));
    // Times come out the same: profiles stay. Any text kernel may define a frame of ephemeris or attitude.
    assert_eq!(
        run(&case),
        [
            "tag_times/image",
            "tag_utc",
            "check_ranges",
            "sample_orientation/image",
            "describe_kernels",
            "publish"
        ]
    );
}

#[test]
fn another_orbit_touches_ranges_and_orientation() {
    let case = fresh();
    std::fs::copy(
        case.path("kernels/mgs_ipng_scene.bsp"),
        case.path("kernels/mgs_nav_scene.bsp"),
    )
    .unwrap();
    let planned = plan(&case);
    assert_eq!(planned["check_ranges"], "kernel mgs_nav_scene.bsp changed");
    assert_eq!(
        planned["sample_orientation/image"],
        "kernel mgs_nav_scene.bsp changed"
    );
    assert!(!planned.contains_key("tag_times/image"));
    let ran = run(&case);
    assert_eq!(
        ran,
        [
            "check_ranges",
            "sample_orientation/image",
            "describe_kernels",
            "fit_sensor_model/image",
            "register/image",
            "check_beam",
            "publish"
        ]
    );
}

#[test]
fn another_camera_model_touches_models_and_registration_alone() {
    let case = fresh();
    case.replace(
        "site.toml",
        "[pedr]",
        "[registration]\nmodel = \"samples\"\n[pedr]",
    );
    let planned = plan(&case);
    // The form in use is chosen where the models are fitted.
    assert_eq!(
        planned["fit_sensor_model/image"],
        "key registration_model changed"
    );
    assert!(!planned.contains_key("sample_orientation/image"));
    assert_eq!(
        run(&case),
        [
            "fit_sensor_model/image",
            "register/image",
            "check_beam",
            "publish"
        ]
    );
}

#[test]
fn a_changed_pedr_file_is_searched_again() {
    let case = fresh();
    let mut bytes = case.read("pedr/ap19117l.b");
    bytes[7_760 + 480] ^= 1; // an engineering byte, far from every footprint
    case.write("pedr/ap19117l.b", bytes);
    assert_eq!(plan(&case)["search_footprints"], "pedr ap19117l.b changed");
    // The file's hash is part of the footprints' origin, so what holds it follows; times do not.
    let ran = run(&case);
    assert!(
        ran.contains(&"search_footprints".to_owned())
            && !ran.contains(&"tag_times/image".to_owned())
    );
}

#[test]
fn the_clock_scope_touches_what_it_reaches() {
    let case = fresh();
    case.replace(
        "site.toml",
        "[pedr]",
        "[altimeter_clock]\nscope = \"both\"\n[pedr]",
    );
    let planned = plan(&case);
    assert_eq!(
        planned["convert_datum"],
        "key altimeter_clock.scope changed"
    );
    assert!(planned["check_ranges"].starts_with("key altimeter_clock.scope changed"));
    assert!(!planned.contains_key("search_footprints"));
    assert!(!planned.contains_key("sample_orientation/image"));
}

#[test]
fn products_do_not_depend_on_how_the_site_is_named() {
    let case = fresh();
    let relative = common::mission::products(&case.path("out"));
    let mut command = case.areograph();
    command
        .arg("--quiet")
        .arg("run")
        .arg(case.path("site.toml"));
    command.arg("--out").arg(case.path("other"));
    common::mission::succeed(&mut command);
    assert!(common::mission::products(&case.path("other")) == relative);
    // The same folder, named otherwise: nothing to do.
    let mut command = case.areograph();
    command
        .arg("--quiet")
        .arg("run")
        .arg(case.path("site.toml"))
        .args(["--out", "out"]);
    let printed = String::from_utf8(common::mission::succeed(&mut command).stdout).unwrap();
    assert!(printed.contains("nothing changed"), "{printed}");
}

#[test]
fn an_index_of_the_archive_changes_nothing() {
    let case = fresh();
    // The index leaves out what may still be written.
    let file = File::open(case.path("pedr/ap19117l.b")).unwrap();
    file.set_modified(SystemTime::UNIX_EPOCH).unwrap();
    let mut command = case.areograph();
    command.args(["pedr", "index", "pedr"]);
    let printed = String::from_utf8(common::mission::succeed(&mut command).stdout).unwrap();
    assert!(printed.contains("1 of them read now"), "{printed}");
    assert_plan(&case, &[]);
    let mut command = case.areograph();
    command.args(["--quiet", "run", "site.toml", "--out", "indexed"]);
    common::mission::succeed(&mut command);
    let products = |out: &str| common::mission::products(&case.path(out));
    assert!(products("indexed") == products("out"));
}

#[test]
fn kernels_that_move_give_another_metakernel_and_nothing_else() {
    let case = fresh();
    std::fs::rename(case.path("kernels"), case.path("moved")).unwrap();
    case.replace("site.toml", "kernels/nav.tm", "moved/nav.tm");
    assert_eq!(run(&case), ["publish"]);
    let metakernel = String::from_utf8(case.read("out/case/kernels.tm")).unwrap();
    assert!(
        metakernel.contains("moved/mgs_nav_scene.bsp"),
        "{metakernel}"
    );
}

#[test]
fn pedr_files_of_one_name_are_of_distinct_images() {
    let case = Case::new();
    std::fs::create_dir(case.path("second")).unwrap();
    let mut bytes = case.read("pedr/ap19117l.b");
    bytes.truncate(7_760 + 50 * 776);
    case.write("second/ap19117l.b", &bytes);
    case.replace(
        "site.toml",
        "[\"pedr/*.b\"]",
        "[\"pedr/*.b\", \"second/*.b\"]",
    );
    run(&case);
    case.replace("site.toml", "[pedr]", "# same\n[pedr]");
    assert_plan(&case, &[]);
    let mut first = case.read("pedr/ap19117l.b");
    first[7_760 + 480] ^= 1;
    case.write("pedr/ap19117l.b", first);
    assert_eq!(plan(&case)["search_footprints"], "pedr ap19117l.b changed");
}

/// The verdict of a check is that of products only while a run would keep them.
#[test]
fn a_check_states_the_verdict_of_current_products_alone() {
    let case = Case::new();
    let checked = |further: &[&str]| {
        let mut command = case.areograph();
        command.args(["--quiet", "check", "site.toml", "--out", "out"]);
        command.args(further);
        case.outcome(command)
    };
    let current = "products are up to date; verdict: valid\n";
    let absent = checked(&[]);
    assert!(
        absent.ends_with("  verdict: not computed; --full computes it, as a run does\n"),
        "{absent}"
    );
    assert!(checked(&["--full"]).ends_with("  a run would be valid\n"));
    assert!(!case.path("out").exists());
    run(&case);
    assert!(checked(&[]).contains(current) && checked(&["--full"]).contains(current));
    // A product that was changed, and a key.
    let product = case.read("out/case/profiles.json");
    case.write("out/case/profiles.json", [&product[..], b"\n"].concat());
    let stale = "products are out of date (areograph plan states why); verdict: not computed";
    assert!(checked(&[]).contains(stale), "{}", checked(&[]));
    run(&case);
    assert!(checked(&[]).contains(current));
    case.replace(
        "site.toml",
        "site = \"case\"",
        "site = \"case\"\ndescription = \"new\"",
    );
    assert!(checked(&[]).contains(stale), "{}", checked(&[]));
}

#[test]
fn until_force_and_plan() {
    let case = Case::new();
    let mut command = case.run();
    command.args(["--until", "convert_datum"]);
    assert_eq!(
        case.outcome(command),
        "exit 0\ncase: stopped after convert_datum, no products\n"
    );
    assert!(!case.path("out/case/manifest.json").exists());
    let mut command = case.run();
    command.arg("--plan");
    let printed = case.outcome(command);
    assert!(
        printed.contains("stages would run: no earlier output\n"),
        "{printed}"
    );
    let mut command = case.areograph();
    let listed = succeed(command.args(["-v", "plan", "site.toml", "--out", "out"]));
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.contains("keep  convert_datum"), "{listed}");
    assert!(
        listed.contains("run   group_profiles                   no earlier output"),
        "{listed}"
    );
    assert!(!case.path("out/case/manifest.json").exists());
    run(&case);
    let before = common::mission::products(&case.path("out"));
    let manifest: serde_json::Value =
        serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap();
    let mut command = case.run();
    command.args(["--until", "convert_datum"]);
    let expected = format!(
        "exit 0\ncase: stopped after convert_datum; the products of {} in out/case remain unchanged\n",
        manifest["finished_utc"].as_str().unwrap()
    );
    assert_eq!(case.outcome(command), expected);
    let mut command = case.run();
    command.arg("--force");
    assert!(case.outcome(command).contains("case: valid; products in"));
    assert!(common::mission::products(&case.path("out")) == before);
}

#[test]
fn outputs_of_an_image_that_was_taken_out_are_forgotten() {
    let case = fresh();
    let stored = |case: &Case| {
        let names = std::fs::read_dir(case.path("out/case/.cache")).unwrap();
        let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
        names.sort();
        names
    };
    let before = stored(&case);
    let second = "[[images]]\nid = \"second\"\nlabel = \"image.lbl\"\n";
    let text = String::from_utf8(case.read("site.toml")).unwrap();
    case.write("site.toml", format!("{text}{second}"));
    run(&case);
    assert!(stored(&case).contains(&"sample_orientation+second".to_owned()));
    case.write("site.toml", text);
    run(&case);
    assert_eq!(stored(&case), before);
    assert_eq!(run(&case), [""; 0]);
}
