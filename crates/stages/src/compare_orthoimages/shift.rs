//! The shift at which two complete orthoimages, reduced, correlate best: where places are searched.

use rayon::prelude::*;

use crate::raster::Raster;

/// Largest shift of two orthoimages, metres: errors of kernels reach some hundred metres.
const REACH_M: f64 = 1_000.0;
/// Largest shift in reduced cells, and largest number of these.
const REACH: f64 = 32.0;
const REDUCED: f64 = 250_000.0;
/// Smallest share of the cells of the smaller orthoimage that both contain.
const SHARE: f64 = 0.25;

/// Shift of the second orthoimage.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shift {
    /// Cells southwards and eastwards.
    pub(super) by: [i64; 2],
    /// Edge of a reduced cell, cells.
    pub(super) factor: u32,
}

/// The shift of `other` against `one`; `None` where they have too little ground in common.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers of cells"
)]
pub(super) fn shift(one: &Raster<'_>, other: &Raster<'_>, cell_m: f64) -> Option<Shift> {
    let cells = one.pixels.len().max(other.pixels.len());
    let of_reach = (REACH_M / cell_m / REACH).ceil() as u32;
    let of_size = (cells as f64 / REDUCED).sqrt().ceil() as u32;
    let factor = of_reach.max(of_size).max(1);
    let reach = (REACH_M / cell_m / f64::from(factor)).ceil() as i64;
    let [one, other] = [one, other].map(|of| of.reduced(factor));
    let least = SHARE * one.known().min(other.known()) as f64;
    let shifts = (-reach..=reach).flat_map(|row| (-reach..=reach).map(move |column| [row, column]));
    let shifts: Vec<[i64; 2]> = shifts.collect();
    let tried = shifts.into_par_iter().map(|by| {
        let (common, correlation) = one.correlation(&other, by);
        (by, common, correlation)
    });
    let tried: Vec<([i64; 2], usize, f64)> = tried.collect();
    let admitted = tried
        .iter()
        .filter(|(_, common, _)| *common > 0 && *common as f64 >= least);
    let best = admitted.max_by(|one, other| one.2.total_cmp(&other.2))?;
    Some(Shift {
        by: best.0.map(|of| of * i64::from(factor)),
        factor,
    })
}
