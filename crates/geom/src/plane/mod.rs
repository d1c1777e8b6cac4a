//! Plane triangulation of rectified pictures: a similarity per picture, tied to its neighbours and to controls.
//!
//! Pictures that are rectified, or nearly vertical, differ from a conformal map by a similarity: four unknowns each, in
//! which the equations from picture to map are linear. Positions are complex numbers, `x + i y`, and so are the two
//! unknowns of a picture, which halves every system. There is one solver ([`solve()`]); the five programs of the paper
//! are ways to use it.
//!
//! | program | here |
//! |---|---|
//! | BRICK | [`brick`]: a few pictures with ties among them, on two rough guesses |
//! | EXTEND | [`extend`]: bricks as pictures, on two controls |
//! | MORTAR | [`mortar`]: bricks as pictures, on all controls by weight |
//! | SCALE | [`scale`]: one figure on all controls, its shape kept |
//! | LOCAL | [`local`]: the pictures of each brick on the means of its seams |
//!
//! The images of every point become orthonormal contrasts, which have the rank that the symmetric equations of the
//! paper lack. Pictures are eliminated in the order of least degree (`eliminate`): there are no normal equations, and
//! the triangular factor gives the covariances of neighbours by the recursion of Takahashi (`inverse`), which libraries
//! of sparse decompositions do not expose. These also standardise the deviations by which blunders are found: a single
//! adjustment spreads a blunder over its neighbours, and its own standardised deviation remains the largest.
//! The standard deviations of points result from the one adjustment, regardless of how the block was georeferenced.
//!
//! # Source
//! Arthur & McMacken 1977; equations by their numbers there.

mod blunders;
mod bricks;
mod check;
mod controls;
mod eliminate;
mod film;
mod grow;
mod inverse;
mod least_median;
mod mirror;
mod net;
mod rigid;
mod shrinkage;
mod similarity;
mod solve;
mod stretch;

/// A position in a picture or on a map: `x + i y`.
pub type Place = nalgebra::Complex<f64>;

pub use blunders::{FLAG_LIMIT, find_blunders, robust_sigma};
pub use bricks::{Block, Figure, brick, extend, local, mortar};
pub use check::check;
pub use controls::{Scaled, fit_similarity, fit_weighted, scale};
pub use film::{CornerZero, FilmError, FourCorners, box_centre};
pub use grow::grow_bricks;
pub use mirror::{find_mirrored, same_hand};
pub use net::{Control, Measurement, Net, PlaneError};
pub use rigid::{Moved, settle_bricks};
pub use shrinkage::{Shrinkage, shrinkage_factor};
pub use similarity::{Similarity, projection_floor_m};
pub use solve::{Precision, Redundancy, Solution, solve};
pub use stretch::{Stretch, stretch};
