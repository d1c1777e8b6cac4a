//! The local distortion of an image against another one.

use nalgebra::{Matrix2, Vector2};

/// Position in another image of a position near `from`: `to + matrix · (place − from)`, lines and samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// A position in one image.
    pub from: Vector2<f64>,
    /// The conjugate position in the other.
    pub to: Vector2<f64>,
    /// Lines and samples of the other image for each line and sample of the first.
    pub matrix: Matrix2<f64>,
}

impl Affine {
    /// The position in the other image.
    #[must_use]
    pub fn apply(&self, place: &Vector2<f64>) -> Vector2<f64> {
        self.to + self.matrix * (place - self.from)
    }

    /// The map between reduced images, of which one pixel is `here` and `there` pixels of these.
    #[must_use]
    pub fn reduced(&self, here: f64, there: f64) -> Self {
        Self {
            from: self.from / here,
            to: self.to / there,
            matrix: self.matrix * (here / there),
        }
    }

    /// From the other image to the first; `None` where the distortion is singular.
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        Some(Self {
            from: self.to,
            to: self.from,
            matrix: self.matrix.try_inverse()?,
        })
    }
}
