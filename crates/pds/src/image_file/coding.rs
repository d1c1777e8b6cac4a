//! Coding of pixels.

/// Coding of pixels, as stated in the first header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// One byte a pixel.
    Raw,
    /// Residuals from a predicted pixel, as prefix codes.
    Predictive {
        /// Predictor of a pixel.
        predictor: Predictor,
        /// Code of the residuals, 0 to 7.
        table: u8,
    },
    /// Quantised coefficients of blocks of 16 × 16 pixels.
    Transform {
        /// Type of transform.
        transform: Transform,
        /// Groups of blocks, each with its own tables, 1 to 8.
        groups: u8,
        /// Step of the quantiser.
        spacing: u16,
    },
}

/// Predictor of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Predictor {
    /// The pixel to its left.
    X,
    /// The pixel above.
    Y,
    /// The pixel above, and the difference of those to the left.
    Xy,
}

/// A transform of blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transform {
    /// Walsh–Hadamard.
    Walsh,
    /// Cosines.
    Cosine,
}

impl Coding {
    /// Most pixels that a byte of data can hold.
    pub(super) const fn pixels_of_byte(self) -> u64 {
        match self {
            Self::Raw => 1,
            // A bit a pixel.
            Self::Predictive { .. } => 8,
            // A block of 256 pixels takes at least 3 bits for its group, and 8 each for its mean and the length of the
            // rest.
            Self::Transform { .. } => 256 * 8 / 19,
        }
    }
}
