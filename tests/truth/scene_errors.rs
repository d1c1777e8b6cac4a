//! Errors that a synthetic mission is given are in its products as `truth.json` tells them.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly, and files in a temporary folder need no atomic writer"
)]

use crate::common;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::{LazyLock, atomic::AtomicBool},
};

use areograph::{
    config::{Document as _, SiteConfig},
    footprints::Footprint,
    geom::{
        attitude::matrix_of_spice_quaternion,
        ellipsoid::spherical_to_xyz_m,
        pushbroom::{ExteriorOrientation, Pose, Projector, SampledOrientation},
    },
    pds::ties::read_ties,
    scene::{
        AttitudeErrors, Jitter, Misregistration, PositionErrors, Relief, Roughness, SceneErrors,
        SceneOptions, write_scene,
    },
    stages::convert_datum::convert_datum,
};
use common::{json, mission::areograph, number, search::search_footprints};
use nalgebra::Vector3;
use serde_json::Value;

/// Nobody stops these searches.
static RUN_ON: AtomicBool = AtomicBool::new(false);
const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];

/// Everything that is drawn, over ground of medium roughness.
const REALISTIC: SceneErrors = SceneErrors::realistic(Roughness::Medium);
const NO_JITTER: Jitter = Jitter {
    sinusoids: 0,
    amplitude_rad: [0.0; 2],
    period_s: [0.0; 2],
};
const NO_TURN: AttitudeErrors = AttitudeErrors {
    constant_sigma_rad: [0.0; 3],
    linear_sigma_rad: 0.0,
    quadratic_sigma_rad: 0.0,
    jitter: NO_JITTER,
    slow_jitter: NO_JITTER,
};

/// A mission of ten-minute days, which images and windows fit into.
struct Mission {
    folder: tempfile::TempDir,
    truth: Value,
}

static MISSION: LazyLock<Mission> = LazyLock::new(|| Mission::of(11, REALISTIC));

impl Mission {
    #[allow(
        clippy::large_types_passed_by_value,
        reason = "a mission is written in seconds"
    )]
    fn of(seed: u64, errors: SceneErrors) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let options = SceneOptions {
            seed,
            day_s: 600.0,
            pairs: 1,
            passes: 0,
            ties: 154,
            ties_at_shots: false,
            errors,
        };
        write_scene(&folder.path().join("mission"), &options).unwrap();
        let truth = json(&folder.path().join("mission/truth.json"));
        Self { folder, truth }
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join("mission").join(relative)
    }

    /// The shots of one file in the window of its site, as areograph reads them.
    fn shots(&self, profile: &Value) -> Vec<Footprint> {
        let site = profile["window"].as_str().unwrap();
        let config = SiteConfig::load(&self.path(&format!("sites/{site}.toml")))
            .unwrap()
            .config;
        let correction_s = config.altimeter_clock.correction_s();
        let searched =
            search_footprints(&config.pedr, &config.windows, correction_s, &RUN_ON).unwrap();
        let all = convert_datum(searched.footprints, &config.altimeter_clock).footprints;
        let name = profile["file"].as_str().unwrap();
        let is_own = |file: usize| all.files[file].name == name;
        (0..all.et_s.len())
            .map(|row| all.row(row))
            .filter(|shot| is_own(usize::from(shot.file)))
            .collect()
    }

    /// What was drawn for the day of an image.
    fn drawn(&self, image: &str) -> &Value {
        let mut drawn = list(&self.truth["errors_drawn"]).iter();
        drawn.find(|drawn| drawn["image"] == image).unwrap()
    }

    /// An image as kernels tell it, by its label's times and the orbit `gsfc`.
    fn told(&self, image: &str) -> SampledOrientation {
        let mut images = list(&self.truth["images"]).iter();
        let truth = images.find(|truth| truth["id"] == image).unwrap();
        let lines = number(&truth["lines_header"]);
        let step = lines / (list(&truth["epochs_et_s"]).len() - 1) as f64;
        orientation(truth, lines, |row| step * row as f64)
    }

    /// The cameras of all tie points, each with its site and the true orientation.
    fn cameras(&self) -> Vec<(&str, &Value, SampledOrientation)> {
        let cameras = list(&self.truth["ties"]).iter().flat_map(|ties| {
            let site = ties["site"].as_str().unwrap();
            list(&ties["cameras"])
                .iter()
                .map(move |camera| (site, camera))
        });
        let oriented = cameras.map(|(site, camera)| {
            let told = list(&camera["line"]);
            let lines = number(&told[told.len() - 1]);
            let taken = orientation(camera, lines, |row| number(&told[row]));
            (site, camera, taken)
        });
        oriented.collect()
    }

    /// Lines by which tie points that are no blunders were measured after the line that shows them as `told`, on
    /// average, and the metres of flight from line to line.
    fn late_lines(&self, site: &str, image: &str) -> f64 {
        let mut all = list(&self.truth["ties"]).iter();
        let truth = all.find(|ties| ties["site"] == site).unwrap();
        let ground: BTreeMap<&str, Vector3<f64>> = list(&truth["ties"])
            .iter()
            .filter(|tie| tie["blunder"].is_null())
            .map(|tie| {
                (
                    tie["id"].as_str().unwrap(),
                    vector(&tie["ground_iau2000_m"]),
                )
            })
            .collect();
        let lines = {
            let mut images = list(&self.truth["images"]).iter();
            number(&images.find(|truth| truth["id"] == image).unwrap()["lines_header"])
        };
        let mut cameras = list(&truth["cameras"]).iter();
        let camera = cameras.find(|camera| camera["image"] == image).unwrap();
        let told = by_light(&self.told(image), camera);
        let projector = Projector::new(&told, lines).unwrap();
        let file = read_ties(&self.path(&format!("ties/{site}.csv"))).unwrap();
        let late = file.ties.iter().filter_map(|tie| {
            let ground_m = ground.get(tie.id.as_str())?;
            let measure = tie.measures.iter().find(|one| one.image == image).unwrap();
            let x_lines = projector.project(ground_m).unwrap().x;
            Some(measure.line - 0.5 * lines - x_lines)
        });
        mean(&late.collect::<Vec<f64>>())
    }
}

/// Poses of `truth` at the lines that `line_of` says, from the middle.
fn orientation(truth: &Value, lines: f64, line_of: impl Fn(usize) -> f64) -> SampledOrientation {
    let poses: Vec<(f64, Pose)> = list(&truth["position_iau2000_m"])
        .iter()
        .zip(list(&truth["camera_to_mars_quaternion_wxyz"]))
        .enumerate()
        .map(|(row, (position, quaternion))| {
            let quaternion = [0, 1, 2, 3].map(|part| number(&quaternion[part]));
            let pose = Pose {
                position_m: vector(position),
                mars_to_camera: matrix_of_spice_quaternion(quaternion).transpose(),
            };
            (line_of(row) - 0.5 * lines, pose)
        })
        .collect();
    SampledOrientation::new(&poses).unwrap()
}

/// The same camera from where it sees the ground: where it was when the light left there, by the truth of `camera`.
fn by_light(orientation: &SampledOrientation, camera: &Value) -> SampledOrientation {
    let (told, times) = (list(&camera["line"]), list(&camera["epochs_et_s"]));
    let last = told.len() - 1;
    let (lines, duration_s) = (
        number(&told[last]),
        number(&times[last]) - number(&times[0]),
    );
    let late_s = list(&camera["light_time_s"]);
    let pose = |(line, late_s): (&Value, &Value)| {
        let x_lines = number(line) - 0.5 * lines;
        let late_lines = number(late_s) * lines / duration_s;
        let pose = Pose {
            position_m: orientation.pose(x_lines - late_lines).position_m,
            ..orientation.pose(x_lines)
        };
        (x_lines, pose)
    };
    let poses: Vec<(f64, Pose)> = told.iter().zip(late_s).map(pose).collect();
    SampledOrientation::new(&poses).unwrap()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| number(&value[axis]))
}

fn mean(values: &[f64]) -> f64 {
    assert!(!values.is_empty());
    values.iter().sum::<f64>() / values.len() as f64
}

fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares = values.iter().map(|value| (value - mean).powi(2));
    f64::sqrt(squares.sum::<f64>() / (values.len() - 1) as f64)
}

/// Where the file has each shot minus where the beam met the ground: east, north, up.
fn shifts_m(mission: &Mission, profile: &Value) -> Vec<Vector3<f64>> {
    let shots = mission.shots(profile);
    let truth = list(&profile["ground_iau2000_m"]);
    let records = list(&profile["record"]);
    let shot_numbers = list(&profile["shot"]);
    let is_shot = |index: usize, shot: &Footprint| {
        records[index] == shot.record && shot_numbers[index] == shot.shot
    };
    let shift = |(index, truth): (usize, &Value)| {
        // A shot whose shifted place is outside the window is not read.
        let shot = shots.iter().find(|shot| is_shot(index, shot))?;
        let told_m = spherical_to_xyz_m(
            shot.longitude_rad,
            shot.latitude_rad,
            shot.radius_crossover_m,
        );
        let true_m = vector(truth);
        let up = true_m.normalize();
        let east = Vector3::z().cross(&up).normalize();
        let off_m = told_m - true_m;
        Some(Vector3::new(
            off_m.dot(&east),
            off_m.dot(&up.cross(&east)),
            told_m.norm() - true_m.norm(),
        ))
    };
    let shifts: Vec<_> = truth.iter().enumerate().filter_map(shift).collect();
    assert!(shifts.len() > 150, "{}", shifts.len());
    shifts
}

#[test]
fn profiles_lie_where_their_drawn_shift_puts_them() {
    for profile in list(&MISSION.truth["profiles"]) {
        let image = profile["image"].as_str().unwrap();
        let drawn = vector(&MISSION.drawn(image)["profile_shift"]["east_north_radial_m"]);
        let shifts = shifts_m(&MISSION, profile);
        for axis in 0..3 {
            let along: Vec<f64> = shifts.iter().map(|shift| shift[axis]).collect();
            let (mean_m, sigma_m) = (mean(&along), standard_deviation(&along));
            println!(
                "{image} axis {axis}: drawn {:.2}, mean {mean_m:.2} ± {sigma_m:.2} m",
                drawn[axis]
            );
            // 190 shots of 2 m (noise 1 m, the ground within the spot): 0.15 m, times four; rounding 0.06 m.
            assert!(
                (mean_m - drawn[axis]).abs() < 0.7,
                "{image} axis {axis}: {mean_m}"
            );
        }
        assert!(drawn.xy().norm() > 0.0);
    }
}

#[test]
fn shots_have_noise_steps_and_a_spot() {
    let smooth = SceneErrors {
        relief: Relief::Gentle,
        ..REALISTIC
    };
    let noise_m = |errors: SceneErrors| {
        let mission = Mission::of(11, errors);
        let profiles = list(&mission.truth["profiles"]).iter();
        let noise = profiles.flat_map(|profile| {
            let up: Vec<f64> = shifts_m(&mission, profile).iter().map(|s| s.z).collect();
            let mean_m = mean(&up);
            up.into_iter().map(move |up_m| up_m - mean_m)
        });
        standard_deviation(&noise.collect::<Vec<f64>>())
    };
    // 1100 shots: 2 %, times four; a step of 0.375 m adds 0.6 %.
    let smooth_m = noise_m(smooth);
    assert!((smooth_m - 1.0).abs() < 0.09, "{smooth_m}");
    // What the mean over a disc of 75 m misses the ground in its middle by, from the structure function: 0.87 m.
    let rough_m = noise_m(REALISTIC);
    let by_the_spot_m = (rough_m.powi(2) - smooth_m.powi(2)).sqrt();
    println!("noise {smooth_m:.3} m, with the spot {rough_m:.3} m");
    assert!((0.65..1.1).contains(&by_the_spot_m), "{by_the_spot_m}");
    for profile in list(&MISSION.truth["profiles"]) {
        for shot in MISSION.shots(profile) {
            let steps = shot.range_m / 0.375;
            // Ranges are written in centimetres.
            assert!(
                (steps - steps.round()).abs() * 0.375 < 0.006,
                "{}",
                shot.range_m
            );
        }
    }
}

/// Axes of the bus in those of the camera: the columns of its mounting (`moc.ti`).
const BUS_IN_CAMERA: [[f64; 3]; 3] = [
    [0.999_994_283_9, -0.003_141_585_0, -0.001_250_004_5],
    [0.003_139_080_4, 0.999_993_071_7, -0.002_000_668_0],
    [0.001_256_281_1, 0.001_996_732_7, 0.999_997_217_4],
];

#[test]
fn camera_and_laser_share_the_errors_of_their_bus() {
    let errors = SceneErrors {
        attitude: AttitudeErrors {
            jitter: NO_JITTER, // poses of the truth are too far apart to show it
            ..REALISTIC.attitude
        },
        ..REALISTIC
    };
    let mission = Mission::of(12, errors);
    let [x, y, z] = BUS_IN_CAMERA.map(Vector3::from);
    for (_, camera, taken) in mission.cameras() {
        let image = camera["image"].as_str().unwrap();
        // +Z of the bus but for the boresight's error, the same on all days.
        let boresight_rad = &mission.drawn(image)["boresight_rad"];
        let [towards_x, towards_y] = [0, 1].map(|axis| number(&boresight_rad[axis]));
        assert!(towards_x.abs().min(towards_y.abs()) > 1e-6);
        let beam = (x * towards_x + y * towards_y + z).normalize();
        let mut profiles = list(&mission.truth["profiles"]).iter();
        let profile = profiles.find(|profile| profile["image"] == image).unwrap();
        let times = list(&camera["epochs_et_s"]);
        let (first_s, last_s) = (number(&times[0]), number(&times[times.len() - 1]));
        let lines = number(&list(&camera["line"])[times.len() - 1]);
        let told = mission.told(image);
        let (mut simultaneous, mut told_off_rad) = (0, 0.0_f64);
        for (et, ground) in list(&profile["et_s"])
            .iter()
            .zip(list(&profile["ground_iau2000_m"]))
        {
            let share = (number(et) - first_s) / (last_s - first_s);
            if !(0.0..1.0).contains(&share) {
                continue;
            }
            simultaneous += 1;
            let off_rad = |orientation: &SampledOrientation, x_lines: f64| {
                let pose = orientation.pose(x_lines);
                let seen = pose.mars_to_camera * (vector(ground) - pose.position_m).normalize();
                (seen - beam).norm()
            };
            // 1e-7 rad is 4 cm on the ground; the mounting is printed to 1e-10.
            let off = off_rad(&taken, (share - 0.5) * lines);
            assert!(off < 1e-7, "{image}: {off} rad");
            let late_lines = number(&camera["time_bias_lines"]);
            told_off_rad = told_off_rad.max(off_rad(&told, (share - 0.5) * lines + late_lines));
        }
        println!("{image}: {simultaneous} shots, as told {told_off_rad:.2e} rad off");
        assert!(simultaneous > 60, "{image}: {simultaneous}");
        let drawn = vector(&mission.drawn(image)["attitude"]["constant_rad"]);
        // As told it is off by what the bus was turned by about the two axes across the beam, and by its place.
        let turned_rad = drawn.xy().norm();
        assert!(
            (told_off_rad - turned_rad).abs() < 2e-4,
            "{image}: {told_off_rad} {turned_rad}"
        );
    }
}

#[test]
fn images_are_late_by_the_lines_that_were_drawn() {
    let errors = SceneErrors {
        attitude: NO_TURN,
        position: PositionErrors::Camera { sigma_m: 0.0 },
        ..REALISTIC
    };
    let mission = Mission::of(13, errors);
    for (site, camera, _) in mission.cameras() {
        let image = camera["image"].as_str().unwrap();
        let drawn = number(&camera["time_bias_lines"]);
        let late = mission.late_lines(site, image);
        println!("{image}: drawn {drawn:.2} lines, measured {late:.2} late");
        // Noise of a line over 146 points: 0.08, times four.
        assert!((late + drawn).abs() < 0.35, "{image}: {late} {drawn}");
        assert!(drawn.abs() > 0.0);
    }
}

#[test]
fn an_offset_of_the_attitudes_clock_shifts_images_that_point_at_nadir_only() {
    let errors = SceneErrors {
        misregistration: Misregistration::AttitudeClock { sigma_s: 0.73 },
        attitude: NO_TURN,
        position: PositionErrors::Camera { sigma_m: 0.0 },
        ..REALISTIC
    };
    let mission = Mission::of(14, errors);
    let offset_s = number(&mission.drawn("E02-00665")["attitude_clock_s"]);
    assert!(offset_s.abs() > 0.1, "{offset_s}");
    for (site, camera, taken) in mission.cameras() {
        let image = camera["image"].as_str().unwrap();
        assert!(number(&camera["time_bias_lines"]).abs() <= 0.0);
        let mut images = list(&mission.truth["images"]).iter();
        let truth = images.find(|truth| truth["id"] == image).unwrap();
        let late = mission.late_lines(site, image);
        let expected = if truth["look"] == "nadir" {
            // 380 km of 0.0509 degrees a second, in lines of 3.05 km/s.
            let turned_m = offset_s * 0.0509_f64.to_radians() * taken.pose(0.0).position_m.norm();
            let height_share = 380.0 / 3_776.0;
            turned_m * height_share / (3_053.0 * number(&truth["line_period_s"]))
        } else {
            0.0
        };
        println!("{image}: {late:.2} lines late, {expected:.2} by {offset_s:.3} s");
        // 2 % for height and speed, and four times the noise.
        assert!(
            (late.abs() - expected.abs()).abs() < 0.02 * expected.abs() + 0.35,
            "{image}: {late} {expected}"
        );
    }
}

#[test]
fn ties_lie_on_rough_ground_that_both_true_cameras_see() {
    for (site, camera, taken) in MISSION.cameras() {
        let image = camera["image"].as_str().unwrap();
        let lines = number(&list(&camera["line"])[30]);
        let seeing = by_light(&taken, camera);
        let projector = Projector::new(&seeing, lines).unwrap();
        let mut all = list(&MISSION.truth["ties"]).iter();
        let truth = all.find(|ties| ties["site"] == site).unwrap();
        let file = read_ties(&MISSION.path(&format!("ties/{site}.csv"))).unwrap();
        assert_eq!(file.ties.len(), 154, "{site}");
        let late: Vec<f64> = file
            .ties
            .iter()
            .zip(list(&truth["ties"]))
            .filter(|(_, truth)| truth["blunder"].is_null())
            .map(|(tie, truth)| {
                let measure = tie.measures.iter().find(|one| one.image == image).unwrap();
                let ground_m = vector(&truth["ground_iau2000_m"]);
                measure.line - 0.5 * lines - projector.project(&ground_m).unwrap().x
            })
            .collect();
        // Noise of a line, and jitter of 10 µrad at most, 0.7 to 1.2 lines, that 31 poses do not show.
        assert!(mean(&late).abs() < 0.5, "{image}: {}", mean(&late));
        let sigma = standard_deviation(&late);
        assert!((0.8..1.8).contains(&sigma), "{image}: {sigma}");
    }
}

/// Contents of every file below a folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = fs::read(&path).unwrap();
                found.insert(path, bytes);
            }
        }
    }
    found
}

#[test]
fn the_same_seed_draws_the_same_and_another_seed_other_errors() {
    let again = Mission::of(11, REALISTIC);
    let [first, second] = [&*MISSION, &again].map(|mission| contents(&mission.path("")));
    assert_eq!(first.len(), second.len());
    assert!(first.len() > 40);
    assert!(first.values().eq(second.values()));
    let other = Mission::of(12, REALISTIC);
    for image in list(&MISSION.truth["images"]) {
        let image = image["id"].as_str().unwrap();
        let [mine, others] = [&*MISSION, &other].map(|mission| mission.drawn(image));
        for part in [
            "time_bias_lines",
            "bus_position_m",
            "attitude",
            "profile_shift",
        ] {
            assert_ne!(mine[part], others[part], "{image}: {part}");
        }
    }
}

#[test]
fn site_files_tell_the_noise_of_their_ties() {
    let errors = SceneErrors {
        tie_noise_px: 0.22,
        ..REALISTIC
    };
    let mission = Mission::of(15, errors);
    for site in SITES {
        let loaded = SiteConfig::load(&mission.path(&format!("sites/{site}.toml"))).unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        let sigma_px = loaded.config.adjustment.tie_sigma_px;
        assert!((sigma_px[1] - 0.22).abs() < 1e-12);
        // A line is 1.03 to 1.63 focal-plane pixels; that of a pair is its mean.
        let along = sigma_px[0] / 0.22;
        let cameras = mission.cameras();
        let own = cameras.iter().filter(|(of, _, _)| *of == site);
        let lines: Vec<f64> = own
            .map(|(_, camera, _)| number(&camera["focal_px_per_line"]))
            .collect();
        println!("{site}: {lines:.3?} focal-plane pixels a line, told {along:.3}");
        assert!((along - mean(&lines)).abs() < 0.003, "{along} {lines:?}"); // told to 0.001 px
        assert!(lines.iter().all(|px| (1.0..1.7).contains(px)), "{lines:?}");
    }
}

#[test]
fn options_without_realistic_or_out_of_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], code: i32, words: &str| {
        let target = folder.path().join("mission");
        let output = areograph()
            .args(["scene", "mission"])
            .arg(&target)
            .args(arguments)
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
        assert!(!target.exists(), "{arguments:?}");
    };
    refused(&["--roughness", "rough"], 2, "--realistic");
    refused(&["--tie-noise-px", "0.22"], 2, "--realistic");
    refused(&["--attitude-clock"], 2, "--realistic");
    refused(
        &["--realistic", "--attitude-clock-s", "0.5"],
        2,
        "--attitude-clock",
    );
    let offset = [
        "--realistic",
        "--attitude-clock",
        "--attitude-clock-s",
        "NaN",
    ];
    refused(&offset, 2, "-100 to 100");
    refused(
        &["--realistic", "--roughness", "steep"],
        2,
        "plains, medium, rough",
    );
    refused(
        &["--realistic", "--tie-noise-px", "7"],
        2,
        "tie_noise_px is 7; expected 0 to 5",
    );
    refused(
        &["--realistic", "--tie-noise-px", "NaN"],
        2,
        "tie_noise_px is NaN; expected 0 to 5",
    );
    refused(&["--day-s", "60"], 2, "day_s is 60; expected 600 to 90000");
}
