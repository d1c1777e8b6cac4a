//! Pieces of images that show the same ground: north up, at one scale.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::pixels::Patch;

/// Pixels of an edge of a piece; odd, so that one is in the middle.
pub const CHIP_EDGE: usize = 141;

/// The meaning of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Mark {
    /// Place at which the image sees the point with the orientation from the kernels.
    Before,
    /// Place at which the image sees the point with the adjusted orientation.
    After,
    /// Place at which the point was measured.
    Measured,
}

/// A piece of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chip {
    /// [`CHIP_EDGE`] rows of as many pixels, the northernmost and the westernmost first; 0 where the image shows nothing.
    pub pixels: Vec<u8>,
    /// Marks with their places: columns and rows from the corner of the first pixel, 0.5 at its centre.
    pub marks: Vec<(Mark, [f64; 2])>,
}

/// From the ground to a piece and to the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    /// Line and sample in the middle of the piece.
    pub(super) centre: Vector2<f64>,
    /// Lines and samples per metre towards east and north.
    pub(super) per_m: Matrix2<f64>,
    /// Edge of a pixel of the piece, metres.
    pub(super) pixel_m: f64,
}

impl Lattice {
    /// Line and sample of a place of the piece, column and row.
    pub(super) fn in_image(&self, column: f64, row: f64) -> Vector2<f64> {
        let middle = 0.5 * CHIP_EDGE as f64;
        self.centre + self.per_m * Vector2::new(column - middle, middle - row) * self.pixel_m
    }

    /// Column and row of a line and sample; `None` beyond the piece.
    fn in_chip(&self, place: &Vector2<f64>) -> Option<[f64; 2]> {
        let edge = CHIP_EDGE as f64;
        let ground_m = self.per_m.try_inverse()? * (place - self.centre);
        let chip = [
            0.5 * edge + ground_m.x / self.pixel_m,
            0.5 * edge - ground_m.y / self.pixel_m,
        ];
        chip.iter()
            .all(|at| (0.0..=edge).contains(at))
            .then_some(chip)
    }

    /// The piece of an image, with pixels from `patch`.
    pub(super) fn cut(&self, patch: &Patch, marks: &[(Mark, Vector2<f64>)]) -> Chip {
        let centres = || (0..CHIP_EDGE).map(|at| at as f64 + 0.5);
        let row = |row: f64| {
            centres().map(move |column| {
                let place = self.in_image(column, row);
                patch.at(place.x, place.y)
            })
        };
        let marks = marks.iter();
        Chip {
            pixels: centres().flat_map(row).collect(),
            marks: marks
                .filter_map(|(mark, place)| Some((*mark, self.in_chip(place)?)))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_has_north_up_and_marks_where_its_pixels_are() {
        // Lines run south, 4 m each; samples run west, 5 m each.
        let lattice = Lattice {
            centre: Vector2::new(1000.25, 200.75),
            per_m: Matrix2::new(0.0, -0.25, -0.2, 0.0),
            pixel_m: 5.0,
        };
        let middle = 0.5 * CHIP_EDGE as f64;
        assert_eq!(lattice.in_image(middle, middle), lattice.centre);
        // 100 m north and 50 m east.
        let place = lattice.in_image(middle + 10.0, middle - 20.0);
        assert!((place - Vector2::new(975.25, 190.75)).norm() < 1e-9);
        let chip = lattice.in_chip(&place).unwrap();
        assert!((chip[0] - middle - 10.0).abs() < 1e-9 && (chip[1] - middle + 20.0).abs() < 1e-9);
        assert_eq!(lattice.in_chip(&Vector2::new(0.0, 200.0)), None);
    }
}
