//! Tie points matched in the mission's images, and the adjustment by them, against the true image coordinates.

#![allow(
    clippy::disallowed_methods,
    reason = "site files in a temporary folder need no atomic writer"
)]

mod orthoimages;
mod surface;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
    time::Instant,
};

use nalgebra::{Matrix2, Vector2, Vector3};

use super::*;
use crate::{
    SceneOptions,
    arc::Arc,
    drawn::DayErrors,
    kernels::{clock_session, image_start},
    mission,
    plan::{IMAGES, PlannedImage, SITES, Site},
    ties::TrueImage,
};
use areograph::flow::{Ending, PUBLISH, RunOptions, run_site};
use areograph_config::{Document as _, SiteConfig};
use areograph_geom::ellipsoid::local_axes;
use areograph_pds::ties::read_ties;
use areograph_store::hashes::HashCache;

/// The mission with its images: from the folder in the environment variable, or a new one.
struct Mission {
    folder: PathBuf,
    days: Vec<Flown<'static>>,
    terrain: Terrain,
}

impl Mission {
    fn new(folder: &Path, sites: &[&Site]) -> Self {
        Self::flown(folder, sites, &SceneOptions::default())
    }

    fn flown(folder: &Path, sites: &[&Site], options: &SceneOptions) -> Self {
        let options = SceneOptions {
            day_s: 600.0,
            ..*options
        };
        let begun = Instant::now();
        mission::write(
            folder,
            &options,
            Some((
                Coder::Predictive,
                sites,
                Watch::from(&AtomicBool::new(false)),
            )),
        )
        .unwrap();
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

    /// A site file with matched tie points only.
    fn matched_site(&self, site: &str) -> PathBuf {
        let text = fs::read_to_string(self.folder.join(format!("sites/{site}.toml"))).unwrap();
        let given = format!("files = [\"../ties/{site}.csv\"]\n# match = true");
        assert!(text.contains(&given), "{text}");
        let text = text.replace(&given, "match = true");
        let text = text.replace(
            &format!("site = \"{site}\""),
            &format!("site = \"matched_{site}\""),
        );
        let path = self.folder.join(format!("sites/matched_{site}.toml"));
        fs::write(&path, text).unwrap();
        path
    }

    /// The site file `written`, with a terrain model of its pair and orthoimages on it.
    fn mapped_site(&self, written: &Path, site: &str, cell_m: f64) -> PathBuf {
        let text = fs::read_to_string(written).unwrap();
        let named = text.replace("site = \"", "site = \"mapped_");
        let path = self.folder.join(format!("sites/mapped_{site}.toml"));
        let table = format!(
            "\n[surface]\ncell_m = {cell_m:.1}\northoimage_cell_m = 5.0\northoimages_before = true\n"
        );
        fs::write(&path, named + &table).unwrap();
        path
    }

    /// The site without tie points and terrain model, with orthoimages on the ground between shots.
    fn site_on_shots(&self, site: &str) -> PathBuf {
        let text = fs::read_to_string(self.folder.join(format!("sites/{site}.toml"))).unwrap();
        let given = format!("[ties]\nfiles = [\"../ties/{site}.csv\"]\n");
        assert!(text.contains(&given), "{text}");
        let text = text.replace(&given, "");
        let named = text.replace("site = \"", "site = \"on_shots_");
        let path = self.folder.join(format!("sites/on_shots_{site}.toml"));
        fs::write(&path, named + "\n[surface]\northoimage_cell_m = 5.0\n").unwrap();
        path
    }

    /// The same site with the pixels of one image as a cube of ISIS, and of the other as a TIFF.
    fn in_other_files(&self, site: &str) -> PathBuf {
        let name = |path: &Path, ending: &str| path.with_extension(ending);
        let mut text = fs::read_to_string(self.matched_site(site)).unwrap();
        text = text.replace("site = \"matched_", "site = \"other_files_");
        let images = IMAGES.iter().filter(|image| image.site.id == site);
        for (image, ending) in images.zip(["cub", "tif"]) {
            let path = self.folder.join("images").join(image_name(image.id));
            let (_, pixels) = decoded(&path);
            let size = [image.samples(), image.lines_delivered];
            let bytes = match ending {
                "cub" => cube(image, size, &pixels),
                _ => tiff(size, &pixels),
            };
            fs::write(name(&path, ending), bytes).unwrap();
            let stem = path.file_stem().unwrap().to_str().unwrap();
            text = text.replace(&format!("{stem}.imq"), &format!("{stem}.{ending}"));
        }
        let path = self.folder.join(format!("sites/other_files_{site}.toml"));
        fs::write(&path, text).unwrap();
        path
    }
}

/// A cube as written by ISIS.
fn cube(image: &PlannedImage, [samples, lines]: [u32; 2], pixels: &[u8]) -> Vec<u8> {
    let label = format!(
        "Object = IsisCube\nObject = Core\nStartByte = 2049\nFormat = BandSequential\n\
         Group = Dimensions\nSamples = {samples}\nLines = {lines}\nBands = 1\nEnd_Group\n\
         Group = Pixels\nType = UnsignedByte\nByteOrder = Lsb\nBase = 0.0\nMultiplier = 1.0\nEnd_Group\nEnd_Object\n\
         Group = Instrument\nSpacecraftName = MARS_GLOBAL_SURVEYOR\nInstrumentId = MOC-NA\nTargetName = Mars\n\
         SpacecraftClockCount = {}\nEnd_Group\nGroup = Archive\nProductId = {}\nEnd_Group\nEnd_Object\nEnd\n",
        image.sclk_start,
        image.id.replace('-', "/"),
    );
    let mut bytes = label.into_bytes();
    bytes.resize(2048, b' ');
    bytes.extend(pixels);
    bytes
}

fn tiff([samples, lines]: [u32; 2], pixels: &[u8]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
    encoder
        .write_image::<tiff::encoder::colortype::Gray8>(samples, lines, pixels)
        .unwrap();
    bytes.into_inner()
}

/// Runs a site; returns the folder of its products.
fn run(site: &Path, out: &Path) -> PathBuf {
    let (products, is_valid) = published(site, out);
    assert!(is_valid);
    products
}

/// The products of a site, and whether they are valid.
fn published(site: &Path, out: &Path) -> (PathBuf, bool) {
    let config = SiteConfig::load(site).unwrap().config;
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
    (outcome.folder, manifest.verdict.valid)
}

/// True image coordinates of a point.
fn place(image: &TrueImage<'_>, ground_m: &Vector3<f64>) -> Vector2<f64> {
    let seen = image.projector().unwrap().project(ground_m).unwrap();
    let camera = &image.oriented_camera;
    let focal_px = camera.detector.focal_px(&seen.camera_m).unwrap();
    Vector2::new(
        seen.x + 0.5 * camera.lines(),
        camera.detector.sample(focal_px.y),
    )
}

/// Errors of a site's matched tie points in the second image, and their stated standard deviations, lines and samples.
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

/// Adjusted tie points by their identifiers, metres Mars-fixed, without rejected ones.
fn adjusted_m(products: &Path) -> BTreeMap<String, Vector3<f64>> {
    use arrow_array::Array as _;
    use arrow_array::cast::AsArray as _;
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
                .as_primitive::<arrow_array::types::Float64Type>()
                .clone()
        });
        for row in (0..batch.num_rows()).filter(|row| !axes[0].is_null(*row)) {
            let place_m = Vector3::from_fn(|axis, _| axes[axis].value(row));
            adjusted.insert(names.value(row).to_owned(), place_m);
        }
    }
    adjusted
}

/// Errors of a site's adjusted tie points.
#[derive(Debug)]
struct Judged {
    /// Mean error and its stated covariance, east, north and up, metres.
    mean_m: Vector3<f64>,
    mean_sigma_m: Vector3<f64>,
    /// Root mean square of the heights' errors, metres.
    heights_m: f64,
}

impl Judged {
    fn of(products: &Path, truth: &BTreeMap<String, Vector3<f64>>) -> Self {
        let adjusted = adjusted_m(products);
        let count = adjusted.len() as f64;
        let mean_m = |of: &dyn Fn(&str, &Vector3<f64>) -> Vector3<f64>| {
            let all = adjusted.iter().map(|(name, place_m)| of(name, place_m));
            all.sum::<Vector3<f64>>() / count
        };
        let axes = local_axes(&mean_m(&|_, place_m| *place_m));
        let heights = adjusted
            .iter()
            .map(|(name, place_m)| place_m.norm() - truth[name].norm());
        let square = heights.map(|height_m| height_m * height_m).sum::<f64>() / count;
        let document: serde_json::Value =
            serde_json::from_slice(&fs::read(products.join("adjustment.json")).unwrap()).unwrap();
        let stated = &document["adjustment"]["heights"]["mean_sigma_m"];
        Self {
            mean_m: axes * mean_m(&|name, place_m| place_m - truth[name]),
            mean_sigma_m: Vector3::from_fn(|axis, _| stated[axis].as_f64().unwrap()),
            heights_m: square.sqrt(),
        }
    }
}

#[test]
fn matched_ties_are_within_what_they_state_and_adjust_as_well_as_given_ones() {
    let folder = tempfile::tempdir().unwrap();
    let is_long = areograph_testing::long();
    // Every run matches and adjusts one site; the long run does all, and maps one.
    let sites: &[&Site] = if is_long { &SITES[..] } else { &SITES[1..2] };
    let mission = Mission::new(&folder.path().join("mission"), sites);
    let truth: serde_json::Value =
        serde_json::from_slice(&fs::read(mission.folder.join("truth.json")).unwrap()).unwrap();
    for site in sites {
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
        // The adjustments by matched and by given tie points against the truth.
        let ties = read_ties(&products.join("exchange/matched_ties.csv"))
            .unwrap()
            .ties;
        if is_long && site.id == "gusev_crater" {
            // Independent of the file format of the pixels.
            let others = run(&mission.in_other_files(site.id), folder.path());
            let others = read_ties(&others.join("exchange/matched_ties.csv")).unwrap();
            assert_eq!(others.ties, ties);
        }
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
        let by_matched = Judged::of(&products, &matched_m.collect());
        println!("{}: {by_matched:.2?}", site.id);
        // The stated uncertainty of the mean holds in height and in planimetry: one of 370 exceeds three standard
        // deviations by chance.
        for axis in 0..3 {
            let [mean_m, sigma_m] =
                [&by_matched.mean_m, &by_matched.mean_sigma_m].map(|of| of[axis]);
            assert!(mean_m.abs() <= 3.0 * sigma_m, "{by_matched:?}");
        }
        // Images have pixels, so the report contains pictures of them.
        let given = run(
            &mission.folder.join(format!("sites/{}.toml", site.id)),
            folder.path(),
        );
        assert!(given.join("report/overlays.html").exists());
        if is_long {
            let written = mission.matched_site(site.id);
            let mapped = run(&mission.mapped_site(&written, site.id, 60.0), folder.path());
            if site.id == "gusev_crater" {
                surface::Published::of(&mapped).hold_against(&mission.terrain);
            }
            orthoimages::Apart::of(&mission, &mapped).is_true();
            let (judged, apart) = orthoimages::judged(&mission, &mapped);
            // Without jitter: 0.3 cells of 5 m.
            assert!(apart <= 0.3, "{apart}");
            for orthoimages::Judged { mean, about } in judged {
                assert!(
                    mean.iter()
                        .all(|[error_m, sigma_m]| error_m.abs() <= 3.0 * sigma_m)
                );
                assert!(about[0] <= 1.25 * about[1], "{about:?}");
            }
        }
        let by_given = Judged::of(&given, &given_m.collect());
        println!("{}: by given ties {by_given:.2?}", site.id);
        assert!(by_matched.heights_m <= by_given.heights_m, "{by_given:?}");
    }
}
