//! How an image is distorted against another one near a place.

use nalgebra::{Matrix2, Vector2};

/// The place in another image of a place near `from`: `to + matrix · (place − from)`, lines and samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// A place in one image.
    pub from: Vector2<f64>,
    /// The same place in the other.
    pub to: Vector2<f64>,
    /// Lines and samples of the other image for each line and sample of the one.
    pub matrix: Matrix2<f64>,
}

impl Affine {
    /// The place in the other image.
    #[must_use]
    pub fn apply(&self, place: &Vector2<f64>) -> Vector2<f64> {
        self.to + self.matrix * (place - self.from)
    }

    /// The same between images of which one pixel is `here` and `there` pixels of these.
    #[must_use]
    pub fn reduced(&self, here: f64, there: f64) -> Self {
        Self {
            from: self.from / here,
            to: self.to / there,
            matrix: self.matrix * (here / there),
        }
    }

    /// From the other image to the one; `None` where the distortion leaves no area.
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        Some(Self {
            from: self.to,
            to: self.from,
            matrix: self.matrix.try_inverse()?,
        })
    }
}
