//! A shifted stereo terrain model of synthetic ground, laser passes over it, and images that show it: the input from
//! which `areograph pedr match` derives control points.

use std::{fs::File, io::BufWriter, path::Path};

use rayon::prelude::*;
use serde::Serialize;
use tiff::{
    encoder::{Compression, DeflateLevel, TiffEncoder, colortype::Gray32Float},
    tags::Tag,
};

use super::{
    error_sources::{Relief, Roughness},
    files::{Draft, put},
    passes::Passes,
    pushbroom_pair::{self, OrbitError, StereoLine},
    random::{mix, normal_of, unit_of},
    terrain::Terrain,
};
use areograph_base::{
    error::{Error, IoError, Locate as _, Result},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{calibration::Offset, ellipsoid::spherical_to_xyz_m, height_grid::HeightGrid};

const README: &str = "A stereo terrain model (model.tif) that is shifted from the ground, PEDR files of passes over this ground\n\
    (pedr/), and support data of two images that show this ground (isd/); truth.json states the shift.\n\
    Next: areograph pedr match model.tif pedr --isd s1=isd/s1.json --isd s2=isd/s2.json\n";

/// Middle of the model.
const LONGITUDE_RAD: f64 = -60.0 * RADIANS_PER_DEGREE;
const LATITUDE_RAD: f64 = -30.0 * RADIANS_PER_DEGREE;
/// Sphere that its heights refer to.
const RADIUS_M: f64 = 3_396_190.0;
/// Rows and columns, and edge of a cell, metres.
const SIZE: [u32; 2] = [430, 560];
const CELL_M: f64 = 150.0;
/// Shift of the model to the east and the north, cells, and above the ground, metres.
const SHIFT_CELLS: [f64; 2] = [12.3, -7.4];
const BIAS_M: f64 = 35.0;
/// Noise of its heights, metres.
const NOISE_M: f64 = 8.0;
/// The value for a missing height, and the size of the corner without heights, cells.
const NO_HEIGHT: f32 = -32_768.0;
const CORNER: u32 = 20;
/// Passes over it.
const PASSES: Passes = Passes {
    longitude_rad: LONGITUDE_RAD,
    latitude_rad: LATITUDE_RAD,
    of_direction: 14,
    half_width_m: 27_000.0,
    half_s: 14.0,
    first_orbit: 1,
    shift_sigma_m: [0.0; 2],
};

/// `truth.json`.
#[derive(Serialize)]
struct Truth {
    made_by: &'static str,
    synthetic: &'static str,
    seed: u64,
    /// Shift of the model to the east and the north.
    shift_cells: [f64; 2],
    shift_m: [f64; 2],
    /// Height of the model above the ground.
    bias_m: f64,
    noise_m: f64,
    radius_m: f64,
}

/// Writes the scene into `directory`, replacing an older one unless files were added or changed. The same seed gives
/// the same bytes.
///
/// # Errors
/// [`SceneError`](super::SceneError) when the folder holds something else; errors of writing.
pub fn write_terrain_model_scene(directory: &Path, seed: u64) -> Result<String> {
    let draft = Draft::begin(directory, README)?;
    let (pedr, isd) = (draft.folder("pedr")?, draft.folder("isd")?);
    let middle = spherical_to_xyz_m(LONGITUDE_RAD, LATITUDE_RAD, 1.0);
    let relief = Relief::SelfAffine(Roughness::Rough);
    let terrain = Terrain::new(seed, &[middle], relief);
    let path = draft.root().join("model.tif");
    write_model(&path, &terrain, seed).in_file(&path)?;
    PASSES.write(&pedr, &terrain, seed)?;
    for (name, pitch_deg) in [("s1", 18.9), ("s2", -18.9)] {
        let path = isd.join(format!("{name}.json"));
        put(&path, &support_data(name, pitch_deg))?;
    }
    let truth = Truth {
        made_by: "areograph scene",
        synthetic: "not from mission data",
        seed,
        shift_cells: SHIFT_CELLS,
        shift_m: SHIFT_CELLS.map(|cells| cells * CELL_M),
        bias_m: BIAS_M,
        noise_m: NOISE_M,
        radius_m: RADIUS_M,
    };
    let truth = serde_json::to_string_pretty(&truth).unwrap_or_default() + "\n";
    put(&draft.root().join("truth.json"), &truth)?;
    draft.finish()?;
    let directory = directory.display();
    Ok(format!(
        "{directory}: a terrain model, {} passes over it; next: areograph pedr match {directory}/model.tif {directory}/pedr",
        PASSES.count()
    ))
}

/// The cells of the model, without heights.
fn empty_grid() -> HeightGrid {
    let north_rad = CELL_M / RADIUS_M;
    let east_rad = north_rad / LATITUDE_RAD.cos();
    let [rows, columns] = SIZE.map(f64::from);
    HeightGrid {
        size: SIZE.map(|of| of as usize),
        first_rad: [
            LONGITUDE_RAD - 0.5 * (columns - 1.0) * east_rad,
            LATITUDE_RAD + 0.5 * (rows - 1.0) * north_rad,
        ],
        cell_rad: [east_rad, north_rad],
        radius_m: RADIUS_M,
        heights_m: Vec::new(),
    }
}

fn write_model(path: &Path, terrain: &Terrain, seed: u64) -> Result<()> {
    let grid = empty_grid();
    let [rows, columns] = SIZE;
    let cells: Vec<[u32; 2]> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| [row, column]))
        .collect();
    #[allow(clippy::cast_possible_truncation, reason = "heights keep a millimetre")]
    let height_m = |[row, column]: &[u32; 2]| -> f32 {
        if row + column < CORNER {
            return NO_HEIGHT;
        }
        // The ground shown at this position of the model is displaced.
        let [longitude_rad, latitude_rad] = grid.place_rad([
            f64::from(*row) + SHIFT_CELLS[1],
            f64::from(*column) - SHIFT_CELLS[0],
        ]);
        let direction = spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0);
        let key = mix(mix(seed ^ u64::from(*row)) ^ u64::from(*column));
        let noise = normal_of(unit_of(mix(key)), unit_of(mix(key ^ 1)));
        (terrain.radius_m(&direction) - RADIUS_M + BIAS_M + NOISE_M * noise) as f32
    };
    let heights_m: Vec<f32> = cells.par_iter().map(height_m).collect();
    let file = File::create(path).map_err(IoError::on("create"))?;
    encode(file, &grid, &heights_m).map_err(|error| {
        Error::from(IoError {
            action: "write",
            source: std::io::Error::other(error),
        })
    })
}

/// Writes an equirectangular map in GDAL's encoding.
fn encode(file: File, grid: &HeightGrid, heights_m: &[f32]) -> tiff::TiffResult<()> {
    /// Model, area, sphere (both half-axes), equirectangular, metres, parallel, meridian.
    const KEYS: [u16; 40] = [
        1, 1, 0, 9, 1024, 0, 1, 1, 1025, 0, 1, 1, 2054, 0, 1, 9102, 2057, 34736, 1, 0, 2058, 34736,
        1, 0, 3075, 0, 1, 17, 3076, 0, 1, 9001, 3078, 34736, 1, 1, 3088, 34736, 1, 2,
    ];
    let [west_rad, _, _, north_rad] = grid.edges_rad();
    let corner_m = [
        west_rad * RADIUS_M * LATITUDE_RAD.cos(),
        north_rad * RADIUS_M,
    ];
    let compression = Compression::Deflate(DeflateLevel::Balanced);
    let mut encoder = TiffEncoder::new(BufWriter::new(file))?.with_compression(compression);
    let mut image = encoder.new_image::<Gray32Float>(SIZE[1], SIZE[0])?;
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[CELL_M, CELL_M, 0.0][..])?;
    let tie = [0.0, 0.0, 0.0, corner_m[0], corner_m[1], 0.0];
    tags.write_tag(Tag::ModelTiepointTag, &tie[..])?;
    tags.write_tag(Tag::GeoKeyDirectoryTag, &KEYS[..])?;
    let numbers = [RADIUS_M, LATITUDE_RAD / RADIANS_PER_DEGREE, 0.0];
    tags.write_tag(Tag::GeoDoubleParamsTag, &numbers[..])?;
    tags.write_tag(Tag::GdalNodata, NO_HEIGHT.to_string().as_str())?;
    image.write_data(heights_m)
}

/// Exact support data of an image.
fn support_data(name: &'static str, pitch_deg: f64) -> String {
    let line = StereoLine {
        name,
        pitch_deg,
        offset: Offset::default(),
        errors: [0.0; 3],
    };
    let orbit = pushbroom_pair::Orbit {
        name: "model".to_owned(),
        start_et_s: 596_764_800.0,
        longitude_deg: LONGITUDE_RAD / RADIANS_PER_DEGREE,
        latitude_deg: LATITUDE_RAD / RADIANS_PER_DEGREE,
        size: pushbroom_pair::LONG,
        is_steered: false,
        error: OrbitError {
            bias_m: [0.0; 3],
            drift_m_per_line: [0.0; 3],
        },
    };
    orbit.support_data(&line)
}
