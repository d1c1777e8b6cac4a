//! A body with all its sites of an output folder, by verdict.

use std::fmt::Write as _;

use plotters::prelude::*;

use super::{
    html::Tone,
    map::labels::{self, Labels},
    plots::{COLOURS, Canvas, Drawn, GRID, INK, Key, MARK, WIDTH, drawn, figure_html, quoted},
};
use crate::{body::Body, error::Result};

/// Height of the map: a degree of latitude is as long as one of longitude.
const HEIGHT: i32 = WIDTH as i32 / 2;
/// Degrees between lines.
const STEP_DEG: i32 = 30;
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
    let words = "Middles of the sites' first windows, 0° E at the left edge, lines every 30°; sites whose window is an outline \
                 are in the table only.";
    Ok(figure_html(&format!("Sites on {body}"), &svg, &keys, words, &csv))
}

fn draw<'a>(places: &[Place], area: &Canvas<'a>) -> Drawn<'a> {
    let width = WIDTH as i32;
    let pixel = |(longitude, latitude): (f64, f64)| {
        let scale = f64::from(WIDTH) / 360.0;
        (
            (scale * longitude.rem_euclid(360.0)).round() as i32,
            (scale * (90.0 - latitude)).round() as i32,
        )
    };
    for line in 1..360 / STEP_DEG {
        let x = line * STEP_DEG * width / 360;
        area.draw(&PathElement::new(
            vec![(x, 0), (x, HEIGHT)],
            GRID.stroke_width(2),
        ))?;
    }
    for line in 1..180 / STEP_DEG {
        let y = line * STEP_DEG * HEIGHT / 180;
        area.draw(&PathElement::new(
            vec![(0, y), (width, y)],
            GRID.stroke_width(2),
        ))?;
    }
    let frame = [(0, 0), (width - 1, HEIGHT - 1)];
    area.draw(&Rectangle::new(frame, INK.stroke_width(2)))?;
    let mut names = Labels::new(width, HEIGHT);
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
