//! One terrain model of a site from the models of its pairs.
//!
//! Every model has its own offset: errors of the orientations of its images. Offsets follow by least squares from the
//! differences in the overlaps and from the altimeter, without a change of the mean level, which the adjustment
//! determines. In a cell with several heights, their mean has weights by their variances. Its standard deviation contains
//! the covariances of the heights: pairs with a common image have its errors of matching and jitter in common, with the opposite
//! sign if it lies between the others; all pairs share the smoothing of the ground by the compared square, and the offsets are correlated. The error that all heights
//! of the site share is not part of it.

mod lattice;
mod offsets;

#[cfg(test)]
mod tests;

use std::{
    cmp::Reverse,
    sync::atomic::{AtomicBool, Ordering},
};

use self::{
    lattice::{Lattice, OnLattice},
    offsets::{Difference, Known, Levels, Offset},
};
use super::{
    convert_datum::Converted,
    group_profiles::Profile,
    map_surface::{
        JoinedPair, Joint, LOOK, MapSurface, SHOTS_MIN, Seam, ShotComparison, Surface,
        SurfaceAccount, SurfaceModel,
    },
};
use areograph_base::error::{Cause, Result, Stopped};
use areograph_config::MolaSurfaceConfig;
use areograph_geom::{height_grid::HeightGrid, statistics::Summary};
use areograph_store::{
    stage::{Called, InOrder, Output, Stage, called},
    stage_inputs,
};
use nalgebra::{DMatrix, Vector3};

/// Share of the variance of matching and jitter that each image of a pair has.
const OF_COMMON_IMAGE: f64 = 0.5;
/// Pairs that a layer of contributing pairs can identify.
const PAIRS_MAX: usize = 32;

stage_inputs! {
    /// Terrain models of all pairs, and the shots.
    pub struct JoinSurfaces<'a> {
        /// The models.
        pub surfaces: InOrder<'a, Output<Surface>>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Uncertainties of shots.
        pub laser_surface: &'a MolaSurfaceConfig,
    }
}

/// Models that cannot be joined.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum JoinError {
    #[error("no pair of images gives a terrain model")]
    #[cause(
        "check the kernels and times of the images, that two of them show the same ground, and that surface.cell_m suits \
         their pixels; name two images in surface.images for the reason"
    )]
    Nothing,
    #[error(
        "the offsets of the terrain models are not determined: a height or a standard deviation is not finite"
    )]
    #[cause(Bug: "report this with the configuration of the site and the log")]
    Undetermined,
    #[error("the terrain models of all pairs cover {cells} cells; expected at most {}", 1 << 24)]
    #[cause("increase surface.cell_m, or name two images in surface.images")]
    TooLarge { cells: usize },
}

impl Stage for JoinSurfaces<'_> {
    const NAME: &'static str = "join_surfaces";
    const METHOD: u32 = 1;
    const CALLS: &'static [Called] = &[called::<MapSurface<'_>>()];
    type Output = Surface;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<Surface> {
        let surfaces = self.surfaces.0.iter().map(Output::value);
        let surfaces: Vec<&Surface> = surfaces.collect::<Result<_>>()?;
        let mut joined = joined(&surfaces, stop)?;
        Stopped::check(stop)?;
        if joined.account.is_refused {
            return Ok(joined);
        }
        let footprints = &self.converted.value()?.footprints;
        let options = self.laser_surface.options(footprints.body);
        let profiles = self.profiles.value()?;
        let account = &mut joined.account;
        account.reference = joined.model.reference(footprints);
        account.shots = ShotComparison::of(&joined.model, footprints, profiles, &options);
        Ok(joined)
    }
}

/// A model with what is needed of its pair.
struct Part<'a> {
    account: &'a SurfaceAccount,
    cells: OnLattice,
}

/// The joined model, without shots and areoid; incomplete if `stop` is set.
fn joined(surfaces: &[&Surface], stop: &AtomicBool) -> std::result::Result<Surface, JoinError> {
    let mut used: Vec<usize> = (0..surfaces.len())
        .filter(|index| !surfaces[*index].account.is_refused)
        .collect();
    // The pairs with most heights, in their order.
    used.sort_by_key(|index| Reverse(surfaces[*index].account.filled));
    used.truncate(PAIRS_MAX);
    used.sort_unstable();
    if used.is_empty() {
        return withheld(surfaces);
    }
    let models: Vec<&SurfaceModel> = used.iter().map(|index| &surfaces[*index].model).collect();
    let lattice = Lattice::over(&models)?;
    let parts: Vec<Part> = used
        .iter()
        .map(|index| Part {
            account: &surfaces[*index].account,
            cells: lattice.take(&surfaces[*index].model),
        })
        .collect();
    let mut seams = seams(&parts, lattice.grid.size, stop);
    let known: Vec<Known> = parts.iter().map(known).collect();
    let measured: Vec<([usize; 2], Offset)> = seams
        .iter()
        .map(|seam| {
            let (offset_m, sigma_m) = (seam.before_m, seam.sigma_m);
            (seam.pairs, Offset { offset_m, sigma_m })
        })
        .collect();
    let levels = Levels::of(&known, &measured).ok_or(JoinError::Undetermined)?;
    for seam in &mut seams {
        let [one, other] = seam.pairs.map(|pair| levels.offsets_m[pair]);
        seam.after_m = seam.before_m - (one - other);
        seam.pairs = seam.pairs.map(|pair| used[pair]);
    }
    let (model, several) = mean(&lattice, &parts, &levels);
    let mut pairs: Vec<JoinedPair> = surfaces
        .iter()
        .map(|of| JoinedPair::of(&of.account))
        .collect();
    for (place, index) in used.iter().enumerate() {
        let pair = &mut pairs[*index];
        pair.bit = u32::try_from(place).ok();
        pair.offset_m = levels.offsets_m[place];
        pair.offset_sigma_m = levels.covariance_m2[(place, place)].max(0.0).sqrt();
        let shots = known[place].shots;
        pair.shots_above_m = shots.map(|of| [of.offset_m, of.sigma_m]);
    }
    let heights = model.heights.heights_m.iter();
    let joint = Joint {
        pairs,
        seams,
        filled: u32::try_from(heights.filter(|of| !of.is_nan()).count()).unwrap_or(u32::MAX),
        several,
    };
    let accounts: Vec<&SurfaceAccount> = parts.iter().map(|part| part.account).collect();
    let mut account = of_all(&accounts, surfaces);
    let squares = model.sigmas_m.iter().filter(|of| !of.is_nan());
    let square_m2: f64 = squares.map(|of| f64::from(*of).powi(2)).sum();
    account.sigma_m = (square_m2 / f64::from(joint.filled.max(1))).sqrt();
    account.look = model.look(LOOK);
    account.joint = Some(joint);
    Ok(Surface { account, model })
}

/// The withheld model of pairs that all have too few heights.
fn withheld(surfaces: &[&Surface]) -> std::result::Result<Surface, JoinError> {
    let accounts: Vec<&SurfaceAccount> = surfaces.iter().map(|of| &of.account).collect();
    let is_searched = accounts.iter().any(|of| of.cells > 0);
    if !is_searched {
        return Err(JoinError::Nothing);
    }
    let model = SurfaceModel::nothing();
    let mut account = of_all(&accounts, surfaces);
    account.look = model.look(1);
    account.joint = Some(Joint {
        pairs: accounts.iter().map(|of| JoinedPair::of(of)).collect(),
        seams: Vec::new(),
        filled: 0,
        several: 0,
    });
    Ok(Surface { account, model })
}

/// What is known of the level of a model.
fn known(part: &Part) -> Known {
    let shots = &part.account.shots;
    let profiles = shots.profiles.iter();
    let of_profiles = profiles
        .filter(|of| of.attitude_sigma_m <= shots.attitude_sigma_m)
        .count();
    let has_shots = shots.above_m.n >= SHOTS_MIN;
    Known {
        cells: part.account.filled,
        level_sigma_m: part.account.common_sigma_m,
        shots: has_shots.then(|| Offset {
            offset_m: shots.above_m.median,
            // Shots of a profile share its errors, and relief times the error of its position.
            sigma_m: (shots.sigma_m / (of_profiles.max(1) as f64).sqrt())
                .hypot(shots.attitude_sigma_m),
        }),
    }
}

/// Differences in the overlaps of all models, before the adjustment of their offsets.
fn seams(parts: &[Part], [rows, columns]: [usize; 2], stop: &AtomicBool) -> Vec<Seam> {
    let mut seams = Vec::new();
    for (first, one) in parts.iter().enumerate() {
        for (second, other) in parts.iter().enumerate().skip(first + 1) {
            if stop.load(Ordering::Relaxed) {
                return seams;
            }
            let mut cells = Vec::new();
            for row in 0..rows {
                for column in 0..columns {
                    let at = [row, column];
                    let Some((here, there)) = one.cells.at(at).zip(other.cells.at(at)) else {
                        continue;
                    };
                    let variance_m2 = here[1].powi(2) + there[1].powi(2)
                        - 2.0 * covariance_m2([one, other], [here[1], there[1]]);
                    cells.push(Difference {
                        row,
                        above_m: here[0] - there[0],
                        sigma_m: variance_m2.max(0.0).sqrt(),
                    });
                }
            }
            let compared = one.account.compared_m.max(other.account.compared_m);
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a few cells"
            )]
            let compared_rows = (compared / one.account.cell_m).ceil() as usize;
            let Some(offset) = Offset::of_overlap(&cells, compared_rows) else {
                continue;
            };
            let normalised = cells
                .iter()
                .map(|cell| (cell.above_m - offset.offset_m) / cell.sigma_m.max(f64::MIN_POSITIVE));
            seams.push(Seam {
                pairs: [first, second],
                cells: u32::try_from(cells.len()).unwrap_or(u32::MAX),
                before_m: offset.offset_m,
                after_m: offset.offset_m,
                sigma_m: offset.sigma_m,
                spread_sigmas: Summary::of(&normalised.collect::<Vec<f64>>()).nmad,
            });
        }
    }
    seams
}

/// Covariance of heights of two pairs in a cell, without their offsets, by their standard deviations.
fn covariance_m2(parts: [&Part; 2], sigmas_m: [f64; 2]) -> f64 {
    let [one, other] = parts.map(|part| part.account);
    let smoothing_m = [one.smoothing_m, other.smoothing_m];
    let matched_m = [0, 1].map(|of| {
        let of_match_m2 = sigmas_m[of].powi(2) - smoothing_m[of].powi(2);
        of_match_m2.max(0.0).sqrt()
    });
    let of_images = OF_COMMON_IMAGE * common_errors([one, other]);
    of_images * matched_m[0] * matched_m[1] + smoothing_m[0] * smoothing_m[1]
}

/// Correlation of the errors of heights of two pairs due to their common images: a shift of an image raises the heights of a
/// pair along the parallax, whose directions have this cosine.
fn common_errors(pairs: [&SurfaceAccount; 2]) -> f64 {
    let parallax = |pair: &SurfaceAccount, place: usize| {
        let [from, to] = [place, 1 - place].map(|of| Vector3::from(pair.directions[of]));
        (to - from).try_normalize(0.0).unwrap_or_default()
    };
    let mut correlation = 0.0;
    for (place, image) in pairs[0].images.iter().enumerate() {
        let there = pairs[1].images.iter().position(|other| other == image);
        correlation += there.map_or(0.0, |there| {
            parallax(pairs[0], place).dot(&parallax(pairs[1], there))
        });
    }
    correlation
}

/// Mean heights of all models with their standard deviations and pairs, and the number of cells with several heights.
#[allow(
    clippy::cast_possible_truncation,
    reason = "planetary heights keep millimetre precision"
)]
fn mean(lattice: &Lattice, parts: &[Part], levels: &Levels) -> (SurfaceModel, u32) {
    let [rows, columns] = lattice.grid.size;
    let cells = rows * columns;
    let mut heights_m = vec![f32::NAN; cells];
    let mut sigmas_m = vec![f32::NAN; cells];
    let mut pairs = vec![0_u32; cells];
    let mut several = 0;
    for at in 0..cells {
        let cell = [at / columns, at % columns];
        let found: Vec<(usize, [f64; 2])> = parts
            .iter()
            .enumerate()
            .filter_map(|(index, part)| Some((index, part.cells.at(cell)?)))
            .collect();
        let weights = found.iter().map(|(_, [_, sigma_m])| sigma_m.powi(-2));
        let total: f64 = weights.clone().sum();
        if found.is_empty() || !total.is_finite() {
            continue;
        }
        let weights: Vec<f64> = weights.map(|weight| weight / total).collect();
        let height_m = found
            .iter()
            .zip(&weights)
            .map(|((index, [height_m, _]), weight)| weight * (height_m - levels.offsets_m[*index]));
        heights_m[at] = height_m.sum::<f64>() as f32;
        sigmas_m[at] = variance_m2(parts, levels, &found, &weights).max(0.0).sqrt() as f32;
        pairs[at] = found.iter().fold(0, |bits, (index, _)| bits | 1 << index);
        several += u32::from(found.len() > 1);
    }
    let model = SurfaceModel {
        heights: HeightGrid {
            heights_m,
            ..lattice.grid.clone()
        },
        parallel_rad: lattice.parallel_rad,
        sigmas_m,
        pairs,
    };
    (model, several)
}

/// Variance of a weighted mean of heights with the covariances of their errors and offsets.
fn variance_m2(
    parts: &[Part],
    levels: &Levels,
    found: &[(usize, [f64; 2])],
    weights: &[f64],
) -> f64 {
    let covariance_m2: &DMatrix<f64> = &levels.covariance_m2;
    let mut variance_m2 = 0.0;
    for ((one, [_, sigma_m]), weight) in found.iter().zip(weights) {
        for ((other, [_, of_other_m]), of_other) in found.iter().zip(weights) {
            let own_m2 = if one == other {
                sigma_m.powi(2)
            } else {
                self::covariance_m2([&parts[*one], &parts[*other]], [*sigma_m, *of_other_m])
            };
            variance_m2 += weight * of_other * (own_m2 + covariance_m2[(*one, *other)]);
        }
    }
    variance_m2
}

/// Statistics over all pairs: sums of cells, and means by numbers of heights.
fn of_all(used: &[&SurfaceAccount], surfaces: &[&Surface]) -> SurfaceAccount {
    let mut all = used[0].clone();
    let total: f64 = used.iter().map(|of| f64::from(of.filled)).sum();
    let mean = |of: &dyn Fn(&SurfaceAccount) -> f64| {
        let weighted = used
            .iter()
            .map(|account| f64::from(account.filled) * of(account));
        weighted.sum::<f64>() / total.max(1.0)
    };
    all.sample_m = mean(&|of| of.sample_m);
    all.compared_m = mean(&|of| of.compared_m);
    all.convergence_rad = mean(&|of| of.convergence_rad);
    all.height_of_pixel_m = mean(&|of| of.height_of_pixel_m);
    all.jitter_m = mean(&|of| of.jitter_m.powi(2)).sqrt();
    all.smoothing_m = mean(&|of| of.smoothing_m.powi(2)).sqrt();
    all.correlation = mean(&|of| of.correlation);
    all.aside_m = mean(&|of| of.aside_m.abs());
    (all.cells, all.filled) = (0, 0);
    all.unfilled.clear();
    // Pairs without a model count only if no pair has one.
    let is_refused = surfaces.iter().all(|of| of.account.is_refused);
    let counted = surfaces.iter().map(|of| &of.account);
    for account in counted.filter(|of| is_refused || !of.is_refused) {
        all.cells = all.cells.saturating_add(account.cells);
        all.filled = all.filled.saturating_add(account.filled);
        for (why, count) in &account.unfilled {
            let all = all.unfilled.entry(*why).or_insert(0);
            *all = all.saturating_add(*count);
        }
    }
    all
}
