//! A synthetic net of rectified pictures as files, with blunders, gross control errors and true values.

use std::{collections::BTreeMap, fmt::Write as _, path::Path};

use serde::Serialize;

use super::{
    error::SceneError,
    files::{Draft, put, put_bytes},
    plane_net::{PlaneRecipe, PlaneScene},
    plane_pictures::Ground,
    random::Random,
};
use areograph_base::error::{Locate, Result};
use areograph_geom::plane::Place;

const README: &str = "A net of 25 rectified pictures for plane triangulation: measurements, controls and a net file.\n\
    Some measurements and two controls are intentionally wrong; truth.json lists them and all true positions.\n\
    Nine pictures in the south-west have pixels; truth.json has the brightness of the ground, in which the contrast of pictures differs.\n\
    Next: areograph triangulate net.toml\n";

/// The tertiary net of the paper with more points and controls, and noise.
const RECIPE: PlaneRecipe = PlaneRecipe {
    points: 600,
    noise_m: 30.0,
    controls: 12,
    control_sigma_m: 800.0,
    ..PlaneRecipe::TERTIARY
};
/// Number of misidentified ties, and their displacement, metres.
const BLUNDERS: usize = 3;
const BLUNDER_M: f64 = 2_000.0;
/// Columns and rows of the grid, from the south-west on, whose pictures have pixels; contrast of every second one.
const WITH_PIXELS: usize = 3;
const CONTRAST: f64 = 0.8;
/// Errors of two controls in Y, metres, as in the secondary net of the paper.
const GROSS_M: [f64; 2] = [17_000.0, 19_000.0];

/// The file of true values.
#[derive(Serialize)]
struct Truth {
    seed: u64,
    noise_m: f64,
    control_sigma_m: f64,
    /// Misidentified measurements: picture and point.
    blunders: Vec<[String; 2]>,
    /// Controls with gross errors.
    gross_controls: Vec<String>,
    /// East and north of every point on the map, metres.
    points_m: BTreeMap<String, [f64; 2]>,
    /// `P`, `Q`, `A`, `B` of every picture, metres.
    pictures: BTreeMap<String, [f64; 4]>,
    /// Brightness of the ground in pictures with pixels.
    ground: Ground,
}

/// Writes a synthetic net into `directory`, replacing an older scene unless files were added or changed. The same seed
/// gives the same bytes.
///
/// # Errors
/// [`SceneError`] when the folder holds something else; errors of writing.
pub fn write_plane_scene(directory: &Path, seed: u64) -> Result<String> {
    let draft = Draft::begin(directory, README)?;
    let mut scene = RECIPE.simulate(seed);
    let blunders = misidentify(&mut scene, seed);
    let gross = [0, 1].map(|of| scene.net.controls.len() / 2 + of);
    for (control, error_m) in gross.iter().zip(GROSS_M) {
        scene.net.controls[*control].at += Place::new(0.0, error_m);
    }
    let picture = name_of;
    let point = |index: usize| format!("{}", index + 1);
    let mut measurements = "picture,point,x,y\n".to_owned();
    for of in &scene.net.measurements {
        // Writing to a string cannot fail.
        let _infallible = writeln!(
            measurements,
            "{},{},{:.6},{:.6}",
            picture(of.picture),
            point(of.point),
            of.at.re,
            of.at.im
        );
    }
    let mut controls = "point,x_km,y_km\n".to_owned();
    for of in &scene.net.controls {
        let _infallible = writeln!(
            controls,
            "{},{:.6},{:.6}",
            point(of.point),
            of.at.re / 1e3,
            of.at.im / 1e3
        );
    }
    let ground = Ground::new(seed);
    let pictures = pictures(&draft, &scene, &ground)?;
    let truth = Truth {
        seed,
        noise_m: RECIPE.noise_m,
        control_sigma_m: RECIPE.control_sigma_m,
        blunders: blunders
            .iter()
            .map(|index| {
                let of = &scene.net.measurements[*index];
                [picture(of.picture), point(of.point)]
            })
            .collect(),
        gross_controls: gross
            .iter()
            .map(|index| point(scene.net.controls[*index].point))
            .collect(),
        points_m: scene
            .points
            .iter()
            .enumerate()
            .map(|(index, place)| (point(index), [place.re, place.im]))
            .collect(),
        pictures: scene
            .pictures
            .iter()
            .enumerate()
            .map(|(index, way)| {
                (
                    picture(index),
                    [way.turn.re, way.turn.im, way.shift.re, way.shift.im],
                )
            })
            .collect(),
        ground,
    };
    let truth = serde_json::to_string_pretty(&truth).unwrap_or_default() + "\n";
    for (name, text) in [
        ("measurements.csv", &*measurements),
        ("controls.csv", &*controls),
        ("pictures.csv", &*pictures),
        ("truth.json", &*truth),
        ("net.toml", NET),
    ] {
        let path = draft.root().join(name);
        put(&path, text).in_file(&path)?;
    }
    draft.finish()?;
    Ok(format!(
        "{}: {} pictures, {} points, {} measurements; next: areograph triangulate {}",
        directory.display(),
        scene.net.pictures,
        scene.net.points,
        scene.net.measurements.len(),
        directory.join("net.toml").display()
    ))
}

/// The table of the pictures; images of some of them are written.
fn pictures(draft: &Draft, scene: &PlaneScene, ground: &Ground) -> Result<String> {
    let images = draft.folder("images")?;
    let mut pictures =
        "picture,brick,metres_per_unit,image,image_x,image_y,pixel_units\n".to_owned();
    for (index, way) in scene.pictures.iter().enumerate() {
        // Three bricks of neighbouring columns.
        let [column, row] = [index % RECIPE.grid[0], index / RECIPE.grid[0]];
        let brick = ["west", "middle", "east"][column * 3 / RECIPE.grid[0]];
        let (name, scale) = (name_of(index), way.scale());
        let _infallible = write!(pictures, "{name},{brick},{scale:.3}");
        if column.max(row) >= WITH_PIXELS {
            pictures += ",,,,\n";
            continue;
        }
        let middle_m = Place::new(column as f64, row as f64) * RECIPE.spacing_m;
        let contrast = if (column + row) % 2 == 0 {
            1.0
        } else {
            CONTRAST
        };
        let path = images.join(format!("{name}.tif"));
        let image = ground.picture(way, middle_m, RECIPE.side_m, contrast);
        let image = image.map_err(|refusal| SceneError::Image {
            image: name.clone(),
            error: refusal.to_string(),
        });
        let image = image.in_file(&path)?;
        put_bytes(&path, &image.tiff)?;
        let _infallible = writeln!(
            pictures,
            ",images/{name}.tif,{:.6},{:.6},{:.9}",
            image.corner.re, image.corner.im, image.pixel_units
        );
    }
    Ok(pictures)
}

/// Name of the picture with this index.
fn name_of(index: usize) -> String {
    format!("P{:02}", index + 1)
}

const NET: &str = "\
net = \"synthetic_net\"
description = \"Synthetic net after the tertiary net of Arthur & McMacken 1977\"

[measurements]
files = [\"measurements.csv\"]

[controls]
files = [\"controls.csv\"]

[pictures]
files = [\"pictures.csv\"]

[map]
latitude_deg = 0.0
longitude_deg = 0.0

[triangulation]
method = \"one_shot\"
";

/// Displaces some measurements of points on three pictures or more as a misidentified crater would; returns their
/// indices.
fn misidentify(scene: &mut PlaneScene, seed: u64) -> Vec<usize> {
    let mut views = vec![0; scene.net.points];
    for of in &scene.net.measurements {
        views[of.point] += 1;
    }
    let mut random = Random::new(seed, "plane blunders");
    let many: Vec<usize> = (0..scene.net.measurements.len())
        .filter(|index| views[scene.net.measurements[*index].point] > 2)
        .collect();
    let chosen: Vec<usize> = (0..BLUNDERS)
        .map(|number| many[(number * many.len() + many.len() / 2) / BLUNDERS % many.len().max(1)])
        .collect();
    for index in &chosen {
        let of = &mut scene.net.measurements[*index];
        let direction = random.between(0.0, std::f64::consts::TAU);
        of.at += Place::from_polar(BLUNDER_M, direction) / scene.pictures[of.picture].turn;
    }
    chosen
}
