//! Orthoimages of a site against the true ground, and against each other.

use std::{
    fs::{self, File},
    path::Path,
};

use nalgebra::{Matrix2, Vector2, Vector3};
use tiff::{
    decoder::{Decoder, DecodingResult},
    tags::Tag,
};

use super::{Mission, decoded, place, published};
use crate::{
    Roughness, SceneErrors, SceneOptions,
    images::image_name,
    plan::{IMAGES, SITES, Site},
    terrain::Terrain,
    ties::TrueImage,
};
use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::{
    ellipsoid::{local_axes, spherical_to_xyz_m},
    imaging::{Affine, Patch, match_least_squares, search},
};

/// Half the edge of a compared square, and the largest shift, cells.
const HALF: i64 = 12;
const REACH: i64 = 8;
/// Largest error of a place, cells: those of kernels reach 90.
const FAR: i64 = 110;
/// Distance of compared squares, cells.
const APART: usize = 150;

/// An orthoimage, with its map.
pub(super) struct Published {
    pixels: Patch,
    /// Edge of a cell, western and northern edge, metres; cosine of the parallel; radius of the sphere, metres.
    cell_m: f64,
    edges_m: [f64; 2],
    parallel_cosine: f64,
    sphere_m: f64,
}

impl Published {
    pub(super) fn of(products: &Path, image: &str, file: &str) -> Self {
        let path = products.join(format!("images/{image}/{file}"));
        let mut decoder = Decoder::new(File::open(path).unwrap()).unwrap();
        let (columns, rows) = decoder.dimensions().unwrap();
        let mut numbers = |tag| decoder.get_tag_f64_vec(tag).unwrap();
        let scale = numbers(Tag::ModelPixelScaleTag);
        let corner = numbers(Tag::ModelTiepointTag);
        let [sphere_m, parallel_deg, _] = numbers(Tag::GeoDoubleParamsTag)[..] else {
            panic!("other parameters");
        };
        let DecodingResult::U8(bytes) = decoder.read_image().unwrap() else {
            panic!("other numbers");
        };
        let missing_or = |byte: u8| if byte == 0 { f32::NAN } else { f32::from(byte) };
        Self {
            pixels: Patch {
                first: [0, 0],
                size: [rows as usize, columns as usize],
                values: bytes.into_iter().map(missing_or).collect(),
            },
            cell_m: scale[0],
            edges_m: [corner[3], corner[4]],
            parallel_cosine: (parallel_deg * RADIANS_PER_DEGREE).cos(),
            sphere_m,
        }
    }

    /// A square about the middle of a cell; `None` where a cell is empty or missing.
    fn square(&self, middle: [i64; 2], half: i64) -> Option<Patch> {
        let first = middle.map(|at| at - half);
        let edge = usize::try_from(2 * half + 1).ok()?;
        let starts = first.map(usize::try_from);
        let [Ok(row), Ok(column)] = starts else {
            return None;
        };
        let [rows, columns] = self.pixels.size;
        if row + edge > rows || column + edge > columns {
            return None;
        }
        let lines = (row..row + edge).map(|row| row * columns + column);
        let values = lines.flat_map(|start| &self.pixels.values[start..start + edge]);
        let values: Vec<f32> = values.copied().collect();
        let is_whole = values.iter().all(|value| !value.is_nan());
        is_whole.then_some(Patch {
            first,
            size: [edge; 2],
            values,
        })
    }

    /// The middles of squares.
    fn middles(&self) -> impl Iterator<Item = [i64; 2]> {
        let [rows, columns] = self.pixels.size.map(|of| i64::try_from(of).unwrap());
        let rows = (0..rows).step_by(APART);
        rows.flat_map(move |row| {
            (0..columns)
                .step_by(APART / 2)
                .map(move |column| [row, column])
        })
    }

    /// The true ground at a place in cells, counted from the north-western edge.
    fn ground_m(&self, terrain: &Terrain, cell: &Vector2<f64>) -> Vector3<f64> {
        let east_m = self.edges_m[0] + cell.y * self.cell_m;
        let north_m = self.edges_m[1] - cell.x * self.cell_m;
        let longitude_rad = east_m / self.sphere_m / self.parallel_cosine;
        let direction = spherical_to_xyz_m(longitude_rad, north_m / self.sphere_m, 1.0);
        direction * terrain.radius_m(&direction)
    }

    /// Errors of its places towards east and north, metres: against the true place of the ground that its cells show.
    pub(super) fn errors_m(
        &self,
        truth: &TrueImage<'_>,
        terrain: &Terrain,
        pixels: &Patch,
    ) -> Vec<Vector2<f64>> {
        let error_m = |middle: [i64; 2]| {
            let template = self.square(middle, HALF)?;
            let from = template.middle();
            let through = |cell: Vector2<f64>| place(truth, &self.ground_m(terrain, &cell));
            let steps = [Vector2::x(), Vector2::y()];
            let matrix = Matrix2::from_columns(
                &steps.map(|step| (through(from + step) - through(from - step)) * 0.5),
            );
            let warp = Affine {
                from,
                to: through(from),
                matrix,
            };
            // The true image on the same cells.
            let first = middle.map(|at| at - HALF - FAR);
            let edge = usize::try_from(2 * (HALF + FAR) + 1).ok()?;
            let area = pixels.resampled(first, [edge; 2], &warp)?;
            let peak = search(&template, &area)?;
            let to = Vector2::from_fn(|axis, _| first[axis] as f64 + peak.at[axis] as f64);
            let start = Affine {
                from,
                to: to + Vector2::repeat(HALF as f64 + 0.5),
                matrix: Matrix2::identity(),
            };
            let found = match_least_squares(&template, &area, &start).ok()?;
            let here_m = self.ground_m(terrain, &from);
            let shown_m = self.ground_m(terrain, &found.affine.to);
            Some((local_axes(&here_m) * (here_m - shown_m)).xy())
        };
        self.middles().filter_map(error_m).collect()
    }

    /// Shifts of another orthoimage against this one, cells southwards and eastwards.
    pub(super) fn shifts(&self, other: &Self) -> Vec<Vector2<f64>> {
        let offset = [
            (other.edges_m[1] - self.edges_m[1]) / self.cell_m,
            (self.edges_m[0] - other.edges_m[0]) / self.cell_m,
        ];
        let shift = |middle: [i64; 2]| {
            let template = self.square(middle, HALF)?;
            let from = template.middle();
            let to = from + Vector2::from(offset);
            #[allow(clippy::cast_possible_truncation, reason = "cells of a small grid")]
            let near = [0, 1].map(|axis| to[axis].floor() as i64);
            let area = other.square(near, HALF + REACH)?;
            let matrix = Matrix2::identity();
            let found = match_least_squares(&template, &area, &Affine { from, to, matrix }).ok()?;
            Some(found.affine.to - to)
        };
        self.middles().filter_map(shift).collect()
    }
}

/// Errors of an orthoimage, with what is stated of them, metres.
pub(super) struct Judged {
    /// Mean error and its standard deviation, east and north.
    pub(super) mean: [[f64; 2]; 2],
    /// Root mean square about the mean, and what is stated.
    pub(super) about: [f64; 2],
}

impl Judged {
    fn of(id: &str, errors_m: &[Vector2<f64>], stated: &serde_json::Value) -> Self {
        let count = errors_m.len() as f64;
        let mean_m = errors_m.iter().sum::<Vector2<f64>>() / count;
        let squares_m2 = errors_m.iter().map(|of| (of - mean_m).norm_squared());
        let about_m = (squares_m2.sum::<f64>() / count).sqrt();
        let number = |place: &str| stated.pointer(place).unwrap().as_f64().unwrap();
        // Adjusted images share this error, others have one each.
        let is_stated = |name: &&str| stated.get(*name).is_some_and(serde_json::Value::is_array);
        let of_mean = ["shared_sigma_m", "image_sigma_m"];
        let of_mean = of_mean.into_iter().find(is_stated).unwrap();
        let mean_sigma = |axis: usize| number(&format!("/{of_mean}/{axis}"));
        println!(
            "orthoimage of {id}: {count} places, mean error {:.1} and {:.1} m, {about_m:.2} m about it; stated {:.1} and \
             {:.1} m, {:.2} m (jitter {:.2} m, drift {:.2} m)",
            mean_m.x,
            mean_m.y,
            mean_sigma(0),
            mean_sigma(1),
            number("/sigma_m"),
            // Omitted where no scatter was measured.
            stated
                .pointer("/jitter_m")
                .map_or(0.0, |of| of.as_f64().unwrap()),
            number("/drift_m"),
        );
        assert!(errors_m.len() >= 30);
        Self {
            mean: [0, 1].map(|axis| [mean_m[axis], mean_sigma(axis)]),
            // With a tenth of a pixel of the comparison itself.
            about: [about_m, number("/sigma_m").hypot(0.1 * number("/pixel_m"))],
        }
    }
}

/// Errors of an orthoimage of a mission, metres.
fn errors_m(mission: &Mission, id: &str, orthoimage: &Published) -> Vec<Vector2<f64>> {
    let image = IMAGES.iter().find(|image| image.id == id).unwrap();
    let (_, pixels) = decoded(&mission.folder.join("images").join(image_name(id)));
    let samples = image.samples() as usize;
    let pixels = Patch {
        first: [0, 0],
        size: [pixels.len() / samples, samples],
        values: pixels.into_iter().map(f32::from).collect(),
    };
    orthoimage.errors_m(&mission.image(id), &mission.terrain, &pixels)
}

/// Offsets of the first pair of a site as the products state them, and as the true ground has them, metres.
#[derive(Debug)]
pub(super) struct Apart {
    pub(super) pixel_m: f64,
    /// Median before the adjustment, stated and true.
    pub(super) before_m: [Vector2<f64>; 2],
    /// Root mean square after it, and the stated jitter of both orthoimages.
    pub(super) after_m: f64,
    pub(super) jitter_m: f64,
}

impl Apart {
    pub(super) fn of(mission: &Mission, products: &Path) -> Self {
        let document = fs::read(products.join("orthoimages.json")).unwrap();
        let document: serde_json::Value = serde_json::from_slice(&document).unwrap();
        let number = |place: &str| document.pointer(place).unwrap().as_f64().unwrap();
        let mean_m = |place: &str| {
            let id = document.pointer(place).unwrap().as_str().unwrap();
            let before = Published::of(products, id, "orthoimage_before.tif");
            let errors_m = errors_m(mission, id, &before);
            assert!(errors_m.len() >= 30);
            errors_m.iter().sum::<Vector2<f64>>() / errors_m.len() as f64
        };
        let stated_m =
            Vector2::from_fn(|axis, _| number(&format!("/pairs/0/before/median_m/{axis}")));
        let [one_m, other_m] = [0, 1].map(|of| mean_m(&format!("/pairs/0/images/{of}")));
        let jitter_m = document["orthoimages"].as_array().unwrap().iter();
        // Omitted where no scatter was measured.
        let jitter_m = jitter_m.filter_map(|of| of.get("jitter_m")?.as_f64());
        Self {
            pixel_m: number("/orthoimages/0/pixel_m"),
            before_m: [stated_m, other_m - one_m],
            after_m: number("/pairs/0/after/rms_m"),
            jitter_m: jitter_m.map(|of| of * of).sum::<f64>().sqrt(),
        }
    }

    /// A known misregistration is found, and is gone after the adjustment but for jitter.
    pub(super) fn is_true(&self) {
        println!("{self:.2?}");
        let [stated_m, true_m] = &self.before_m;
        assert!(true_m.norm() > 10.0 * self.pixel_m);
        // Errors of orientation change along the images, and the squares are not the places that are compared with the truth.
        let most_px = if self.jitter_m > 0.0 { 0.5 } else { 0.3 };
        assert!((stated_m - true_m).norm() <= most_px * self.pixel_m);
        assert!(self.after_m <= (0.3 * self.pixel_m).hypot(self.jitter_m));
    }
}

/// The errors of all orthoimages of a site, and how far those of the first two are apart, root mean square in cells.
pub(super) fn judged(mission: &Mission, products: &Path) -> (Vec<Judged>, f64) {
    let document = fs::read(products.join("orthoimages.json")).unwrap();
    let document: serde_json::Value = serde_json::from_slice(&document).unwrap();
    let (mut made, mut judged) = (Vec::new(), Vec::new());
    for stated in document["orthoimages"].as_array().unwrap() {
        let id = stated["image"].as_str().unwrap();
        let orthoimage = Published::of(products, id, "orthoimage.tif");
        judged.push(Judged::of(id, &errors_m(mission, id, &orthoimage), stated));
        made.push(orthoimage);
    }
    let shifts = made[0].shifts(&made[1]);
    let square = shifts.iter().map(Vector2::norm_squared).sum::<f64>();
    let apart = (square / shifts.len() as f64).sqrt();
    println!(
        "{} places in both orthoimages, {apart:.3} cells apart",
        shifts.len()
    );
    assert!(shifts.len() >= 30);
    (judged, apart)
}

/// The orthoimages of a site on the ground between shots; empty for an invalid site.
fn on_shots(mission: &Mission, site: &Site, out: &Path) -> Vec<Judged> {
    let (products, is_valid) = published(&mission.site_on_shots(site.id), out);
    if !is_valid {
        return Vec::new();
    }
    let document = fs::read(products.join("orthoimages.json")).unwrap();
    let document: serde_json::Value = serde_json::from_slice(&document).unwrap();
    let of_image = |stated: &serde_json::Value| {
        let id = stated["image"].as_str().unwrap();
        let orthoimage = Published::of(&products, id, "orthoimage.tif");
        Judged::of(id, &errors_m(mission, id, &orthoimage), stated)
    };
    let all = document["orthoimages"].as_array().unwrap();
    all.iter().map(of_image).collect()
}

/// Images with the orientation from the kernels, whose errors have other sizes in every mission.
#[test]
fn orthoimages_on_the_ground_between_shots_are_where_they_state() {
    if !areograph_testing::long() {
        return;
    }
    let roughness = [Roughness::Medium, Roughness::Plains, Roughness::Varied];
    let mut all = Vec::new();
    for (seed, roughness) in (31_001..).zip(roughness) {
        let options = SceneOptions {
            seed,
            errors: SceneErrors::realistic(roughness).with_drawn_sizes(seed),
            ..SceneOptions::default()
        };
        let sites: Vec<&Site> = SITES.to_vec();
        let folder = tempfile::tempdir().unwrap();
        let mission = Mission::flown(&folder.path().join("mission"), &sites, &options);
        for site in sites {
            all.extend(on_shots(&mission, site, folder.path()));
        }
    }
    let means = all
        .iter()
        .flat_map(|of| of.mean.map(|[error_m, sigma_m]| error_m / sigma_m));
    let means: Vec<f64> = means.collect();
    let square = means.iter().map(|of| of * of).sum::<f64>() / means.len() as f64;
    let sums = [0, 1].map(|of| {
        all.iter()
            .map(|judged| judged.about[of].powi(2))
            .sum::<f64>()
    });
    let ratio = (sums[0] / sums[1]).sqrt();
    println!(
        "{} orthoimages on the ground between shots: mean {:.2}, about it {ratio:.2}",
        all.len(),
        square.sqrt()
    );
    assert!(means.iter().all(|of| of.abs() <= 3.0));
    // 16 images have 32 axes: chance alone gives 1 ± 0.13, and two of these are allowed. Jitter is not stated.
    assert!((0.74..=1.26).contains(&square.sqrt()));
    assert!((0.7..=1.4).contains(&ratio));
}

#[test]
fn orthoimages_of_realistic_missions_are_where_they_state() {
    if !areograph_testing::long() {
        return;
    }
    let (mut means, mut abouts) = (Vec::new(), Vec::new());
    for (seed, roughness) in [
        (26_001, Roughness::Plains),
        (26_002, Roughness::Medium),
        (26_003, Roughness::Varied),
        (26_004, Roughness::Medium),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let options = SceneOptions {
            seed,
            errors: SceneErrors::realistic(roughness).with_drawn_sizes(seed),
            ..SceneOptions::default()
        };
        let sites: Vec<&Site> = SITES.to_vec();
        let mission = Mission::flown(&folder.path().join("mission"), &sites, &options);
        for site in sites {
            let written = mission.matched_site(site.id);
            let mapped = mission.mapped_site(&written, site.id, 30.0);
            let (products, is_valid) = published(&mapped, folder.path());
            if !is_valid {
                continue;
            }
            println!("{} of mission {seed}", site.id);
            Apart::of(&mission, &products).is_true();
            let (of_site, _) = judged(&mission, &products);
            for Judged { mean, about } in of_site {
                means.extend(mean.map(|[error_m, sigma_m]| error_m / sigma_m));
                abouts.push(about);
            }
        }
    }
    let square = means.iter().map(|of| of * of).sum::<f64>() / means.len() as f64;
    let [found, stated] =
        [0, 1].map(|of| abouts.iter().map(|about| about[of].powi(2)).sum::<f64>());
    let ratio = (found / stated).sqrt();
    println!(
        "{} orthoimages: mean {:.2}, about it {ratio:.2}",
        abouts.len(),
        square.sqrt()
    );
    assert!(means.iter().all(|of| of.abs() <= 3.0));
    // Twelve sites have 24 axes, whose errors both images of a pair share: chance alone gives 1 ± 0.14, and two of these are allowed.
    assert!((0.72..=1.28).contains(&square.sqrt()));
    assert!((0.8..=1.25).contains(&ratio));
}
