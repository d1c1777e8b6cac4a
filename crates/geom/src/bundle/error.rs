//! Reasons for which a network cannot be adjusted.

use super::{
    Part,
    unknowns::{Unknown, names},
};

/// A network that cannot be adjusted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BundleError {
    /// An invalid standard deviation, coordinate or number.
    #[error("{what} of {part} is {value}; expected {expected}")]
    Value {
        /// The part to which it belongs.
        part: Part,
        /// The quantity.
        what: &'static str,
        /// The value.
        value: f64,
        /// The expected value.
        expected: &'static str,
    },
    /// An index of a point, image or profile that the network does not have.
    #[error("{part} belongs to {missing}, which is not in the network")]
    Unmatched {
        /// View or range.
        part: Part,
        /// The missing part.
        missing: Part,
    },
    /// Unknowns that the observations do not separate.
    #[error("the network is singular: the observations do not separate {}", names(.unknowns))]
    Singular {
        /// The weakest combination.
        unknowns: Vec<Unknown>,
    },
    /// Fewer observations than unknowns.
    #[error(
        "{observations} observations for {unknowns} unknowns; expected at least as many observations"
    )]
    Underdetermined {
        /// Observations.
        observations: usize,
        /// Unknowns.
        unknowns: usize,
    },
    /// The steps do not converge.
    #[error(
        "the adjustment did not converge after {steps} steps; weighted sum of squares {weighted_squares:.6e}"
    )]
    NotConverged {
        /// Steps taken.
        steps: usize,
        /// Weighted sum of squares at which the iteration was stopped.
        weighted_squares: f64,
    },
}
