//! Orthoimages: brightness and positional uncertainty on the map of the terrain model, and their statistics.

use std::{collections::BTreeSet, path::Path};

use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    capabilities::terrain::{Band, write_map},
    error::Result,
    geom::height_grid::HeightGrid,
    products::{
        Content, Context, Declaration, GeoTiff, Number, Role, SiteProducts, Write, write_json,
        write_raster,
    },
    schema::DocumentSchema,
    stage::Round,
    stages::{
        compare_orthoimages::OrthoimageOffsets,
        rectify_images::{GroundModel, Orthoimage},
    },
};

/// Images and sites with these products.
const IMAGES: &str = "every image with an orthoimage";
const SITES: &str = "a site with orthoimages";

pub(super) static ORTHOIMAGE: Declaration = Declaration {
    path: "images/<image>/orthoimage.tif",
    what: "orthoimage on an equirectangular map, that of surface_above_sphere.tif where there is one (cloud-optimised GeoTIFF): brightness 1 to 255 (pixel value 0 is \
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

pub(super) static BEFORE: Declaration = Declaration {
    path: "images/<image>/orthoimage_before.tif",
    what: "as orthoimage.tif, with the orientation before the adjustment, for comparison; its positions have the errors of the \
           kernels",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::ImageWhere {
        images: "every image with an orthoimage, with `surface.orthoimages_before`",
        has: |site, image| !matches!(orthoimage_before(site, image), Ok(None)),
        write: |path, of, image| {
            let made = orthoimage_before(of.site, image)?;
            made.map_or(Ok(0), |image| write_brightness(path, of, image))
        },
    },
    uses: &[],
};

pub(super) static SIGMAS: Declaration = Declaration {
    path: "images/<image>/orthoimage_sigma.tif",
    what: "standard deviation of horizontal positions in the orthoimage (both axes together, without the shared error), metres, \
           on the cells of the terrain model or of the ground between shots: due to height errors, jitter and drift; orthoimages.json states the shared error",
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
            let ground = GroundModel::of(of.site.book)?;
            let made = orthoimage(of.site, image)?.zip(ground);
            made.map_or(Ok(0), |(image, model)| {
                let numbers = (band, &*image.sigmas_m);
                write_map(path, of, &model.heights, numbers, model.parallel_rad)
            })
        },
    },
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "orthoimages.json",
    what: "cells of every orthoimage, the uncertainty of positions in each, and measured offsets between them",
    readers: "scripts",
    rows: "orthoimages",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("orthoimages")),
    write: Write::Where {
        sites: SITES,
        has: has_orthoimages,
        write: |path, of| {
            let orthoimages = orthoimages(of.site)?;
            write_json(path, &Document::of(of.site, orthoimages)?)?;
            Ok(orthoimages.len() as u64)
        },
    },
    uses: &[],
};

/// The orthoimages of a site; empty if it requests none.
pub(super) fn orthoimages<'a>(site: &SiteProducts<'a>) -> Result<&'a [Orthoimage]> {
    Orthoimage::best(site.book)
}

fn orthoimage<'a>(site: &SiteProducts<'a>, image: usize) -> Result<Option<&'a Orthoimage>> {
    let mut all = orthoimages(site)?.iter();
    Ok(all.find(|of| of.account.image == image))
}

fn orthoimage_before<'a>(site: &SiteProducts<'a>, image: usize) -> Result<Option<&'a Orthoimage>> {
    let mut all = Orthoimage::before(site.book)?.iter();
    Ok(all.find(|of| of.account.image == image))
}

/// Whether a site has orthoimages. The writer reports an output that cannot be read, here and below.
pub(super) fn has_orthoimages(site: &SiteProducts) -> bool {
    !matches!(orthoimages(site), Ok([]))
}

fn has_orthoimage(site: &SiteProducts, image: usize) -> bool {
    !matches!(orthoimage(site, image), Ok(None))
}

/// Writes the brightness of all cells.
fn write_brightness(path: &Path, of: &Context, image: &Orthoimage) -> Result<u64> {
    let account = &image.account;
    let what = "brightness of an image";
    let map = (&account.map, account.parallel_rad);
    write_cells(path, of, map, (what, &*image.brightness.bytes()))?;
    Ok(u64::from(account.filled))
}

/// Writes the numbers of all cells of a map, and reads them back.
pub(super) fn write_cells<N: Number + Send + Sync>(
    path: &Path,
    of: &Context,
    (grid, parallel_rad): (&HeightGrid, f64),
    (what, numbers): (&str, &[N]),
) -> Result<u64> {
    let file = GeoTiff {
        grid,
        parallel_rad,
        body: of.site.config.body,
        conformal: None,
        what,
        unit: "",
        vertical: "",
        numbers,
    };
    write_raster(path, &file)
}

/// `orthoimages.json`.
#[derive(Serialize, JsonSchema)]
#[schemars(
    deny_unknown_fields,
    title = "orthoimages.json",
    description = "orthoimages.json of areograph: cells of every orthoimage of a site, the uncertainty of positions in each, and measured offsets between them. Metres; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph orthoimages 1"))]
    format: &'static str,
    site: &'a str,
    #[schemars(length(min = 1))]
    orthoimages: Vec<Entry<'a>>,
    /// Offsets of every two overlapping orthoimages; `orthoimage_offsets.csv` lists their places.
    pairs: Vec<Pair<'a>>,
}

/// Two overlapping orthoimages.
#[derive(Serialize, JsonSchema)]
pub(super) struct Pair<'a> {
    /// Identifiers of the images.
    pub(super) images: [&'a str; 2],
    /// Number of squares that match before and after the adjustment. The statistics of both states are over these squares; if none
    /// matches in both, each state is over its own. Omitted if only one state was computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) places_in_both: Option<u32>,
    /// With the orientation from the kernels; omitted if it was not computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) before: Option<Offsets>,
    /// With the adjusted orientation; omitted without an adjustment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) after: Option<Offsets>,
}

/// Offsets of the second orthoimage against the first.
#[derive(Serialize, JsonSchema)]
pub(super) struct Offsets {
    /// Number of compared squares.
    pub(super) squares: u32,
    /// Number of squares that match in this state.
    pub(super) places: u32,
    /// Root mean square offset, both axes together; omitted if no square matches.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rms_m: Option<f64>,
    /// The same in cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rms_cells: Option<f64>,
    /// Median, east and north.
    pub(super) median_m: [f64; 2],
    /// Robust standard deviation (1.4826 times the median absolute deviation), east and north.
    #[schemars(inner(range(min = 0.0)))]
    pub(super) sigma_m: [f64; 2],
}

impl Offsets {
    /// Statistics over the squares of `chosen`, a part of those of the pair.
    fn of(pair: &OrthoimageOffsets, chosen: &OrthoimageOffsets) -> Self {
        let summaries_m = chosen.summaries_m();
        let rms_m = chosen.rms_m();
        Self {
            squares: pair.squares,
            places: u32::try_from(pair.places.len()).unwrap_or(u32::MAX),
            rms_m,
            rms_cells: rms_m.map(|rms_m| rms_m / pair.cell_m),
            median_m: summaries_m.map(|of| of.median),
            sigma_m: summaries_m.map(|of| of.nmad),
        }
    }
}

/// Offsets of one pair before and after the adjustment.
pub(super) struct States<'a>([Option<&'a OrthoimageOffsets>; 2]);

impl<'a> States<'a> {
    /// Of this pair of images.
    pub(super) fn of(site: &SiteProducts<'a>, images: [usize; 2]) -> Result<Self> {
        let of = |round| -> Result<Option<&'a OrthoimageOffsets>> {
            Ok(offsets(site, round)?.iter().find(|of| of.images == images))
        };
        Ok(Self([of(Round::Initial)?, of(Round::Adjusted)?]))
    }

    /// Cells of the squares that match in both states; `None` if only one was computed.
    pub(super) fn in_both(&self) -> Option<BTreeSet<[i64; 2]>> {
        let [before, after] = self.0;
        let (before, after) = (before?.cells(), after?.cells());
        Some(before.intersection(&after).copied().collect())
    }

    /// The offsets of a state in these cells; in all of its own without a cell of both.
    pub(super) fn chosen(
        &self,
        state: usize,
        cells: Option<&BTreeSet<[i64; 2]>>,
    ) -> Option<OrthoimageOffsets> {
        let of = self.0[state]?;
        let cells = cells.filter(|cells| !cells.is_empty());
        Some(cells.map_or_else(|| of.clone(), |cells| of.in_cells(cells)))
    }
}

/// Offsets with the orientation of this round; empty if the site has none.
pub(super) fn offsets<'a>(
    site: &SiteProducts<'a>,
    round: Round,
) -> Result<&'a [OrthoimageOffsets]> {
    let found = site.book.find::<Vec<OrthoimageOffsets>>(round)?;
    Ok(found.map_or(&[], Vec::as_slice))
}

/// All pairs of overlapping orthoimages.
pub(super) fn pairs<'a>(site: &SiteProducts<'a>) -> Result<Vec<Pair<'a>>> {
    let rounds = [Round::Initial, Round::Adjusted].map(|round| offsets(site, round));
    let [before, after] = rounds;
    let [before, after] = [before?, after?];
    let mut images: Vec<[usize; 2]> = before.iter().chain(after).map(|of| of.images).collect();
    images.sort_unstable();
    images.dedup();
    let pair = |images| {
        let states = States::of(site, images)?;
        let in_both = states.in_both();
        let of = |state: usize| {
            let chosen = states.chosen(state, in_both.as_ref());
            states.0[state]
                .zip(chosen)
                .map(|(of, chosen)| Offsets::of(of, &chosen))
        };
        Ok(Pair {
            images: images.map(|image| &*site.images[image].times.id),
            places_in_both: in_both
                .as_ref()
                .map(|cells| u32::try_from(cells.len()).unwrap_or(u32::MAX)),
            before: of(0),
            after: of(1),
        })
    };
    images.into_iter().map(pair).collect()
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
    /// Standard deviation due to drift (orientation errors that change along the image), both axes together: by the adjustment, or by
    /// the usual errors of kernels.
    #[serde(skip_serializing_if = "Option::is_none")]
    drift_m: Option<f64>,
    /// Standard deviations of the error that all adjusted images of the site share, east and north; omitted without an adjustment of
    /// heights.
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_sigma_m: Option<[f64; 2]>,
    /// Without an adjustment: standard deviations of the error that all places of this image share, but no other image, east and
    /// north, by the usual errors of kernels.
    #[serde(skip_serializing_if = "Option::is_none")]
    image_sigma_m: Option<[f64; 2]>,
}

impl<'a> Document<'a> {
    fn of(site: &SiteProducts<'a>, orthoimages: &'a [Orthoimage]) -> Result<Self> {
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
                image_sigma_m: of.image_sigma_m,
            }
        });
        Ok(Self {
            format: "areograph orthoimages 1",
            site: &site.config.site,
            orthoimages: orthoimages.collect(),
            pairs: pairs(site)?,
        })
    }
}
