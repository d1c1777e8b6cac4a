//! Film and its measurements: ticks at corners and edges, craters boxed by two settings of a cross.

use nalgebra::{Matrix4, Vector4};

use super::Place;

/// Corners that lie no closer to a line than this share of their distance determine a mapping.
const FLAT: f64 = 1e-9;

/// Reasons why ticks do not determine a correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FilmError {
    /// Three of the corners are collinear, or two coincide.
    #[error("the four corner ticks enclose no area")]
    Flat,
    /// The mid-edge ticks are so far away that the correction is no longer one to one.
    #[error("the mid-edge ticks deviate by a quarter of the picture size or more")]
    TooLarge,
}

/// The middle of a crater by the settings on the upper right and the lower left of its box.
#[must_use]
pub fn box_centre(upper_right: Place, lower_left: Place) -> Place {
    (upper_right + lower_left) * 0.5
}

/// Linear double interpolation from four measured corner ticks to their known positions: shear, scales and rotation of
/// drum scanners (*Optronics*).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FourCorners {
    origin: Place,
    size: f64,
    /// Coefficients of 1, x, y and xy.
    coefficients: [Place; 4],
}

impl FourCorners {
    /// The mapping that takes each `measured` corner exactly to the `known` one.
    ///
    /// # Errors
    /// [`FilmError::Flat`].
    pub fn new(measured: &[Place; 4], known: &[Place; 4]) -> Result<Self, FilmError> {
        let origin = measured.iter().sum::<Place>() * 0.25;
        let size = measured
            .iter()
            .map(|of| (of - origin).norm())
            .fold(0.0, f64::max);
        if !(size > 0.0) {
            return Err(FilmError::Flat);
        }
        let inside = measured.map(|of| (of - origin) / size);
        let matrix = Matrix4::from_fn(|row, column| {
            let of = inside[row];
            [1.0, of.re, of.im, of.re * of.im][column]
        });
        let decomposed = matrix.full_piv_lu();
        let pivots = decomposed.u().diagonal();
        if pivots.iter().any(|pivot| !(pivot.abs() > FLAT)) {
            return Err(FilmError::Flat);
        }
        let solve = |part: fn(&Place) -> f64| {
            let right = Vector4::from_iterator(known.iter().map(part));
            decomposed.solve(&right).ok_or(FilmError::Flat)
        };
        let (x, y) = (solve(|of| of.re)?, solve(|of| of.im)?);
        Ok(Self {
            origin,
            size,
            coefficients: std::array::from_fn(|index| Place::new(x[index], y[index])),
        })
    }

    /// The position of a measured point in the known frame.
    #[must_use]
    pub fn correct(&self, measured: Place) -> Place {
        let of = (measured - self.origin) / self.size;
        let [one, x, y, xy] = self.coefficients;
        one + x * of.re + y * of.im + xy * (of.re * of.im)
    }
}

/// The additional correction of cathode-ray recorders (*Dicomed*) after [`FourCorners`]: `δx = a x + b x²` and
/// `δy = a' y + b' y²` that are 0 at the corners, with the origin at a corner, hence `δx = b x (x − W)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerZero {
    corner: Place,
    width: f64,
    height: f64,
    /// `b` and `b'`.
    bends: [f64; 2],
}

impl CornerZero {
    /// From the residuals at the middle of the edges after [`FourCorners`].
    ///
    /// * `corner` – the corner of the known frame from which `width` and `height` lead to the opposite one
    /// * `rests` – corrected minus known: of the x of the ticks on the lower and the upper edge, then of the y of those on
    ///   the left and the right edge; opposite edges are averaged, `b = −4 δ/W²`
    ///
    /// # Errors
    /// [`FilmError::Flat`] without width or height, [`FilmError::TooLarge`].
    pub fn new(
        corner: Place,
        width: f64,
        height: f64,
        rests: [[f64; 2]; 2],
    ) -> Result<Self, FilmError> {
        let bend = |size: f64, rest: [f64; 2]| {
            let rest = 0.5 * (rest[0] + rest[1]);
            if !(size.abs() > 0.0) {
                Err(FilmError::Flat)
            } else if !(4.0 * rest.abs() < size.abs()) {
                Err(FilmError::TooLarge)
            } else {
                Ok(-4.0 * rest / size.powi(2))
            }
        };
        Ok(Self {
            corner,
            width,
            height,
            bends: [bend(width, rests[0])?, bend(height, rests[1])?],
        })
    }

    /// The apparent position of a point in the known frame: its own error added.
    #[must_use]
    pub fn distort(&self, known: Place) -> Place {
        let of = known - self.corner;
        let [x, y] = self.bends;
        known
            + Place::new(
                x * of.re * (of.re - self.width),
                y * of.im * (of.im - self.height),
            )
    }

    /// The known position of a point corrected by [`FourCorners`].
    #[must_use]
    pub fn correct(&self, seen: Place) -> Place {
        let of = seen - self.corner;
        let [x, y] = self.bends;
        self.corner
            + Place::new(
                straight(of.re, x, self.width),
                straight(of.im, y, self.height),
            )
    }
}

/// The root of `x + b x (x − W) = s` near `s`, by the formula that is stable for small `b`.
fn straight(seen: f64, bend: f64, size: f64) -> f64 {
    let linear = 1.0 - bend * size;
    let root = (linear * linear + 4.0 * bend * seen).max(0.0).sqrt();
    2.0 * seen / (linear + root)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [Place; 4] = [
        Place::new(0.0, 0.0),
        Place::new(1204.0, 0.0),
        Place::new(1204.0, 1056.0),
        Place::new(0.0, 1056.0),
    ];

    #[test]
    fn the_middle_of_the_box_is_the_crater() {
        let centre = box_centre(Place::new(8.0, 5.0), Place::new(2.0, -1.0));
        assert!((centre - Place::new(5.0, 2.0)).norm() < 1e-15);
    }

    #[test]
    fn corners_come_to_their_places_and_shear_goes() {
        // Shear, scale, rotation and a twist, as in linear double interpolation.
        let film = |of: Place| {
            Place::new(
                3.0 + 0.012 * of.re - 0.0003 * of.im + 2e-8 * of.re * of.im,
                7.0 + 0.0004 * of.re + 0.0121 * of.im - 1e-8 * of.re * of.im,
            )
        };
        let corners = FourCorners::new(&KNOWN.map(film), &KNOWN).unwrap();
        for known in KNOWN {
            let rest = (corners.correct(film(known)) - known).norm();
            assert!(rest < 1e-12 * 1204.0, "{rest}"); // rounding of a picture's size
        }
        // With shear only, every point is corrected.
        let sheared = |of: Place| Place::new(of.re + 0.004 * of.im, of.im);
        let corners = FourCorners::new(&KNOWN.map(sheared), &KNOWN).unwrap();
        let inside = Place::new(333.0, 777.0);
        assert!((corners.correct(sheared(inside)) - inside).norm() < 1e-12 * 1204.0);
    }

    #[test]
    fn the_corner_zero_quadratic_leaves_corners_and_mends_edges() {
        let (width, height) = (1204.0, 1056.0);
        let bent = CornerZero::new(KNOWN[0], width, height, [[1.5, 1.5], [-2.25, -2.25]]).unwrap();
        for corner in KNOWN {
            assert!((bent.correct(corner) - corner).norm() < 1e-12 * width);
            assert!((bent.distort(corner) - corner).norm() < 1e-12 * width);
        }
        for (edge, off) in [
            (Place::new(0.5 * width, 0.0), Place::new(1.5, 0.0)),
            (Place::new(0.5 * width, height), Place::new(1.5, 0.0)),
            (Place::new(0.0, 0.5 * height), Place::new(0.0, -2.25)),
            (Place::new(width, 0.5 * height), Place::new(0.0, -2.25)),
        ] {
            assert!((bent.distort(edge) - edge - off).norm() < 1e-12 * width);
            assert!((bent.correct(edge + off) - edge).norm() < 1e-12 * width);
        }
        let inside = Place::new(100.0, 900.0);
        assert!((bent.correct(bent.distort(inside)) - inside).norm() < 1e-12 * width);
        // Unlike edges are averaged: half of the difference stays at each.
        let unlike = CornerZero::new(KNOWN[0], width, height, [[1.0, 2.0], [0.0, 0.0]]).unwrap();
        let middle = Place::new(0.5 * width, 0.0);
        assert!((unlike.distort(middle) - middle - Place::new(1.5, 0.0)).norm() < 1e-12 * width);
    }

    #[test]
    fn ticks_that_give_no_correction_are_refused() {
        let line = [0.0, 1.0, 2.0, 3.0].map(|x| Place::new(x, 2.0 * x));
        assert_eq!(FourCorners::new(&line, &KNOWN), Err(FilmError::Flat));
        let one = [Place::new(1.0, 1.0); 4];
        assert_eq!(FourCorners::new(&one, &KNOWN), Err(FilmError::Flat));
        let origin = Place::new(0.0, 0.0);
        let bend = |width, rest| CornerZero::new(origin, width, 10.0, [[rest; 2], [0.0; 2]]);
        assert_eq!(bend(0.0, 0.1), Err(FilmError::Flat));
        assert_eq!(bend(10.0, 2.5), Err(FilmError::TooLarge));
        assert!(bend(10.0, 2.4).is_ok());
    }
}
