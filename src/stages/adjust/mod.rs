//! Combined adjustment of stereo images, MOLA footprints with their ranges, and tie points.
//!
//! # Source
//! Yoon & Shan 2004. Image coordinates of footprints are computed from the orientation that is being
//! adjusted; with small standard deviations they would hold the misregistration in place.

mod adjusted;
mod blunders;
mod fault;
mod network;
mod summary;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

pub use adjusted::{
    Adjusted, CorrectedImage, CorrectedPoint, ImageResidual, PointKind, RangeResidual,
    ScalarResidual,
};
pub use fault::AdjustFault;
pub use summary::{AdjustmentSummary, GroundSummary, ImageSummary, ObservationType, TypeSummary};

use super::intersect::IntersectedTies;
use crate::{
    config::AdjustmentConfig,
    error::Result,
    geom::{
        bundle::{Adjustment, BundleOptions, ORIENTATION_UNKNOWNS, Residual, Unknown},
        pushbroom::ExteriorOrientation,
        stereo::StereoImage,
    },
    ties::TiePoint,
};

/// An image with what is known of its orientation beforehand.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustImage<M> {
    /// Initial orientation and detector.
    pub stereo: StereoImage<M>,
    /// Time from line to line, seconds.
    pub line_period_s: f64,
    /// Standard deviation of each orientation unknown, see [`orientation_sigmas`]; infinite leaves it free,
    /// 0 holds it fixed.
    pub sigmas: [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviation of a bias of the line times, seconds; 0 for no such unknown.
    pub time_bias_sigma_s: f64,
}

/// Standard deviations of an image's unknowns from one for positions and one for rotations.
///
/// All powers of `t`, half the image being its unit, get the same.
#[must_use]
pub fn orientation_sigmas(position_m: f64, angle_rad: f64) -> [f64; ORIENTATION_UNKNOWNS] {
    std::array::from_fn(|index| if index < 9 { position_m } else { angle_rad })
}

/// A laser shot.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserShot {
    /// Identifier, unique among the shots; messages put the word `shot` before it.
    pub id: String,
    /// Footprint, Mars-fixed, metres.
    pub ground_m: [f64; 3],
    /// Its range, when an image was exposed from the same orbit meanwhile.
    pub range: Option<ShotRange>,
}

/// Range of a shot that was fired while an image was exposed.
#[derive(Debug, Clone, PartialEq)]
pub struct ShotRange {
    /// Profile that the shot belongs to.
    pub profile: String,
    /// Identifier of the image.
    pub image: String,
    /// Instant of the shot as a line from the middle of that image.
    pub x_lines: f64,
    /// Distance, metres.
    pub range_m: f64,
}

/// A point that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Shot or tie point.
    pub kind: PointKind,
    /// Identifier.
    pub id: String,
    /// Why.
    pub reason: LeftOutReason,
}

/// Why a point was left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum LeftOutReason {
    /// Its intersection gave no ground point.
    #[error("it could not be intersected")]
    NotIntersected,
    /// Too few rays, or behind a camera.
    #[error("it is not determined")]
    Undetermined,
    /// A residual fails the test.
    #[error("standardised residual {standardised:.1}")]
    Blunder {
        /// Its largest standardised residual, without sign.
        standardised: f64,
    },
}

/// An initial value so far from its adjusted one is a contradiction, in its standard deviations.
const CONTRADICTION: f64 = 10.0;

/// Adjusts images, shots and tie points together.
///
/// Tie points start from their intersection; those without one are left out and listed.
///
/// # Errors
/// No tie point with a ground point, identifiers that do not match, a singular network, initial values that the rest refutes.
pub fn adjust<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    shots: &[LaserShot],
    ties: &[TiePoint],
    starts: &IntersectedTies,
    config: &AdjustmentConfig,
) -> Result<Adjusted> {
    if starts.points.is_empty() {
        let first = starts.rejected.first();
        return Err(AdjustFault::NoTies {
            ties: ties.len(),
            first: first.map_or_else(
                || "there are none".to_owned(),
                |tie| format!("{}: {}", tie.id, tie.reason),
            ),
        }
        .into());
    }
    let mut assembled = network::assemble(images, shots, ties, starts, config)?;
    let bundle_options = BundleOptions {
        robust: config.robust,
        ..BundleOptions::default()
    };
    let adjustment =
        blunders::solve_without_blunders(&mut assembled, &bundle_options, config.blunder_limit)
            .map_err(|fault| fault::in_words(fault, images, &assembled))?;
    // Blunders have lost their measurements and are listed already.
    let listed: BTreeSet<&str> = assembled
        .left_out
        .iter()
        .map(|tie| tie.id.as_str())
        .collect();
    let dropped = adjustment
        .points
        .iter()
        .enumerate()
        .filter_map(|(point, outcome)| {
            let id = &assembled.points[point];
            let known = point >= assembled.shots && listed.contains(id.as_str());
            (outcome.is_err() && !known).then(|| LeftOut {
                kind: assembled.kind(point),
                id: id.clone(),
                reason: LeftOutReason::Undetermined,
            })
        });
    let dropped: Vec<LeftOut> = dropped.collect();
    assembled.left_out.extend(dropped);
    contradictions(images, &assembled.points, &adjustment)?;
    let summary = summary::summarise(
        images,
        &assembled,
        &adjustment,
        config.footprint_image_coordinates,
    )?;
    Ok(adjusted::collect(images, assembled, adjustment, summary))
}

fn contradictions<M>(
    images: &[AdjustImage<M>],
    points: &[String],
    adjustment: &Adjustment,
) -> std::result::Result<(), AdjustFault> {
    let refuse = |what: String, standardised: f64| {
        if standardised > CONTRADICTION {
            Err(AdjustFault::Contradiction { what, standardised })
        } else {
            Ok(())
        }
    };
    let size = |residual: &Residual| (residual.value / residual.sigma).abs();
    for (image, adjusted) in adjustment.images.iter().enumerate() {
        for (coefficient, prior) in adjusted.priors.iter().enumerate() {
            if let Some(prior) = prior {
                let unknown = Unknown::Orientation { image, coefficient };
                refuse(fault::unknown_in_words(unknown, images, &[]), size(prior))?;
            }
        }
    }
    for (id, outcome) in points.iter().zip(&adjustment.points) {
        for prior in outcome.iter().filter_map(|point| point.priors).flatten() {
            refuse(format!("the footprint of shot {id}"), size(&prior))?;
        }
    }
    Ok(())
}

/// Index of each image by its identifier.
fn image_index<M>(images: &[AdjustImage<M>]) -> BTreeMap<&str, usize> {
    let ids = images.iter().map(|image| image.stereo.id.as_str());
    ids.zip(0..).collect()
}

/// Standard deviations as a vector.
fn pair([along, across]: [f64; 2]) -> Vector2<f64> {
    Vector2::new(along, across)
}
