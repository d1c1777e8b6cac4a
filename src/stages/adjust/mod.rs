//! Combined adjustment of stereo images, MOLA footprints with their ranges, and tie points.
//!
//! # Source
//! Yoon & Shan 2004. Image coordinates of footprints are computed from the orientation that is being
//! adjusted; with small standard deviations they would hold the misregistration in place.

mod adjusted;
mod attitude_clock;
mod blunders;
mod common_bus;
mod components;
mod error;
mod height_summary;
mod heights;
mod input;
mod network;
mod points;
mod prepare;
mod relief;
mod run;
mod split;
mod stage;
mod summary;
mod words;

pub use adjusted::{
    Adjusted, CorrectedImage, CorrectedPoint, ImageResidual, RangeResidual, ScalarResidual,
};
pub use common_bus::{BoresightSummary, SpotsOfImage};
pub use components::WORSE_THAN_CONFIGURED;
pub use error::AdjustError;
pub use height_summary::HeightSummary;
pub use heights::HEIGHTS_MIN;
pub use input::{AdjustImage, LaserShot, LaserShots, ShotRange, orientation_sigmas};
pub use points::{PointKind, RejectedPoint, RejectionReason};
pub use prepare::{Candidate, prepare_adjustment};
pub use relief::{ProfileOffset, ReliefSummary};
pub use run::adjust;
pub use split::OtherReading;
pub use stage::Adjust;
pub use summary::{AdjustmentSummary, GroundSummary, ImageSummary, ObservationType, TypeSummary};
