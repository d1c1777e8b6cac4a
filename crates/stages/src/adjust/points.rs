//! The kinds of point in an adjustment, and points that are left out of it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::minus::signed;

/// The kinds of point.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum PointKind {
    /// A footprint of the laser altimeter.
    Shot,
    /// A tie point.
    Tie,
}

/// A rejected point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RejectedPoint {
    /// Shot or tie point.
    pub kind: PointKind,
    /// Row of the footprint, or index of the tie point.
    pub index: usize,
    /// Identifier.
    pub id: String,
    /// Reason.
    pub reason: RejectionReason,
}

/// Reasons for the rejection of a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum RejectionReason {
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
    /// Its height is implausible.
    #[error("{} m above the laser surface, {standardised:.1} standard deviations", signed(*above_m, 0))]
    Height {
        /// Height above the surface without the part that tie points share, metres.
        above_m: f64,
        /// This height in its standard deviations, without sign.
        standardised: f64,
    },
}
