//! Tie points measured in the pixels of realistic images, held against the true ground: none is lost to the jitter of the images,
//! and heights scatter as their standard deviations state.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use std::{fs, path::Path};

use areograph::{
    body::Body,
    geom::ellipsoid::spherical_to_xyz_m,
    pds::terrain_model::{HeightsAbove, read_terrain_model},
    scene::{Roughness, SceneErrors, SceneOptions, TrueGround},
};
use arrow_array::{Array as _, cast::AsArray, types::Float64Type};
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::{
    common::{
        json, long_test,
        mission::{areograph, succeed},
    },
    truth::{local, scene, table},
};

/// Cells of a terrain model that are compared at most.
const CELLS_MAX: usize = 4_000;
const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];
/// Steps of the search for the place of a site, metres, and steps to each side.
const SEARCH: [(f64, i32); 3] = [(40.0, 10), (8.0, 6), (1.5, 6)];

/// Places of a site by its images: positions, metres, and standard deviations of their heights against each other, metres.
pub(crate) struct Points {
    places_m: Vec<Vector3<f64>>,
    pub(crate) sigmas_m: Vec<f64>,
}

impl Points {
    fn of(folder: &Path) -> Self {
        let rows = table(&folder.join("ties.parquet"));
        let column = |name: &str| {
            let column = rows.column_by_name(name).unwrap();
            column.as_primitive::<Float64Type>().clone()
        };
        let axes = ["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"].map(column);
        let sigmas = column("relative_sigma_up_m");
        // Every other row: a tie point has two measurements.
        let kept = (0..rows.num_rows()).step_by(2);
        let kept: Vec<usize> = kept.filter(|row| !axes[0].is_null(*row)).collect();
        let place = |row: &usize| Vector3::from_fn(|axis, _| axes[axis].value(*row));
        Self {
            places_m: kept.iter().map(place).collect(),
            sigmas_m: kept.iter().map(|row| sigmas.value(*row)).collect(),
        }
    }

    /// Cells of the terrain model with a height, evenly chosen.
    pub(crate) fn of_terrain_model(folder: &Path) -> Self {
        let read = |name: &str| {
            let above = HeightsAbove::default();
            read_terrain_model(&folder.join(name), Body::Mars, above).unwrap()
        };
        let (model, sigmas) = (read("surface_above_sphere.tif"), read("surface_sigma.tif"));
        let columns = model.size[1];
        let cells = model.heights_m.iter().zip(&sigmas.heights_m).enumerate();
        let known = cells.filter(|(_, (height_m, _))| !height_m.is_nan());
        let known = known.map(|(at, (height_m, sigma_m))| {
            let cell = [(at / columns) as f64, (at % columns) as f64];
            let [longitude_rad, latitude_rad] = model.place_rad(cell);
            let radius_m = model.radius_m + f64::from(*height_m);
            let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
            (place_m, f64::from(*sigma_m))
        });
        let (places_m, sigmas_m): (Vec<_>, Vec<_>) = known.unzip();
        let every = places_m.len().div_ceil(CELLS_MAX);
        Self {
            places_m: places_m.into_iter().step_by(every).collect(),
            sigmas_m: sigmas_m.into_iter().step_by(every).collect(),
        }
    }

    /// Height errors over their standard deviations, and their root mean square, metres.
    pub(crate) fn ratios(&self, ground: &TrueGround) -> (Vec<f64>, f64) {
        let errors_m = self.height_errors_m(ground);
        let square_m2: f64 = errors_m.iter().map(|error_m| error_m * error_m).sum();
        let rms_m = (square_m2 / errors_m.len() as f64).sqrt();
        let ratios = errors_m.iter().zip(&self.sigmas_m);
        (
            ratios.map(|(error_m, sigma_m)| error_m / sigma_m).collect(),
            rms_m,
        )
    }

    /// Heights above the true ground of a place that is `shift_m` farther east and north, without their mean, metres.
    fn errors_m(
        &self,
        ground: &TrueGround,
        axes: &Matrix3<f64>,
        shift_m: Vector2<f64>,
    ) -> Vec<f64> {
        let shift_m = axes.transpose() * Vector3::new(shift_m.x, shift_m.y, 0.0);
        let above = self
            .places_m
            .iter()
            .map(|place_m| place_m.norm() - ground.radius_m(&(place_m + shift_m)));
        let above: Vec<f64> = above.collect();
        let mean_m = above.iter().sum::<f64>() / above.len() as f64;
        above.into_iter().map(|above_m| above_m - mean_m).collect()
    }

    /// The errors of the heights at the place that the whole site really shows: places are known to 100 m only, which all share.
    fn height_errors_m(&self, ground: &TrueGround) -> Vec<f64> {
        let axes = local(&self.places_m[0]);
        let squares = |shift_m: Vector2<f64>| -> f64 {
            self.errors_m(ground, &axes, shift_m)
                .iter()
                .map(|error_m| error_m * error_m)
                .sum()
        };
        let mut best_m = Vector2::zeros();
        for (step_m, steps) in SEARCH {
            let around = |step: i32| {
                (-steps..=steps)
                    .map(move |other| Vector2::new(f64::from(step), f64::from(other)) * step_m)
            };
            let shifts = (-steps..=steps)
                .flat_map(around)
                .map(|offset_m| best_m + offset_m);
            let judged = shifts.map(|shift_m| (squares(shift_m), shift_m));
            best_m = judged
                .min_by(|one, other| one.0.total_cmp(&other.0))
                .unwrap()
                .1;
        }
        self.errors_m(ground, &axes, best_m)
    }
}

/// Sites with tie points by matching instead of their files.
fn matched_sites(mission: &Path) -> Vec<std::path::PathBuf> {
    let matched = |site: &&str| {
        let text = fs::read_to_string(mission.join(format!("sites/{site}.toml"))).unwrap();
        let files = format!("files = [\"../ties/{site}.csv\"]\n");
        assert!(text.contains(&files), "{text}");
        let file = mission.join(format!("sites/{site}_matched.toml"));
        let text = text
            .replace(&files, "match = true\n")
            .replace("# match = true", "#")
            .replace(
                &format!("site = \"{site}\""),
                &format!("site = \"{site}_matched\""),
            );
        let text = text + "\n[surface]\ncell_m = 30.0\n";
        fs::write(&file, text).unwrap();
        file
    };
    SITES.iter().map(matched).collect()
}

/// Cells of a terrain model against the true ground.
struct Model {
    /// Sum of the squares of their errors over their standard deviations.
    squares: f64,
    far: usize,
    cells: usize,
}

impl Model {
    /// Mean square of the errors over their standard deviations.
    fn square(&self) -> f64 {
        self.squares / self.cells as f64
    }
}

/// A short relative is `scatter_beyond_the_standard_deviations_is_no_blunder` of the stages.
#[test]
fn matched_ties_of_realistic_images_are_kept_and_heights_scatter_as_stated() {
    if !long_test("ties matched in realistic images") {
        return;
    }
    let (mut squares, mut far, mut points, mut lost) = (0.0, 0, 0, 0);
    let mut models = Vec::new();
    for (seed, name, roughness) in [
        (24_001, "medium", Roughness::Medium),
        (24_002, "plains", Roughness::Plains),
        (24_003, "rough", Roughness::Rough),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let options = ["--realistic", "--images", "--roughness", name];
        let (mission, out) = (
            scene(folder.path(), seed, &options),
            folder.path().join("out"),
        );
        let ground = TrueGround::of(&SceneOptions {
            seed: seed.into(),
            day_s: 600.0,
            pairs: 1,
            passes: 0,
            ties: 154,
            ties_at_shots: false,
            errors: SceneErrors::realistic(roughness),
        });
        let mut run = areograph();
        run.args(["--quiet", "run"])
            .args(matched_sites(&mission))
            .arg("--out")
            .arg(&out);
        succeed(&mut run);
        for site in SITES {
            let folder = out.join(format!("{site}_matched"));
            let adjustment = json(&folder.join("adjustment.json"))["adjustment"].take();
            let rejected = adjustment["rejected"].as_array().unwrap().len();
            let scatter_px = adjustment["summary"]["tie_scatter_px"].as_f64().unwrap();
            let of_site = Points::of(&folder);
            let (ratios, _) = of_site.ratios(&ground);
            let of_ratios: f64 = ratios.iter().map(|ratio| ratio * ratio).sum();
            println!(
                "seed {seed} {name} {site}: scatter {scatter_px:.2} px, {rejected} of {} rejected, heights {:.2} of their standard deviations",
                ratios.len() + rejected,
                (of_ratios / ratios.len() as f64).sqrt()
            );
            let model = Points::of_terrain_model(&folder);
            let (of_cells, rms_m) = model.ratios(&ground);
            let stated_m2: f64 = model.sigmas_m.iter().map(|sigma_m| sigma_m * sigma_m).sum();
            let of_model = Model {
                squares: of_cells.iter().map(|ratio| ratio * ratio).sum(),
                far: of_cells.iter().filter(|ratio| ratio.abs() > 3.0).count(),
                cells: of_cells.len(),
            };
            println!(
                "  terrain model: {} cells, {rms_m:.1} m rms, stated {:.1} m, {:.2} of their standard deviations, {} beyond three",
                of_model.cells,
                (stated_m2 / of_cells.len() as f64).sqrt(),
                of_model.square().sqrt(),
                of_model.far
            );
            models.push(of_model);
            squares += of_ratios;
            far += ratios.iter().filter(|ratio| ratio.abs() > 3.0).count();
            points += ratios.len();
            lost += rejected;
        }
    }
    let pooled = (squares / points as f64).sqrt();
    println!("{points} points: {pooled:.2}, {far} beyond three, {lost} rejected");
    // Errors of neighbours are alike, so that the sites count, nine of them.
    assert!((0.8..=1.25).contains(&pooled), "{pooled}");
    assert!(200 * lost <= points, "{lost} of {points}");
    // 0.1 % were seen.
    assert!(200 * far <= points, "{far} of {points}");
    let mean_square = models.iter().map(Model::square).sum::<f64>() / models.len() as f64;
    println!("terrain models: {:.2}", mean_square.sqrt());
    // Cells are correlated, so that the models count, nine of them; 0.72 to 1.13 were seen.
    assert!((0.8..=1.25).contains(&mean_square.sqrt()), "{mean_square}");
    for model in &models {
        assert!((0.36..=2.0).contains(&model.square()), "{}", model.square());
        assert!(200 * model.far <= model.cells, "{} far", model.far);
    }
}
