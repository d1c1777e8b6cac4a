//! The terrain model of a pair of images: heights, their standard deviations, and statistics.

mod document;

use std::path::Path;

use super::{
    error::ProductError,
    files::{write_bytes, write_json},
    geotiff::GeoTiff,
    product::{Content, Context, Declaration, Role, Write},
};
use areograph_base::{
    error::{Locate as _, Result},
    schema::DocumentSchema,
};
use areograph_pds::terrain_model::{HeightsAbove, read_terrain_model};
use areograph_stages::map_surface::Surface;

use document::Document;

pub(super) static HEIGHTS: Declaration = Declaration {
    path: "surface.tif",
    what: "terrain model of a pair of images: heights above the sphere of the body's maps, metres, on an equirectangular map; \
           -32768 in cells without a height; a cloud-optimised GeoTIFF",
    readers: "GIS, Ames Stereo Pipeline, `areograph pedr match`",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Model(|path, of, surface| {
        let what = "height above the sphere, metres";
        write(path, of, surface, (what, &surface.model.heights.heights_m))
    }),
    uses: &[],
};

pub(super) static SIGMAS: Declaration = Declaration {
    path: "surface_sigma.tif",
    what: "standard deviations of these heights about the offset common to all, metres, in the same cells: from the \
           match, jitter and relief inside the compared square; surface.json has the standard deviation of the offset",
    readers: "GIS, Ames Stereo Pipeline",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Model(|path, of, surface| {
        let what = "standard deviation of the height about the common offset, metres";
        write(path, of, surface, (what, &surface.model.sigmas_m))
    }),
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "surface.json",
    what: "how the terrain model was made, statistics of its cells, and its differences from MOLA, profile by profile",
    readers: "scripts",
    rows: "profiles on it",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("surface")),
    write: Write::Surface(|path, of, surface| {
        write_json(path, &Document::of(of, surface))?;
        Ok(surface.account.shots.profiles.len() as u64)
    }),
    uses: &[],
};

/// Writes numbers of all cells, and reads them back as every terrain model is read.
fn write(
    path: &Path,
    of: &Context,
    surface: &Surface,
    (what, numbers): (&str, &[f32]),
) -> Result<u64> {
    let model = &surface.model;
    let body = of.site.config.body;
    let file = GeoTiff {
        grid: &model.heights,
        parallel_rad: model.parallel_rad,
        body,
        what,
        numbers,
    };
    write_bytes(path, &file.encoded())?;
    let again = read_terrain_model(path, body, HeightsAbove::default())?;
    let is_same = |(one, other): (&f32, &f32)| {
        one.to_bits() == other.to_bits() || (one.is_nan() && other.is_nan())
    };
    let rounding_rad = 1e-9 * model.heights.cell_rad[1];
    let moved = [0, 1].map(|axis| again.first_rad[axis] - model.heights.first_rad[axis]);
    let is_there = moved.iter().all(|moved_rad| {
        let turns = (moved_rad / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        // A cell keeps a millionth of its edge beside a radian.
        (moved_rad - turns).abs() <= rounding_rad.max(1e-14)
    });
    let all = again.heights_m.iter().zip(numbers);
    if again.size == model.heights.size && is_there && all.clone().all(is_same) {
        return Ok(all.filter(|(_, number)| !number.is_nan()).count() as u64);
    }
    let what = format!("{what} of {} cells", numbers.len());
    Err(ProductError::ReadBack { what }).in_file(path)
}
