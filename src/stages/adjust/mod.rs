//! Combined adjustment of stereo images, MOLA footprints with their ranges, and tie points.
//!
//! # Source
//! Yoon & Shan 2004. Image coordinates of footprints are computed from the orientation that is being
//! adjusted; with small standard deviations they would hold the misregistration in place.

mod blunders;
mod network;
mod summary;

use std::collections::BTreeMap;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

pub use summary::{AdjustmentSummary, GroundSummary, ImageSummary, ObservationType, TypeSummary};

use super::intersect::IntersectedTies;
use crate::{
    error::{Fault, Kind, Result},
    geom::{
        bundle::{
            Adjustment, BundleFault, BundleOptions, Dropped, Network, ORIENTATION_UNKNOWNS, Unknown,
        },
        pushbroom::{EulerPolynomial, Unseen},
        robust::RobustWeight,
        stereo::StereoImage,
    },
    ties::TiePoint,
};

/// An image with what is known of its orientation beforehand.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustImage {
    /// Initial orientation and detector.
    pub stereo: StereoImage<EulerPolynomial>,
    /// Time from line to line, seconds.
    pub line_period_s: f64,
    /// Standard deviation of each unknown, see [`orientation_sigmas`].
    pub sigmas: [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviation of a bias of the line times, seconds; 0 for no such unknown.
    pub time_bias_sigma_s: f64,
}

/// Standard deviations of an image's unknowns from one for positions and one for angles.
///
/// All powers of `t`, half the image being its unit, get the same.
#[must_use]
pub fn orientation_sigmas(position_m: f64, angle_rad: f64) -> [f64; ORIENTATION_UNKNOWNS] {
    std::array::from_fn(|index| if index < 9 { position_m } else { angle_rad })
}

/// A laser shot.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserShot {
    /// Identifier, unique among the shots.
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

/// What image coordinates of footprints are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MolaImage {
    /// Observations with their own standard deviations, as in the paper.
    Weighted,
    /// Nothing.
    Off,
    /// No observations, but projected with the adjusted orientation afterwards: a coordinate that
    /// follows the orientation has no residual and carries no weight, no freedom and no covariance.
    Reproject,
}

/// Standard deviations and options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdjustOptions {
    /// Tie points, along and across the track, focal pixels.
    pub tie_sigma_px: [f64; 2],
    /// What image coordinates of footprints are.
    pub mola_image: MolaImage,
    /// Their standard deviations, along and across the track, focal pixels.
    pub mola_sigma_px: [f64; 2],
    /// How far outside an image a footprint still counts as seen by it, pixels.
    pub mola_margin_px: f64,
    /// Footprint coordinates, metres.
    pub ground_sigma_m: f64,
    /// Ranges, metres.
    pub range_sigma_m: f64,
    /// Range bias of each profile, metres; 0 for no such unknown.
    pub range_bias_sigma_m: f64,
    /// Robust weights of image coordinates.
    pub robust: Option<RobustWeight>,
    /// Standardised residual above which a tie point is a blunder and left out; `None` keeps all.
    pub blunder_limit: Option<f64>,
}

impl Default for AdjustOptions {
    /// The standard deviations of the paper, one MOLA spacing for footprints in images, and no test.
    fn default() -> Self {
        Self {
            tie_sigma_px: [1.0, 1.0],
            mola_image: MolaImage::Weighted,
            mola_sigma_px: [74.0, 4.0],
            mola_margin_px: 200.0,
            ground_sigma_m: 10.0,
            range_sigma_m: 10.0,
            range_bias_sigma_m: 0.0,
            robust: None,
            blunder_limit: None,
        }
    }
}

/// Critical value of the test of standardised residuals: one good observation in a thousand fails it.
///
/// # Source
/// Baarda 1968, A testing procedure for use in geodetic networks.
pub const BAARDA_LIMIT: f64 = 3.29;

/// The adjusted site.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustedSite {
    /// What was adjusted: shots first, then tie points.
    pub network: Network,
    /// The result.
    pub adjustment: Adjustment,
    /// Identifiers of the points, in the order of the network.
    pub points: Vec<String>,
    /// Number of shots among them.
    pub shots: usize,
    /// Tie points that were left out.
    pub rejected: Vec<LeftOut>,
    /// Statistics.
    pub summary: AdjustmentSummary,
}

/// A point that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
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

/// Why a site cannot be adjusted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AdjustFault {
    /// The network itself.
    #[error("{0}")]
    Network(BundleFault),
    /// Nothing tells unknowns apart.
    #[error("the network is singular: nothing tells apart {0}")]
    Singular(String),
    /// A range names an image that is not there.
    #[error("shot {shot} was fired during image {image}, which is none of the images {known}")]
    UnknownImage {
        /// Identifier of the shot.
        shot: String,
        /// The name.
        image: String,
        /// The names that are known.
        known: String,
    },
    /// Two shots have the same identifier.
    #[error("two shots have the identifier {0}")]
    DuplicateShot(String),
    /// An orientation that sees nothing.
    #[error("image {image}: its orientation sees no ground: {unseen}")]
    Blind {
        /// Identifier of the image.
        image: String,
        /// Why.
        unseen: Unseen,
    },
    /// Initial values that the observations refute.
    #[error(
        "{what} contradicts the rest of the network: standardised residual {standardised:.1}, expected at most {CONTRADICTION}"
    )]
    Contradiction {
        /// The initial value.
        what: String,
        /// Its standardised residual, without sign.
        standardised: f64,
    },
}

/// An initial value so far from its adjusted one is a contradiction, in its standard deviations.
const CONTRADICTION: f64 = 10.0;

impl Fault for AdjustFault {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self {
            Self::Network(_) => "check the input of the adjustment, and give orientations and footprints finite standard deviations",
            Self::Singular(_) => "give these unknowns finite standard deviations, or hold them fixed with 0",
            Self::UnknownImage { .. } => "give shots the identifiers of the images",
            Self::DuplicateShot(_) => "leave out the second file, or number the shots anew",
            Self::Blind { .. } => "check the orientation samples of the image",
            Self::Contradiction { .. } => "check the datum, the clock and the units of this value, or raise its standard deviation",
        }
        .to_owned()
    }
}

/// Adjusts images, shots and tie points together.
///
/// Tie points start from their intersection; those without one are left out and listed.
///
/// # Errors
/// Identifiers that do not match, a singular network, initial values that the rest refutes.
pub fn adjust(
    images: &[AdjustImage],
    shots: &[LaserShot],
    ties: &[TiePoint],
    starts: &IntersectedTies,
    options: &AdjustOptions,
) -> Result<AdjustedSite> {
    let mut assembled = network::assemble(images, shots, ties, starts, options)?;
    let bundle_options = BundleOptions {
        robust: options.robust,
        ..BundleOptions::default()
    };
    let adjustment = blunders::solve_without_blunders(&mut assembled, &bundle_options, options)
        .map_err(|fault| in_words(fault, images, &assembled.profiles))?;
    for (point, outcome) in assembled.points.iter().zip(&adjustment.points) {
        if let Err(Dropped::Undetermined | Dropped::BehindCamera) = outcome {
            // Blunders have lost their measurements and are listed already.
            if !assembled
                .rejected
                .iter()
                .any(|left_out| left_out.id == *point)
            {
                assembled.rejected.push(LeftOut {
                    id: point.clone(),
                    reason: LeftOutReason::Undetermined,
                });
            }
        }
    }
    contradictions(images, &assembled.points, &adjustment)?;
    let summary = summary::summarise(images, &assembled, &adjustment, options.mola_image)?;
    Ok(AdjustedSite {
        network: assembled.network,
        adjustment,
        points: assembled.points,
        shots: shots.len(),
        rejected: assembled.rejected,
        summary,
    })
}

/// The fault with identifiers in place of indices.
fn in_words(fault: BundleFault, images: &[AdjustImage], profiles: &[String]) -> AdjustFault {
    let BundleFault::Singular { unknowns } = fault else {
        return AdjustFault::Network(fault);
    };
    let words: Vec<String> = unknowns
        .iter()
        .map(|unknown| unknown_in_words(*unknown, images, profiles))
        .collect();
    AdjustFault::Singular(words.join(", "))
}

/// An unknown as a surveyor names it.
fn unknown_in_words(unknown: Unknown, images: &[AdjustImage], profiles: &[String]) -> String {
    match unknown {
        Unknown::Orientation { image, coefficient } => {
            let quantity = ["X", "Y", "Z", "ω", "φ", "κ"][coefficient / 3 % 6];
            let power = ["constant", "linear term", "quadratic term"][coefficient % 3];
            format!(
                "the {power} of {quantity} of image {}",
                images[image].stereo.id
            )
        }
        Unknown::TimeBias { image } => {
            format!("the time bias of image {}", images[image].stereo.id)
        }
        Unknown::RangeBias { profile } => {
            format!("the range bias of profile {}", profiles[profile])
        }
    }
}

fn contradictions(
    images: &[AdjustImage],
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
    let size = |residual: &crate::geom::bundle::Residual| (residual.value / residual.sigma).abs();
    for (image, adjusted) in adjustment.images.iter().enumerate() {
        for (coefficient, prior) in adjusted.priors.iter().enumerate() {
            if let Some(prior) = prior {
                let unknown = Unknown::Orientation { image, coefficient };
                refuse(unknown_in_words(unknown, images, &[]), size(prior))?;
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
fn image_index(images: &[AdjustImage]) -> BTreeMap<&str, usize> {
    let ids = images.iter().map(|image| image.stereo.id.as_str());
    ids.zip(0..).collect()
}

/// Standard deviations as a vector.
fn pair([along, across]: [f64; 2]) -> Vector2<f64> {
    Vector2::new(along, across)
}
