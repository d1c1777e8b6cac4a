//! Image support data read by usgscsm's line scanner: ground falls on the lines and samples that the products have it
//! on, by every convention for light time, before the adjustment and after it.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;
use crate::common::adjusted as image;
use crate::common::products_site;
use crate::common::readers;

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::Write as _,
    path::Path,
    process::Stdio,
};

use areograph::{
    capabilities::write_products,
    config::OrientationConfig,
    geom::{light_time::LightTime, pushbroom::CameraModel},
    stages::{
        fit_sensor_model::fit_sensor_model,
        oriented::OrientedImage,
        reorient::{LineCorrection, reorient},
        sample_orientation::Orientation,
    },
};
use arrow_array::cast::AsArray as _;
use arrow_array::types::{Float64Type, UInt32Type};
use arrow_array::{Array as _, RecordBatch};
use common::{
    json,
    mission::{areograph, succeed},
    number,
};
use image::Image;
use nalgebra::Vector3;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];
/// Lines and samples: 0.01 for interpolation, on top of which both programs stop their iterations.
pub(crate) const LIMIT_PX: f64 = 0.01;

/// Where the camera of `isd` sees points of the ground: line and sample.
pub(crate) fn seen(isd: &Path, ground_m: &[Vector3<f64>], test: &str) -> Option<Vec<[f64; 2]>> {
    let mut camera = readers::camera(isd, "ground-to-image", test)?;
    camera.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut camera = camera.spawn().unwrap();
    let asked: Vec<String> = ground_m
        .iter()
        .map(|point| format!("{} {} {}\n", point.x, point.y, point.z))
        .collect();
    let mut to = camera.stdin.take().unwrap();
    let writer = std::thread::spawn(move || to.write_all(asked.concat().as_bytes()).unwrap());
    let answered = camera.wait_with_output().unwrap();
    writer.join().unwrap();
    assert!(answered.status.success(), "{}", isd.display());
    let text = String::from_utf8(answered.stdout).unwrap();
    let places = text.lines().map(|line| {
        let mut numbers = line.split(' ').map(|number| number.parse().unwrap());
        [numbers.next().unwrap(), numbers.next().unwrap()]
    });
    let places: Vec<[f64; 2]> = places.collect();
    assert_eq!(places.len(), ground_m.len());
    Some(places)
}

fn table(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    // All rows at once.
    let mut reader = builder.with_batch_size(1 << 20).build().unwrap();
    reader.next().unwrap().unwrap()
}

/// Footprints that an image shows, and where a registration has them, by image.
type Registered = BTreeMap<String, (Vec<Vector3<f64>>, Vec<[f64; 2]>)>;

fn registered(site: &Path, name: &str) -> Registered {
    let (footprints, registration) = (
        table(&site.join("footprints.parquet")),
        table(&site.join(name)),
    );
    let numbers = |table: &RecordBatch, name: &str| {
        let column = table.column_by_name(name).unwrap();
        column.as_primitive::<Float64Type>().values().to_vec()
    };
    let xyz_m = ["x_m", "y_m", "z_m"].map(|name| numbers(&footprints, name));
    let places = ["line", "sample"].map(|name| numbers(&registration, name));
    let column = |name: &str| registration.column_by_name(name).unwrap();
    let images = column("image").as_string::<i32>();
    let rows = column("footprint_row").as_primitive::<UInt32Type>();
    let inside = column("inside").as_boolean();
    let mut found = Registered::new();
    for (index, row) in rows.values().iter().enumerate() {
        if inside.value(index) {
            let row = *row as usize;
            let (ground_m, place) = found.entry(images.value(index).to_owned()).or_default();
            ground_m.push(Vector3::from_fn(|axis, _| xyz_m[axis][row]));
            place.push([0, 1].map(|axis: usize| places[axis][index]));
        }
    }
    found
}

/// Largest distance of lines and of samples.
fn apart(a: &[[f64; 2]], b: &[[f64; 2]]) -> [f64; 2] {
    let pairs = || a.iter().zip(b);
    [0, 1].map(|axis| pairs().fold(0.0, |most: f64, (a, b)| most.max((a[axis] - b[axis]).abs())))
}

/// A mission, and its sites with keys of their own.
struct Runs {
    folder: tempfile::TempDir,
}

impl Runs {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut scene = areograph();
        scene.args(["--quiet", "scene", "mission", "--day-s", "600"]);
        succeed(scene.arg(folder.path().join("mission")));
        Self { folder }
    }

    /// The products of all sites with `keys`.
    fn run(&self, keys: &str) -> std::path::PathBuf {
        let sites = self.folder.path().join("mission/sites");
        let mut run = areograph();
        run.args(["--quiet", "run"]);
        for site in SITES {
            let text = fs::read_to_string(sites.join(format!("{site}.toml"))).unwrap();
            let path = sites.join(format!("own_{site}.toml"));
            fs::write(&path, format!("{text}\n{keys}")).unwrap();
            run.arg(path);
        }
        let out = self.folder.path().join("out");
        succeed(run.arg("--out").arg(&out));
        out
    }
}

#[test]
fn registration_is_that_of_usgscsm_by_every_convention() {
    let test = "usgscsm beside registration";
    let runs = Runs::new();
    for (word, light_time) in LightTime::WORDS {
        let out = runs.run(&format!(
            "[orientation]\nlight_time = \"{word}\"\n[registration]\nmodel = \"samples\"\n"
        ));
        let mut images = 0;
        for site in SITES {
            let site = out.join(site);
            for (table, isd) in [
                ("registration.parquet", "isd.json"),
                ("registration_adjusted.parquet", "adjusted_isd.json"),
            ] {
                for (image, (ground_m, places)) in registered(&site, table) {
                    let isd = site.join(format!("images/{image}/{isd}"));
                    let Some(seen) = seen(&isd, &ground_m, test) else {
                        return;
                    };
                    let [lines, samples] = apart(&seen, &places);
                    println!("{word} {image} {table}: {lines:.1e} lines, {samples:.1e} samples");
                    assert!(lines < LIMIT_PX && samples < LIMIT_PX, "{word} {image}");
                    let told = json(&isd);
                    assert_eq!(told["areograph"]["light_time"]["convention"], word);
                    let notes = told["areograph"]["notes"].as_array().unwrap();
                    let positions = format!("instrument_position: {}", light_time.positions());
                    let is_told = |note: &Value| note.as_str().unwrap().starts_with(&positions);
                    assert!(notes.iter().any(is_told), "{notes:?}");
                    images += 1;
                }
            }
        }
        assert_eq!(images, 12, "{word}");
    }
}

/// With a polynomial the registration is as far from usgscsm as the products say that it is from the samples.
#[test]
fn other_models_are_as_far_from_usgscsm_as_stated() {
    let test = "usgscsm beside other models";
    let runs = Runs::new();
    let out = runs.run("");
    for site in SITES {
        let site = out.join(site);
        let stated = json(&site.join("registration.json"));
        for (image, (ground_m, places)) in registered(&site, "registration.parquet") {
            let isd = site.join(format!("images/{image}/isd.json"));
            let Some(seen) = seen(&isd, &ground_m, test) else {
                return;
            };
            let apart = apart(&seen, &places);
            let mut images = stated["images"].as_array().unwrap().iter();
            let own = images.find(|of| of["image"] == image.as_str()).unwrap();
            let mut models = own["models"].as_array().unwrap().iter();
            let samples = models.find(|of| of["model"] == "samples").unwrap();
            for (axis, key) in ["lines", "samples"].into_iter().enumerate() {
                let error = ["min", "max"]
                    .map(|end| number(&samples[key][end]).abs())
                    .into_iter()
                    .fold(0.0, f64::max);
                println!("{image} {key}: {:.3} px, stated {error:.3}", apart[axis]);
                assert!(apart[axis] < error + LIMIT_PX, "{image} {key}");
            }
        }
    }
}

/// Lines and samples of ISIS, with 1 at the centre of the first pixel, of the rows of `registered`; `NaN` if missing.
fn isis_places(site: &Path, name: &str) -> BTreeMap<String, Vec<[f64; 2]>> {
    let table = table(&site.join(name));
    let column = |name: &str| table.column_by_name(name).unwrap();
    let images = column("image").as_string::<i32>();
    let inside = column("inside").as_boolean();
    let places =
        ["isis_line", "isis_sample"].map(|name| column(name).as_primitive::<Float64Type>());
    let mut found = BTreeMap::<String, Vec<[f64; 2]>>::new();
    for index in (0..table.num_rows()).filter(|index| inside.value(*index)) {
        let place = places.map(|of| {
            if of.is_valid(index) {
                of.value(index)
            } else {
                f64::NAN
            }
        });
        found
            .entry(images.value(index).to_owned())
            .or_default()
            .push(place);
    }
    found
}

/// The support data without the hash of the configuration.
fn support_data(path: &Path) -> Value {
    let mut support = json(path);
    support["areograph"]["configuration_blake3"].take();
    support
}

/// Files for ISIS do not depend on the convention of the run; usgscsm reads from them the lines and samples of ISIS, and
/// those of a run with the convention of ISIS.
#[test]
fn files_for_isis_have_its_convention_in_every_run() {
    let test = "usgscsm beside lines and samples of ISIS";
    let runs = Runs::new();
    let mut of_isis = BTreeMap::new();
    for word in ["centre", "surface", "none"] {
        let out = runs.run(&format!(
            "[orientation]\nlight_time = \"{word}\"\n[registration]\nmodel = \"samples\"\n"
        ));
        for site in SITES.map(|site| out.join(site)) {
            let isis = isis_places(&site, "registration.parquet");
            for (image, (ground_m, places)) in registered(&site, "registration.parquet") {
                let path = site.join(format!("exchange/centre/{image}_isd.json"));
                let support = support_data(&path);
                if word == "centre" {
                    let own = json(&site.join(format!("images/{image}/isd.json")));
                    for key in [
                        "instrument_position",
                        "instrument_pointing",
                        "body_rotation",
                    ] {
                        assert!(support[key] == own[key], "{image} {key}");
                    }
                    let points = ground_m.iter().map(|point_m| format!("{point_m:?}"));
                    let by_point: BTreeMap<_, _> = points.zip(places.clone()).collect();
                    of_isis.insert(image.clone(), (support.clone(), by_point));
                }
                let (expected, by_point) = &of_isis[&image];
                assert!(support == *expected, "{word} {image}");
                let Some(seen) = seen(&path, &ground_m, test) else {
                    return;
                };
                let (mut compared, mut most_px) = (0, 0.0_f64);
                for ((point_m, seen), isis) in ground_m.iter().zip(&seen).zip(&isis[&image]) {
                    let run = by_point.get(&format!("{point_m:?}"));
                    let Some(run) = run.filter(|_| isis[0].is_finite()) else {
                        continue;
                    };
                    for axis in [0, 1] {
                        most_px = most_px.max((isis[axis] - 0.5 - seen[axis]).abs());
                        most_px = most_px.max((run[axis] - seen[axis]).abs());
                    }
                    compared += 1;
                }
                let moved = apart(&seen, &places);
                println!("{word} {image}: {most_px:.1e} px, {moved:.1?} from the run");
                assert!(most_px < LIMIT_PX, "{word} {image}: {most_px} px");
                // Nearly all footprints inside the image; ISIS has some beyond its ends.
                assert!(
                    compared * 10 > ground_m.len() * 9,
                    "{word} {image}: {compared}"
                );
                assert_eq!(word == "centre", moved[0] < LIMIT_PX, "{word} {image}");
            }
            let adjusted = isis_places(&site, "registration_adjusted.parquet");
            for (image, (_, places)) in registered(&site, "registration_adjusted.parquet") {
                // The same rays: places at the image's very edge may be on its other side.
                let isis = adjusted[&image].iter().zip(&places);
                let isis = isis.filter(|(isis, _)| isis[0].is_finite());
                let (isis, own): (Vec<_>, Vec<_>) = isis
                    .map(|(isis, own)| ([isis[0] - 0.5, isis[1] - 0.5], *own))
                    .unzip();
                let [lines, samples] = apart(&isis, &own);
                assert!(isis.len() + 1 >= places.len() && lines.max(samples) < LIMIT_PX);
            }
        }
    }
}

/// Tens of metres and of arcseconds, with slopes and bends.
fn curved(x: f64) -> LineCorrection {
    let t = x / 768.0;
    LineCorrection {
        position_m: Vector3::new(80.0 - 30.0 * t, -45.0 + 20.0 * t * t, 12.0 + 9.0 * t),
        rotation_rad: 1e-4 * Vector3::new(1.5 + 0.5 * t, -2.0 + 0.8 * t * t, 3.0 - t),
    }
}

/// How far usgscsm is from the samples of `orientation` over the image.
fn real_image_apart(image: &Image, orientation: &Orientation, test: &str) -> Option<[f64; 2]> {
    let mut site = products_site::Site::small();
    site.times = image.times.clone();
    site.orientation = orientation.clone();
    let limits = OrientationConfig {
        light_time: image.light_time,
        ..OrientationConfig::default()
    };
    site.model = fit_sensor_model(orientation, &limits, None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    site.with(true, |site| write_products(folder.path(), site, ""))
        .unwrap();
    let isd = folder.path().join("images/m04-02852/isd.json");
    let camera = OrientedImage::of(&image.times, orientation, &site.model).unwrap();
    let projector = camera.projector_of(CameraModel::Samples).unwrap();
    let ground = orientation.samples.iter().skip(1).step_by(2);
    let ground_m: Vec<Vector3<f64>> = ground
        .flat_map(|at| {
            let look = |share: f64| camera.detector.look(share * camera.detector.samples);
            [0.0, 0.3, 1.0]
                .map(|share| at.position.xyz_m + 3.7e5 * (at.camera_to_mars.matrix() * look(share)))
        })
        .collect();
    let places: Vec<[f64; 2]> = ground_m
        .iter()
        .map(|point_m| {
            let found = projector.project(point_m).unwrap();
            let focal_px = camera.detector.focal_px(&found.camera_m).unwrap();
            [
                found.x + 0.5 * camera.lines(),
                camera.detector.sample(focal_px.y),
            ]
        })
        .collect();
    Some(apart(&seen(&isd, &ground_m, test)?, &places))
}

#[test]
fn the_real_image_is_seen_alike_by_every_convention() {
    let test = "usgscsm beside M04/02852";
    for (word, light_time) in LightTime::WORDS {
        let Some(image) = Image::real_with(test, light_time) else {
            return;
        };
        for shift_lines in [None, Some(0.0), Some(-18.4)] {
            let orientation = shift_lines.map_or_else(
                || image.orientation.clone(),
                |shift| reorient(&image.orientation, &image.times, shift, curved).unwrap(),
            );
            let Some([lines, samples]) = real_image_apart(&image, &orientation, test) else {
                return;
            };
            println!("{word} {shift_lines:?}: {lines:.1e} lines, {samples:.1e} samples");
            assert!(
                lines < LIMIT_PX && samples < LIMIT_PX,
                "{word} {shift_lines:?}"
            );
        }
    }
}
