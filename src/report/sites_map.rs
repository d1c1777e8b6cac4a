//! A body with all its sites of an output folder, by verdict.

use std::fmt::Write as _;

use plotters::{prelude::*, style::text_anchor::HPos};

use super::{
    html::Tone,
    map::labels::{self, Labels},
    plots::{
        COLOURS, Canvas, Drawn, GRID, INK, Key, MARK, WIDTH, draw_text, drawn, figure_html, quoted,
    },
};
use crate::{body::Body, error::Result};

/// Height of the map: a degree of latitude is as long as one of longitude.
const HEIGHT: i32 = WIDTH as i32 / 2;
/// Degrees between lines, and between named ones.
const STEP_DEG: i32 = 30;
const NAMED_DEG: i32 = 90;
/// Half the size of a mark.
const MARK_SIZE: i32 = 12;
/// Around the map, for marks on its edge and names of lines.
const MARGIN: i32 = 40;
/// Colours of valid sites and of those with remarks.
const VALID: usize = 2;
const REMARKS: usize = 4;

/// A site on the map.
pub(super) struct Place<'a> {
    pub(super) name: &'a str,
    pub(super) tone: Tone,
    /// East longitude, 0 to 360, and areocentric latitude, degrees.
    pub(super) place_deg: (f64, f64),
}

/// The map; nothing without a place.
///
/// # Errors
/// A drawing that cannot be made.
pub(super) fn figure(body: Body, places: &[Place]) -> Result<String> {
    if places.is_empty() {
        return Ok(String::new());
    }
    let svg = drawn(HEIGHT as u32, |area| draw(places, area))?;
    let mut csv = "site,longitude_deg,latitude_deg\n".to_owned();
    for place in places {
        let (longitude, latitude) = place.place_deg;
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{},{longitude:.4},{latitude:.4}", quoted(place.name));
    }
    let keys = [
        Key::colour("valid (disc)", VALID),
        Key::colour("valid with remarks (triangle)", REMARKS),
        Key::mark("invalid or failed (cross)"),
    ];
    let words = "Middles of the sites' first windows, 0° E at the left edge, lines every 30°. Sites with an outline for a \
                 window are in the table only.";
    Ok(figure_html(
        &format!("Sites on {body}"),
        &svg,
        &keys,
        words,
        &csv,
    ))
}

fn draw<'a>(places: &[Place], area: &Canvas<'a>) -> Drawn<'a> {
    let (width, height) = (WIDTH as i32 - 2 * MARGIN, HEIGHT - 2 * MARGIN);
    let pixel = |(longitude, latitude): (f64, f64)| {
        let x = f64::from(width) / 360.0 * longitude.rem_euclid(360.0);
        let y = f64::from(height) / 180.0 * (90.0 - latitude);
        (MARGIN + x.round() as i32, MARGIN + y.round() as i32)
    };
    let (right, bottom) = (MARGIN + width, MARGIN + height);
    for longitude in (STEP_DEG..360).step_by(STEP_DEG as usize) {
        let (x, _) = pixel((f64::from(longitude), 0.0));
        let line = vec![(x, MARGIN), (x, bottom)];
        area.draw(&PathElement::new(line, GRID.stroke_width(2)))?;
        if longitude % NAMED_DEG == 0 {
            let name = format!("{longitude}° E");
            draw_text(area, &name, (x, bottom + MARGIN / 2), HPos::Center)?;
        }
    }
    for latitude in (STEP_DEG - 90..90).step_by(STEP_DEG as usize) {
        let (_, y) = pixel((0.0, f64::from(latitude)));
        let line = vec![(MARGIN, y), (right, y)];
        area.draw(&PathElement::new(line, GRID.stroke_width(2)))?;
    }
    let frame = [(MARGIN, MARGIN), (right, bottom)];
    area.draw(&Rectangle::new(frame, INK.stroke_width(2)))?;
    let mut names = Labels::new(WIDTH as i32, HEIGHT);
    for place in places {
        names.keep_off(pixel(place.place_deg), MARK_SIZE);
    }
    // The worst over the others, where sites lie close together.
    let order = [Tone::Good, Tone::Remarks, Tone::Bad];
    let sorted = order
        .into_iter()
        .flat_map(|tone| places.iter().filter(move |of| of.tone == tone));
    for place in sorted {
        let (x, y) = pixel(place.place_deg);
        match place.tone {
            Tone::Good => area.draw(&Circle::new((x, y), 9, COLOURS[VALID].filled()))?,
            Tone::Remarks => {
                area.draw(&TriangleMarker::new((x, y), 13, COLOURS[REMARKS].filled()))?;
            }
            Tone::Bad => area.draw(&Cross::new((x, y), 9, MARK.stroke_width(5)))?,
        }
        let wide = labels::width(place.name);
        let beside = [
            (x + 16, y),
            (x - wide - 16, y),
            (x - wide / 2, y - 30),
            (x - wide / 2, y + 30),
        ];
        names.place(place.name, INK, beside.into_iter());
    }
    names.draw(area)
}
