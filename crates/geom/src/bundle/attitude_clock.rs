//! The attitude clock of a network.

use nalgebra::Vector3;

/// An offset of the time at which attitudes were read, common to all images.
///
/// An image whose camera rotates inertially, as one that follows nadir does, was rotated by an amount proportional to
/// the offset against its attitude; one that is held towards a star was not.
#[derive(Debug, Clone, PartialEq)]
pub struct AttitudeClock {
    /// Standard deviation of the offset, seconds.
    pub sigma_s: f64,
    /// Inertial rotation rate of each image, camera components, radians per second.
    pub turns_rad_s: Vec<Vector3<f64>>,
}
