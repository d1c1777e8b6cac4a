//! What is drawn on: the drawing library's canvas, and words and numbers on it.

use plotters::{
    coord::{Shift, types::RangedCoordf64},
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{INK, LETTERS, WIDTH};
use crate::{error::Result, products::error::ProductError};

/// A drawing in progress.
pub(in crate::report) type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Whether a piece could be drawn.
pub(in crate::report) type Drawn<'a> =
    std::result::Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;
pub(super) type Chart<'a, 'b> =
    ChartContext<'b, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// SVG of the given height, filled by `with`.
///
/// # Errors
/// A drawing that the library refuses, which is a bug in areograph.
pub(in crate::report) fn drawn(
    height: u32,
    with: impl for<'a> FnOnce(&Canvas<'a>) -> Drawn<'a>,
) -> Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        with(&area)
            .and_then(|()| area.present())
            .map_err(ProductError::refused("draw a plot"))?;
    }
    Ok(svg)
}

/// Words on a drawing, in the colour of ink.
pub(in crate::report) fn draw_text<'a>(
    area: &Canvas<'a>,
    text: &str,
    at: (i32, i32),
    anchor: HPos,
) -> Drawn<'a> {
    let style = TextStyle::from(("sans-serif", LETTERS).into_font())
        .color(&INK)
        .pos(Pos::new(anchor, VPos::Center));
    area.draw_text(text, &style, at)
}

/// A number of an axis; what rounds to zero has no sign.
pub(in crate::report) fn label(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if !digits.contains(|digit| matches!(digit, '1'..='9')) => digits.to_owned(),
        _ => text.replace('-', "\u{2212}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign() {
        assert_eq!(label(-0.004, 2), "0.00");
        assert_eq!(label(-0.006, 2), "−0.01");
        assert_eq!(label(-20.0, 0), "−20");
    }
}
