//! What products state of accuracy, held against the truth of synthetic missions: ten seeds and the built-in one.
//!
//! Nothing here is computed by what is judged: errors come from `truth.json`, which no stage reads.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

mod common;

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::{Path, PathBuf},
};

use areograph::geom::{
    attitude::matrix_of_spice_quaternion,
    pushbroom::{Pose, Projector, SampledOrientation},
};
use arrow::{
    array::{Array as _, AsArray, RecordBatch},
    datatypes::{Float64Type, UInt32Type},
};
use common::{
    json,
    mission::{areograph, mission, succeed},
};
use nalgebra::{Matrix3, Vector3};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];
const SEEDS: std::ops::RangeInclusive<u32> = 2..=11;

/// Errors of a site's good tie points against truth, and what is stated of them.
struct Judged {
    name: String,
    /// East, north and up, metres.
    errors_m: Vec<Vector3<f64>>,
    /// Stated standard deviations of the same.
    sigmas_m: Vec<Vector3<f64>>,
    /// Stated standard deviations of their mean.
    mean_sigmas_m: Vector3<f64>,
    /// Median height above the MOLA surface before the adjustment, and the true error of heights then, metres.
    against_mola_m: f64,
    before_m: f64,
    /// Stated standard deviation of the mean height of the surface, metres.
    surface_sigma_m: f64,
    /// Standard deviation of unit weight along the track.
    along: f64,
    lost: Vec<String>,
    kept_blunders: Vec<String>,
}

fn table(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    builder.build().unwrap().next().unwrap().unwrap()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| value[axis].as_f64().unwrap())
}

/// Rows towards east, north and up.
fn local(place_m: &Vector3<f64>) -> Matrix3<f64> {
    let up = place_m.normalize();
    let east = Vector3::z().cross(&up).normalize();
    Matrix3::from_rows(&[
        east.transpose(),
        up.cross(&east).transpose(),
        up.transpose(),
    ])
}

impl Judged {
    fn of(mission: &Path, out: &Path, site: &str) -> Self {
        let truth = json(&mission.join("truth.json"));
        let mut sites = truth["ties"].as_array().unwrap().iter();
        let own = sites.find(|of| of["site"] == site).unwrap();
        let ties: BTreeMap<&str, &Value> = own["ties"]
            .as_array()
            .unwrap()
            .iter()
            .map(|tie| (tie["id"].as_str().unwrap(), tie))
            .collect();
        let folder = out.join(site);
        let found = table(&folder.join("ties.parquet"));
        let names = found.column_by_name("tie").unwrap().as_string::<i32>();
        let numbers = |name: &str, row: usize| {
            let column = found.column_by_name(name).unwrap();
            let column = column.as_primitive::<Float64Type>();
            (!column.is_null(row)).then(|| column.value(row))
        };
        let three = |names: [&str; 3], row: usize| {
            let values = names.map(|name| numbers(name, row));
            Some(Vector3::new(values[0]?, values[1]?, values[2]?))
        };
        let document = json(&folder.join("adjustment.json"));
        let summary = &document["adjustment"]["summary"];
        let mut judged = Self {
            name: format!("{} {site}", mission.file_name().unwrap().to_string_lossy()),
            errors_m: Vec::new(),
            sigmas_m: Vec::new(),
            mean_sigmas_m: vector(&document["adjustment"]["heights"]["mean_sigma_m"]),
            against_mola_m: document["before"]["heights"]["above_surface_m"]["median"]
                .as_f64()
                .unwrap(),
            before_m: 0.0,
            surface_sigma_m: document["before"]["heights"]["mean_sigma_m"]
                .as_f64()
                .unwrap(),
            along: summary["tie_components"][0].as_f64().unwrap(),
            lost: Vec::new(),
            kept_blunders: Vec::new(),
        };
        let mut before_m = Vec::new();
        // Every other row: a tie point has two measurements.
        for row in (0..found.num_rows()).step_by(2) {
            let name = names.value(row);
            let tie = ties[name];
            let true_m = vector(&tie["ground_iau2000_m"]);
            let adjusted = three(["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"], row);
            match (adjusted, tie["blunder"].is_null()) {
                (Some(_), false) => judged.kept_blunders.push(name.to_owned()),
                (None, true) => judged.lost.push(name.to_owned()),
                (None, false) => {}
                (Some(adjusted_m), true) => {
                    let axes = local(&true_m);
                    let initial_m = three(["x_m", "y_m", "z_m"], row).unwrap();
                    before_m.push((axes * (initial_m - true_m)).z);
                    judged.errors_m.push(axes * (adjusted_m - true_m));
                    let sigmas = ["sigma_east_m", "sigma_north_m", "sigma_up_m"];
                    judged.sigmas_m.push(three(sigmas, row).unwrap());
                }
            }
        }
        before_m.sort_by(f64::total_cmp);
        judged.before_m = before_m[before_m.len() / 2];
        judged
    }

    fn mean_m(&self) -> Vector3<f64> {
        self.errors_m.iter().sum::<Vector3<f64>>() / self.errors_m.len() as f64
    }

    /// Root mean square of the height errors about their mean, metres.
    fn relative_height_m(&self) -> f64 {
        let mean_m = self.mean_m().z;
        let squares = self.errors_m.iter().map(|error| (error.z - mean_m).powi(2));
        (squares.sum::<f64>() / self.errors_m.len() as f64).sqrt()
    }
}

/// Every site of every mission.
fn all() -> Vec<Judged> {
    let folder = tempfile::tempdir().unwrap();
    let seeds = SEEDS.map(|seed| {
        let path = folder.path().join(format!("seed-{seed}"));
        let mut scene = areograph();
        scene.args(["--quiet", "scene", "--seed", &seed.to_string()]);
        succeed(scene.arg(&path));
        path
    });
    let missions: Vec<PathBuf> = [mission()].into_iter().chain(seeds).collect();
    let of_mission = |mission: &PathBuf| {
        let out = folder.path().join("out").join(mission.file_name().unwrap());
        let mut run = areograph();
        run.args(["--quiet", "run"]);
        for site in SITES {
            run.arg(mission.join(format!("sites/{site}.toml")));
        }
        succeed(run.arg("--out").arg(&out));
        let judged = SITES.map(|site| Judged::of(mission, &out, site));
        fs::remove_dir_all(&out).unwrap();
        judged
    };
    missions.iter().flat_map(of_mission).collect()
}

fn root_mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    (values.map(|value| value * value).sum::<f64>() / count).sqrt()
}

#[test]
fn stated_heights_hold_against_truth() {
    let all = all();
    for site in &all {
        let (mean_m, sigma_m) = (site.mean_m(), site.mean_sigmas_m);
        println!(
            "{:28} mean {:6.1} {:6.1} {:5.2} ± {:.0} {:.0} {:.2} m; relative height {:.1} m; MOLA said {:.1} ± {:.1}, truth {:.1} m",
            site.name,
            mean_m.x,
            mean_m.y,
            mean_m.z,
            sigma_m.x,
            sigma_m.y,
            sigma_m.z,
            site.relative_height_m(),
            site.against_mola_m,
            site.surface_sigma_m,
            site.before_m
        );
        // Metres, and in stated standard deviations: one of 400 exceeds three of them by chance.
        assert!(mean_m.z.abs() < 6.0, "{}: {} m", site.name, mean_m.z);
        assert!(mean_m.z.abs() < 3.0 * sigma_m.z, "{}", site.name);
        // The place is not determined, and stated as such: to 110 m on an axis.
        for axis in 0..2 {
            assert!(mean_m[axis].abs() < 3.0 * sigma_m[axis], "{}", site.name);
            assert!(sigma_m[axis] > 100.0, "{}: {sigma_m}", site.name);
        }
        // Bends and tilts of heights within a site, noise of a line included: what the surface controls.
        assert!(site.relative_height_m() < 10.0, "{}", site.name);
        // Before the adjustment MOLA measures the true error, without knowing it: to four standard deviations of what
        // its surface errs by at all tie points.
        let off_m = site.against_mola_m - site.before_m;
        assert!(
            off_m.abs() < 4.0 * site.surface_sigma_m,
            "{}: {off_m} m",
            site.name
        );
        assert!(
            (0.5..1.2).contains(&site.along),
            "{}: {}",
            site.name,
            site.along
        );
        assert_eq!(site.kept_blunders, [""; 0], "{}", site.name);
    }
    let pooled = root_mean_square(
        all.iter()
            .map(|site| site.mean_m().z / site.mean_sigmas_m.z),
    );
    println!("mean heights over their standard deviations: {pooled:.2}");
    // 33 sites: chance alone gives 0.75 to 1.25; the surface's least roughness overstates it a little.
    assert!((0.7..1.3).contains(&pooled), "{pooled}");
    let relative_m = root_mean_square(all.iter().map(Judged::relative_height_m));
    assert!(relative_m < 8.0, "{relative_m} m");
    let single: Vec<f64> = all
        .iter()
        .flat_map(|site| site.errors_m.iter().zip(&site.sigmas_m))
        .map(|(error, sigma)| error.z / sigma.z)
        .collect();
    let single = root_mean_square(single.into_iter());
    println!("single heights over theirs: {single:.2}; relative {relative_m:.1} m");
    assert!((0.7..1.3).contains(&single), "{single}");
    // Good tie points lost: 0.2 % at most.
    let lost: usize = all.iter().map(|site| site.lost.len()).sum();
    let good: usize = all.iter().map(|site| site.errors_m.len()).sum();
    println!("{lost} of {good} good tie points lost");
    assert!(500 * lost <= good, "{lost} of {good}");
}

/// A camera as it truly was, and how many lines its image has.
fn true_camera(truth: &Value) -> (SampledOrientation, f64) {
    let of = |name: &str| truth[name].as_array().unwrap();
    let at_lines: Vec<f64> = of("line").iter().map(|at| at.as_f64().unwrap()).collect();
    let lines = at_lines[at_lines.len() - 1];
    let poses = of("position_iau2000_m")
        .iter()
        .zip(of("camera_to_mars_quaternion_wxyz"));
    let poses = poses.map(|(position, quaternion)| {
        let quaternion = [0, 1, 2, 3].map(|part| quaternion[part].as_f64().unwrap());
        Pose {
            position_m: vector(position),
            mars_to_camera: matrix_of_spice_quaternion(quaternion).transpose(),
        }
    });
    let x_lines = at_lines.iter().map(|at| at - 0.5 * lines);
    let poses: Vec<(f64, Pose)> = x_lines.zip(poses).collect();
    (SampledOrientation::new(&poses).unwrap(), lines)
}

/// True places of a site's footprints, metres, by row of its footprints.
fn true_footprints_m(truth: &Value, footprints: &RecordBatch) -> BTreeMap<u32, Vector3<f64>> {
    let mut shots = BTreeMap::new();
    for profile in truth["profiles"].as_array().unwrap() {
        let file = profile["file"].as_str().unwrap();
        let numbers = |name: &str| profile[name].as_array().unwrap().iter();
        let each = numbers("record").zip(numbers("shot"));
        for ((record, shot), ground_m) in each.zip(numbers("ground_iau2000_m")) {
            let shot = (file, record.as_u64().unwrap(), shot.as_u64().unwrap());
            shots.insert(shot, vector(ground_m));
        }
    }
    let column = |name: &str| footprints.column_by_name(name).unwrap();
    let files = column("source_file").as_string::<i32>();
    let [records, numbers] =
        ["record", "shot"].map(|name| column(name).as_primitive::<UInt32Type>());
    let place = |row: usize| {
        let (record, shot) = (records.value(row), numbers.value(row));
        let ground_m = shots.get(&(files.value(row), u64::from(record), u64::from(shot)))?;
        Some((u32::try_from(row).unwrap(), *ground_m))
    };
    (0..footprints.num_rows()).filter_map(place).collect()
}

/// How many lines after its true ground a state of the site has each footprint that an image shows: by profile and
/// footprint, the two images in order.
fn lines_late(
    registration: &RecordBatch,
    cameras: &[Value],
    ground_m: &BTreeMap<u32, Vector3<f64>>,
) -> BTreeMap<(String, u32), [Option<f64>; 2]> {
    let column = |name: &str| registration.column_by_name(name).unwrap();
    let [images, profiles] = ["image", "profile"].map(|name| column(name).as_string::<i32>());
    let footprints = column("footprint_row").as_primitive::<UInt32Type>();
    let lines = column("line").as_primitive::<Float64Type>();
    let inside = column("inside").as_boolean();
    let mut late: BTreeMap<_, [Option<f64>; 2]> = BTreeMap::new();
    for (index, truth) in cameras.iter().enumerate() {
        let (camera, lines_of_image) = true_camera(truth);
        let projector = Projector::new(&camera, lines_of_image).unwrap();
        for row in 0..registration.num_rows() {
            if truth["image"] != images.value(row) || !inside.value(row) {
                continue;
            }
            let footprint = footprints.value(row);
            let Some(ground_m) = ground_m.get(&footprint) else {
                continue;
            };
            let true_line = projector.project(ground_m).unwrap().x + 0.5 * lines_of_image;
            let shot = (profiles.value(row).to_owned(), footprint);
            late.entry(shot).or_default()[index] = Some(lines.value(row) - true_line);
        }
    }
    late
}

/// A transformation of second order through 146 tie points with a line's noise in each image puts a profile between them
/// to 0.6 to 1.1 m along the flight (standard deviation): three of the largest.
const TRANSFORMED_M: f64 = 3.4;
/// The same for the one profile that lies 50 samples beyond the tie points, at their first lines: three of 2.8 m.
const BEYOND_SAMPLES: (&str, f64) = ("isidis/9118", 8.4);

#[test]
fn footprints_fall_as_far_apart_in_two_images_as_is_stated() {
    let out = tempfile::tempdir().unwrap();
    let truth = json(&mission().join("truth.json"));
    for site in SITES {
        let mut run = areograph();
        run.args(["--quiet", "run"]);
        run.arg(mission().join(format!("sites/{site}.toml")));
        succeed(run.arg("--out").arg(out.path()));
        let folder = out.path().join(site);
        let found = json(&folder.join("adjustment.json"));
        let ground_m = true_footprints_m(&truth, &table(&folder.join("footprints.parquet")));
        let mut sites = truth["ties"].as_array().unwrap().iter();
        let own = sites.find(|of| of["site"] == site).unwrap();
        let cameras = own["cameras"].as_array().unwrap();
        for (state, file) in [
            ("before", "registration"),
            ("after", "registration_adjusted"),
        ] {
            let registration = table(&folder.join(format!("{file}.parquet")));
            let late = lines_late(&registration, cameras, &ground_m);
            let pair = &found[state]["pairs"][0];
            let spacing_m = [0, 1].map(|at| pair["line_spacing_m"][at].as_f64().unwrap());
            let profiles = pair["footprints"]["profiles"].as_array().unwrap();
            assert!(!profiles.is_empty(), "{site} {state}");
            for profile in profiles {
                let name = profile["profile"].as_str().unwrap();
                let own = late.iter().filter(|(shot, _)| shot.0 == name);
                let apart_m: Vec<f64> = own
                    .filter_map(|(_, late)| Some(late[0]? * spacing_m[0] - late[1]? * spacing_m[1]))
                    .collect();
                let true_m = apart_m.iter().sum::<f64>() / apart_m.len() as f64;
                let stated_m = profile["along_m"].as_f64().unwrap();
                println!(
                    "{name}, {state}: {stated_m:.1} m over {} footprints, truth {true_m:.1} m over {}",
                    profile["lines"]["n"],
                    apart_m.len()
                );
                // All that both images show, and no others.
                let counted = ["/lines/n", "/beyond_ties"]
                    .map(|pointer| profile.pointer(pointer).unwrap().as_u64().unwrap());
                assert_eq!(counted[0] + counted[1], apart_m.len() as u64, "{name}");
                let tolerance_m = if name == BEYOND_SAMPLES.0 {
                    BEYOND_SAMPLES.1
                } else {
                    TRANSFORMED_M
                };
                assert!((stated_m - true_m).abs() < tolerance_m, "{name}, {state}");
            }
        }
    }
}
