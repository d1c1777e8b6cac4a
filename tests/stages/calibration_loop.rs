//! `areograph calibrate` from pixels: three rendered lines and laser passes against their truth, and input that is refused.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests work in temporary folders and may fail loudly"
)]

use crate::common;

mod curves;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::{
        LazyLock,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, SystemTime},
};

use areograph::{
    body::Body,
    config::{CalibrationConfig, Document as _},
    error::{Error, Kind},
    flow::{Observer, RunOutcome, StageEvent, Task},
    geom::{
        ellipsoid::{Spherical, local_axes},
        statistics::median,
    },
    pds::terrain_model::{HeightsAbove, read_terrain_model},
    scene::{write_calibration_loop_scene, write_terrain_model_scene},
    stages::line_camera::LineCamera,
    store::publish::CACHE,
    watch::Watch,
};
use common::{
    assert_keeps_schema,
    flows::{ran, run_into, run_observed, would_run},
    json, long, long_test,
    mission::{areograph, products, succeed},
    number,
};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

/// Pixel of the stereo lines on the ground, metres: a line, and 14 µm at 175 mm from 350 km.
const PIXEL_M: f64 = 27.0;
const STEREO: [&str; 2] = ["s1", "s2"];

/// The scene, rendered once.
static SCENE: LazyLock<tempfile::TempDir> = LazyLock::new(|| scene(1));

/// Its calibration, run once: to the end in the long run, and otherwise its first round, which takes a third of the time.
static RUN: LazyLock<RunOutcome> = LazyLock::new(|| {
    let first = ("search_cells = 30", "search_cells = 30\nrounds_max = 1");
    let replaced: &[_] = if long() { &[] } else { &[first] };
    run("whole", replaced).unwrap()
});

fn scene(seed: u64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_calibration_loop_scene(
        &folder.path().join("lines"),
        seed,
        Watch::from(&AtomicBool::new(false)),
    )
    .unwrap();
    folder
}

/// Runs the scene's calibration file with some text replaced.
fn run(name: &str, replaced: &[(&str, &str)]) -> Result<RunOutcome, Error> {
    run_in(SCENE.path(), name, replaced)
}

fn run_in(folder: &Path, name: &str, replaced: &[(&str, &str)]) -> Result<RunOutcome, Error> {
    let mut text = fs::read_to_string(folder.join("lines/calibration.toml")).unwrap();
    for (was, is) in replaced {
        assert!(text.contains(was), "{was}");
        text = text.replace(was, is);
    }
    let path = folder.join("lines").join(format!("{name}.toml"));
    fs::write(&path, text).unwrap();
    let config = CalibrationConfig::load(&path)?.config;
    run_into(Task::Calibration(&config), &folder.join(name), false)
}

/// What a file that was changed is told: an error, or an invalid result.
fn refused(name: &str, replaced: &[(&str, &str)]) -> String {
    match run(name, replaced) {
        Err(failure) => {
            let path = format!("{}/", SCENE.path().join("lines").display());
            failure.to_string().replace(&path, "")
        }
        Ok(outcome) => {
            let verdict = &outcome.manifest().unwrap().verdict;
            assert!(!verdict.valid, "{verdict:?}");
            format!("{}: {}", verdict.word(), verdict.reasons.join("; "))
        }
    }
}

/// Where the calibrated stereo lines have the checked places, minus where these are: east, north, up, metres.
fn errors_m(folder: &Path, support: impl Fn(&str) -> std::path::PathBuf) -> Vec<Vector3<f64>> {
    checked_errors_m(&json(&folder.join("lines/truth.json")), support)
}

/// The same for the true values of an orbit.
pub(crate) fn checked_errors_m(
    truth: &Value,
    support: impl Fn(&str) -> std::path::PathBuf,
) -> Vec<Vector3<f64>> {
    let lines = STEREO.map(|line| LineCamera::read(&support(line), line, Body::Mars).unwrap());
    let checked = truth["checked"].as_array().unwrap();
    let error_m = |of: &Value| {
        let place_m = Vector3::from([0, 1, 2].map(|axis| number(&of["place_m"][axis])));
        let (mut normals, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (line, name) in lines.iter().zip(STEREO) {
            let [at_line, sample] = [0, 1].map(|axis| number(&of["seen"][name][axis]));
            let ray = line.camera.ray(at_line, sample);
            let direction = ray.direction();
            let across = Matrix3::identity() - direction * direction.transpose();
            normals += across;
            right += across * ray.position_m;
        }
        let found_m = normals.try_inverse().unwrap() * right;
        local_axes(&place_m) * (found_m - place_m)
    };
    checked.iter().map(error_m).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        (sum + value * value, count + 1.0)
    });
    (sum / count).sqrt()
}

/// Root mean square in the plane and in height.
pub(crate) fn plane_and_height_m(errors_m: &[Vector3<f64>]) -> [f64; 2] {
    let plane_m = rms(errors_m.iter().map(|of| of.xy().norm()));
    [plane_m, rms(errors_m.iter().map(|of| of.z))]
}

#[test]
fn rounds_converge_and_their_numbers_are_kept() {
    let verdict = &RUN.manifest().unwrap().verdict;
    let document = json(&RUN.folder.join("calibration.json"));
    assert_keeps_schema(&document, "calibration_result");
    let rounds = document["rounds"]["rounds"].as_array().unwrap();
    for round in rounds {
        println!("{round}");
    }
    assert_eq!(verdict.valid, long(), "{:?}", verdict.reasons);
    assert_eq!(document["rounds"]["converged"], long());
    // The bound.
    let expected = if long() { 2..=4 } else { 1..=1 };
    assert!(expected.contains(&rounds.len()), "{}", rounds.len());
    // The orbit is 740 m off and the mounting 300 m: many cells of 100 m at first, in the end less than one (the bound).
    let shift = |of: &Value| number(&of["shift_cells"]);
    assert!(shift(&rounds[0]) > 3.0, "{}", shift(&rounds[0]));
    assert!(!long() || shift(rounds.last().unwrap()) < 1.0);
    for round in rounds {
        // As many as a calibration needs, on either side.
        assert!(number(&round["units_kept"]) >= 10.0);
        assert!(number(&round["judging_kept"]) >= 5.0);
        // Matched to some tenths of a pixel by 31 pixels of texture.
        assert!(number(&round["tie_rms_px"]) < 0.3);
    }
    let page = fs::read_to_string(RUN.folder.join("report/index.html")).unwrap();
    assert!(page.contains("From round to round"));
    assert!(page.contains("Concordance of terrain model and laser heights at withheld shots"));
}

/// The terrain model of the last round and the units of shots are products; withheld shots agree with the model after the
/// shift, and in the last round without one.
#[test]
fn the_terrain_model_and_the_laser_units_are_products() {
    let document = json(&RUN.folder.join("calibration.json"));
    let last = document["rounds"]["rounds"]
        .as_array()
        .unwrap()
        .last()
        .unwrap();
    let units = fs::read_to_string(RUN.folder.join("units.csv")).unwrap();
    let mut rows = units
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let at = |name: &str| names.iter().position(|of| *of == name).unwrap();
    let (kept, before, after) = (at("kept"), at("ccc_before"), at("ccc_after"));
    let kept: Vec<[f64; 2]> = rows
        .filter(|cells| cells[kept] == "true")
        .map(|cells| [before, after].map(|at| cells[at].parse().unwrap()))
        .collect();
    let stated = number(&last["units_kept"]) + number(&last["judging_kept"]);
    assert!(
        (kept.len() as f64 - stated).abs() < 0.5,
        "{} units, {stated} stated",
        kept.len()
    );
    let median = |at: usize| median(&mut kept.iter().map(|unit| unit[at]).collect::<Vec<_>>());
    println!(
        "concordance {:.3} without the shift, {:.3} with it",
        median(0),
        median(1)
    );
    // A shift does not change the height offset of the first model, which lowers its concordance; the last one has none.
    assert!(median(1) > median(0), "{} {}", median(0), median(1));
    assert!(!long() || median(0) > 0.9, "{}", median(0));
    let model = read_terrain_model(
        &RUN.folder.join("surface_above_sphere.tif"),
        Body::Mars,
        HeightsAbove::default(),
    );
    let model = model.unwrap();
    // Checked places are on the true ground. In the first round, the model is as far off as the orbit.
    let truth = json(&SCENE.path().join("lines/truth.json"));
    let checked = truth["checked"].as_array().unwrap().iter();
    let off_m = checked.filter_map(|of| {
        let place = Spherical::from_xyz_m(&Vector3::from(
            [0, 1, 2].map(|axis| number(&of["place_m"][axis])),
        ));
        let height_m = model.height_m(model.cell_of(place.longitude_rad, place.latitude.0))?;
        Some(height_m + model.radius_m - place.radius_m)
    });
    let off_m: Vec<f64> = off_m.collect();
    println!(
        "{} places, {:.1} m",
        off_m.len(),
        rms(off_m.iter().copied())
    );
    assert!(off_m.len() >= 50, "{}", off_m.len());
    // Cells of 100 m on slopes: the bound of the heights of places.
    assert!(!long() || rms(off_m.iter().copied()) < 30.0);
    let manifest = RUN.manifest().unwrap();
    let rows_of = |path: &str| {
        manifest
            .products
            .iter()
            .find(|of| of.path == path)
            .unwrap()
            .rows
    };
    assert_eq!(
        rows_of("surface_above_sphere.tif"),
        rows_of("surface_sigma.tif")
    );
}

#[test]
fn places_are_as_near_as_stated_to_where_they_truly_are() {
    // The second one in the long run: a scene and its calibration take as long as all the rest.
    let other = long().then(|| {
        let folder = scene(2);
        let run = run_in(folder.path(), "other", &[]).unwrap();
        (folder, run)
    });
    let other = other.as_ref().map(|(folder, run)| (folder.path(), run));
    for (folder, run) in [(SCENE.path(), &*RUN)].into_iter().chain(other) {
        let verdict = &run.manifest().unwrap().verdict;
        assert_eq!(verdict.valid, long(), "{:?}", verdict.reasons);
        let given = errors_m(folder, |line| folder.join(format!("lines/isd/{line}.json")));
        let errors_m = errors_m(folder, |line| {
            run.folder.join(format!("cameras/{line}/isd.json"))
        });
        let [plane_m, height_m] = plane_and_height_m(&errors_m);
        let before_m = plane_and_height_m(&given);
        println!(
            "before {before_m:.1?}; plane {plane_m:.2} m, height {height_m:.2} m of {}",
            errors_m.len()
        );
        assert!(errors_m.len() >= 100);
        assert!(before_m[0] > 500.0 && before_m[1] > 300.0, "{before_m:?}");
        if !long() {
            // The terrain model of the first round is as far off as the orbit: what is left is some per cent of it.
            assert!(plane_m < 0.1 * before_m[0], "{plane_m}");
            assert!(height_m < 0.1 * before_m[1], "{height_m}");
            continue;
        }
        // The bounds: half a pixel of the stereo lines, and 20 m.
        assert!(plane_m < 0.5 * PIXEL_M, "{plane_m}");
        assert!(height_m < 20.0, "{height_m}");
        let document = json(&run.folder.join("calibration.json"));
        let held_back = &document["held_back"];
        let stated_m = ["accuracy_plane_m", "accuracy_height_m"].map(|key| number(&held_back[key]));
        let scatter = [&held_back["scatter"], &document["control_scatter"]]
            .map(|of| ["plane", "height"].map(|axis| number(&of[axis]["sigmas"])));
        println!("stated {stated_m:.2?}, control off {scatter:.2?} times as far as expected");
        // The checked places are measured without error, so that only that of the calibration is left, which all of them share: two
        // standard deviations of it are rarely exceeded.
        for (found_m, stated_m) in [plane_m, height_m].iter().zip(stated_m) {
            assert!(*found_m < 2.0 * stated_m, "{found_m} of {stated_m}");
        }
        // Nor are standard deviations so large that they always hold. In the plane: the range within which the verdict has no word to
        // say; heights of units are as good as the worst of their ground, which few have.
        for [plane, height] in scatter {
            assert!((0.6..1.5).contains(&plane), "{scatter:?}");
            assert!((0.3..1.5).contains(&height), "{scatter:?}");
        }
    }
}

#[test]
fn a_second_run_has_nothing_to_do() {
    let finished = RUN.manifest().unwrap().finished_utc.clone();
    let config = CalibrationConfig::load(&SCENE.path().join("lines/whole.toml"))
        .unwrap()
        .config;
    let stored = stored_at(&RUN.folder);
    assert!(!stored.is_empty());
    let again = run_into(
        Task::Calibration(&config),
        &SCENE.path().join("whole"),
        false,
    )
    .unwrap();
    assert!(again.is_unchanged());
    assert_eq!(again.manifest().unwrap().finished_utc, finished);
    assert_eq!(
        again.manifest().unwrap().verdict,
        RUN.manifest().unwrap().verdict
    );
    assert_eq!(
        stored_at(&RUN.folder),
        stored,
        "a stage ran and stored its output again"
    );
}

/// A run that an observer stops when a stage begins.
#[derive(Debug)]
struct StopAt {
    stage: &'static str,
    stop: AtomicBool,
}

impl Observer for StopAt {
    fn hear(&self, stage: &str, event: &StageEvent<'_>) {
        if stage == self.stage && matches!(event, StageEvent::Begins(_)) {
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

/// The calibration of [`RUN`].
fn whole() -> CalibrationConfig {
    LazyLock::force(&RUN);
    let path = SCENE.path().join("lines/whole.toml");
    CalibrationConfig::load(&path).unwrap().config
}

/// The stages that [`RUN`] ran, from `first` on.
fn stages_from(first: &str) -> Vec<&'static str> {
    let all = ran(&RUN);
    let place = all.iter().position(|stage| *stage == first).unwrap();
    all[place..].to_vec()
}

/// A run that was ended in `stage` goes on there, and gives the products of an undisturbed one.
fn assert_resumes(out: &Path, stage: &str) {
    let config = whole();
    let planned = would_run(Task::Calibration(&config), out);
    assert_eq!(
        planned[0],
        (stage.to_owned(), "no earlier output".to_owned())
    );
    assert!(!out.join(&config.calibration).join("manifest.json").exists());
    let resumed = run_into(Task::Calibration(&config), out, false).unwrap();
    assert_eq!(ran(&resumed), stages_from(stage));
    assert!(products(&resumed.folder) == products(&RUN.folder));
}

/// In the last round of the long run, and in the first one of the short run, which has no other.
#[test]
fn a_calibration_that_was_stopped_goes_on_at_the_round_where_it_was() {
    let stage = if long() {
        "match_ties/round-3"
    } else {
        "map_surface/round-1"
    };
    let (config, out) = (whole(), SCENE.path().join("stopped"));
    let observer = StopAt {
        stage,
        stop: AtomicBool::new(false),
    };
    let stopped = run_observed(Task::Calibration(&config), &out, &observer, &observer.stop);
    let failure = stopped.unwrap_err();
    assert_eq!(failure.kind(), Kind::Interrupted, "{failure}");
    let place = format!("{}/{stage}: interrupted", config.calibration);
    assert!(failure.to_string().starts_with(&place), "{failure}");
    assert_resumes(&out, stage);
}

/// Sends a signal to the command as soon as the stage before the terrain model of `round` is stored; its exit code.
fn signalled(out: &Path, signal: &str, round: u32) -> Option<i32> {
    let config = whole();
    let mut command = areograph();
    command.args(["--quiet", "calibrate"]).arg(&config.file);
    let mut child = command.arg("--out").arg(out).spawn().unwrap();
    let stored = out.join(&config.calibration).join(CACHE);
    let before = stored.join(format!("align_lines+round-{round}"));
    while !before.exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended first");
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut kill = Command::new("kill");
    succeed(kill.arg(signal).arg(child.id().to_string()));
    child.wait().unwrap().code()
}

/// The test above and the one below are its short relatives.
#[test]
fn a_calibration_that_was_killed_goes_on_at_the_round_where_it_was() {
    if !long_test("a killed calibration") {
        return;
    }
    let out = SCENE.path().join("killed");
    assert_eq!(signalled(&out, "-KILL", 3), None);
    assert_resumes(&out, "map_surface/round-3");
}

#[test]
fn an_interrupt_leaves_the_terrain_model_and_the_earlier_products() {
    let out = SCENE.path().join("interrupted");
    let folder = out.join(whole().calibration);
    fs::create_dir_all(&folder).unwrap();
    for (path, bytes) in products(&RUN.folder) {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    assert_eq!(signalled(&out, "-INT", 1), Some(130));
    assert!(!folder.join(CACHE).join("map_surface+round-1").exists());
    assert!(products(&folder) == products(&RUN.folder));
}

/// What a changed key reaches, up to the first output that is not known.
#[test]
fn a_plan_names_the_round_that_a_key_changes() {
    let config = whole();
    let task = Task::Calibration(&config);
    assert_eq!(would_run(task, &SCENE.path().join("whole")), []);
    let mut changed = config.clone();
    changed.laser.least_score = 0.89;
    let planned = would_run(Task::Calibration(&changed), &SCENE.path().join("whole"));
    let named = |stage: &str, why: &str| (stage.to_owned(), why.to_owned());
    assert_eq!(
        planned,
        [
            named("match_laser/round-1", "key laser.least_score changed"),
            named(
                "calibrate/round-1",
                "output of match_laser/round-1 may change"
            ),
            named(
                "publish",
                "further stages may change, inputs of calibrate/round-1 may change, \
                 inputs of match_laser/round-1 may change, output of calibrate/round-1 may change, \
                 output of match_laser/round-1 may change"
            ),
        ]
    );
    let nowhere = SCENE.path().join("nowhere");
    let first = would_run(task, &nowhere);
    // The survey, the wide search, a round, and the publication.
    assert_eq!(first.len(), 1 + 2 + 5 + 1);
    assert!(first.iter().all(|(_, why)| why == "no earlier output"));
    assert!(!nowhere.exists());
}

/// When each stage output of a folder was stored; hashes of these files are hidden.
fn stored_at(folder: &Path) -> BTreeMap<PathBuf, SystemTime> {
    let entries = fs::read_dir(folder.join(CACHE)).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let is_hidden = |path: &Path| path.file_name().unwrap().to_string_lossy().starts_with('.');
    let outputs = paths.filter(|path| !is_hidden(path)).map(|path| {
        let modified = path.metadata().unwrap().modified().unwrap();
        (path, modified)
    });
    outputs.collect()
}

#[test]
fn exchanged_pixels_are_refused() {
    let exchanged = [
        ("images/s1.tif", "images/other.tif"),
        ("images/s2.tif", "images/s1.tif"),
        ("images/other.tif", "images/s2.tif"),
        ("search_cells = 30", "search_cells = 30\nrounds_max = 3"),
    ];
    // What is expected higher in one line lies lower in the other: nothing is alike.
    let told = refused("exchanged", &exchanged);
    assert!(told.contains("no tie point was found"), "{told}");
}

#[test]
fn input_that_is_missing_or_of_another_place_is_told() {
    let elsewhere = SCENE.path().join("lines/elsewhere");
    write_terrain_model_scene(&elsewhere, 1).unwrap();
    let small = SCENE.path().join("lines/small.png");
    let mut encoder = png::Encoder::new(fs::File::create(&small).unwrap(), 640, 8);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[100; 640 * 8]).unwrap();
    writer.finish().unwrap();
    let cases = [
        (
            "no shot lies on the ground of the images",
            refused("place", &[("pedr/*.b", "elsewhere/pedr/*.b")]),
        ),
        (
            "its pixel file has 8 lines of 640 samples",
            refused("size", &[("images/nd.tif", "small.png")]),
        ),
        (
            "a file with the pixels of camera nd",
            refused("pixels", &[("pixels = \"images/nd.tif\"\n", "")]),
        ),
        (
            "xy.tif",
            refused("absent", &[("images/nd.tif", "images/xy.tif")]),
        ),
        (
            "no table of points",
            refused(
                "tables",
                &[("match = true", "match = true\nfiles = [\"truth.json\"]")],
            ),
        ),
        ("rounds_max", {
            let text =
                "calibration = \"c\"\n[ties]\nmatch = true\n[laser]\ncell_m = 0\nrounds_max = 0\n";
            CalibrationConfig::parse(text, Path::new("c.toml"))
                .unwrap_err()
                .to_string()
        }),
    ];
    for (expected, told) in cases {
        assert!(told.contains(expected), "{expected}: {told}");
    }
}
