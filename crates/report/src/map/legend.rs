//! The strip below a map: its scale, its colours of heights, and its location on Mars.

use super::{
    super::{
        graticule::View,
        plots::{Canvas, Drawn, WIDTH},
    },
    globe::Globe,
    keys::{ColourBar, draw_scale},
    relief, round_length_m,
};

/// Height of the strip.
pub(super) const STRIP: i32 = 176;
/// Left and right end of the bar of colours.
const BAR: (i32, i32) = (330, 800);

/// The strip, from the height `top` down.
pub(super) struct Legend<'a> {
    pub(super) top: i32,
    pub(super) view: &'a View,
    /// Heights of the first and last colour, metres; `None` without shots.
    pub(super) heights_m: Option<(f64, f64)>,
    /// Surface that they refer to.
    pub(super) areoid: &'static str,
    /// East longitude and areocentric latitude of the map's centre, radians.
    pub(super) centre_rad: (f64, f64),
}

impl Legend<'_> {
    pub(super) fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        self.draw_scale(area)?;
        if let Some(heights_m) = self.heights_m {
            self.draw_bar(heights_m, area)?;
        }
        self.globe().draw(area)
    }

    /// The globe at the right.
    pub(super) const fn globe(&self) -> Globe {
        Globe {
            centre: (WIDTH as i32 - 100, self.top + STRIP / 2 + 4),
            place_rad: self.centre_rad,
        }
    }

    /// A bar of a round length, true at the centre.
    fn draw_scale<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let length_m = round_length_m(0.24 * self.view.width_m());
        let pixels = (length_m / self.view.width_m() * f64::from(WIDTH)).round() as i32;
        draw_scale(area, (12, self.top + 74), length_m, pixels)
    }

    fn draw_bar<'a>(&self, (low, high): (f64, f64), area: &Canvas<'a>) -> Drawn<'a> {
        let bar = ColourBar {
            ends: BAR,
            top: self.top + 62,
            words: &format!("height above the {}, m", self.areoid),
            numbers: [low, high],
            colour: relief::colour,
        };
        // Heights that agree to half a metre have one colour and one name.
        let shares: &[f64] = if high - low < 0.5 {
            &[0.5]
        } else {
            &[0.0, 0.5, 1.0]
        };
        bar.draw(shares, area)
    }
}
