//! What products state of accuracy, held against the truth of synthetic missions: ten seeds and the built-in one in the long
//! run, the first of them and the built-in one otherwise.
//!
//! Nothing here is computed by what is judged: errors come from `truth.json`, which no stage reads.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use crate::common;

mod across;
mod attitude_clock;
mod boresight;
mod campaign;
mod common_bus;
mod everything_errs;
mod flown;
mod footprint_heights;
mod light_time;
mod misregistration;
mod mistakes;
mod orbit;
mod overlays;
mod pairs;
mod parts;
mod profiles;
mod readings;
mod relief;
mod shared_errors;
mod stated;
mod unmodelled;

use std::{
    collections::BTreeMap,
    fs::{self, File},
    ops::RangeInclusive,
    path::{Path, PathBuf},
    process::Command,
    sync::LazyLock,
};

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array as _, RecordBatch};
use common::{
    json,
    mission::{areograph, mission, once, succeed},
};
use nalgebra::{Matrix3, Vector3};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];
const SEEDS: RangeInclusive<u32> = 2..=11;

/// Errors of a site's good tie points against truth, and what is stated of them.
struct Judged {
    name: String,
    /// East, north and up, metres.
    errors_m: Vec<Vector3<f64>>,
    /// Stated standard deviations of the same.
    sigmas_m: Vec<Vector3<f64>>,
    /// The same without the error that all share.
    relative_m: Vec<Vector3<f64>>,
    /// Stated standard deviations of their mean.
    mean_sigmas_m: Vector3<f64>,
    /// Median height above the MOLA surface before the adjustment, and the true error of heights then, metres.
    against_mola_m: f64,
    before_m: f64,
    /// Mean error of the surface at the tie points before the adjustment, and its stated standard deviation, metres.
    surface_off_m: f64,
    surface_sigma_m: f64,
    /// Standard deviation of unit weight along the track.
    along: f64,
    /// Estimate of the attitude's clock with its standard deviation, seconds, where it is an unknown.
    clock_s: Option<(f64, f64)>,
    /// By the other reading of what images disagree by: mean minus that of the adjustment, and its standard deviations,
    /// towards east, north and up, metres.
    other_m: Option<[Vector3<f64>; 2]>,
    lost: Vec<String>,
    kept_blunders: Vec<String>,
    /// Largest height error of these in stated standard deviations.
    kept_blunder_sigmas: f64,
}

pub(crate) fn table(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    // All rows at once.
    let reader = builder.with_batch_size(1 << 20).build();
    reader.unwrap().next().unwrap().unwrap()
}

/// A column of texts.
fn texts(table: &RecordBatch, name: &str) -> Vec<String> {
    let column = table.column_by_name(name).unwrap().as_string::<i32>();
    column.iter().map(|text| text.unwrap().to_owned()).collect()
}

pub(crate) fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| value[axis].as_f64().unwrap())
}

/// Rows towards east, north and up.
pub(crate) fn local(place_m: &Vector3<f64>) -> Matrix3<f64> {
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
            relative_m: Vec::new(),
            mean_sigmas_m: vector(&document["adjustment"]["heights"]["mean_sigma_m"]),
            against_mola_m: document["before"]["heights"]["above_surface_m"]["median"]
                .as_f64()
                .unwrap(),
            before_m: 0.0,
            surface_off_m: 0.0,
            surface_sigma_m: document["before"]["heights"]["mean_sigma_m"]
                .as_f64()
                .unwrap(),
            along: summary["tie_components"][0].as_f64().unwrap(),
            clock_s: document["adjustment"]["attitude_clock_s"]
                .as_array()
                .map(|clock| {
                    let [offset_s, sigma_s] = [0, 1].map(|at| clock[at].as_f64().unwrap());
                    (offset_s, sigma_s)
                }),
            other_m: document["adjustment"]
                .get("other_reading")
                .map(|other| [vector(&other["moved_m"]), vector(&other["mean_sigma_m"])]),
            lost: Vec::new(),
            kept_blunders: Vec::new(),
            kept_blunder_sigmas: 0.0,
        };
        let heights = table(&folder.join("height_check.parquet"));
        let above = heights.column_by_name("above_surface_m").unwrap();
        let above = above.as_primitive::<Float64Type>();
        let above_m: BTreeMap<String, f64> = texts(&heights, "tie")
            .into_iter()
            .zip(above.iter())
            .filter_map(|(point, above_m)| Some((point, above_m?)))
            .collect();
        let (mut before_m, mut off_m) = (Vec::new(), Vec::new());
        // Every other row: a tie point has two measurements.
        for row in (0..found.num_rows()).step_by(2) {
            let name = names.value(row);
            let tie = ties[name];
            let true_m = vector(&tie["ground_iau2000_m"]);
            let adjusted = three(["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"], row);
            match (adjusted, tie["blunder"].is_null()) {
                (Some(adjusted_m), false) => {
                    let up_m = (local(&true_m) * (adjusted_m - true_m)).z;
                    let sigma_m = numbers("sigma_up_m", row).unwrap();
                    let kept = format!("{name}: {up_m:.1} m in height, stated {sigma_m:.1} m");
                    judged.kept_blunders.push(kept);
                    let sigmas = (up_m / sigma_m).abs();
                    judged.kept_blunder_sigmas = judged.kept_blunder_sigmas.max(sigmas);
                }
                (None, true) => judged.lost.push(name.to_owned()),
                (None, false) => {}
                (Some(adjusted_m), true) => {
                    let axes = local(&true_m);
                    let initial_m = three(["x_m", "y_m", "z_m"], row).unwrap();
                    let height_m = (axes * (initial_m - true_m)).z;
                    before_m.push(height_m);
                    off_m.extend(above_m.get(name).map(|above_m| above_m - height_m));
                    judged.errors_m.push(axes * (adjusted_m - true_m));
                    let sigmas = ["sigma_east_m", "sigma_north_m", "sigma_up_m"];
                    judged.sigmas_m.push(three(sigmas, row).unwrap());
                    let relative = sigmas.map(|name| format!("relative_{name}"));
                    let relative = relative.each_ref().map(String::as_str);
                    judged.relative_m.push(three(relative, row).unwrap());
                }
            }
        }
        before_m.sort_by(f64::total_cmp);
        judged.before_m = before_m[before_m.len() / 2];
        judged.surface_off_m = off_m.iter().sum::<f64>() / off_m.len() as f64;
        judged
    }

    /// Mean error of adjusted heights, metres, whatever is stated of them.
    fn height_error_m(mission: &Path, out: &Path, site: &str) -> f64 {
        let truth = json(&mission.join("truth.json"));
        let mut sites = truth["ties"].as_array().unwrap().iter();
        let own = sites.find(|of| of["site"] == site).unwrap();
        let found = table(&out.join(site).join("ties.parquet"));
        let names = texts(&found, "tie");
        let axes = ["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"].map(|axis| {
            let column = found.column_by_name(axis).unwrap();
            column.as_primitive::<Float64Type>().clone()
        });
        let errors = own["ties"].as_array().unwrap().iter().filter_map(|tie| {
            let row = names.iter().position(|name| tie["id"] == name.as_str())?;
            let is_good = tie["blunder"].is_null() && !axes[0].is_null(row);
            is_good.then(|| {
                let true_m = vector(&tie["ground_iau2000_m"]);
                let adjusted_m = Vector3::from_fn(|axis, _| axes[axis].value(row));
                adjusted_m.norm() - true_m.norm()
            })
        });
        let errors: Vec<f64> = errors.collect();
        errors.iter().sum::<f64>() / errors.len() as f64
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

/// What the observations allow of [`Judged::relative_height_m`], metres.
///
/// The adjustment is linear and weighs all observations by their covariance: what it states is then the least variance that
/// any unbiased estimate can have (Gauss and Markov; Cramér and Rao where errors are normal). Of the single heights'
/// variances the mean of all is no part of the relative error.
fn relative_bound_m(site: &Judged) -> f64 {
    let singles = site.sigmas_m.iter().map(|sigma| sigma.z);
    (root_mean_square(singles).powi(2) - site.mean_sigmas_m.z.powi(2)).sqrt()
}

/// A mission of this seed, with `options`.
pub(crate) fn scene(folder: &Path, seed: u32, options: &[&str]) -> PathBuf {
    let path = folder.join(format!("seed-{seed}"));
    let mut scene = areograph();
    scene.args([
        "--quiet",
        "scene",
        "mission",
        "--day-s",
        "600",
        "--seed",
        &seed.to_string(),
    ]);
    succeed(scene.args(options).arg(&path));
    path
}

/// The command that runs every site of a mission.
fn run(mission: &Path, out: &Path) -> Command {
    run_of(&SITES, mission, out)
}

fn run_of(sites: &[&str], mission: &Path, out: &Path) -> Command {
    let mut run = areograph();
    run.args(["--quiet", "run"]);
    for site in sites {
        run.arg(mission.join(format!("sites/{site}.toml")));
    }
    run.arg("--out").arg(out);
    run
}

/// Products of the default mission's sites, run once for all tests.
fn default_run() -> &'static Path {
    static OUT: LazyLock<PathBuf> = LazyLock::new(|| {
        once("sites", |folder| {
            succeed(&mut run(&mission(), folder));
        })
    });
    &OUT
}

/// Seeds of a trial: in the long run all, otherwise the first ones. A mission takes 7 s of a processor, nearly all of it for
/// the adjustments of its sites.
fn seeds(all: RangeInclusive<u32>, few: usize) -> Vec<u32> {
    let count = if common::long() { usize::MAX } else { few };
    all.take(count).collect()
}

/// What a root mean square of `count` errors over their standard deviations is by chance in 99 of 100 cases, for trials of
/// the first seeds: Wilson and Hilferty's approximation of chi-squared.
fn by_chance(count: usize) -> [f64; 2] {
    const SIGMAS: f64 = 2.576;
    let share = 2.0 / (9.0 * count as f64);
    [-SIGMAS, SIGMAS].map(|sigmas| (1.0 - share + sigmas * share.sqrt()).max(0.0).powf(1.5))
}

/// Whether a root mean square lies within these limits in the long run, and in that of the first seeds within what chance
/// allows their number, where that is wider.
fn is_within(value: f64, limits: [f64; 2], count: usize) -> bool {
    let chance = by_chance(count);
    let [low, high] = if common::long() {
        limits
    } else {
        [limits[0].min(chance[0]), limits[1].max(chance[1])]
    };
    (low..high).contains(&value)
}

/// Every site of every mission, run into `folder`.
fn judged(folder: &Path, missions: &[PathBuf]) -> Vec<Judged> {
    let of_mission = |mission: &PathBuf| {
        let out = folder.join("out").join(mission.file_name().unwrap());
        succeed(&mut run(mission, &out));
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
    let folder = tempfile::tempdir().unwrap();
    let missions = seeds(SEEDS, 2).into_iter();
    let missions: Vec<PathBuf> = missions
        .map(|seed| scene(folder.path(), seed, &[]))
        .collect();
    let mut all: Vec<Judged> = SITES
        .map(|site| Judged::of(&mission(), default_run(), site))
        .into();
    all.extend(judged(folder.path(), &missions));
    for site in &all {
        let (mean_m, sigma_m) = (site.mean_m(), site.mean_sigmas_m);
        println!(
            "{:28} mean {:6.1} {:6.1} {:5.2} ± {:.0} {:.0} {:.2} m; relative height {:.1} m of {:.1} m; MOLA said {:.1} ± {:.1}, truth {:.1} m",
            site.name,
            mean_m.x,
            mean_m.y,
            mean_m.z,
            sigma_m.x,
            sigma_m.y,
            sigma_m.z,
            site.relative_height_m(),
            relative_bound_m(site),
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
    assert!(is_within(pooled, [0.7, 1.3], all.len()), "{pooled}");
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
    // Correct tie points rejected: 0.2 % at most.
    let lost: usize = all.iter().map(|site| site.lost.len()).sum();
    let good: usize = all.iter().map(|site| site.errors_m.len()).sum();
    println!("{lost} of {good} good tie points lost");
    assert!(500 * lost <= good, "{lost} of {good}");
}
