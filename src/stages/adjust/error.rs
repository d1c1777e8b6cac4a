//! Why a site cannot be adjusted.

use crate::{
    error::{Cause, Kind},
    geom::{bundle::BundleError, pushbroom::Unseen},
};

/// An initial value so far from its adjusted one is a contradiction, in its standard deviations.
pub(super) const CONTRADICTION: f64 = 10.0;

/// Why a site cannot be adjusted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AdjustError {
    /// No tie point could be intersected.
    #[error("none of {ties} tie points has a ground point; {first}")]
    NoTies {
        /// Tie points.
        ties: usize,
        /// The first of them, and why it has none.
        first: String,
    },
    /// The network as a whole.
    #[error("{0}")]
    Network(BundleError),
    /// The steps do not converge.
    #[error(
        "the adjustment did not converge after {steps} steps (weighted sum of squares {weighted_squares:.3e}) with {held_by}"
    )]
    NotConverged {
        /// Steps taken.
        steps: usize,
        /// The sum where it was given up.
        weighted_squares: f64,
        /// The keys that hold the orientations, with their values.
        held_by: String,
    },
    /// A standard deviation, coordinate or number that is none.
    #[error("{what} is {value}, expected {expected}")]
    Value {
        /// What it is, of which image, point or profile.
        what: String,
        /// The value.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// Nothing tells unknowns apart.
    #[error("the network is singular: the observations do not separate {0}")]
    Singular(String),
    /// A shot occurs twice.
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

impl Cause for AdjustError {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self {
            Self::NoTies { .. } => "check that the images overlap and that the tie points are theirs",
            Self::NotConverged { .. } => "lower these standard deviations where they leave an orientation freer than its kernels are uncertain; otherwise check the tie points and the images' times and kernels: so far apart the observations have no common solution",
            Self::Network(_) => "check the input of the adjustment, and give orientations and footprints finite standard deviations",
            Self::Value { .. } => "correct this value, or leave out what it belongs to",
            Self::Singular(_) => "give these unknowns finite standard deviations in [adjustment], or smaller ones, or hold them fixed with 0",
            Self::DuplicateShot(_) => "leave out the second file, or renumber the shots",
            Self::Blind { .. } => "check the orientation samples of the image",
            Self::Contradiction { .. } => "check the datum, the clock and the units of this value, or raise its standard deviation",
        }
        .to_owned()
    }
}
