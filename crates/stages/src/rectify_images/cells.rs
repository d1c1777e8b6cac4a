//! The cells of an orthoimage, and their brightness tile by tile.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{CELLS_MAX, RectifyError, sight_lines::SightLines};
use crate::{
    ground::{Ground, Sight, Tile},
    image_view::View,
    map_surface::SurfaceModel,
};
use areograph_base::{
    column::{self, TILE, Tiles},
    error::Result,
    watch::Watch,
};
use areograph_geom::{ellipsoid::spherical_to_xyz_m, height_grid::HeightGrid};

/// Pixels around a place that its brightness needs, and some room.
const ROOM_PX: f64 = 3.0;
/// Distance of a place from the edge of the image within which its brightness is not known, pixels.
const EDGE_PX: f64 = 2.0;

/// Cells of an orthoimage, on the map of the terrain model.
pub(super) struct Cells {
    ground: Ground,
    /// Halvings of the image after which a pixel is not larger than a cell.
    halvings: usize,
}

/// Brightness of all cells.
pub(super) struct Brightness {
    /// 0 where there is none.
    pub(super) cells: Tiles,
    /// Number of cells with a brightness.
    pub(super) filled: u32,
    /// Number of cells on ground inside the image whose pixels are missing.
    pub(super) without_pixels: u32,
}

/// Brightness of the cells of a tile.
struct OfTile {
    /// Row by row; 0 where there is none.
    pixels: Vec<u8>,
    without_pixels: u32,
}

impl Cells {
    /// Cells of this edge over the part of the terrain model that the image shows; `None` where it shows nothing.
    ///
    /// # Errors
    /// [`RectifyError::TooLarge`].
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "few halvings"
    )]
    pub(super) fn of(
        view: &View<'_>,
        model: &SurfaceModel,
        sight_lines: &SightLines,
        cell_m: f64,
    ) -> std::result::Result<Option<Self>, RectifyError> {
        let shown = &sight_lines.shown;
        let columns = shown.size[1];
        let heights = shown.heights_m.iter().enumerate();
        let known = heights.filter(|(_, height_m)| !height_m.is_nan());
        let places_m = known.map(|(at, height_m)| {
            let [longitude_rad, latitude_rad] =
                shown.place_rad([(at / columns) as f64, (at % columns) as f64]);
            let radius_m = shown.radius_m + f64::from(*height_m);
            spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m)
        });
        let places_m: Vec<Vector3<f64>> = places_m.collect();
        let ground = Ground::over_at(
            [shown.middle_rad()[0], model.parallel_rad],
            shown.radius_m,
            &places_m,
            cell_m,
        );
        let Some(ground) = ground else {
            return Ok(None);
        };
        let cells = ground.size[0].saturating_mul(ground.size[1]);
        if cells > CELLS_MAX {
            let image = view.camera.id.clone();
            return Err(RectifyError::TooLarge {
                image,
                cell_m,
                cells,
            });
        }
        let halvings = (cell_m / sight_lines.pixel_m).log2().max(0.0) as usize;
        Ok(Some(Self {
            ground,
            halvings: halvings.min(view.pixels.halvings()),
        }))
    }

    /// The cells as a grid without heights.
    pub(super) fn map(&self) -> HeightGrid {
        self.ground.height_grid(Vec::new())
    }

    /// Brightness of every cell.
    ///
    /// # Errors
    /// The system's refusal to read the image's temporary file; a stop.
    pub(super) fn brightness(
        &self,
        view: &View<'_>,
        sight_lines: &SightLines,
        watch: Watch<'_>,
    ) -> Result<Brightness> {
        let size = self.ground.size;
        let map = self.map();
        let tiles = Tile::all(size, TILE, 1, 0);
        watch.announce(tiles.len());
        let made = tiles.par_iter().map(|tile| {
            watch.check()?;
            let found = self.of_tile(view, &sight_lines.shown, &map, tile)?;
            watch.step(1, "tiles");
            let filled = found.pixels.iter().filter(|pixel| **pixel > 0).count();
            let counts = [filled, found.without_pixels as usize];
            Ok((column::Tile::of(found.pixels), counts))
        });
        let (tiles, counts): (Vec<column::Tile>, Vec<[usize; 2]>) =
            made.collect::<Result<Vec<_>>>()?.into_iter().unzip();
        let sum = |of: usize| {
            let sum: usize = counts.iter().map(|counts| counts[of]).sum();
            u32::try_from(sum).unwrap_or(u32::MAX)
        };
        Ok(Brightness {
            cells: Tiles::of_tiles(size, tiles),
            filled: sum(0),
            without_pixels: sum(1),
        })
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "the edges are near the few pixels of a tile, or far from all of them"
    )]
    fn of_tile(
        &self,
        view: &View<'_>,
        shown: &HeightGrid,
        map: &HeightGrid,
        tile: &Tile,
    ) -> Result<OfTile> {
        let mut found = OfTile {
            pixels: vec![0; tile.size[0] * tile.size[1]],
            without_pixels: 0,
        };
        let heights_m = heights_m(shown, map, tile);
        let scale = (1_u64 << self.halvings) as f64;
        let has_heights = heights_m.iter().any(|height_m| !height_m.is_nan());
        let sight =
            has_heights.then(|| Sight::of(view, scale, (&self.ground, 1), tile, (&heights_m, 0.0)));
        let Some(sight) = sight.flatten() else {
            return Ok(found);
        };
        let [lines, samples] = sight.spans_px(&heights_m, 0.0, ROOM_PX, tile);
        let patch = view
            .pixels
            .window_with_gaps(self.halvings, [&lines, &samples])?;
        let inside = [0, 1].map(|axis| {
            let first = patch.first[axis] as f64 + 0.5;
            let end = sight.size_px[axis] - EDGE_PX;
            [EDGE_PX - first, end - first].map(|edge| edge as f32)
        });
        let width = tile.size[1];
        let mut places = [vec![0.0; width], vec![0.0; width]];
        let mut numbers = vec![0.0; width];
        let OfTile {
            pixels,
            without_pixels,
        } = &mut found;
        let of_lines = heights_m
            .chunks_exact(width)
            .zip(pixels.chunks_exact_mut(width));
        for (line, (heights_m, pixels)) in of_lines.enumerate() {
            let [lines, samples] = &mut places;
            sight.places_px(line, (heights_m, 0.0), patch.first, [lines, samples]);
            patch.numbers([lines, samples], &mut numbers);
            let shown = numbers.iter().zip(lines.iter().zip(samples.iter()));
            for (pixel, (number, (line, sample))) in pixels.iter_mut().zip(shown) {
                // NaN, where there is no height, is not inside.
                let is_inside = [(line, inside[0]), (sample, inside[1])]
                    .into_iter()
                    .all(|(at, [start, end])| *at >= start && *at <= end);
                match (is_inside, number.is_nan()) {
                    (false, _) => {}
                    (true, true) => *without_pixels += 1,
                    (true, false) => *pixel = byte(*number),
                }
            }
        }
        Ok(found)
    }
}

/// Heights of the cells of a tile, NaN where there is none.
#[allow(
    clippy::cast_possible_truncation,
    reason = "planetary heights keep millimetre precision"
)]
fn heights_m(shown: &HeightGrid, map: &HeightGrid, tile: &Tile) -> Vec<f32> {
    let mut heights_m = Vec::with_capacity(tile.size[0] * tile.size[1]);
    for line in 0..tile.size[0] {
        for sample in 0..tile.size[1] {
            let [longitude_rad, latitude_rad] = map.place_rad(tile.cell_of([line, sample], 1));
            let height_m = shown.height_m(shown.cell_of(longitude_rad, latitude_rad));
            heights_m.push(height_m.map_or(f32::NAN, |height_m| height_m as f32));
        }
    }
    heights_m
}

/// The nearest brightness above 0, which means none.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the range of a byte"
)]
fn byte(number: f32) -> u8 {
    number.round().clamp(1.0, 255.0) as u8
}
