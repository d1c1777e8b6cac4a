//! A picture on the cells of the map.

use nalgebra::Vector2;
use rayon::prelude::*;

use super::{
    PLANE_RADIUS_M,
    images::{PictureImage, PicturesError},
};
use crate::{
    look::OrthoimageLook,
    rectify_images::{Orthoimage, OrthoimageAccount},
    triangulate::Triangulation,
};
use areograph_base::{
    column::{Tile, Tiles, spans},
    error::Result,
    watch::Watch,
};
use areograph_config::YAxis;
use areograph_geom::{
    height_grid::HeightGrid,
    plane::{Place, Similarity},
};
use areograph_pds::pixel_file::Pyramid;

/// Pixels around a place that its brightness needs, and some room.
const ROOM_PX: f64 = 3.0;

/// The image of a picture, and its place on the map.
pub(super) struct View {
    pixels: Pyramid,
    /// From the coordinates of the picture, y upwards, to the map.
    to_map: Similarity,
    /// Outer corner of the first pixel in these coordinates, and edge of a pixel.
    corner: Place,
    pixel_units: f64,
    /// Edge of a pixel on the map, metres.
    pub(super) pixel_m: f64,
}

impl View {
    /// The place of an image by the triangulation.
    ///
    /// # Errors
    /// A picture that is not in the net; a point outside its image.
    pub(super) fn of(
        image: &PictureImage,
        pixels: Pyramid,
        net: &Triangulation,
        y_axis: YAxis,
    ) -> std::result::Result<Self, PicturesError> {
        let picture = || image.picture.clone();
        let found = net.pictures.iter().find(|of| of.picture == image.picture);
        let found = found.ok_or_else(|| PicturesError::NotInNet { picture: picture() })?;
        let [p, q, a, b] = found.coefficients;
        let to_map = Similarity {
            turn: Place::new(p, q),
            shift: Place::new(a, b),
        };
        let pixel_units = image.pixel_units;
        let height = pixels.size(0)[0] as f64 * pixel_units;
        let corner = match (image.corner, y_axis) {
            (Some(corner), YAxis::Up) => corner,
            (Some(corner), YAxis::Down) => corner.conj(),
            (None, YAxis::Up) => Place::new(0.0, height),
            (None, YAxis::Down) => Place::new(0.0, 0.0),
        };
        let view = Self {
            pixels,
            pixel_m: to_map.scale() * pixel_units,
            to_map,
            corner,
            pixel_units,
        };
        let [lines, samples] = view.pixels.size(0);
        let own = net.measurements.iter();
        // A blunder may lie anywhere.
        for of in own.filter(|of| of.picture == image.picture && !of.removed) {
            let [x, y] = of.at;
            let place = view.within(Place::new(x, y));
            let size = Vector2::from(view.size_px());
            if place.min() < 0.0 || (size - place).min() < 0.0 {
                return Err(PicturesError::Outside {
                    picture: picture(),
                    point: of.point.clone(),
                    line: place.x,
                    sample: place.y,
                    lines,
                    samples,
                });
            }
        }
        Ok(view)
    }

    /// Lines and samples.
    pub(super) fn size_px(&self) -> [f64; 2] {
        self.pixels.size(0).map(|of| of as f64)
    }

    /// Line and sample, 0 at the outer edge of the first pixel, of a place of the map.
    pub(super) fn pixel(&self, place_m: Place) -> Vector2<f64> {
        self.within((place_m - self.to_map.shift) / self.to_map.turn)
    }

    /// Line and sample of a place of the picture, y upwards.
    fn within(&self, at: Place) -> Vector2<f64> {
        let from = at - self.corner;
        Vector2::new(-from.im, from.re) / self.pixel_units
    }

    /// The first cell and the end of the cells that contain the image: rows southwards, columns eastwards, from the origin of the map.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a cast from floating point saturates, and such a map is refused"
    )]
    pub(super) fn span(&self, cell_m: f64) -> [[i64; 2]; 2] {
        let [lines, samples] = self.size_px();
        let corners = [[0.0, 0.0], [0.0, samples], [lines, 0.0], [lines, samples]];
        let places = corners.map(|[line, sample]| {
            let at = self.corner + Place::new(sample, -line) * self.pixel_units;
            let place_m = self.to_map.map(at);
            [-place_m.im, place_m.re].map(|of| of / cell_m)
        });
        let ends = [0, 1].map(|axis| {
            let along = places.map(|place| place[axis]);
            let least = along.into_iter().fold(f64::INFINITY, f64::min);
            let most = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
            [least.floor() as i64, most.ceil() as i64]
        });
        [0, 1].map(|end| [0, 1].map(|axis| ends[axis][end]))
    }

    /// The picture on the cells of the map; `None` where no cell has a brightness.
    ///
    /// # Errors
    /// The system's refusal to read the image's temporary file; a stop.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the caller limits the number of cells; few halvings"
    )]
    pub(super) fn rectified(
        &self,
        index: usize,
        cell_m: f64,
        watch: Watch<'_>,
    ) -> Result<Option<Orthoimage>> {
        let [first, end] = self.span(cell_m);
        let size = [0, 1].map(|axis| end[axis].abs_diff(first[axis]) as usize);
        let halvings = (cell_m / self.pixel_m).log2().max(0.0) as usize;
        let level = halvings.min(self.pixels.halvings());
        let made = spans(size).into_par_iter().map(|[rows, columns]| {
            watch.check()?;
            let cells = |row: usize, column: usize| {
                let row = (first[0] as f64 + row as f64 + 0.5) * cell_m;
                let column = (first[1] as f64 + column as f64 + 0.5) * cell_m;
                self.pixel(Place::new(column, -row)) / (1_u64 << level) as f64
            };
            let mut pixels = vec![0; rows.len() * columns.len()];
            let corners = [rows.start, rows.end - 1]
                .map(|row| [columns.start, columns.end - 1].map(|column| cells(row, column)));
            let corners = corners.concat();
            let least = corners.iter().fold(corners[0], |of, next| of.inf(next));
            let most = corners.iter().fold(corners[0], |of, next| of.sup(next));
            // A cast from floating point saturates.
            let span = |axis: usize| {
                let start = (least[axis] - ROOM_PX).max(0.0) as usize;
                start..((most[axis] + ROOM_PX).max(0.0) as usize).max(start)
            };
            let (lines, samples) = (span(0), span(1));
            let patch = self.pixels.window_with_gaps(level, [&lines, &samples])?;
            if !patch.values.is_empty() {
                let from = patch.first.map(|of| of as f64 + 0.5);
                let mut places = [vec![0.0; columns.len()], vec![0.0; columns.len()]];
                let mut numbers = vec![0.0; columns.len()];
                let of_rows = pixels.chunks_exact_mut(columns.len());
                for (row, pixels) in rows.clone().zip(of_rows) {
                    for (at, column) in columns.clone().enumerate() {
                        let place = cells(row, column);
                        for axis in 0..2 {
                            places[axis][at] = (place[axis] - from[axis]) as f32;
                        }
                    }
                    let [lines, samples] = &places;
                    patch.numbers([lines, samples], &mut numbers);
                    for (pixel, number) in pixels.iter_mut().zip(&numbers) {
                        if !number.is_nan() {
                            *pixel = number.round().clamp(1.0, 255.0) as u8;
                        }
                    }
                }
            }
            Ok(Tile::of(pixels))
        });
        let tiles: Vec<Tile> = made.collect::<Result<_>>()?;
        let brightness = Tiles::of_tiles(size, tiles);
        let filled: u64 = brightness.counts()[1..].iter().sum();
        if filled == 0 {
            return Ok(None);
        }
        let first_m = [first[1] as f64 + 0.5, -(first[0] as f64 + 0.5)].map(|of| of * cell_m);
        let map = HeightGrid {
            size,
            first_rad: first_m.map(|of| of / PLANE_RADIUS_M),
            cell_rad: [cell_m / PLANE_RADIUS_M; 2],
            radius_m: PLANE_RADIUS_M,
            heights_m: Vec::new(),
        };
        Ok(Some(Orthoimage {
            account: OrthoimageAccount {
                image: index,
                map,
                parallel_rad: 0.0,
                cell_m,
                pixel_m: self.pixel_m,
                filled: u32::try_from(filled).unwrap_or(u32::MAX),
                without_pixels: 0,
                terrain_cells: 0,
                interpolated: 0,
                hidden: 0,
                sigma_m: 0.0,
                jitter_m: None,
                drift_m: None,
                shared_sigma_m: None,
                image_sigma_m: None,
                look: OrthoimageLook::of(&brightness),
            },
            brightness,
            sigmas_m: Vec::new(),
        }))
    }
}
