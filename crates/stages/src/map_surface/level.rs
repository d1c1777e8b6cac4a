//! One size of cells and images, and the known ground when it is matched.

use crate::{
    ground::{Field, Ground},
    image_view::View,
};

/// One level: its cells, and the images at a similar size.
pub(super) struct Level<'a> {
    pub(super) ground: Ground,
    /// Samples of the ground along the edge of a cell, an odd number.
    pub(super) per_cell: usize,
    pub(super) views: [&'a View<'a>; 2],
    /// Levels of the images' halvings.
    pub(super) halvings: [usize; 2],
}

/// The known ground when a level is matched.
pub(super) struct Known {
    /// Heights above the sphere, metres.
    pub(super) heights_m: Field,
    /// Offset of the ground in the second image against the first, across the parallax, samples of the ground.
    pub(super) aside: Field,
}

impl Level<'_> {
    /// Pixels of an image for a pixel of its level.
    pub(super) fn scale(&self, image: usize) -> f64 {
        (1_u64 << self.halvings[image]) as f64
    }
}
