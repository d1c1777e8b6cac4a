//! Image matching: patches of images, their texture, their correlation, and least-squares matching. Pure functions;
//! positions are lines and samples, 0 at the outer edge of the first pixel.

mod affine;
mod correlation;
mod interest;
mod least_squares;
mod numbers;
mod patch;

pub use affine::Affine;
pub use correlation::{Peak, search};
pub use interest::{Texture, noise_dn, texture};
pub use least_squares::{LeastSquaresFailure, LeastSquaresMatch, match_least_squares};
pub use patch::{Between, Patch};

#[cfg(test)]
mod tests;
