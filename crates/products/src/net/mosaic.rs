//! The mosaic of the pictures of a net: brightness, sources, and statistics.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use super::{NetProducts, WriteNet};
use crate::{
    files::write_json,
    geotiff::{GeoTiff, Number, write_raster},
    product::{Content, Declaration, Role},
    raster_label::Label,
};
use areograph_base::{body::Body, error::Result, schema::DocumentSchema};
use areograph_stages::{compare_orthoimages::OrthoimageOffsets, map_pictures::PicturesOnMap};

pub(super) static MOSAIC: Declaration<WriteNet> = Declaration {
    path: "mosaic.tif",
    what: "mosaic of the pictures with images on the map of the net (cloud-optimised GeoTIFF): brightness 1 to 255, or 0 in cells that no \
           picture shows; seams where overlapping pictures differ least",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: |path, of| {
        let Some(made) = of.mosaic else { return Ok(0) };
        let cells = made.mosaic.brightness.bytes();
        write_cells(path, of, made, ("brightness of a mosaic", &*cells))
    },
    uses: &[],
};

pub(super) static SOURCES: Declaration<WriteNet> = Declaration {
    path: "mosaic_source.tif",
    what: "number of the picture that each cell of mosaic.tif is taken from, as listed in mosaic.json; 0 in empty cells",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: |path, of| {
        let Some(made) = of.mosaic else { return Ok(0) };
        let labels = made.mosaic.sources.bytes().into_iter().map(Label);
        let labels: Vec<Label> = labels.collect();
        let what = "number of the picture of a cell, as listed in mosaic.json";
        write_cells(path, of, made, (what, &*labels))
    },
    uses: &[],
};

pub(super) static DOCUMENT: Declaration<WriteNet> = Declaration {
    path: "mosaic.json",
    what: "pictures of the mosaic with their numbers in mosaic_source.tif and their tones, and offsets between pictures after the adjustment, \
           in their overlaps and along the seams",
    readers: "scripts",
    rows: "pictures",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("net_mosaic")),
    write: |path, of| {
        let Some(made) = of.mosaic else { return Ok(0) };
        write_json(path, &Document::of(of, made))?;
        Ok(made.pictures.len() as u64)
    },
    uses: &[],
};

fn write_cells<N: Number + Send + Sync>(
    path: &Path,
    of: &NetProducts,
    made: &PicturesOnMap,
    (what, numbers): (&str, &[N]),
) -> Result<u64> {
    let file = GeoTiff {
        grid: &made.mosaic.account.map,
        parallel_rad: 0.0,
        body: Body::Mars,
        conformal: Some(&of.config.map.map),
        what,
        unit: "",
        vertical: "",
        numbers,
    };
    write_raster(path, &file)
}

/// `mosaic.json` of a net.
#[derive(Serialize, JsonSchema)]
#[schemars(
    deny_unknown_fields,
    title = "mosaic.json of a net",
    description = "mosaic.json of a net of areograph: pictures of a mosaic, and offsets between them after the adjustment. Metres on the map and grey values; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph net mosaic 1"))]
    format: &'static str,
    net: &'a str,
    /// Edge of a cell.
    #[schemars(extend("exclusiveMinimum" = 0))]
    cell_m: f64,
    rows: usize,
    columns: usize,
    #[schemars(length(min = 1))]
    pictures: Vec<Part<'a>>,
    /// Offsets of every two pictures with common squares.
    pairs: Vec<Pair<'a>>,
    /// Seams between two pictures; without those that no matching square crosses.
    seams: Vec<Seam<'a>>,
}

/// A picture of a mosaic.
#[derive(Serialize, JsonSchema)]
struct Part<'a> {
    /// Number in `mosaic_source.tif`.
    #[schemars(range(min = 1))]
    number: usize,
    /// Name of the picture.
    picture: &'a str,
    /// Edge of a pixel.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pixel_m: f64,
    /// Gain of its brightness.
    #[schemars(extend("exclusiveMinimum" = 0))]
    gain: f64,
    /// Offset of its brightness, grey values.
    offset: f64,
    /// Number of cells taken from it.
    cells: u32,
    /// Standard deviation of a coordinate of its middle; omitted if it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    sigma_m: Option<f64>,
}

/// Two overlapping pictures.
#[derive(Serialize, JsonSchema)]
struct Pair<'a> {
    /// Names of the pictures.
    pictures: [&'a str; 2],
    /// Number of compared squares, and of those that match.
    squares: u32,
    places: u32,
    /// Root mean square offset, both axes together; omitted if no square matches.
    #[serde(skip_serializing_if = "Option::is_none")]
    rms_m: Option<f64>,
    /// Median, east and north.
    median_m: [f64; 2],
    /// Robust standard deviation (1.4826 times the median absolute deviation), east and north.
    #[schemars(inner(range(min = 0.0)))]
    sigma_m: [f64; 2],
}

/// A seam between two pictures.
#[derive(Serialize, JsonSchema)]
struct Seam<'a> {
    /// Names of the pictures.
    pictures: [&'a str; 2],
    /// Number of matching squares that it crosses.
    places: usize,
    /// Root mean square offset in them, both axes together.
    #[schemars(range(min = 0.0))]
    rms_m: f64,
}

impl<'a> Document<'a> {
    fn of(net: &NetProducts<'a>, made: &'a PicturesOnMap) -> Self {
        let account = &made.mosaic.account;
        let name = |picture: usize| &*made.pictures[picture].picture;
        let sigma_m = |name: &str| {
            let found = net.result.pictures.iter().find(|of| of.picture == name);
            found.and_then(|of| of.sigma_m)
        };
        let parts = account.images.iter().enumerate().map(|(index, of)| Part {
            number: index + 1,
            picture: name(of.image),
            pixel_m: made.pictures[of.image].pixel_m,
            gain: of.tone[0],
            offset: of.tone[1],
            cells: of.cells,
            sigma_m: sigma_m(name(of.image)),
        });
        let pair = |of: &'a OrthoimageOffsets| {
            let summaries_m = of.summaries_m();
            Pair {
                pictures: of.images.map(name),
                squares: of.squares,
                places: u32::try_from(of.places.len()).unwrap_or(u32::MAX),
                rms_m: of.rms_m(),
                median_m: summaries_m.map(|of| of.median),
                sigma_m: summaries_m.map(|of| of.nmad),
            }
        };
        let seams = made.seams().map(|(images, places, rms_m)| Seam {
            pictures: images.map(name),
            places,
            rms_m,
        });
        let [rows, columns] = account.map.size;
        Self {
            format: "areograph net mosaic 1",
            net: &net.config.net,
            cell_m: account.cell_m,
            rows,
            columns,
            pictures: parts.collect(),
            pairs: made.offsets.iter().map(pair).collect(),
            seams: seams.collect(),
        }
    }
}
