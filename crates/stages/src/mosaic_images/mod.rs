//! A mosaic of the orthoimages of a site: every cell is taken from one image, and a second layer identifies it.
//!
//! `seams.rs` chooses the image of every block of cells, `balance.rs` the tones. No brightness is mixed or interpolated: a cell
//! has the brightness of its image, changed by the gain and the offset of that image if tones are balanced. Where the image of
//! a block lacks a cell, the first image that has it supplies it; where none has it, the cell stays empty.
//!
//! Memory does not grow with the number of orthoimages: it contains what they show in the tiles at work (`tile.rs`), the blocks, and one byte
//! for each cell while statistics are made of the sources. Tones are found in one pass over the tiles, seams in a second, and the mosaic
//! is composed in a third.

#![allow(
    clippy::cast_possible_wrap,
    reason = "numbers of cells of a map are far below 2⁶³"
)]

mod balance;
mod blocks;
mod seams;
mod tile;

use std::{ops::Range, sync::atomic::AtomicBool};

use nalgebra::Vector2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    compare_orthoimages::{EDGE, OrthoimageOffsets, PlaceOffset},
    look::OrthoimageLook,
    raster::{Raster, first_cell},
    rectify_images::{CELLS_MAX, GroundModel, Orthoimage},
    site_image::SiteImages,
};
use areograph_base::{
    column::{Tile, Tiles, spans},
    error::{Cause, Result},
    watch::Watch,
};
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    height_grid::HeightGrid,
    pushbroom::{Projector, Unseen},
    statistics::median,
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

use balance::Tone;
use blocks::Survey;
use seams::Set;
use tile::MapTile;

/// Largest number of orthoimages of a mosaic.
pub(crate) const ORTHOIMAGES_MAX: usize = Set::MOST;
/// Rows and columns of the detail around a seam.
const DETAIL: usize = 240;

stage_inputs! {
    /// Orthoimages of one orientation, and the images that they are of.
    pub struct MosaicImages<'a> {
        /// Their orientation.
        pub round: Round,
        /// The images.
        pub images: SiteImages<'a>,
        /// The heights of the ground.
        pub surface: GroundModel<'a>,
        /// The orthoimages.
        pub orthoimages: &'a Output<Vec<Orthoimage>>,
        /// Their offsets.
        pub offsets: &'a Output<Vec<OrthoimageOffsets>>,
        /// Whether tones are balanced.
        pub balance: &'a bool,
    }
}

/// A mosaic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mosaic {
    /// Statistics.
    pub account: MosaicAccount,
    /// Brightness; 0 where there is none.
    pub brightness: Tiles,
    /// Number of the orthoimage that a cell is taken from, from 1, in the order of [`MosaicAccount::images`]; 0 for an empty
    /// cell.
    pub sources: Tiles,
}

/// Statistics of a mosaic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MosaicAccount {
    /// Cells of the map, without heights.
    pub map: HeightGrid,
    /// Latitude at which cells are as wide as high, radians.
    pub parallel_rad: f64,
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// Its orthoimages.
    pub images: Vec<MosaicPart>,
    /// Compared places along the seams.
    pub seams: Vec<SeamPlaces>,
    /// The mosaic in larger cells, for display.
    pub look: OrthoimageLook,
    /// Cells around a seam near the middle; `None` without a seam.
    pub detail: Option<MosaicDetail>,
}

/// An orthoimage in a mosaic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MosaicPart {
    /// Index of the image.
    pub image: usize,
    /// Gain and offset of its brightness, grey values.
    pub tone: [f64; 2],
    /// Number of cells taken from it.
    pub cells: u32,
}

/// Places of two images where a seam between them passes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeamPlaces {
    /// Indices of the images.
    pub images: [usize; 2],
    /// Cells of the places ([`PlaceOffset::cell`]) whose squares the seam crosses.
    pub cells: Vec<[i64; 2]>,
}

/// Cells around a seam.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MosaicDetail {
    /// Rows and columns.
    pub size: [usize; 2],
    /// Brightness, row by row; 0 where there is none.
    pub brightness: Vec<u8>,
    /// See [`Mosaic::sources`].
    pub sources: Vec<u8>,
}

/// A mosaic cannot be made.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum MosaicError {
    #[error("image {image}: its rays do not intersect the ground ({unseen})")]
    #[cause("check the kernels and times of the image")]
    Unseen { image: String, unseen: Unseen },
    #[error(
        "{count} orthoimages; expected at most {} for surface.mosaic",
        Set::MOST
    )]
    #[cause("divide the site, or set surface.mosaic = false")]
    TooMany { count: usize },
    #[error("the mosaic requires {cells} cells of {cell_m} m; expected at most {CELLS_MAX}")]
    #[cause("increase surface.orthoimage_cell_m, or set surface.mosaic = false")]
    TooLarge { cell_m: f64, cells: usize },
}

impl Mosaic {
    /// The mosaic of orthoimages, by the distance from the edge of its image, metres, at which an orthoimage shows a place of this longitude and
    /// latitude; `None` without an orthoimage.
    ///
    /// # Errors
    /// More than [`ORTHOIMAGES_MAX`] orthoimages, too many cells, a stop.
    pub(crate) fn of(
        orthoimages: &[Orthoimage],
        offsets: &[OrthoimageOffsets],
        inside_m: impl Fn(usize, [f64; 2]) -> f64 + Sync,
        watch: Watch<'_>,
    ) -> Result<Option<Self>> {
        mosaic(orthoimages, offsets, true, inside_m, watch)
    }

    /// Its statistics, which a page shows.
    #[must_use]
    pub fn without_cells(&self) -> Self {
        Self {
            account: self.account.clone(),
            brightness: Tiles::default(),
            sources: Tiles::default(),
        }
    }
}

impl Stage for MosaicImages<'_> {
    const NAME: &'static str = "mosaic_images";
    const METHOD: u32 = 3;
    type Output = Option<Mosaic>;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Option<Mosaic>> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Option<Mosaic>> {
        let orthoimages = self.orthoimages.value()?;
        if orthoimages.is_empty() {
            return Ok(None);
        }
        let Some(look) = self.surface.look()? else {
            return Ok(None);
        };
        let known = look.heights_m.iter().filter(|of| !of.is_nan());
        let height_m = median(&mut known.map(|of| f64::from(*of)).collect::<Vec<_>>());
        let oriented = self.images.oriented()?;
        let mut cameras = Vec::new();
        for orthoimage in orthoimages {
            let camera = oriented[orthoimage.account.image].oriented_camera();
            let projector = Projector::new(camera.orientation, camera.lines());
            let projector = projector.map_err(|unseen| MosaicError::Unseen {
                image: camera.id.clone(),
                unseen,
            })?;
            cameras.push((projector.through(camera.detector.distortion), camera));
        }
        let inside_m = |of: usize, [longitude_rad, latitude_rad]: [f64; 2]| {
            let (projector, camera) = &cameras[of];
            let radius_m = look.radius_m + height_m;
            let ground_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
            let place = projector.project(&ground_m).ok().and_then(|seen| {
                let focal_px = camera.detector.focal_px(&seen.camera_m).ok()?;
                let line = camera.line_times.line_of_offset(seen.x);
                Some(Vector2::new(line, camera.detector.sample(focal_px.y)))
            });
            let size = Vector2::new(camera.lines(), camera.detector.samples);
            let inside_px = place.map(|place| place.inf(&(size - place)).min());
            inside_px.unwrap_or_default().max(0.0) * orthoimages[of].account.pixel_m
        };
        mosaic(
            orthoimages,
            self.offsets.value()?,
            *self.balance,
            inside_m,
            watch,
        )
    }
}

/// The mosaic of orthoimages, by the distance from the edge of its image, metres, at which an orthoimage shows a place of this
/// longitude and latitude; `None` without an orthoimage.
fn mosaic(
    orthoimages: &[Orthoimage],
    offsets: &[OrthoimageOffsets],
    is_balanced: bool,
    inside_m: impl Fn(usize, [f64; 2]) -> f64 + Sync,
    watch: Watch<'_>,
) -> Result<Option<Mosaic>> {
    let Some(map) = common_map(orthoimages)? else {
        return Ok(None);
    };
    let first = &orthoimages[0].account;
    let survey = Survey::of(&map, orthoimages, is_balanced, inside_m, watch)?;
    let labels = survey.blocks.labels();
    let tables: Vec<[u8; 256]> = survey.tones.iter().map(Tone::table).collect();
    let cells = composed(&map, orthoimages, (&labels, survey.edge), &tables, watch)?;
    let counts = cells.sources.counts();
    let parts = orthoimages.iter().zip(&survey.tones).zip(&counts[1..]);
    let parts = parts.map(|((of, tone), cells)| MosaicPart {
        image: of.account.image,
        tone: [tone.gain, tone.offset],
        cells: u32::try_from(*cells).unwrap_or(u32::MAX),
    });
    let parts: Vec<MosaicPart> = parts.collect();
    let sources = cells.sources.bytes();
    let sources = Raster::of(&map, &sources);
    let account = MosaicAccount {
        parallel_rad: first.parallel_rad,
        cell_m: first.cell_m,
        seams: offsets
            .iter()
            .filter_map(|pair| seam(pair, &parts, &sources))
            .collect(),
        images: parts,
        look: OrthoimageLook::of(&cells.brightness),
        detail: detail(&sources, &cells),
        map,
    };
    Ok(Some(Mosaic {
        account,
        brightness: cells.brightness,
        sources: cells.sources,
    }))
}

/// Cells over all orthoimages; `None` without one.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the extent of a few maps"
)]
fn common_map(orthoimages: &[Orthoimage]) -> std::result::Result<Option<HeightGrid>, MosaicError> {
    if orthoimages.len() > Set::MOST {
        let count = orthoimages.len();
        return Err(MosaicError::TooMany { count });
    }
    let Some((one, others)) = orthoimages.split_first() else {
        return Ok(None);
    };
    let corners = |of: &Orthoimage| {
        let first = first_cell(&of.account.map);
        let end = [0, 1].map(|axis| first[axis] + of.account.map.size[axis] as i64);
        [first, end]
    };
    let own = corners(one);
    let [mut first, mut end] = own;
    for other in others {
        let [start, stop] = corners(other);
        for axis in 0..2 {
            first[axis] = first[axis].min(start[axis]);
            end[axis] = end[axis].max(stop[axis]);
        }
    }
    let size = [0, 1].map(|axis| (end[axis] - first[axis]) as usize);
    let cells = size[0].saturating_mul(size[1]);
    let map = &one.account.map;
    if cells > CELLS_MAX {
        let cell_m = one.account.cell_m;
        return Err(MosaicError::TooLarge { cell_m, cells });
    }
    let before = [0, 1].map(|axis| (first[axis] - own[0][axis]) as f64);
    Ok(Some(HeightGrid {
        size,
        first_rad: map.place_rad(before),
        ..map.clone()
    }))
}

/// Cells of a mosaic.
struct Composed {
    brightness: Tiles,
    sources: Tiles,
}

/// Every cell from the orthoimage of its block.
fn composed(
    map: &HeightGrid,
    orthoimages: &[Orthoimage],
    (labels, edge): (&[u8], usize),
    tables: &[[u8; 256]],
    watch: Watch<'_>,
) -> Result<Composed> {
    let across = map.size[1].div_ceil(edge);
    let first = first_cell(map);
    let of_tile = |span: [Range<usize>; 2]| {
        watch.check()?;
        let tile = MapTile::of(orthoimages, first, span);
        let [rows, columns] = &tile.span;
        let mut brightness = vec![0; rows.len() * columns.len()];
        let mut sources = brightness.clone();
        let cells = rows
            .clone()
            .flat_map(|row| columns.clone().map(move |column| [row, column]));
        let made = brightness.iter_mut().zip(&mut sources);
        for (cell, ([row, column], (brightness, source))) in cells.zip(made).enumerate() {
            let label = labels[row / edge * across + column / edge];
            let pixel = |of: u8| (of, tile.at(usize::from(of), cell));
            let own = (usize::from(label) < orthoimages.len()).then(|| pixel(label));
            let other = || {
                let mut others = (0_u8..).zip(orthoimages).map(|(of, _)| pixel(of));
                others.find(|(_, pixel)| *pixel > 0)
            };
            if let Some((of, pixel)) = own.filter(|(_, pixel)| *pixel > 0).or_else(other) {
                *brightness = tables[usize::from(of)][usize::from(pixel)];
                *source = of + 1;
            }
        }
        Ok((Tile::of(brightness), Tile::of(sources)))
    };
    let tiles = spans(map.size).into_par_iter().map(of_tile);
    let tiles: Vec<(Tile, Tile)> = tiles.collect::<Result<_>>()?;
    let (brightness, sources) = tiles.into_iter().unzip();
    Ok(Composed {
        brightness: Tiles::of_tiles(map.size, brightness),
        sources: Tiles::of_tiles(map.size, sources),
    })
}

/// Places of a pair whose squares its seam crosses; `None` without one.
fn seam(
    pair: &OrthoimageOffsets,
    parts: &[MosaicPart],
    sources: &Raster<'_>,
) -> Option<SeamPlaces> {
    let number = |image: usize| (1_u8..).zip(parts).find(|(_, of)| of.image == image);
    let [one, other] = pair
        .images
        .map(|image| number(image).map(|(number, _)| number));
    let numbers = [one?, other?];
    let half = i64::from(EDGE / 2);
    let is_crossed = |place: &&PlaceOffset| {
        let span = |axis: usize| place.cell[axis] - half..=place.cell[axis] + half;
        let mut found = [false; 2];
        for cell in span(0).flat_map(|row| span(1).map(move |column| [row, column])) {
            let source = sources.at(cell);
            for (found, number) in found.iter_mut().zip(numbers) {
                *found |= source == number;
            }
        }
        found == [true; 2]
    };
    let crossed = pair.places.iter().filter(is_crossed);
    let cells: Vec<[i64; 2]> = crossed.map(|of| of.cell).collect();
    (!cells.is_empty()).then_some(SeamPlaces {
        images: pair.images,
        cells,
    })
}

/// The cells around the seam that is nearest to the middle.
fn detail(sources: &Raster<'_>, cells: &Composed) -> Option<MosaicDetail> {
    let [rows, columns] = sources.size;
    let pairs = sources.pixels.windows(2).enumerate();
    let seams = pairs.filter(|(at, pair)| {
        !pair.contains(&0) && pair[0] != pair[1] && at % columns + 1 < columns
    });
    let from_middle = |at: usize| {
        let [row, column] = [at / columns, at % columns];
        (2 * row).abs_diff(rows).max((2 * column).abs_diff(columns))
    };
    let (middle, _) = seams.min_by_key(|(at, _)| from_middle(*at))?;
    let size = [rows.min(DETAIL), columns.min(DETAIL)];
    let start = |at: usize, axis: usize| {
        let start = at.saturating_sub(size[axis] / 2);
        start.min(sources.size[axis] - size[axis])
    };
    let [row, column] = [start(middle / columns, 0), start(middle % columns, 1)];
    let [rows, columns] = [row..row + size[0], column..column + size[1]];
    Some(MosaicDetail {
        size,
        brightness: cells.brightness.window(&rows, &columns),
        sources: cells.sources.window(&rows, &columns),
    })
}

#[cfg(test)]
mod tests;
