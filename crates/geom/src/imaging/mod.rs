//! Pixels as numbers: patches of images, where they have texture, how well two of them agree, and where exactly one lies
//! in the other. Pure functions; places are lines and samples, 0 at the outer edge of the first pixel.

mod affine;
mod correlation;
mod interest;
mod least_squares;
mod patch;

pub use affine::Affine;
pub use correlation::{Peak, search};
pub use interest::{Texture, noise_dn, texture};
pub use least_squares::{LeastSquaresFailure, LeastSquaresMatch, match_least_squares};
pub use patch::{Between, Patch};

#[cfg(test)]
mod tests;
