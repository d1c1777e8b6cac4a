//! An orthoimage whose brightness a function states: input of tests.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "cells of a small grid, and the brightness of a byte"
)]

use crate::{
    look::OrthoimageLook,
    rectify_images::{Orthoimage, OrthoimageAccount},
};
use areograph_base::column::Tiles;
use areograph_geom::height_grid::HeightGrid;

pub(crate) const RADIUS_M: f64 = 3_396_190.0;
/// Edge of a cell, metres.
pub(crate) const CELL_M: f64 = 5.0;

/// An orthoimage with these first cell and size, by the brightness of its cells.
pub(crate) fn orthoimage(
    image: usize,
    first: [i64; 2],
    size: [usize; 2],
    brightness: impl Fn([i64; 2]) -> f64,
) -> Orthoimage {
    let cell_rad = CELL_M / RADIUS_M;
    let map = HeightGrid {
        size,
        first_rad: [first[1] as f64 + 0.5, -(first[0] as f64 + 0.5)].map(|at| at * cell_rad),
        cell_rad: [cell_rad; 2],
        radius_m: RADIUS_M,
        heights_m: Vec::new(),
    };
    let cells =
        (0..size[0] as i64).flat_map(|row| (0..size[1] as i64).map(move |column| [row, column]));
    let brightness =
        cells.map(|cell| brightness([0, 1].map(|axis| first[axis] + cell[axis])) as u8);
    let brightness = Tiles::of(size, &brightness.collect::<Vec<u8>>());
    Orthoimage {
        account: OrthoimageAccount {
            image,
            look: OrthoimageLook::of(&brightness),
            map,
            parallel_rad: 0.0,
            cell_m: CELL_M,
            pixel_m: CELL_M,
            filled: 0,
            without_pixels: 0,
            terrain_cells: 0,
            interpolated: 0,
            hidden: 0,
            sigma_m: 1.0,
            jitter_m: None,
            drift_m: None,
            shared_sigma_m: None,
            image_sigma_m: None,
        },
        brightness,
        sigmas_m: Vec::new(),
    }
}
