//! The terrain model of a pair of images: heights, their standard deviations, and statistics.

use std::path::Path;

use super::document::Document;
use crate::{
    error::{Locate as _, Result},
    geom::height_grid::HeightGrid,
    pds::terrain_model::{HeightsAbove, read_terrain_model},
    products::{
        Content, Context, Declaration, GeoTiff, Role, SiteProducts, Write, error::ProductError,
        write_bytes, write_json,
    },
    schema::DocumentSchema,
    stages::map_surface::{Surface, SurfaceModel},
};

pub(super) static HEIGHTS: Declaration = Declaration {
    path: "surface.tif",
    what: "terrain model from a pair of images (cloud-optimised GeoTIFF): heights above the sphere of the body's maps, \
           metres, on an equirectangular map; -32768 in cells without a height",
    readers: "GIS, Ames Stereo Pipeline, `areograph pedr match`",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let what = "height above the sphere, metres";
            write_cells(path, of, what, |model| &model.heights.heights_m)
        },
    },
    uses: &[],
};

pub(super) static SIGMAS: Declaration = Declaration {
    path: "surface_sigma.tif",
    what: "standard deviations of the heights in surface.tif about their common offset, metres, in the same cells: \
           due to matching, jitter and relief inside the compared square; surface.json states the standard deviation \
           of the offset",
    readers: "GIS, Ames Stereo Pipeline",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let what = "standard deviation of the height about the common offset, metres";
            write_cells(path, of, what, |model| &model.sigmas_m)
        },
    },
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "surface.json",
    what: "derivation of the terrain model, statistics of its cells, and differences from {altimeter} by profile",
    readers: "scripts",
    rows: "profiles on the model",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("surface")),
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: |site| site.has::<Surface>(),
        write: |path, of| {
            let Some(surface) = of.site.find::<Surface>()? else {
                return Ok(0);
            };
            write_json(path, &Document::of(of, surface))?;
            Ok(surface.account.shots.profiles.len() as u64)
        },
    },
    uses: &[],
};

/// Sites with these products.
const WITH_A_MODEL: &str = "a site with a terrain model";

/// The terrain model of a site, where enough cells matched.
fn significant<'a>(site: &SiteProducts<'a>) -> Result<Option<&'a SurfaceModel>> {
    let surface = site.find::<Surface>()?;
    let significant = surface.filter(|surface| !surface.account.is_refused);
    Ok(significant.map(|surface| &surface.model))
}

/// Whether the site has one. The writer reports an output that cannot be read.
fn has_model(site: &SiteProducts) -> bool {
    !matches!(significant(site), Ok(None))
}

/// Writes the values of all cells of the model.
fn write_cells(
    path: &Path,
    of: &Context,
    what: &str,
    numbers: fn(&SurfaceModel) -> &[f32],
) -> Result<u64> {
    let Some(model) = significant(of.site)? else {
        return Ok(0);
    };
    let numbers = (what, numbers(model));
    write_map(path, of, &model.heights, numbers, model.parallel_rad)
}

/// Writes the values of all cells, and reads them back like any terrain model.
pub(in crate::capabilities) fn write_map(
    path: &Path,
    of: &Context,
    grid: &HeightGrid,
    (what, numbers): (&str, &[f32]),
    parallel_rad: f64,
) -> Result<u64> {
    let body = of.site.config.body;
    let file = GeoTiff {
        grid,
        parallel_rad,
        body,
        what,
        numbers,
    };
    write_bytes(path, &file.encoded())?;
    let again = read_terrain_model(path, body, HeightsAbove::default())?;
    let is_same = |(one, other): (&f32, &f32)| {
        one.to_bits() == other.to_bits() || (one.is_nan() && other.is_nan())
    };
    let rounding_rad = 1e-9 * grid.cell_rad[1];
    let moved = [0, 1].map(|axis| again.first_rad[axis] - grid.first_rad[axis]);
    let is_there = moved.iter().all(|moved_rad| {
        let turns = (moved_rad / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        // A cell keeps a millionth of its edge beside a radian.
        (moved_rad - turns).abs() <= rounding_rad.max(1e-14)
    });
    let all = again.heights_m.iter().zip(numbers);
    if again.size == grid.size && is_there && all.clone().all(is_same) {
        return Ok(all.filter(|(_, number)| !number.is_nan()).count() as u64);
    }
    let what = format!("{what} of {} cells", numbers.len());
    Err(ProductError::ReadBack { what }).in_file(path)
}
