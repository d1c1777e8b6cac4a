//! The terrain model of a site: heights, their standard deviations, and statistics.

use std::path::Path;

use super::document::Document;
use crate::{
    error::{Locate as _, Result},
    geom::height_grid::HeightGrid,
    pds::terrain_model::{HeightsAbove, read_terrain_model},
    products::{
        Content, Context, Declaration, GeoTiff, Role, SiteProducts, Write, error::ProductError,
        write_bytes, write_json, write_raster,
    },
    schema::DocumentSchema,
    stages::map_surface::{Surface, SurfaceModel},
};

/// A terrain model above the sphere of the maps, which programs for digital terrain expect.
pub(super) static ABOVE_SPHERE: Declaration = Declaration {
    path: "surface_above_sphere.tif",
    what: "terrain model (cloud-optimised GeoTIFF): heights above the sphere of the body's maps, metres, on an equirectangular \
           map; -32768 in cells without a height",
    readers: "GIS, Ames Stereo Pipeline, `areograph pedr match`",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let band = Band {
                what: "height above the map sphere",
                unit: "m",
            };
            write_cells(path, of, band, |model| &model.heights.heights_m)
        },
    },
    uses: &[],
};

pub(super) static ABOVE_AREOID: Declaration = Declaration {
    path: "surface_above_areoid.tif",
    what: "the same terrain model (cloud-optimised GeoTIFF): heights above the areoid, metres, in the same cells; the \
           areoid is that of the shots, and surface.json states its departure from them; the vertical system is part of the file",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with a terrain model and shots with areoid radii",
        has: |site| matches!(reference_file(site), Some(("areoid", _))),
        write: |path, of| write_above(path, of, "areoid"),
    },
    uses: &[],
};

pub(super) static ABOVE_ELLIPSOID: Declaration = Declaration {
    path: "surface_above_ellipsoid.tif",
    what: "the same terrain model (cloud-optimised GeoTIFF): heights above the ellipsoid of the body, metres, in the same \
           cells; the vertical system is part of the file",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site on Mars with a terrain model and shots without areoid radii",
        has: |site| matches!(reference_file(site), Some(("ellipsoid", _))),
        write: |path, of| write_above(path, of, "ellipsoid"),
    },
    uses: &[],
};

pub(super) static SIGMAS: Declaration = Declaration {
    path: "surface_sigma.tif",
    what: "standard deviations of the heights of the terrain model about their common offset, metres, in the same cells: due to \
           matching, jitter and relief inside the compared square; surface.json states the standard deviation of the offset",
    readers: "GIS, Ames Stereo Pipeline",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let band = Band {
                what: "standard deviation of the height about the common offset",
                unit: "m",
            };
            write_cells(path, of, band, |model| &model.sigmas_m)
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
pub(super) const WITH_A_MODEL: &str = "a site with a terrain model";

/// The terrain model of a site with its statistics, where enough cells matched.
pub(in crate::capabilities) fn significant_surface<'a>(
    site: &SiteProducts<'a>,
) -> Result<Option<&'a Surface>> {
    let surface = site.find::<Surface>()?;
    Ok(surface.filter(|surface| !surface.account.is_refused))
}

/// The terrain model of a site, where enough cells matched.
pub(super) fn significant<'a>(site: &SiteProducts<'a>) -> Result<Option<&'a SurfaceModel>> {
    Ok(significant_surface(site)?.map(|surface| &surface.model))
}

/// Whether the site has one. The writer reports an output that cannot be read.
pub(super) fn has_model(site: &SiteProducts) -> bool {
    !matches!(significant(site), Ok(None))
}

/// The surface other than the sphere above which the heights of a site are known, and their file.
pub(super) fn reference_file(site: &SiteProducts) -> Option<(&'static str, &'static Declaration)> {
    let surface = site.find::<Surface>();
    // The writer reports an output that cannot be read.
    let is_known = !matches!(surface, Ok(Some(surface)) if surface.account.reference.is_none());
    let terms = site.config.terms();
    let of = if terms.has_areoid {
        &ABOVE_AREOID
    } else {
        &ABOVE_ELLIPSOID
    };
    let ellipsoid = terms.body.model();
    let is_apart = terms.has_areoid || ellipsoid.equatorial_radius_m > ellipsoid.polar_radius_m;
    (is_known && is_apart && has_model(site)).then_some((terms.areoid(), of))
}

/// Name and unit of the numbers of a file.
pub(in crate::capabilities) struct Band<'a> {
    pub(in crate::capabilities) what: &'a str,
    pub(in crate::capabilities) unit: &'a str,
}

/// Writes the values of all cells of the model.
fn write_cells(
    path: &Path,
    of: &Context,
    band: Band<'_>,
    numbers: fn(&SurfaceModel) -> &[f32],
) -> Result<u64> {
    let Some(model) = significant(of.site)? else {
        return Ok(0);
    };
    let numbers = numbers(model);
    write_map(
        path,
        of,
        &model.heights,
        (band, numbers),
        model.parallel_rad,
    )
}

/// Writes the heights of all cells above `surface`.
fn write_above(path: &Path, of: &Context, surface: &str) -> Result<u64> {
    let model = significant(of.site)?;
    model.map_or(Ok(0), |model| above(path, of, surface, model))
}

/// Writes the heights of all cells of a model of the site above `surface`.
pub(super) fn above(path: &Path, of: &Context, surface: &str, model: &SurfaceModel) -> Result<u64> {
    let known = of.site.find::<Surface>()?;
    let Some(reference) = known.and_then(|known| known.account.reference.as_ref()) else {
        return Ok(0);
    };
    let numbers = reference.heights_m(&model.heights);
    let file = GeoTiff {
        grid: &model.heights,
        parallel_rad: model.parallel_rad,
        body: of.site.config.body,
        conformal: None,
        what: &format!("height above the {surface}"),
        unit: "m",
        vertical: surface,
        numbers: &numbers,
    };
    write_raster(path, &file)
}

/// Writes the values of all cells, and reads them back like any terrain model.
pub(in crate::capabilities) fn write_map(
    path: &Path,
    of: &Context,
    grid: &HeightGrid,
    (Band { what, unit }, numbers): (Band<'_>, &[f32]),
    parallel_rad: f64,
) -> Result<u64> {
    let body = of.site.config.body;
    let file = GeoTiff {
        grid,
        parallel_rad,
        body,
        conformal: None,
        what,
        unit,
        vertical: "",
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
