//! Parts of a network, for messages.

/// A part of a network, by its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Part {
    /// An image.
    #[error("image {0}")]
    Image(usize),
    /// A ground point.
    #[error("point {0}")]
    Point(usize),
    /// Image coordinates of a point.
    #[error("view {0}")]
    View(usize),
    /// A range.
    #[error("range {0}")]
    Range(usize),
    /// A profile of ranges.
    #[error("profile {0}")]
    Profile(usize),
    /// A spot of the laser.
    #[error("spot {0}")]
    Spot(usize),
    /// Unknowns common to all images.
    #[error("all images")]
    Images,
}
