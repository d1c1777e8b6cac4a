//! Orthoimages: brightness and positional uncertainty on the map of the terrain model, and their statistics.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    capabilities::terrain::{Band, write_map, write_raster},
    error::Result,
    products::{Content, Context, Declaration, GeoTiff, Role, SiteProducts, Write, write_json},
    schema::DocumentSchema,
    stages::{map_surface::Surface, rectify_images::Orthoimage},
};

/// Images and sites with these products.
const IMAGES: &str = "every image with an orthoimage";
const SITES: &str = "a site with orthoimages";

pub(super) static ORTHOIMAGE: Declaration = Declaration {
    path: "images/<image>/orthoimage.tif",
    what: "orthoimage on the equirectangular map of surface_above_sphere.tif (cloud-optimised GeoTIFF): brightness 1 to 255 (pixel value 0 is \
           stored as 1), or 0 in cells that have no height, are hidden by relief or lack pixels",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::ImageWhere {
        images: IMAGES,
        has: has_orthoimage,
        write: |path, of, image| {
            let made = orthoimage(of.site, image)?;
            made.map_or(Ok(0), |image| write_brightness(path, of, image))
        },
    },
    uses: &[],
};

pub(super) static SIGMAS: Declaration = Declaration {
    path: "images/<image>/orthoimage_sigma.tif",
    what: "standard deviation of horizontal positions in the orthoimage (both axes together, without the shared error), metres, \
           on the cells of surface_above_sphere.tif: due to height errors, jitter and drift; orthoimages.json states the shared error",
    readers: "GIS",
    rows: "cells that the image shows",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::ImageWhere {
        images: IMAGES,
        has: has_orthoimage,
        write: |path, of, image| {
            let band = Band {
                what: "standard deviation of the horizontal position",
                unit: "m",
            };
            let terrain = of.site.find::<Surface>()?;
            let made = orthoimage(of.site, image)?.zip(terrain);
            made.map_or(Ok(0), |(image, Surface { model, .. })| {
                let numbers = (band, &*image.sigmas_m);
                write_map(path, of, &model.heights, numbers, model.parallel_rad)
            })
        },
    },
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "orthoimages.json",
    what: "cells of every orthoimage, and the uncertainty of positions in each",
    readers: "scripts",
    rows: "orthoimages",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("orthoimages")),
    write: Write::Where {
        sites: SITES,
        has: has_orthoimages,
        write: |path, of| {
            let orthoimages = orthoimages(of.site)?;
            write_json(path, &Document::of(of.site, orthoimages))?;
            Ok(orthoimages.len() as u64)
        },
    },
    uses: &[],
};

/// The orthoimages of a site; empty if it requests none.
pub(super) fn orthoimages<'a>(site: &SiteProducts<'a>) -> Result<&'a [Orthoimage]> {
    let found = site.find::<Vec<Orthoimage>>()?;
    Ok(found.map_or(&[], Vec::as_slice))
}

fn orthoimage<'a>(site: &SiteProducts<'a>, image: usize) -> Result<Option<&'a Orthoimage>> {
    let mut all = orthoimages(site)?.iter();
    Ok(all.find(|of| of.account.image == image))
}

/// Whether a site has orthoimages. The writer reports an output that cannot be read, here and below.
pub(super) fn has_orthoimages(site: &SiteProducts) -> bool {
    !matches!(orthoimages(site), Ok([]))
}

fn has_orthoimage(site: &SiteProducts, image: usize) -> bool {
    !matches!(orthoimage(site, image), Ok(None))
}

/// Writes the brightness of all cells, and reads it back.
fn write_brightness(path: &Path, of: &Context, image: &Orthoimage) -> Result<u64> {
    let file = GeoTiff {
        grid: &image.account.map,
        parallel_rad: image.account.parallel_rad,
        body: of.site.config.body,
        what: "brightness of an image",
        unit: "",
        vertical: "",
        numbers: &image.brightness,
    };
    write_raster(path, &file)
}

/// `orthoimages.json`.
#[derive(Serialize, JsonSchema)]
#[schemars(
    deny_unknown_fields,
    title = "orthoimages.json",
    description = "orthoimages.json of areograph: cells of every orthoimage of a site, and the uncertainty of positions in each. Metres; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph orthoimages 1"))]
    format: &'static str,
    site: &'a str,
    #[schemars(length(min = 1))]
    orthoimages: Vec<Entry<'a>>,
}

/// An orthoimage.
#[derive(Serialize, JsonSchema)]
struct Entry<'a> {
    /// Identifier of the image.
    image: &'a str,
    /// Edge of a cell.
    #[schemars(extend("exclusiveMinimum" = 0))]
    cell_m: f64,
    /// Edge of an image pixel on the ground.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pixel_m: f64,
    rows: usize,
    columns: usize,
    /// Number of cells with a brightness.
    filled: u32,
    /// Number of terrain cells with missing pixels.
    without_pixels: u32,
    /// Number of terrain cells inside the image, including interpolated holes.
    terrain_cells: u32,
    /// Number of terrain cells inside the image that relief hides from the camera.
    hidden: u32,
    /// Number of terrain cells shown with an interpolated height.
    interpolated: u32,
    /// Root mean square standard deviation of horizontal positions, both axes together, without the shared error.
    #[schemars(range(min = 0.0))]
    sigma_m: f64,
    /// Standard deviation due to jitter, both axes together, from the scatter of tie points; omitted if
    /// no scatter was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    jitter_m: Option<f64>,
    /// Standard deviation due to drift (orientation errors that change along the image), both axes together; omitted without
    /// an adjustment.
    #[serde(skip_serializing_if = "Option::is_none")]
    drift_m: Option<f64>,
    /// Standard deviations of the shared error, east and north; omitted without an adjustment with heights.
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_sigma_m: Option<[f64; 2]>,
}

impl<'a> Document<'a> {
    fn of(site: &SiteProducts<'a>, orthoimages: &'a [Orthoimage]) -> Self {
        let orthoimages = orthoimages.iter().map(|of| {
            let of = &of.account;
            let [rows, columns] = of.map.size;
            Entry {
                image: &site.images[of.image].times.id,
                cell_m: of.cell_m,
                pixel_m: of.pixel_m,
                rows,
                columns,
                filled: of.filled,
                without_pixels: of.without_pixels,
                terrain_cells: of.terrain_cells,
                hidden: of.hidden,
                interpolated: of.interpolated,
                sigma_m: of.sigma_m,
                jitter_m: of.jitter_m,
                drift_m: of.drift_m,
                shared_sigma_m: of.shared_sigma_m,
            }
        });
        Self {
            format: "areograph orthoimages 1",
            site: &site.config.site,
            orthoimages: orthoimages.collect(),
        }
    }
}
