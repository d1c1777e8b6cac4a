//! Offsets between the orthoimages of overlapping images: what is left of errors of orientation and of heights between two
//! images, measured on their pixels.
//!
//! Both orthoimages show the same ground on the same cells. A square of the first is searched in the second by normalised
//! cross-correlation at whole cells, around the shift at which the complete orthoimages, reduced, correlate best; least-squares
//! matching, which maximises the same correlation between cells, gives the offset and its standard deviation. Squares lie on
//! an even grid, without overlap. Where the window around that shift is large (`coarse.rs`), it is searched in reduced orthoimages
//! first, and completely where these do not decide.
//!
//! No offset takes part in what made the orthoimages. Their orientation may come from tie points matched in the same
//! images; these are measured in images, not in orthoimages, and at other places.
//!
//! # Source
//! Lewis 1995, *Fast normalized cross-correlation*; Förstner 1982 and Gruen 1985 for least-squares matching.

#![allow(
    clippy::cast_possible_wrap,
    reason = "numbers of cells of a map are far below 2⁶³"
)]

mod coarse;
mod shift;

use std::{collections::BTreeSet, sync::atomic::AtomicBool};

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    raster::Raster,
    rectify_images::{Orthoimage, OrthoimageAccount},
};
use areograph_base::{error::Result, watch::Watch};
use areograph_geom::{
    imaging::{Affine, Patch, match_least_squares, search},
    statistics::Summary,
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

use coarse::{Levels, NEAR};
use shift::{Shift, shift};

/// Half the edge of a compared square, cells, and its edge.
const HALF: u32 = 16;
/// Edge of a compared square, cells.
pub(crate) const EDGE: u32 = 2 * HALF + 1;
/// Room around the shift of the complete orthoimages, cells, besides the edge of a reduced cell.
const ROOM: u32 = 12;
/// Number of places beyond which they are farther apart than the edge of a square.
const PLACES: usize = 2_000;
/// Least correlation of a place.
const CORRELATION_MIN: f64 = 0.7;
/// Least difference of the correlation from that of another peak.
const DISTINCT: f64 = 0.1;
/// Share of the squares that match by chance: no more of them are trusted.
const CHANCE: f64 = 0.25;
/// Largest distance of an offset from the median of all: robust standard deviations, and cells in addition.
const SCATTER_MAX: [f64; 2] = [6.0, 2.0];
/// Largest distance of the final position from the best whole cell, along an axis.
const MOVED_MAX: f64 = 1.5;

stage_inputs! {
    /// The orthoimages of one orientation.
    pub struct CompareOrthoimages<'a> {
        /// Their orientation.
        pub round: Round,
        /// The orthoimages.
        pub orthoimages: &'a Output<Vec<Orthoimage>>,
    }
}

/// Offsets of the second orthoimage of a pair against the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrthoimageOffsets {
    /// Indices of the images.
    pub images: [usize; 2],
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// Number of squares that both orthoimages contain.
    pub squares: u32,
    /// The places where they match.
    pub places: Vec<PlaceOffset>,
}

/// The offset at a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlaceOffset {
    /// Row and column of its cell in the first orthoimage, southwards and eastwards from 0° E 0° N.
    pub cell: [i64; 2],
    /// East longitude and latitude there, radians.
    pub place_rad: [f64; 2],
    /// Position of the ground in the second orthoimage minus that in the first, east and north, metres.
    pub offset_m: [f64; 2],
    /// Standard deviations of the match, east and north, metres.
    pub sigma_m: [f64; 2],
    /// Correlation of the two squares.
    pub correlation: f64,
}

impl OrthoimageOffsets {
    /// Those of the second orthoimage against the first; `None` where they have no square in common.
    #[must_use]
    pub(crate) fn between(first: &Orthoimage, second: &Orthoimage) -> Option<Self> {
        offsets(first, second)
    }

    /// Root mean square offset, both axes together, metres; `None` without a place.
    #[must_use]
    pub fn rms_m(&self) -> Option<f64> {
        let squares_m2 = self.places.iter().map(|of| {
            let [east_m, north_m] = of.offset_m;
            east_m * east_m + north_m * north_m
        });
        let count = self.places.len() as f64;
        (!self.places.is_empty()).then(|| (squares_m2.sum::<f64>() / count).sqrt())
    }

    /// Its cells of places.
    #[must_use]
    pub fn cells(&self) -> BTreeSet<[i64; 2]> {
        self.places.iter().map(|of| of.cell).collect()
    }

    /// Its offsets in these cells.
    #[must_use]
    pub fn in_cells(&self, cells: &BTreeSet<[i64; 2]>) -> Self {
        let places = self.places.iter().filter(|of| cells.contains(&of.cell));
        Self {
            places: places.copied().collect(),
            ..*self
        }
    }

    /// Statistics of the offsets, east and north, metres.
    #[must_use]
    pub fn summaries_m(&self) -> [Summary; 2] {
        [0, 1].map(|axis| Summary::over(|| self.places.iter().map(move |of| of.offset_m[axis])))
    }
}

impl Stage for CompareOrthoimages<'_> {
    const NAME: &'static str = "compare_orthoimages";
    const METHOD: u32 = 2;
    type Output = Vec<OrthoimageOffsets>;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Vec<OrthoimageOffsets>> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Vec<OrthoimageOffsets>> {
        let orthoimages = self.orthoimages.value()?;
        let mut pairs = Vec::new();
        for (at, first) in orthoimages.iter().enumerate() {
            for second in &orthoimages[at + 1..] {
                watch.check()?;
                pairs.extend(offsets(first, second));
            }
        }
        Ok(pairs)
    }
}

/// Offsets of the second orthoimage against the first; `None` where they have no square in common.
fn offsets(first: &Orthoimage, second: &Orthoimage) -> Option<OrthoimageOffsets> {
    let cells = [first, second].map(|of| of.brightness.bytes());
    let [one, other] = [(first, &cells[0]), (second, &cells[1])]
        .map(|(of, cells)| Raster::of(&of.account.map, cells));
    let shift = shift(&one, &other, first.account.cell_m)?;
    let levels = Levels::of([&one, &other], ROOM + shift.factor);
    let pair = Pair {
        account: &first.account,
        one,
        other,
    };
    let middles = middles(&pair.one);
    let found: Vec<Option<Found>> = middles
        .par_iter()
        .map(|middle| pair.found(*middle, &shift, &levels))
        .collect();
    let squares = found.iter().flatten().count();
    let mut offsets = OrthoimageOffsets {
        images: [first, second].map(|of| of.account.image),
        cell_m: first.account.cell_m,
        squares: u32::try_from(squares).unwrap_or(u32::MAX),
        places: found.into_iter().flatten().flatten().collect(),
    };
    offsets.leave_out_mismatches();
    (squares > 0).then_some(offsets)
}

impl OrthoimageOffsets {
    /// Leaves out places whose offsets contradict the others, and all of them where so few match that chance may explain them.
    fn leave_out_mismatches(&mut self) {
        let summaries_m = self.summaries_m();
        let [sigmas, cells] = SCATTER_MAX;
        let cells_m = cells * self.cell_m;
        self.places.retain(|of| {
            let axes = summaries_m.iter().zip(of.offset_m);
            let mut near = axes.map(|(all, offset_m)| {
                (offset_m - all.median).abs() <= sigmas * all.nmad + cells_m
            });
            near.all(|is_near| is_near)
        });
        if (self.places.len() as f64) < CHANCE * f64::from(self.squares) {
            self.places.clear();
        }
    }
}

/// Cells in the middle of squares. The grid is that of all orthoimages of about this size, so that places before and after the
/// adjustment are the same.
fn middles(raster: &Raster<'_>) -> Vec<[i64; 2]> {
    let filled = raster.pixels.iter().filter(|pixel| **pixel > 0).count();
    let mut step = EDGE as usize;
    while filled / (step * step) > PLACES {
        step *= 2;
    }
    let axis = |of: usize| {
        let (first, size) = (raster.first[of], raster.size[of]);
        let to_first = first.rem_euclid(step as i64);
        let start = (step as i64 - to_first) % step as i64;
        (start..size as i64).step_by(step).map(move |at| first + at)
    };
    axis(0)
        .flat_map(|row| axis(1).map(move |column| [row, column]))
        .collect()
}

/// The offset of a square in both orthoimages; `None` in it where it does not match.
type Found = Option<PlaceOffset>;

/// Two orthoimages.
struct Pair<'a> {
    /// Of the first.
    account: &'a OrthoimageAccount,
    one: Raster<'a>,
    other: Raster<'a>,
}

impl Pair<'_> {
    /// What is found at a place; `None` where an orthoimage lacks a cell.
    fn found(&self, middle: [i64; 2], shift: &Shift, levels: &Levels) -> Option<Found> {
        let reach = ROOM + shift.factor;
        let template = self
            .one
            .square(middle.map(|at| at - i64::from(HALF)), EDGE)?;
        let corner = [0, 1].map(|axis| middle[axis] + shift.by[axis] - i64::from(HALF + reach));
        if !self.other.is_filled(corner, EDGE + 2 * reach) {
            return None;
        }
        let near = levels.near(middle, shift.by, reach);
        let near = near.and_then(|by| self.matched(&template, middle, by, NEAR));
        Some(near.or_else(|| self.matched(&template, middle, shift.by, reach)))
    }

    /// The offset of a square, searched within `reach` cells around the shift `by`.
    fn matched(
        &self,
        template: &Patch,
        middle: [i64; 2],
        by: [i64; 2],
        reach: u32,
    ) -> Option<PlaceOffset> {
        let corner = [0, 1].map(|axis| middle[axis] + by[axis] - i64::from(HALF + reach));
        let area = self.other.square(corner, EDGE + 2 * reach)?;
        let peak = search(template, &area)?;
        let inside = 1..2 * reach as usize;
        let is_found = peak.at.iter().all(|at| inside.contains(at))
            && peak.correlation - peak.second >= DISTINCT;
        if !is_found {
            return None;
        }
        let from = template.middle();
        let whole =
            Vector2::from_fn(|axis, _| (by[axis] + peak.at[axis] as i64 - i64::from(reach)) as f64);
        let start = Affine {
            from,
            to: from + whole,
            matrix: Matrix2::identity(),
        };
        let matched = match_least_squares(template, &area, &start).ok()?;
        let by = matched.affine.to - from;
        let is_near = (by - whole).amax() <= MOVED_MAX;
        if !is_near || matched.correlation < CORRELATION_MIN {
            return None;
        }
        let [east_m, north_m] = self.account.map.cell_m();
        let variances = matched.covariance_px2.diagonal();
        let here = [0, 1].map(|axis| (middle[axis] - self.one.first[axis]) as f64);
        Some(PlaceOffset {
            cell: middle,
            place_rad: self.account.map.place_rad(here),
            // Rows count southwards.
            offset_m: [by.y * east_m, -by.x * north_m],
            sigma_m: [variances.y.sqrt() * east_m, variances.x.sqrt() * north_m],
            correlation: matched.correlation,
        })
    }
}

#[cfg(test)]
mod tests;
