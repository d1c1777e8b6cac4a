//! `areograph pedr match` as its user has it: laser passes over a synthetic terrain model, from files to products, against the
//! truth, and input that is refused.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::too_many_lines,
    reason = "tests work in temporary folders and may fail loudly"
)]

use crate::common;

pub(crate) mod curves;
mod model;
mod pictures;
mod refused;
mod sigma;

use std::{
    fs,
    path::PathBuf,
    sync::{LazyLock, atomic::AtomicBool},
};

use areograph::{
    altimetry::{GroundRadius, ShotFilter},
    body::Body,
    error::Error,
    flow::Task,
    geom::{ellipsoid::spherical_to_xyz_m, pushbroom::Detector},
    pds::{
        calibration_tables::read_control,
        isd::read_isd,
        terrain_model::{HeightsAbove, read_terrain_model},
    },
    scene::write_terrain_model_scene,
    stages::match_laser::{
        LaserMatch, MatchImage, MatchOptions, MatchRequest, Similarity, UnitResult, match_laser,
    },
};
use common::{
    flows::{run_into, would_run},
    json,
    mission::{areograph, products, succeed},
};
use tempfile::TempDir;

/// The scene of seed 1, which tests read and do not change.
static SCENE: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    write_terrain_model_scene(&folder.path().join("scene"), 1).unwrap();
    folder
});

fn scene() -> PathBuf {
    SCENE.path().join("scene")
}

/// What `areograph pedr match` asks for, with fewer shifts.
fn request(search_cells: u32, similarity: Option<Similarity>) -> MatchRequest {
    MatchRequest {
        options: MatchOptions {
            segment_points: 15,
            segment_drift: None,
            least_variance_m2: 1_000.0,
            similarity,
            search_cells,
            least_score: 0.9,
            least_contrast: 1.0,
            limit_m: 60.0,
            seed: 1,
            ground: GroundRadius::Corrected,
            filter: ShotFilter {
                classes: vec![1],
                channels: vec![1, 2, 3, 4],
                attitude_flags: vec![0, 1],
                off_nadir_max_rad: 1.5,
                solar_longitude_rad: ShotFilter::ALL_SEASONS,
            },
        },
        body: Body::Mars,
        radius_m: None,
        heights_apart: false,
        model: scene().join("model.tif"),
        pedr: vec![scene().join("pedr")],
        images: Vec::new(),
    }
}

fn with_images(of: MatchRequest) -> MatchRequest {
    let image = |name: &str| MatchImage {
        name: name.to_owned(),
        isd: scene().join(format!("isd/{name}.json")),
    };
    MatchRequest {
        images: vec![image("s1"), image("s2")],
        ..of
    }
}

fn matched(request: &MatchRequest) -> Result<LaserMatch, Error> {
    match_laser(request, &AtomicBool::new(false))
}

fn kept(of: &LaserMatch) -> Vec<&UnitResult> {
    of.units.iter().filter(|unit| unit.is_kept()).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Two numbers of the truth.
fn truth(key: &str) -> [f64; 2] {
    let truth = json(&scene().join("truth.json"));
    [0, 1].map(|axis| truth[key][axis].as_f64().unwrap())
}

fn true_bias_m() -> f64 {
    json(&scene().join("truth.json"))["bias_m"]
        .as_f64()
        .unwrap()
}

/// How far the shifts of kept units are from the truth, cells.
fn errors_cells(of: &LaserMatch) -> Vec<f64> {
    let [east, north] = truth("shift_cells");
    let found = kept(of)
        .into_iter()
        .map(|unit| unit.found.unwrap().shift_cells);
    found
        .map(|found| (found[0] - east).hypot(found[1] - north))
        .collect()
}

/// By the measure that is taken by itself.
static MATCHED: LazyLock<LaserMatch> =
    LazyLock::new(|| matched(&with_images(request(30, None))).unwrap());

#[test]
fn shifts_and_bias_are_those_of_the_truth() {
    let of = &*MATCHED;
    assert!(of.verdict.valid, "{:?}", of.verdict);
    // The bias of 35 m is 0.4 of the relief: correlation stays, and says so.
    assert_eq!(of.similarity, Similarity::Pearson);
    assert!(
        of.verdict
            .remarks
            .iter()
            .any(|of| of.contains("by correlation"))
    );
    // Units of at least 16 shots from 5,700 shots, a half of them without relief.
    assert!(kept(of).len() >= 80, "{} units", kept(of).len());
    let errors = errors_cells(of);
    let largest = errors.iter().copied().fold(0.0, f64::max);
    // Half a cell is what the peak of whole cells could tell; a unit with little relief is known to a cell and a half.
    assert!(
        median(errors.clone()) < 0.5 && largest < 1.5,
        "{} {largest}",
        median(errors)
    );
    let bias_m = of.bias_m.unwrap();
    // Noise of 8 m over more than 800 shots leaves 0.3 m; heights between cells of rough ground about as much.
    assert!((bias_m - true_bias_m()).abs() < 2.0, "{bias_m} m");
}

/// Longer segments, as a drift of one cell in 40 shots permits (Li et al. 2023, eq. 16).
#[test]
fn segments_by_drift_have_the_shifts_of_the_truth() {
    let cell_m = MATCHED.cell_m[0].min(MATCHED.cell_m[1]);
    let mut longer = request(30, None);
    // Shots are 300 m apart.
    longer.options.segment_drift = Some(cell_m / (40.0 * 300.0));
    let of = matched(&longer).unwrap();
    assert!(of.verdict.valid, "{:?}", of.verdict);
    assert!(
        of.segments * 2 < MATCHED.segments && of.segments > 0,
        "{} of {}",
        of.segments,
        MATCHED.segments
    );
    // As with segments of 15 shots: half a cell is what the peak of whole cells could tell.
    let errors = errors_cells(&of);
    assert!(errors.len() > 20, "{} units", errors.len());
    assert!(median(errors) < 0.5);
}

/// Model minus laser with the true shift and bias at all shots of the box, by another reader of shots: root mean square, metres.
fn true_rms_m() -> f64 {
    let shots = SCENE.path().join("shots.csv");
    let mut search = areograph();
    search
        .args(["--quiet", "pedr", "search"])
        .arg(scene().join("pedr"));
    search
        .arg("--box=-60.45,-59.55,-30.4,-29.6")
        .arg("--out")
        .arg(&shots);
    succeed(&mut search);
    let model = scene().join("model.tif");
    let grid = read_terrain_model(&model, Body::Mars, HeightsAbove::default()).unwrap();
    let [east, north] = truth("shift_cells");
    let mut table = csv::Reader::from_path(&shots).unwrap();
    let header = table.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|of| of == name).unwrap();
    let columns = ["longitude_deg", "latitude_deg", "radius_m"].map(at);
    let off_m = table.records().filter_map(|row| {
        let row = row.unwrap();
        let [longitude, latitude, radius_m] = columns.map(|of| row[of].parse::<f64>().unwrap());
        let [row, column] = grid.cell_of(longitude.to_radians(), latitude.to_radians());
        let height_m = grid.height_m([row - north, column + east])?;
        Some(height_m + grid.radius_m - radius_m - true_bias_m())
    });
    let squares: Vec<f64> = off_m.map(|of| of * of).collect();
    assert!(squares.len() > 3_000, "{} shots", squares.len());
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn the_stated_figure_of_held_out_shots_is_the_true_one() {
    let held_out = MATCHED.held_out.unwrap();
    let expected_m = true_rms_m();
    // 800 shots tell it to 3 %; kept units are rougher than the whole box, and their shifts are off by a fifth of a cell.
    assert!(
        (0.85..1.25).contains(&(held_out.after_m / expected_m)),
        "{} m, true {expected_m} m",
        held_out.after_m
    );
    assert!(held_out.before_m > 4.0 * held_out.after_m, "{held_out:?}");
    // Every fourth shot of every kept unit.
    let shots: usize = kept(&MATCHED).iter().map(|unit| unit.shots / 4).sum();
    assert_eq!(held_out.shots, shots);
}

/// The doubt of the fact sheet about eq. 18, in numbers: concordance takes a bias for a misfit and moves to where there is less.
#[test]
fn concordance_is_driven_aside_by_a_bias_and_is_told_to_be() {
    let concordance = matched(&request(30, Some(Similarity::Ccc))).unwrap();
    assert!(!concordance.verdict.valid, "{:?}", concordance.verdict);
    assert!(
        concordance.verdict.reasons[0].contains("concordance"),
        "{:?}",
        concordance.verdict
    );
    // Least squares bring a unit back by a cell at most; correlation is off by less than half a cell, with the whole bias.
    assert!(median(errors_cells(&concordance)) > 1.0);
    assert!(concordance.bias_m.unwrap() < 0.6 * true_bias_m());
    let removed = matched(&request(30, Some(Similarity::CccBiasRemoved))).unwrap();
    assert!(removed.verdict.valid && median(errors_cells(&removed)) < 0.5);
}

/// Without a bias concordance is taken, and is right.
#[test]
fn concordance_is_taken_where_it_can_see() {
    let folder = tempfile::tempdir().unwrap();
    let level = folder.path().join("level.tif");
    model::edited(&scene().join("model.tif"), &level, |model| {
        model.change(|height_m| height_m - 35.0);
    });
    let of = matched(&MatchRequest {
        model: level,
        ..request(20, None)
    });
    let of = of.unwrap();
    assert!(of.verdict.valid, "{:?}", of.verdict);
    assert_eq!(of.similarity, Similarity::Ccc);
    assert!(
        median(errors_cells(&of)) < 0.5,
        "{}",
        median(errors_cells(&of))
    );
}

/// The ray of a place in an image, by the tables of its support data alone, passes the model's place.
#[test]
fn images_show_the_models_place_where_the_table_says() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let request = with_images(request(20, None));
    let outcome = run_into(Task::Match(&request), &out, false).unwrap();
    assert!(outcome.manifest().unwrap().verdict.valid && !outcome.is_unchanged());
    let table = read_control(&out.join("control.csv")).unwrap();
    assert!(table.complaints.is_empty());
    let of = matched(&request).unwrap();
    assert_eq!(of.points.len(), kept(&of).len());
    let seen = of
        .points
        .iter()
        .flat_map(|point| &point.in_images)
        .flatten();
    assert_eq!(table.rows.len(), seen.count());
    assert!(
        table.rows.len() > of.points.len(),
        "{} places",
        table.rows.len()
    );
    for row in &table.rows {
        let image = read_isd(&scene().join(format!("isd/{}.json", row.image.camera))).unwrap();
        let detector = Detector::new(
            &image.instrument,
            image.crosstrack_summing,
            image.first_detector,
            image.samples,
        );
        let et_s = image.line_times.et(row.image.line).seconds();
        let tables = &image.tables;
        let to_body = tables.body_rotation.constant * tables.body_rotation.at(et_s).0;
        let to_camera = tables.pointing.constant * tables.pointing.at(et_s).0;
        let position_m = to_body * tables.position.at(et_s).0;
        let ray = to_body
            * to_camera
                .tr_mul(&detector.look(row.image.sample))
                .normalize();
        let point = of
            .points
            .iter()
            .find(|point| point.name == row.image.point)
            .unwrap();
        let [longitude_rad, latitude_rad, radius_m] = point.model;
        let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
        let off_m = (place_m - position_m).cross(&ray).norm();
        // A hundredth of a line of 27 m.
        assert!(off_m < 0.3, "{}: {off_m} m", row.image.point);
        // Digits of the table, metres. What the laser errs by is for the calibration to say.
        assert!((row.radius_m - point.laser[2]).abs() < 1e-3);
        let [horizontal_m, vertical_m] = row.matching_m.map(Option::unwrap);
        assert!((horizontal_m - point.sigma_horizontal_m()).abs() < 1e-3);
        assert!((vertical_m - point.sigma_m[2]).abs() < 1e-3 && row.sigma_m == [None; 2]);
    }
    // The same again is kept; products are those of one thread.
    assert!(
        run_into(Task::Match(&request), &out, false)
            .unwrap()
            .is_unchanged()
    );
    assert_eq!(would_run(Task::Match(&request), &out), []);
    let mut changed = request.clone();
    changed.options.seed += 1;
    let planned = would_run(Task::Match(&changed), &out);
    let seed = "key request.options.seed changed".to_owned();
    assert_eq!(planned[0], ("match_laser".to_owned(), seed));
    assert_eq!((planned.len(), &*planned[1].0), (2, "publish"));
    let alone = folder.path().join("alone");
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    pool.install(|| run_into(Task::Match(&request), &alone, false))
        .unwrap();
    assert_eq!(products(&out), products(&alone));
}

#[test]
fn the_command_answers_with_its_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let ended = |more: &[&str]| {
        let mut command = areograph();
        command
            .args(["--quiet", "pedr", "match"])
            .arg(scene().join("model.tif"));
        command
            .arg(scene().join("pedr"))
            .args(["--search", "15", "--out"]);
        let output = command
            .arg(folder.path().join("out"))
            .args(more)
            .output()
            .unwrap();
        let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        (output.status.code().unwrap(), text)
    };
    let (code, text) = ended(&["--json"]);
    assert_eq!(code, 0, "{text}");
    let answer: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(answer["verdict"]["valid"], true);
    assert!(answer["figures"]["held_out_rms_m"].as_f64().unwrap() > 1.0);
    let page = fs::read_to_string(folder.path().join("out/report/index.html")).unwrap();
    assert!(page.contains("Shifts of the model"));
    // In the letters of a picture anything may stand.
    let mut words = page
        .split("base64,")
        .filter_map(|part| part.split_once('"'));
    assert!(words.all(|(_, words)| !words.contains("NaN")));
    let (code, text) = ended(&["--limit-m", "2"]);
    assert_eq!(code, 5, "{text}");
    assert!(text.contains("expected at most 2 m"), "{text}");
    assert_eq!(ended(&["--isd", "s1=a.json"]).0, 2);
    assert_eq!(ended(&["--least-score", "1.5"]).0, 2);
}
