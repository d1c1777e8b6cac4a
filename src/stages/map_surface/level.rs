//! One size of cells and images, and what is known of the ground when it is matched.

use super::{field::Field, ground::Ground};
use crate::stages::image_view::View;

/// What is matched at one level: its cells, and the images at a like size.
pub(super) struct Level<'a> {
    pub(super) ground: Ground,
    /// Samples of the ground along the edge of a cell, an odd number.
    pub(super) per_cell: usize,
    pub(super) views: [&'a View<'a>; 2],
    /// Levels of the images' halvings.
    pub(super) halvings: [usize; 2],
}

/// What is known of the ground when a level is matched.
pub(super) struct Known {
    /// Heights above the sphere, metres.
    pub(super) heights_m: Field,
    /// How far the second image shows the ground aside of where the first has it, across the parallax, samples of the ground.
    pub(super) aside: Field,
}
