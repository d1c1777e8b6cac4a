//! Tie points that are matched in the mission's images, and the adjustment by them, against what the images truly show.

#![allow(
    clippy::disallowed_methods,
    reason = "site files in a temporary folder need no atomic writer"
)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use nalgebra::{Matrix2, Vector2, Vector3};

use super::*;
use crate::{
    config,
    flow::{Ending, PUBLISH, RunOptions, run_site},
    pds::ties::read_ties,
    scene::{
        SceneOptions,
        arc::Arc,
        drawn::DayErrors,
        kernels::{clock_session, image_start},
        plan::{IMAGES, SITES, Site},
        write_scene_with_images,
    },
    store::hashes::HashCache,
};

/// The mission with its images: that in the folder of the variable, or a new one.
struct Mission {
    folder: PathBuf,
    days: Vec<Flown>,
    terrain: Terrain,
}

impl Mission {
    fn new(folder: &Path) -> Self {
        let options = SceneOptions {
            day_s: 600.0,
            ..SceneOptions::default()
        };
        let begun = Instant::now();
        write_scene_with_images(folder, &options).unwrap();
        println!("rendered in {:.1} s", begun.elapsed().as_secs_f64());
        let session = clock_session(&folder.join("kernels")).unwrap();
        let fly = |image| {
            let start = image_start(&session, image).unwrap();
            let arc = Arc::new(image, start, image.pedr_duration_s(options.day_s)).unwrap();
            let errors = DayErrors::draw(&options.errors, &arc, options.seed);
            Flown { arc, errors }
        };
        Self {
            folder: folder.to_owned(),
            days: IMAGES.iter().map(fly).collect(),
            terrain: Terrain::new(
                options.seed,
                &SITES.map(Site::direction),
                options.errors.relief,
            ),
        }
    }

    fn image(&self, id: &str) -> TrueImage<'_> {
        let flown = self.days.iter().find(|flown| flown.arc.image.id == id);
        TrueImage::new(flown.unwrap(), &self.terrain).unwrap()
    }

    /// A site file whose tie points are matched.
    fn matched_site(&self, site: &str) -> PathBuf {
        let text = fs::read_to_string(self.folder.join(format!("sites/{site}.toml"))).unwrap();
        let mut with_pixels = String::new();
        for line in text.lines() {
            let line = match line.strip_prefix("files = [\"../ties") {
                Some(_) => "match = true",
                None => line,
            };
            with_pixels.extend([line, "\n"]);
            if let Some(id) = line
                .strip_prefix("id = \"E")
                .and_then(|id| id.strip_suffix('"'))
            {
                let name = id.replace('-', "");
                with_pixels.extend(["pixels = \"../images/e", &name, ".imq\"\n"]);
            }
        }
        let path = self.folder.join(format!("sites/matched_{site}.toml"));
        fs::write(
            &path,
            with_pixels.replace(
                &format!("site = \"{site}\""),
                &format!("site = \"matched_{site}\""),
            ),
        )
        .unwrap();
        path
    }
}

/// Runs a site; the folder of its products.
fn run(site: &Path, out: &Path) -> PathBuf {
    let config = config::load(site).unwrap().site;
    let hashes = HashCache::in_folder(out, false);
    let options = RunOptions {
        out: out.to_owned(),
        until: PUBLISH,
        force: false,
        stop: &std::sync::atomic::AtomicBool::new(false),
        hashes: &hashes,
        roots: &[],
        observer: &(),
    };
    let begun = Instant::now();
    let outcome = run_site(&config, &options).unwrap();
    println!("{}: {:.1} s", config.site, begun.elapsed().as_secs_f64());
    let Ending::Published(manifest) = outcome.ending else {
        panic!("{:?}", outcome.ending);
    };
    println!("{:?}\n{:?}", manifest.verdict.reasons, manifest.counts);
    assert!(manifest.verdict.valid, "{:?}", manifest.verdict);
    outcome.folder
}

/// Where an image truly shows a point.
fn place(image: &TrueImage<'_>, ground_m: &Vector3<f64>) -> Vector2<f64> {
    let seen = image.projector().unwrap().project(ground_m).unwrap();
    let camera = &image.oriented_camera;
    let focal_px = camera.detector.focal_px(&seen.camera_m).unwrap();
    Vector2::new(
        seen.x + 0.5 * camera.lines(),
        camera.detector.sample(focal_px.y),
    )
}

/// What matched tie points of a site are off by in the second image, and the standard deviations that they state, lines and
/// samples.
fn errors_px(mission: &Mission, products: &Path) -> Vec<[Vector2<f64>; 2]> {
    let ties = read_ties(&products.join("exchange/matched_ties.csv"))
        .unwrap()
        .ties;
    let [first, second] = [0, 1].map(|at| mission.image(&ties[0].measures[at].image));
    let ties = ties.iter().map(|tie| {
        let [from, to] = [0, 1].map(|at| {
            let measure = &tie.measures[at];
            (
                Vector2::new(measure.line, measure.sample),
                Vector2::from(measure.sigma_px.unwrap()),
            )
        });
        let through = |place_px: &Vector2<f64>| {
            let ground_m = first.ground_m(&mission.terrain, place_px.x, place_px.y);
            place(&second, &ground_m.unwrap())
        };
        let matrix = Matrix2::from_columns(
            &[Vector2::x(), Vector2::y()]
                .map(|step| 0.5 * (through(&(from.0 + step)) - through(&(from.0 - step)))),
        );
        let of_first =
            matrix * Matrix2::from_diagonal(&from.1.component_mul(&from.1)) * matrix.transpose();
        let variance = of_first.diagonal() + to.1.component_mul(&to.1);
        [to.0 - through(&from.0), variance.map(f64::sqrt)]
    });
    ties.collect()
}

/// Adjusted tie points by their identifiers, metres Mars-fixed; those that were rejected are not there.
fn adjusted_m(products: &Path) -> BTreeMap<String, Vector3<f64>> {
    use arrow::array::{Array as _, AsArray as _};
    use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

    let file = File::open(products.join("ties.parquet")).unwrap();
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let mut adjusted = BTreeMap::new();
    for batch in builder.build().unwrap() {
        let batch = batch.unwrap();
        let names = batch
            .column_by_name("tie")
            .unwrap()
            .as_string::<i32>()
            .clone();
        let axes = ["x", "y", "z"].map(|axis| {
            let column = batch.column_by_name(&format!("adjusted_{axis}_m")).unwrap();
            column
                .as_primitive::<arrow::datatypes::Float64Type>()
                .clone()
        });
        for row in (0..batch.num_rows()).filter(|row| !axes[0].is_null(*row)) {
            let place_m = Vector3::from_fn(|axis, _| axes[axis].value(row));
            adjusted.insert(names.value(row).to_owned(), place_m);
        }
    }
    adjusted
}

/// Length of the mean error of adjusted tie points, and root mean square of their heights' errors, metres.
fn judged(
    adjusted: &BTreeMap<String, Vector3<f64>>,
    truth: &BTreeMap<String, Vector3<f64>>,
) -> [f64; 2] {
    let errors = adjusted.iter().map(|(name, place_m)| place_m - truth[name]);
    let errors: Vec<Vector3<f64>> = errors.collect();
    let count = errors.len() as f64;
    let mean_m = errors.iter().sum::<Vector3<f64>>() / count;
    let heights = adjusted
        .iter()
        .map(|(name, place_m)| place_m.norm() - truth[name].norm());
    let square = heights.map(|height_m| height_m * height_m).sum::<f64>() / count;
    [mean_m.norm(), square.sqrt()]
}

#[test]
fn matched_ties_are_within_what_they_state_and_adjust_as_well_as_given_ones() {
    let folder = tempfile::tempdir().unwrap();
    let mission = Mission::new(&folder.path().join("mission"));
    let truth: serde_json::Value =
        serde_json::from_slice(&fs::read(mission.folder.join("truth.json")).unwrap()).unwrap();
    for site in SITES {
        let products = run(&mission.matched_site(site.id), folder.path());
        let errors = errors_px(&mission, &products);
        assert!(errors.len() >= 150, "{}", errors.len());
        for (axis, name) in ["line", "sample"].iter().enumerate() {
            let square: f64 = errors.iter().map(|[error, _]| error[axis].powi(2)).sum();
            let rms = (square / errors.len() as f64).sqrt();
            let over = |[error, sigma]: &[Vector2<f64>; 2]| (error[axis] / sigma[axis]).abs();
            let within = errors.iter().filter(|of| over(of) <= 3.0).count();
            let mean: f64 =
                errors.iter().map(|[error, _]| error[axis]).sum::<f64>() / errors.len() as f64;
            println!(
                "{} {name}: {} ties, rms {rms:.3}, mean {mean:.3}, {within} within",
                site.id,
                errors.len()
            );
            assert!(rms <= 0.3, "{rms}"); // pixels
            assert!(
                within * 100 >= errors.len() * 99,
                "{within} of {}",
                errors.len()
            );
        }
        // Against truth, the adjustment by matched tie points and that by the given ones.
        let ties = read_ties(&products.join("exchange/matched_ties.csv"))
            .unwrap()
            .ties;
        let first = mission.image(&ties[0].measures[0].image);
        let matched_m = ties.iter().map(|tie| {
            let measure = &tie.measures[0];
            let ground_m = first.ground_m(&mission.terrain, measure.line, measure.sample);
            (tie.id.clone(), ground_m.unwrap())
        });
        let of_site = truth["ties"].as_array().unwrap().iter();
        let of_site = of_site
            .filter(|of| of["site"] == site.id)
            .flat_map(|of| of["ties"].as_array().unwrap());
        let given_m = of_site.map(|tie| {
            let axis = |axis: usize, _: usize| tie["ground_iau2000_m"][axis].as_f64().unwrap();
            (
                tie["id"].as_str().unwrap().to_owned(),
                Vector3::from_fn(axis),
            )
        });
        let adjusted = adjusted_m(&products);
        // No blunder is left: every point lies within a few of the errors that all of them share.
        let matched_m: BTreeMap<_, _> = matched_m.collect();
        let by_matched = judged(&adjusted, &matched_m);
        let given = run(
            &mission.folder.join(format!("sites/{}.toml", site.id)),
            folder.path(),
        );
        let by_given = judged(&adjusted_m(&given), &given_m.collect());
        println!(
            "{}: mean error and rms of heights {by_matched:.2?} m, by given ties {by_given:.2?} m",
            site.id
        );
        assert!(by_matched[1] <= by_given[1], "{by_matched:?} {by_given:?}");
    }
}
