//! A QGIS project of a site: footprints by height, residuals of tie points, outlines of images, orthoimages and terrain
//! model on one map, ready to open.
//!
//! The project refers to products by relative paths, so that the folder of a site may be moved as a whole. It is a zip
//! archive with one document (QGIS 3, `QgsProject`); `project.rs` writes the document, `map.rs` has its projection, and
//! `vectors.rs` the layers that no other product contains.

mod map;
mod project;
mod vectors;

use std::{
    io::{Cursor, Read as _, Write as _},
    path::{Component, Path},
};

use areograph_base::{
    column::Tiles,
    error::{Locate as _, Result},
};
use areograph_stages::{map_surface::Surface, mosaic_images::Mosaic, rectify_images::Orthoimage};
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter, write::SimpleFileOptions};

pub use self::vectors::{on_ground_m, tie_residuals};
use self::{
    map::{Map, equirectangular_wkt},
    project::{Form, Layer},
};
use crate::{
    error::ProductError,
    exchange::{contours, geopackage::GEOPACKAGE},
    files::{read_bytes, write_bytes},
    gis::crs_wkt,
    product::{Content, Context, Declaration, Program, Role, Use, Write},
    registered_footprints,
    site::SiteProducts,
};

/// Name of the document inside the project.
const DOCUMENT: &str = "site.qgs";
/// The terrain model among the products, and above the surface to which the heights of the report refer.
const TERRAIN: &str = "surface_above_sphere.tif";
const TERRAIN_ABOVE: [&str; 2] = ["surface_above_areoid.tif", "surface_above_ellipsoid.tif"];
const CONTOURS: &str = "exchange/surface_contours.gpkg";
/// Shares of the pixels of an orthoimage that are black and white on the map.
const STRETCH: [f64; 2] = [0.02, 0.98];

pub(crate) static PROJECT: Declaration = Declaration {
    path: "exchange/site.qgz",
    what: "QGIS project with the layers of the site",
    readers: "QGIS",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with an image whose edges show the ground",
        has: has_outlines,
        write: |path, of| write(path, of).map(|()| 0),
    },
    uses: &[Use {
        program: Program::Gis,
        lines: "qgis site.qgz                                    QGIS project with these layers on one map",
    }],
};

pub(crate) static OUTLINES: Declaration = Declaration {
    path: "exchange/image_outlines.geojson",
    what: "outlines of the images on the ellipsoid with their initial orientation, as GeoJSON",
    readers: "GIS",
    rows: "images with an outline",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with an image whose edges show the ground",
        has: has_outlines,
        write: |path, of| {
            let outlines = vectors::outlines(of.site);
            vectors::write(path, of.site, "image_outlines", outlines)
        },
    },
    uses: &[],
};

pub(crate) static RESIDUALS: Declaration = Declaration {
    path: "exchange/tie_residuals.geojson",
    what: "measurements of adjusted tie points at their ground points, with residuals in the image and on the ground, as GeoJSON",
    readers: "GIS",
    rows: "measurements",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with adjusted tie points in images with an outline",
        has: |site| has_outlines(site) && vectors::has_residuals(site),
        write: |path, of| {
            let map = Map::of(of.site);
            let residuals = vectors::residuals(of.site, &map);
            vectors::write(path, of.site, "tie_residuals", residuals)
        },
    },
    uses: &[],
};

fn has_outlines(site: &SiteProducts) -> bool {
    let mut images = site.images.iter();
    images.any(|image| image.orientation.outline.is_some())
}

/// Writes the project and reads it back.
fn write(path: &Path, of: &Context) -> Result<()> {
    let document = project::document(&of.site.config.site, &Map::of(of.site), &layers(of)?);
    let bytes = archive(&document)
        .map_err(ProductError::refused("write QGIS project"))
        .in_file(path)?;
    write_bytes(path, &bytes)?;
    let read = document_of(&read_bytes(path)?)
        .map_err(ProductError::unreadable)
        .in_file(path)?;
    if read != document {
        let what = format!("{} characters of the project", document.len());
        return Err(ProductError::ReadBack { what }).in_file(path);
    }
    Ok(())
}

/// The archive; its date is the first that the format knows, since a clock would give different bytes each time.
fn archive(document: &str) -> zip::result::ZipResult<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    archive.start_file(DOCUMENT, options)?;
    archive.write_all(document.as_bytes())?;
    Ok(archive.finish()?.into_inner())
}

fn document_of(bytes: &[u8]) -> zip::result::ZipResult<String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes))?;
    let mut document = String::new();
    archive.by_name(DOCUMENT)?.read_to_string(&mut document)?;
    Ok(document)
}

/// The layers of the products that were written, from the top of the map to its bottom.
fn layers(of: &Context) -> Result<Vec<Layer>> {
    let site = of.site;
    let mut layers = vector_layers(of);
    let mosaics = mosaics(of)?;
    // Orthoimages are below the mosaic that is made of them.
    let is_alone = mosaics.is_empty();
    layers.extend(mosaics);
    for orthoimage in Orthoimage::best(site.book)? {
        let id = &site.images[orthoimage.account.image].times.id;
        let path = format!("images/{id}/orthoimage.tif");
        if !is_written(of, &path) {
            continue;
        }
        layers.push(Layer {
            name: format!("Orthoimage {id}"),
            source: source(&path),
            wkt: equirectangular_wkt(site.config.body, orthoimage.account.parallel_rad),
            is_shown: is_alone,
            form: Form::Brightness {
                range: stretch(&orthoimage.brightness),
            },
        });
    }
    layers.extend(terrain(of)?);
    Ok(layers)
}

/// Points, arrows and lines, from the top of the map.
fn vector_layers(of: &Context) -> Vec<Layer> {
    let site = of.site;
    let terms = site.config.terms();
    let geographic = || crs_wkt(site.config.body);
    let mut layers = Vec::new();
    if is_written(of, RESIDUALS.path) {
        let magnification = vectors::magnification(site);
        layers.push(Layer {
            name: format!("Residuals of tie points, × {magnification}"),
            source: source(RESIDUALS.path),
            wkt: geographic(),
            is_shown: true,
            form: Form::Arrows { magnification },
        });
    }
    if is_written(of, registered_footprints::GEOPACKAGE.path) {
        let table = registered_footprints::LAYER;
        layers.push(Layer {
            name: format!("{} footprints inside images, height in m", terms.altimeter),
            source: format!(
                "{}|layername={table}",
                source(registered_footprints::GEOPACKAGE.path)
            ),
            wkt: geographic(),
            is_shown: true,
            form: Form::Heights {
                column: "height_m",
                range: range(registered_footprints::heights_m(site)),
            },
        });
    }
    if is_written(of, GEOPACKAGE.path) {
        layers.push(Layer {
            name: format!("{} footprints, all", terms.altimeter),
            source: format!("{}|layername=footprints", source(GEOPACKAGE.path)),
            wkt: geographic(),
            is_shown: false,
            form: Form::Points,
        });
    }
    layers.push(Layer {
        name: "Outlines of images".to_owned(),
        source: source(OUTLINES.path),
        wkt: geographic(),
        is_shown: true,
        form: Form::Outlines { label: "image" },
    });
    if is_written(of, CONTOURS) {
        layers.push(Layer {
            name: "Contours of the terrain model".to_owned(),
            source: format!("{}|layername={}", source(CONTOURS), contours::LAYER),
            wkt: geographic(),
            is_shown: false,
            form: Form::Contours { label: "height_m" },
        });
    }
    layers
}

/// The terrain model in colours, and shaded below it; empty without one.
fn terrain(of: &Context) -> Result<Vec<Layer>> {
    let site = of.site;
    let Some(terrain) = site.find::<Surface>()?.filter(|_| is_written(of, TERRAIN)) else {
        return Ok(Vec::new());
    };
    let grid = &terrain.model.heights;
    let other = TERRAIN_ABOVE.into_iter().find(|path| is_written(of, path));
    let other = other.zip(terrain.account.reference.as_ref());
    let (path, surface, heights_m) = match other {
        Some((path, reference)) => {
            let areoid = site.config.terms().areoid();
            (path, areoid, reference.heights_m(grid))
        }
        None => (TERRAIN, "map sphere", grid.heights_m.clone()),
    };
    let known = heights_m.iter().filter(|height| height.is_finite());
    let range = range(known.map(|height| f64::from(*height)));
    let wkt = equirectangular_wkt(site.config.body, terrain.model.parallel_rad);
    let layer = |name: String, form: Form| Layer {
        name,
        source: source(path),
        wkt: wkt.clone(),
        is_shown: true,
        form,
    };
    Ok(vec![
        layer(
            format!("Terrain model, height above the {surface} in m"),
            Form::Terrain { range },
        ),
        layer("Terrain model, shaded".to_owned(), Form::Shaded),
    ])
}

/// The images of the mosaic, the mosaic, and the one before the adjustment.
fn mosaics(of: &Context) -> Result<Vec<Layer>> {
    let site = of.site;
    let mut layers = Vec::new();
    let mosaics = [
        (site.book.find_best::<Option<Mosaic>>()?, ""),
        (site.book.find_before::<Option<Mosaic>>()?, "_before"),
    ];
    for (mosaic, suffix) in mosaics {
        let [brightness, sources] = ["", "_source"].map(|of| format!("mosaic{suffix}{of}.tif"));
        let is_best = suffix.is_empty();
        let mosaic = mosaic.and_then(Option::as_ref);
        let Some(mosaic) = mosaic.filter(|_| is_written(of, &brightness)) else {
            continue;
        };
        let wkt = equirectangular_wkt(site.config.body, mosaic.account.parallel_rad);
        if is_best && is_written(of, &sources) {
            let parts = mosaic.account.images.iter();
            layers.push(Layer {
                name: "Images of the mosaic".to_owned(),
                source: source(&sources),
                wkt: wkt.clone(),
                is_shown: false,
                form: Form::Sources {
                    images: parts
                        .map(|part| site.images[part.image].times.id.clone())
                        .collect(),
                },
            });
        }
        let name = if is_best {
            "Mosaic"
        } else {
            "Mosaic before the adjustment"
        };
        layers.push(Layer {
            name: name.to_owned(),
            source: source(&brightness),
            wkt,
            is_shown: is_best,
            form: Form::Brightness {
                range: stretch(&mosaic.brightness),
            },
        });
    }
    Ok(layers)
}

fn is_written(of: &Context, path: &str) -> bool {
    of.written.iter().any(|(product, declaration)| {
        let is_filled = product.rows > 0 || declaration.rows.is_empty();
        is_filled && product.path == Path::new(path)
    })
}

/// Path of a product from the folder of the project.
fn source(product: &str) -> String {
    let folder = Path::new(PROJECT.path).parent().unwrap_or(Path::new(""));
    let product = Path::new(product);
    if let Ok(inside) = product.strip_prefix(folder) {
        return format!("./{}", inside.display());
    }
    let up = folder
        .components()
        .filter(|part| matches!(part, Component::Normal(_)));
    let up: String = up.map(|_| "../").collect();
    up + &product.display().to_string()
}

/// Least and greatest; 0 and 1 without a value.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let ends = values.fold(None, |ends: Option<[f64; 2]>, value| {
        Some(ends.map_or([value; 2], |[least, most]| {
            [least.min(value), most.max(value)]
        }))
    });
    ends.unwrap_or([0.0, 1.0])
}

/// Brightness that is black, and that is white, on the map: empty cells, of brightness 0, do not count.
#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells are counted"
)]
fn stretch(brightness: &Tiles) -> [u8; 2] {
    let counts = brightness.counts();
    let filled: u64 = counts[1..].iter().sum();
    STRETCH.map(|share| {
        let wanted = (share * filled as f64) as u64;
        let mut below = 0;
        let found = (1..=u8::MAX).find(|value| {
            below += counts[usize::from(*value)];
            below > wanted
        });
        found.unwrap_or(u8::MAX)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_lead_from_the_project_to_the_products() {
        assert_eq!(source("exchange/a.gpkg"), "./a.gpkg");
        assert_eq!(
            source("images/E02-00665/orthoimage.tif"),
            "../images/E02-00665/orthoimage.tif"
        );
    }

    #[test]
    fn empty_cells_do_not_change_the_stretch() {
        let mut brightness = vec![0; 10_000];
        brightness.extend(100..=199);
        assert_eq!(stretch(&Tiles::of([101, 100], &brightness)), [102, 198]);
        assert_eq!(stretch(&Tiles::of([1, 2], &[0, 0])), [255, 255]);
    }

    #[test]
    fn the_archive_contains_the_document_and_no_clock() {
        let bytes = archive("<qgis/>").unwrap();
        assert_eq!(document_of(&bytes).unwrap(), "<qgis/>");
        assert_eq!(archive("<qgis/>").unwrap(), bytes);
    }
}
