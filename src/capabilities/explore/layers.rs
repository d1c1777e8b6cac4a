//! Pictures of the page: of the ground on its map, and of images in their lines and samples.

use std::borrow::Cow;

use serde::Serialize;

use super::frame::MapFrame;
use crate::{
    capabilities::{
        orthoimages::{best_mosaic, mosaic_before},
        terrain::significant_surface,
    },
    column::Tiles,
    error::Result,
    geom::height_grid::HeightGrid,
    products::SiteProducts,
    report::parts::{relief_of_shots, round_length_m, shade},
    stages::{
        lay_overlays::{QuickLook, ShownImage},
        mosaic_images::Mosaic,
        rectify_images::{Orthoimage, OrthoimageLook},
    },
};

/// Suffixes of the names and titles of pictures with the orientation from the kernels.
const BEFORE: [&str; 2] = ["_before", ", before the adjustment"];
/// Longest side of an overview, pixels, and of a tile.
const OVERVIEW: usize = 1024;
const TILE: usize = 2048;
/// Share of the darkest and of the brightest cells that are shown as black and as white.
const CLIPPED: f64 = 0.005;
/// Slope for shading: lower relief is exaggerated up to it.
const SLOPE: f64 = 0.35;
const EXAGGERATION_MAX: f64 = 100.0;

/// A picture in one file, or as an overview and tiles.
pub(super) struct Layer<'a> {
    pub(super) name: String,
    pub(super) title: String,
    pub(super) place: LayerPlace,
    pub(super) pixels: Pixels<'a>,
    /// Rows and columns.
    pub(super) size: [usize; 2],
}

/// Where a layer lies.
#[derive(Clone, Copy)]
pub(super) enum LayerPlace {
    /// West, south, east and north edge on the map, metres.
    Map([f64; 4]),
    /// In the image with this index; so many lines and samples are one pixel.
    Image { image: usize, reduction: u32 },
}

/// Contents of a layer.
pub(super) enum Pixels<'a> {
    /// Brightness, row by row, 0 where there is none; shown as black and as white.
    Grey(Cow<'a, [u8]>, [u8; 2]),
    /// The same in tiles, of which few are in memory.
    Tiles(&'a Tiles, [u8; 2]),
    /// A complete file, which lies below other layers of the map.
    Png(Vec<u8>),
}

/// A file of a layer.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Part {
    pub(super) file: String,
    /// First and last row and column, the last ones excluded; those of an overview may lie beyond the layer.
    pub(super) rows: [usize; 2],
    pub(super) columns: [usize; 2],
    /// Rows and columns of the layer that are one pixel.
    #[serde(skip)]
    pub(super) step: usize,
}

impl Layer<'_> {
    /// Its files: one, or an overview and tiles that are not empty.
    pub(super) fn parts(&self) -> Vec<Part> {
        let [rows, columns] = self.size;
        let part = |suffix: String, rows, columns, step| Part {
            file: format!("{}{suffix}.png", self.name),
            rows,
            columns,
            step,
        };
        let longest = rows.max(columns);
        // A whole number of squares, so that the pixels of an overview keep their size at its last edges.
        let whole = |step: usize| {
            let [rows, columns] = [rows, columns].map(|of: usize| of.next_multiple_of(step));
            part(String::new(), [0, rows], [0, columns], step)
        };
        if longest <= TILE || matches!(self.pixels, Pixels::Png(_)) {
            return vec![whole(1)];
        }
        let mut parts = vec![whole(longest.div_ceil(OVERVIEW))];
        for top in (0..rows).step_by(TILE) {
            for left in (0..columns).step_by(TILE) {
                let to = [rows.min(top + TILE), columns.min(left + TILE)];
                let suffix = format!("_{}_{}", top / TILE, left / TILE);
                let part = part(suffix, [top, to[0]], [left, to[1]], 1);
                if self.has_pixels(&part) {
                    parts.push(part);
                }
            }
        }
        parts
    }

    fn has_pixels(&self, part: &Part) -> bool {
        let pixels = match &self.pixels {
            Pixels::Grey(pixels, _) => pixels,
            Pixels::Tiles(tiles, _) => {
                let [rows, columns] = [part.rows, part.columns].map(|[from, to]| from..to);
                let own = tiles.filled_window(&rows, &columns);
                return own.is_some_and(|own| own.iter().any(|pixel| *pixel > 0));
            }
            Pixels::Png(_) => return true,
        };
        let mut rows = part.rows[0]..part.rows[1];
        rows.any(|row| {
            let from = row * self.size[1];
            let own = &pixels[from + part.columns[0]..from + part.columns[1]];
            own.iter().any(|pixel| *pixel > 0)
        })
    }
}

/// All layers of a site.
///
/// # Errors
/// An output that cannot be read; a picture that the library rejects.
pub(super) fn layers<'a>(site: &SiteProducts<'a>) -> Result<Vec<Layer<'a>>> {
    let frame = MapFrame::of(site)?;
    let mut layers = Vec::new();
    layers.extend(relief(site, &frame)?);
    let surface = significant_surface(site)?;
    layers.extend(surface.map(|surface| hillshade(&frame, &surface.model.heights)));
    let shown = site.shown_images();
    let is_shown = |image: usize| shown.binary_search(&image).is_ok();
    let before = Orthoimage::before(site.book)?;
    for of in Orthoimage::best(site.book)? {
        let image = of.account.image;
        if is_shown(image) {
            let before = before.iter().filter(|of| of.account.image == image);
            layers.extend(before.map(|of| orthoimage(site, &frame, of, BEFORE)));
            layers.push(orthoimage(site, &frame, of, ["", ""]));
        }
    }
    // The map begins with the last two pictures: an image, or the mosaic, before and after the adjustment.
    let mosaics = [
        (mosaic_before(site)?, BEFORE),
        (best_mosaic(site)?, ["", ""]),
    ];
    for (mosaic, when) in mosaics {
        layers.extend(mosaic.map(|of| mosaic_layer(&frame, of, when)));
    }
    let images = site.overlays.map_or(&[][..], |overlays| &overlays.images);
    let images = images.iter().filter(|shown| is_shown(shown.image));
    layers.extend(images.map(|shown| strip(site, shown)));
    Ok(layers)
}

/// The ground between all shots.
fn relief<'a>(site: &SiteProducts, frame: &MapFrame) -> Result<Option<Layer<'a>>> {
    let footprints = site.footprints;
    let shots: Vec<((f64, f64), f64)> = (0..footprints.len())
        .map(|row| {
            let place = [&footprints.longitude_rad, &footprints.latitude_rad].map(|of| of.at(row));
            let place_m = frame.place_m(place[0], place[1]);
            (place_m, footprints.topography_of_m(row))
        })
        .collect();
    let relief = relief_of_shots(&shots)?;
    Ok(relief.map(|(png, edges_m)| Layer {
        name: "relief".to_owned(),
        title: format!("{} relief", site.config.terms().altimeter),
        place: LayerPlace::Map(edges_m),
        pixels: Pixels::Png(png),
        size: [1, 1],
    }))
}

fn hillshade<'a>(frame: &MapFrame, grid: &HeightGrid) -> Layer<'a> {
    Layer {
        name: "terrain".to_owned(),
        title: "Terrain model, shaded".to_owned(),
        place: LayerPlace::Map(edges_m(frame, grid)),
        pixels: Pixels::Grey(shaded(grid).into(), [1, u8::MAX]),
        size: grid.size,
    }
}

/// Light on every cell, from 1 on; 0 where there is no height.
fn shaded(grid: &HeightGrid) -> Vec<u8> {
    let [rows, columns] = grid.size;
    let [east_m, north_m] = grid.cell_m();
    let height_m = |row: usize, column: usize| {
        let is_inside = row < rows && column < columns;
        let height_m = is_inside.then(|| f64::from(grid.heights_m[row * columns + column]));
        height_m.filter(|height_m| !height_m.is_nan())
    };
    let slope = |ahead: Option<f64>, back: Option<f64>, cell_m: f64| match (ahead, back) {
        (Some(ahead), Some(back)) => (ahead - back) / (2.0 * cell_m),
        _ => 0.0,
    };
    let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let slopes: Vec<Option<[f64; 2]>> = cells
        .map(|(row, column)| {
            height_m(row, column)?;
            let [west, north] = [column, row].map(|at| at.wrapping_sub(1));
            Some([
                slope(height_m(row, column + 1), height_m(row, west), east_m),
                slope(height_m(row + 1, column), height_m(north, column), north_m),
            ])
        })
        .collect();
    let known = || slopes.iter().flatten();
    let squares: f64 = known()
        .map(|[east, south]| east * east + south * south)
        .sum();
    let slope = (squares / known().count().max(1) as f64).sqrt();
    let times = (SLOPE / slope.max(f64::MIN_POSITIVE)).clamp(1.0, EXAGGERATION_MAX);
    let times = round_length_m(times);
    let light = |of: &Option<[f64; 2]>| {
        of.map_or(0, |[east, south]| byte(shade(times * east, times * south)))
    };
    slopes.iter().map(light).collect()
}

/// A share as a brightness from 1 on.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "1 to 255"
)]
fn byte(share: f64) -> u8 {
    (1.0 + 254.0 * share.clamp(0.0, 1.0)).round() as u8
}

fn orthoimage<'a>(
    site: &SiteProducts,
    frame: &MapFrame,
    of: &'a Orthoimage,
    [suffix, when]: [&str; 2],
) -> Layer<'a> {
    let id = &site.images[of.account.image].times.id;
    let (account, look) = (&of.account, &of.account.look);
    let name = format!("{id}_orthoimage{suffix}");
    let title = format!("Orthoimage of {id}{when}");
    on_map(frame, [name, title], (&account.map, &of.brightness), look)
}

fn mosaic_layer<'a>(frame: &MapFrame, of: &'a Mosaic, [suffix, when]: [&str; 2]) -> Layer<'a> {
    let (account, look) = (&of.account, &of.account.look);
    let names = [format!("mosaic{suffix}"), format!("Mosaic{when}")];
    on_map(frame, names, (&account.map, &of.brightness), look)
}

/// A picture of the ground, with the tones of its look.
fn on_map<'a>(
    frame: &MapFrame,
    [name, title]: [String; 2],
    (grid, brightness): (&HeightGrid, &'a Tiles),
    look: &OrthoimageLook,
) -> Layer<'a> {
    Layer {
        name,
        title,
        place: LayerPlace::Map(edges_m(frame, grid)),
        pixels: Pixels::Tiles(brightness, stretch(&look.brightness)),
        size: grid.size,
    }
}

fn strip<'a>(site: &SiteProducts, shown: &'a ShownImage) -> Layer<'a> {
    let look: &QuickLook = shown.view.as_ref().unwrap_or(&shown.quick_look);
    let id = &site.images[shown.image].times.id;
    Layer {
        name: format!("{id}_image"),
        title: id.clone(),
        place: LayerPlace::Image {
            image: shown.image,
            reduction: look.reduction,
        },
        pixels: Pixels::Grey(look.pixels.as_slice().into(), look.range_dn),
        size: [look.height as usize, look.width as usize],
    }
}

/// West, south, east and north edge of a grid on the map, metres.
fn edges_m(frame: &MapFrame, grid: &HeightGrid) -> [f64; 4] {
    let [west_rad, south_rad, east_rad, north_rad] = grid.edges_rad();
    let (west_m, south_m) = frame.place_m(west_rad, south_rad);
    let (east_m, north_m) = frame.place_m(east_rad, north_rad);
    [west_m, south_m, east_m, north_m]
}

/// Brightnesses to be shown as black and as white.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a place among the cells"
)]
fn stretch(brightness: &[u8]) -> [u8; 2] {
    let mut known: Vec<u8> = brightness.iter().copied().filter(|of| *of > 0).collect();
    known.sort_unstable();
    let last = known.len().saturating_sub(1);
    let clipped = (CLIPPED * last as f64) as usize;
    let at = |place: usize, otherwise: u8| known.get(place).copied().unwrap_or(otherwise);
    [at(clipped, 1), at(last.saturating_sub(clipped), u8::MAX)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(size: [usize; 2], pixels: &[u8]) -> Layer<'_> {
        Layer {
            name: "a".to_owned(),
            title: String::new(),
            place: LayerPlace::Map([0.0; 4]),
            pixels: Pixels::Grey(pixels.into(), [1, 255]),
            size,
        }
    }

    #[test]
    fn a_large_layer_has_an_overview_and_the_tiles_with_pixels() {
        let size = [TILE + 5, TILE + 3];
        let mut pixels = vec![0; size[0] * size[1]];
        pixels[0] = 9;
        *pixels.last_mut().unwrap() = 9;
        let parts = layer(size, &pixels).parts();
        let files: Vec<&str> = parts.iter().map(|part| &*part.file).collect();
        assert_eq!(files, ["a.png", "a_0_0.png", "a_1_1.png"]);
        assert_eq!(
            (parts[2].rows, parts[2].columns),
            ([TILE, size[0]], [TILE, size[1]])
        );
        assert_eq!(parts[0].step, 3);
        assert_eq!(layer([2, 2], &[0; 4]).parts().len(), 1);
    }

    #[test]
    fn ground_that_faces_the_light_is_brighter_and_holes_stay_empty() {
        let heights_m = |slope: f32| -> Vec<f32> {
            let cells = (0..25_u8).map(|cell| slope * f32::from(cell % 5));
            cells.collect()
        };
        let grid = |heights_m: Vec<f32>| HeightGrid {
            size: [5, 5],
            first_rad: [0.0; 2],
            cell_rad: [1e-3; 2],
            radius_m: 1e4,
            heights_m,
        };
        let mut rising = heights_m(5.0);
        rising[0] = f32::NAN;
        // It rises towards the east, and the light is in the north-west.
        let (rising, falling) = (shaded(&grid(rising)), shaded(&grid(heights_m(-5.0))));
        assert_eq!(rising[0], 0);
        assert!(rising[12] > falling[12], "{} {}", rising[12], falling[12]);
    }
}
