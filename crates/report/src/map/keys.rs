//! Scale and colours below a map or a picture of the ground.

use plotters::{prelude::*, style::text_anchor::HPos};

use super::{
    super::plots::{Canvas, Drawn, INK, label},
    labels::write,
};
use areograph_base::units::METRES_PER_KM;

/// Width of one colour of a bar, and height of the bar, units of the drawing.
const STEP: i32 = 5;
const HEIGHT: i32 = 30;

/// Draws a bar of `length_m` metres, which is `length` units of the drawing long, from its lower left corner.
pub(crate) fn draw_scale<'a>(
    area: &Canvas<'a>,
    (left, y): (i32, i32),
    length_m: f64,
    length: i32,
) -> Drawn<'a> {
    let bar = vec![
        (left, y - 12),
        (left, y),
        (left + length, y),
        (left + length, y - 12),
    ];
    area.draw(&PathElement::new(bar, INK.stroke_width(4)))?;
    let text = if length_m < METRES_PER_KM {
        format!("{} m", label(length_m, 0))
    } else {
        format!("{} km", label(length_m / METRES_PER_KM, 0))
    };
    write(area, &text, (left, y + 28), HPos::Left, INK)
}

/// A bar of colours.
pub(crate) struct ColourBar<'b> {
    /// Left and right end, units of the drawing.
    pub(crate) ends: (i32, i32),
    /// Its upper edge.
    pub(crate) top: i32,
    /// Meaning of the numbers.
    pub(crate) words: &'b str,
    /// Numbers of the first and the last colour.
    pub(crate) numbers: [f64; 2],
    /// Colours by their share of the bar.
    pub(crate) colour: fn(f64) -> [u8; 3],
}

impl ColourBar<'_> {
    /// Draws the bar with its words above it, and its numbers below the places with these shares of it.
    pub(crate) fn draw<'a>(&self, shares: &[f64], area: &Canvas<'a>) -> Drawn<'a> {
        let (left, right) = self.ends;
        let (top, bottom) = (self.top, self.top + HEIGHT);
        let steps = (right - left) / STEP;
        for place in 0..steps {
            let [red, green, blue] = (self.colour)((f64::from(place) + 0.5) / f64::from(steps));
            let x = left + place * STEP;
            // One unit into the next step, so that no gap shows between them.
            let corners = [(x, top), (x + STEP + 1, bottom)];
            area.draw(&Rectangle::new(
                corners,
                RGBColor(red, green, blue).filled(),
            ))?;
        }
        let middle = i32::midpoint(left, right);
        write(area, self.words, (middle, top - 26), HPos::Center, INK)?;
        let [low, high] = self.numbers;
        for share in shares {
            let x = left + (share * f64::from(STEP * steps)).round() as i32;
            let text = label(low + share * (high - low), usize::from(high - low < 10.0));
            area.draw(&PathElement::new(
                vec![(x, bottom), (x, bottom + 8)],
                INK.stroke_width(2),
            ))?;
            write(area, &text, (x, bottom + 26), HPos::Center, INK)?;
        }
        Ok(())
    }
}
