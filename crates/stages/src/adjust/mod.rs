//! Combined adjustment of stereo images, MOLA footprints with their ranges, and tie points.
//!
//! The surface of all MOLA shots (`geom/surface`, kriging with full covariance) controls the heights, and
//! `stages/check_heights` compares with it before and after. Residuals along track follow decision 0010: with the
//! published residual, ten thousand ties in a pair and noise of a full line biased the estimated along-track velocity
//! by several of its a priori standard deviations.
//!
//! Image coordinates of footprints follow from the orientation under adjustment and are observations only in the
//! published model. A pair of images controls its ties along track only; across track, height absorbs the error.
//! Heights of tie points above the surface of all MOLA shots are therefore observations
//! (`geom/bundle/reduced_heights`). They enter the factor of the reduced equations (`geom/bundle/factor`) without
//! giving up the elimination of points or the blocks. Covariances come from a priori variances; a good fit never
//! reduces them.
//!
//! Images of one pass share the errors of its orbit and attitude (`common_pass`).
//!
//! Horizontal position is determined by the a priori orbit and attitude only. Three options constrain it further:
//! - `geom/bundle/spots`: the mounting places the laser in simultaneous images (decision 0021). Boresight and profile
//!   shifts are unknowns, also those of heights on relief.
//! - `geom/bundle/relief`: heights depend on the horizontal position and on the position of each profile. Its accuracy
//!   is reported whether or not it is used; `by_relief` decides (decision 0037).
//! - the attitude clock, one unknown of all images. It is a decision, not an estimate; `split` reports both readings
//!   (decision 0019).
//!
//! # Source
//! Yoon & Shan 2004. Image coordinates of footprints are computed from the orientation that is being
//! adjusted; with small standard deviations they would hold the misregistration in place.

mod a_priori;
mod adjusted;
mod attitude_clock;
mod blunders;
mod boresight;
mod boresight_prior;
mod by_relief;
mod common_bus;
mod common_pass;
mod components;
mod error;
mod height_summary;
mod heights;
mod input;
mod line_times;
mod mean_parts;
mod network;
mod point_errors;
mod points;
mod prepare;
mod relief;
mod run;
mod split;
mod stage;
mod summary;
mod tie_correlation;
mod tie_scatter;
mod words;

pub use a_priori::accuracy_withheld;
pub use adjusted::{
    Adjusted, CorrectedImage, CorrectedPoint, ImageResidual, RangeResidual, ScalarResidual,
};
pub use boresight::{BoresightSummary, SpotsOfImage};
pub use boresight_prior::BoresightPrior;
pub use components::WORSE_THAN_CONFIGURED;
pub use error::AdjustError;
pub use height_summary::HeightSummary;
pub use heights::HEIGHTS_MIN;
pub use input::{AdjustImage, LaserShot, LaserShots, ShotRange, orientation_sigmas};
pub use line_times::LineDelay;
pub use mean_parts::{MeanSigmaPart, MeanSigmaParts};
pub use point_errors::{SharedError, recorded_m2};
pub use points::{PointKind, RejectedPoint, RejectionReason};
pub use prepare::{Candidate, prepare_adjustment};
pub use relief::{ProfileOffset, ReliefChoice, ReliefComparison, ReliefSummary};
pub use run::adjust;
pub use split::OtherReading;
pub use stage::Adjust;
pub use summary::{AdjustmentSummary, GroundSummary, ImageSummary, ObservationType, TypeSummary};
