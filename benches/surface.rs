//! Heights of the ground between shots, a terrain model of two rendered lines, and units of shots that are matched with a
//! terrain model: seconds, and rates per second.
//!
//! `cargo bench --bench surface`: the scenes are made and calibrated in temporary folders first, which is not timed.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a benchmark may fail loudly, and works in temporary folders"
)]

use areograph_testing::moc_file;
use std::{fs, path::Path, sync::atomic::AtomicBool, time::Instant};

use areograph::{
    altimetry::{GroundRadius, ShotFilter},
    body::Body,
    config::{CalibrationConfig, Document as _},
    flow::{PUBLISH, RunOptions, Task, run_task},
    geom::{
        ellipsoid::spherical_to_xyz_m,
        surface::{LaserSurface, SurfaceOptions, SurfaceShot},
    },
    pds::pixel_file::{PixelFile, Pyramid},
    scene::{write_calibration_loop_scene, write_terrain_model_scene},
    stages::{
        line_camera::LineCamera,
        map_surface::{LinesToMap, map_lines},
        match_laser::{MatchOptions, MatchRequest, match_laser},
    },
    store::hashes::HashCache,
    watch::Watch,
};
use nalgebra::Vector3;
use serde_json::Value;

use moc_file::peak_memory;

const LINES: [&str; 2] = ["s1", "s2"];
/// Edges of cells, metres: two, three and four pixels.
const CELLS_M: [f64; 3] = [54.0, 81.0, 108.0];
/// Cells to either side that a unit is searched in: 141 by 141 shifts.
const SEARCH_CELLS: u32 = 70;

/// Seconds of a computation, the best of three, and its result.
fn timed<T>(run: impl Fn() -> T) -> (f64, T) {
    let times = (0..3).map(|_| {
        let began = Instant::now();
        let given = run();
        (began.elapsed().as_secs_f64(), given)
    });
    times.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

/// Profiles along meridians 5 km apart, 300 m from shot to shot, on ground of two waves.
fn shots_of(profiles: u32, each: u32) -> Vec<SurfaceShot> {
    let shot = |profile: u32, shot: u32| {
        let [east_m, north_m] = [5_000.0 * f64::from(profile), 300.0 * f64::from(shot)];
        SurfaceShot {
            ground_m: ground_m(east_m, north_m),
            profile: profile as usize,
            attitude_known: true,
            off_nadir_rad: 0.0,
        }
    };
    let of = |profile| (0..each).map(move |index| shot(profile, index));
    (0..profiles).flat_map(of).collect()
}

fn ground_m(east_m: f64, north_m: f64) -> Vector3<f64> {
    let height_m = 40.0 * (east_m / 2_000.0).sin() + 25.0 * (north_m / 700.0).cos();
    let radius_m = 3_396_190.0;
    spherical_to_xyz_m(east_m / radius_m, north_m / radius_m, radius_m + height_m)
}

fn heights() {
    for [profiles, each] in [[2, 185], [10, 150]] {
        let shots = shots_of(profiles, each);
        let options = SurfaceOptions::default();
        let (made_s, surface) = timed(|| LaserSurface::new(&shots, &[], &options).unwrap());
        let places: Vec<Vector3<f64>> = (0..10_000)
            .map(|place| ground_m(0.4 * f64::from(place), 3.0 * f64::from(place)))
            .collect();
        let (each_s, _) = timed(|| surface.predict_each(&places));
        let (mean_s, _) = timed(|| surface.predict_mean(&places[..1_000]));
        let (whole_s, _) = timed(|| surface.predict(&places[..400]));
        println!(
            "ground between {} shots: {made_s:.3} s; 10,000 places one by one {each_s:.3} s, the mean of 1,000 {mean_s:.3} s, \
             400 with the covariance between them {whole_s:.3} s",
            shots.len()
        );
    }
}

fn terrain_models(folder: &Path) {
    let scene = folder.join("lines");
    write_calibration_loop_scene(&scene, 1, Watch::from(&AtomicBool::new(false))).unwrap();
    let config = CalibrationConfig::load(&scene.join("calibration.toml"))
        .unwrap()
        .config;
    let out = folder.join("calibrated");
    let options = RunOptions {
        out: out.clone(),
        until: PUBLISH,
        force: false,
        stop: &AtomicBool::new(false),
        hashes: &HashCache::in_folder(&out, false),
        roots: &[],
        observer: &(),
    };
    let run = run_task(Task::Calibration(&config), &options).unwrap();
    let cameras = LINES.map(|line| {
        let isd = run.folder.join(format!("cameras/{line}/isd.json"));
        LineCamera::read(&isd, line, Body::Mars).unwrap()
    });
    let pixels = LINES.map(|line| {
        let path = scene.join(format!("images/{line}.tif"));
        PixelFile::open(&path, &[]).unwrap()
    });
    let size = [pixels[0].lines(), pixels[0].samples()];
    let pixels = pixels.map(|file| Pyramid::of(&file).unwrap());
    let truth: Value =
        serde_json::from_str(&fs::read_to_string(scene.join("truth.json")).unwrap()).unwrap();
    let places = truth["checked"].as_array().unwrap().iter();
    let ground_m: Vec<Vector3<f64>> = places
        .map(|of| Vector3::from([0, 1, 2].map(|axis| of["place_m"][axis].as_f64().unwrap())))
        .collect();
    for cell_m in CELLS_M {
        let lines = LinesToMap {
            body: Body::Mars,
            pair: [0, 1].map(|at| (&cameras[at], &pixels[at])),
            ground_m: &ground_m,
            off_m: 100.0,
            cell_m,
        };
        let (seconds, surface) =
            timed(|| map_lines(&lines, (&AtomicBool::new(false)).into()).unwrap());
        let account = &surface.account;
        println!(
            "terrain model, {} by {} pixels: {} cells of {cell_m} m, {} with a height, in {seconds:.2} s; {:.2} million pixels a second; \
             {} MB at most",
            size[0],
            size[1],
            account.cells,
            account.filled,
            1e-6 * f64::from(size[0] * size[1]) / seconds,
            peak_memory() >> 20
        );
    }
}

fn units(folder: &Path) {
    let scene = folder.join("ground");
    write_terrain_model_scene(&scene, 1).unwrap();
    let request = MatchRequest {
        options: MatchOptions {
            segment_points: 15,
            segment_drift: None,
            least_variance_m2: 1_000.0,
            similarity: None,
            search_cells: SEARCH_CELLS,
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
        model: scene.join("model.tif"),
        pedr: vec![scene.join("pedr")],
        images: Vec::new(),
    };
    let (seconds, of) = timed(|| match_laser(&request, &AtomicBool::new(false)).unwrap());
    let shifts = (2 * SEARCH_CELLS + 1).pow(2);
    println!(
        "laser control: {} units at {shifts} shifts, twice, the second time for the page, with reading: {seconds:.2} s",
        of.units.len()
    );
}

fn main() {
    heights();
    let folder = tempfile::tempdir().unwrap();
    units(folder.path());
    terrain_models(folder.path());
}
