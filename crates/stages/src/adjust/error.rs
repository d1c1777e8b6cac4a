//! Reasons why a site cannot be adjusted.

use areograph_base::error::Cause;
use areograph_geom::{bundle::BundleError, pushbroom::Unseen};

/// Distance between initial and adjusted value that is a contradiction, in standard deviations of the initial value.
pub(super) const CONTRADICTION: f64 = 10.0;

/// Reason why a site cannot be adjusted.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum AdjustError {
    /// No tie point could be intersected.
    #[error("none of the {ties} tie points has a ground point; {first}")]
    #[cause("check that the images overlap and that the tie points belong to these images")]
    NoTies {
        /// Tie points.
        ties: usize,
        /// The first of them, and why it has no ground point.
        first: String,
    },
    /// A fault of the network.
    #[error("{0}")]
    #[cause(
        "check the adjustment input, and give orientations and footprints finite standard deviations"
    )]
    Network(BundleError),
    /// The steps do not converge.
    #[error(
        "the adjustment did not converge after {steps} steps (weighted sum of squares {weighted_squares:.3e}) with {held_by}"
    )]
    #[cause(
        "reduce these standard deviations if they exceed the kernel uncertainty; otherwise check the tie points, image \
         times and kernels: the observations have no common solution"
    )]
    NotConverged {
        /// Steps taken.
        steps: usize,
        /// The sum when the iteration stopped.
        weighted_squares: f64,
        /// The keys that constrain the orientations, with their values.
        held_by: String,
    },
    /// An invalid standard deviation, coordinate or number.
    #[error("{what} is {value}; expected {expected}")]
    #[cause("correct this value, or omit the item to which it belongs")]
    Value {
        /// The quantity, with its image, point or profile.
        what: String,
        /// The value.
        value: f64,
        /// The expected value.
        expected: &'static str,
    },
    /// The observations do not separate unknowns.
    #[error("the network is singular: the observations do not separate {0}")]
    #[cause(
        "give these unknowns finite or smaller standard deviations in [adjustment], or fix them with 0"
    )]
    Singular(String),
    /// A shot occurs twice.
    #[error("two shots have the identifier {0}")]
    #[cause("omit the second file, or renumber the shots")]
    DuplicateShot(String),
    /// An image that shows no ground according to its orientation.
    #[error("image {image} shows no ground according to its orientation: {unseen}")]
    #[cause("check the orientation samples of the image")]
    Blind {
        /// Identifier of the image.
        image: String,
        /// Reason.
        unseen: Unseen,
    },
    /// Statements about the laser in other cameras, or with a different mounting.
    #[error(
        "adjustment.boresight does not apply to image {image}: its camera and laser are mounted differently from {known}, to \
         which the file refers"
    )]
    #[cause(Configuration: "estimate the boresight from sites with this camera, laser and frame kernels, or remove adjustment.boresight")]
    OtherMounting {
        /// Identifier of the image.
        image: String,
        /// Cameras of the file.
        known: String,
    },
    /// Initial values that the observations contradict.
    #[error(
        "{what} contradicts the rest of the network: standardised residual {standardised:.1}; expected at most \
         {CONTRADICTION}"
    )]
    #[cause("check the datum, clock and units of this value, or increase its standard deviation")]
    Contradiction {
        /// The initial value.
        what: String,
        /// Its standardised residual, without sign.
        standardised: f64,
    },
}
