//! The drawing library's canvas, and words and numbers on it.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use plotters::{
    coord::{Shift, types::RangedCoordf64},
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{super::numbers::number, INK, LETTERS, WIDTH};
use areograph_base::error::Result;
use areograph_products::error::ProductError;

/// A drawing in progress.
pub(crate) type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Result of drawing a piece.
pub(crate) type Drawn<'a> =
    std::result::Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;
pub(super) type Chart<'a, 'b> =
    ChartContext<'b, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// SVG of the given height, filled by `with`.
///
/// # Errors
/// A drawing that the library rejects, which is a bug in areograph.
pub(crate) fn drawn(
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

/// A picture as an element of an SVG: left, top, width and height in units of the drawing.
pub(crate) fn image([left, top, width, height]: [f64; 4], png: &[u8]) -> String {
    format!(
        "<image x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" preserveAspectRatio=\"none\" \
         href=\"data:image/png;base64,{}\"/>\n",
        STANDARD.encode(png)
    )
}

/// Places elements behind everything else that an SVG draws.
pub(crate) fn place_behind(svg: &mut String, elements: &str) {
    if let Some(start) = svg.find('>') {
        svg.insert_str(start + 1, elements);
    }
}

/// Words on a drawing, in the colour of ink.
pub(crate) fn draw_text<'a>(
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

/// A number of an axis or a table, as `numbers.rs` writes it.
#[must_use]
pub fn label(value: f64, decimals: usize) -> String {
    number(value, decimals)
}
