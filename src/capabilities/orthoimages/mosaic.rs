//! The mosaic of orthoimages: brightness, sources, and statistics.

use std::{collections::BTreeSet, path::Path};

use schemars::JsonSchema;
use serde::Serialize;

use super::products::{States, write_cells};
use crate::{
    error::Result,
    products::{Content, Context, Declaration, Label, Role, SiteProducts, Write, write_json},
    schema::DocumentSchema,
    stage::Round,
    stages::mosaic_images::{Mosaic, MosaicAccount},
};

/// Sites with these products.
const SITES: &str = "a site with orthoimages, with `surface.mosaic`";
const SITES_BEFORE: &str = "a site with a mosaic, with `surface.orthoimages_before`";

pub(super) static MOSAIC: Declaration = Declaration {
    path: "mosaic.tif",
    what: "mosaic of the orthoimages (cloud-optimised GeoTIFF): brightness 1 to 255, or 0 in cells that no orthoimage shows; seams \
           where overlapping images differ least",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: SITES,
        has: has_mosaic,
        write: |path, of| write_brightness(path, of, best(of.site)?),
    },
    uses: &[],
};

pub(super) static SOURCES: Declaration = Declaration {
    path: "mosaic_source.tif",
    what: "number of the image that each cell of mosaic.tif is taken from, as listed in mosaic.json; 0 in empty cells",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: SITES,
        has: has_mosaic,
        write: |path, of| write_sources(path, of, best(of.site)?),
    },
    uses: &[],
};

pub(super) static BEFORE: Declaration = Declaration {
    path: "mosaic_before.tif",
    what: "as mosaic.tif, of the orthoimages with the orientation before the adjustment, for comparison",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: SITES_BEFORE,
        has: has_before,
        write: |path, of| write_brightness(path, of, before(of.site)?),
    },
    uses: &[],
};

pub(super) static SOURCES_BEFORE: Declaration = Declaration {
    path: "mosaic_before_source.tif",
    what: "as mosaic_source.tif, for mosaic_before.tif",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: SITES_BEFORE,
        has: has_before,
        write: |path, of| write_sources(path, of, before(of.site)?),
    },
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "mosaic.json",
    what: "images of the mosaic with their numbers in mosaic_source.tif and their tones, and offsets along the seams before and \
           after the adjustment",
    readers: "scripts",
    rows: "images",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("mosaic")),
    write: Write::Where {
        sites: SITES,
        has: has_mosaic,
        write: |path, of| {
            let Some(mosaic) = best(of.site)? else {
                return Ok(0);
            };
            let document = Document::of(of.site, &mosaic.account)?;
            write_json(path, &document)?;
            Ok(document.images.len() as u64)
        },
    },
    uses: &[],
};

/// The mosaic with the best orientation.
pub(in crate::capabilities) fn best<'a>(site: &SiteProducts<'a>) -> Result<Option<&'a Mosaic>> {
    let found = site.book.find_best::<Option<Mosaic>>()?;
    Ok(found.and_then(Option::as_ref))
}

/// The mosaic with the orientation from the kernels, in a site whose best orientation is the adjusted one.
pub(in crate::capabilities) fn before<'a>(site: &SiteProducts<'a>) -> Result<Option<&'a Mosaic>> {
    let found = site.book.find_before::<Option<Mosaic>>()?;
    Ok(found.and_then(Option::as_ref))
}

/// Whether a site has a mosaic. The writer reports an output that cannot be read, here and below.
fn has_mosaic(site: &SiteProducts) -> bool {
    !matches!(best(site), Ok(None))
}

fn has_before(site: &SiteProducts) -> bool {
    !matches!(before(site), Ok(None))
}

fn write_brightness(path: &Path, of: &Context, mosaic: Option<&Mosaic>) -> Result<u64> {
    let Some(Mosaic {
        account,
        brightness,
        ..
    }) = mosaic
    else {
        return Ok(0);
    };
    let numbers = ("brightness of a mosaic", &*brightness.bytes());
    write_cells(path, of, (&account.map, account.parallel_rad), numbers)?;
    Ok(cells(account))
}

fn write_sources(path: &Path, of: &Context, mosaic: Option<&Mosaic>) -> Result<u64> {
    let Some(Mosaic {
        account, sources, ..
    }) = mosaic
    else {
        return Ok(0);
    };
    let labels: Vec<Label> = sources.bytes().into_iter().map(Label).collect();
    let numbers = (
        "number of the image of a cell, as listed in mosaic.json",
        &*labels,
    );
    write_cells(path, of, (&account.map, account.parallel_rad), numbers)?;
    Ok(cells(account))
}

/// Number of cells with a brightness.
fn cells(account: &MosaicAccount) -> u64 {
    account.images.iter().map(|of| u64::from(of.cells)).sum()
}

/// `mosaic.json`.
#[derive(Serialize, JsonSchema)]
#[schemars(
    deny_unknown_fields,
    title = "mosaic.json",
    description = "mosaic.json of areograph: images of a mosaic and offsets along its seams. Metres and grey values; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph mosaic 1"))]
    format: &'static str,
    site: &'a str,
    /// Edge of a cell.
    #[schemars(extend("exclusiveMinimum" = 0))]
    cell_m: f64,
    rows: usize,
    columns: usize,
    #[schemars(length(min = 1))]
    images: Vec<Part<'a>>,
    /// Seams between two images; without those that no matching square crosses.
    seams: Vec<Seam<'a>>,
    /// Seams of the mosaic with the orientation from the kernels, `mosaic_before.tif`; omitted if it was not requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    seams_before: Option<Vec<Seam<'a>>>,
}

/// An image of a mosaic.
#[derive(Serialize, JsonSchema)]
struct Part<'a> {
    /// Number in `mosaic_source.tif`.
    #[schemars(range(min = 1))]
    number: usize,
    /// Identifier of the image.
    image: &'a str,
    /// Gain of its brightness; 1 without balance.
    #[schemars(extend("exclusiveMinimum" = 0))]
    gain: f64,
    /// Offset of its brightness, grey values; 0 without balance.
    offset: f64,
    /// Number of cells taken from it.
    cells: u32,
}

/// A seam between two images.
#[derive(Serialize, JsonSchema)]
pub(super) struct Seam<'a> {
    /// Identifiers of the images.
    pub(super) images: [&'a str; 2],
    /// Number of compared squares that it crosses. With both mosaics, squares count that match before and after the adjustment and that
    /// the seam of either mosaic crosses, the same for both; if there is none, each seam has its own.
    pub(super) places: u32,
    /// Root mean square offset in them, both axes together.
    #[schemars(range(min = 0.0))]
    pub(super) rms_m: f64,
}

/// The seams of the mosaic before the adjustment, if there is one, and of the best one.
pub(super) fn seams<'a>(site: &SiteProducts<'a>) -> Result<[Vec<Seam<'a>>; 2]> {
    let (before, best) = (before(site)?, best(site)?);
    let accounts = [before, best].map(|of| of.map_or(&[][..], |of| &of.account.seams));
    let mut pairs: Vec<[usize; 2]> = accounts.concat().iter().map(|of| of.images).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut seams = [Vec::new(), Vec::new()];
    for images in pairs {
        let states = States::of(site, images)?;
        let crossed = accounts.map(|of| {
            let seam = of.iter().find(|of| of.images == images);
            seam.map_or_else(BTreeSet::new, |of| of.cells.iter().copied().collect())
        });
        let common = states.in_both().filter(|_| before.is_some());
        let common = common.map(|cells| {
            let of_either = crossed[0].union(&crossed[1]).copied();
            of_either.filter(|cell| cells.contains(cell)).collect()
        });
        let common = common.filter(|cells: &BTreeSet<_>| !cells.is_empty());
        let ids = images.map(|image| &*site.images[image].times.id);
        for (state, crossed) in crossed.iter().enumerate() {
            // The offsets of the best mosaic of a site without an adjustment are those of its kernels.
            let round = usize::from(state == 1 && site.book.has::<Option<Mosaic>>(Round::Adjusted));
            // A seam of one mosaic only is not one of the other.
            if crossed.is_empty() {
                continue;
            }
            let cells = common.as_ref().unwrap_or(crossed);
            let Some(offsets) = states.chosen(round, Some(cells)) else {
                continue;
            };
            if let Some(rms_m) = offsets.rms_m() {
                seams[state].push(Seam {
                    images: ids,
                    places: u32::try_from(offsets.places.len()).unwrap_or(u32::MAX),
                    rms_m,
                });
            }
        }
    }
    Ok(seams)
}

impl<'a> Document<'a> {
    fn of(site: &SiteProducts<'a>, account: &'a MosaicAccount) -> Result<Self> {
        let [rows, columns] = account.map.size;
        let id = |image: usize| &*site.images[image].times.id;
        let images = account.images.iter().enumerate().map(|(index, of)| Part {
            number: index + 1,
            image: id(of.image),
            gain: of.tone[0],
            offset: of.tone[1],
            cells: of.cells,
        });
        let [seams_before, seams] = seams(site)?;
        Ok(Self {
            format: "areograph mosaic 1",
            site: &site.config.site,
            cell_m: account.cell_m,
            rows,
            columns,
            images: images.collect(),
            seams,
            seams_before: before(site)?.map(|_| seams_before),
        })
    }
}
