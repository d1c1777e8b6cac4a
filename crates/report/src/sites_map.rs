//! A map of a body with all its sites in an output folder, by verdict, over its relief or its largest features.

mod features;

use std::{collections::BTreeMap, f64::consts::TAU, fmt::Write as _};

use plotters::{prelude::*, style::text_anchor::HPos};

use self::features::{FEATURES, Feature, Kind};
use super::{
    html::{Markup, Tone},
    map::labels::{self, LETTERS, Labels, write},
    numbers::whole,
    plots::{
        COLOURS, Canvas, Drawn, GREY, GRID, INK, Key, MARK, SOFT, WIDTH, drawn, figure_html, image,
        place_behind, quoted,
    },
};
use areograph_base::{body::Body, error::Result};

/// Margin for the names of parallels at the left, and around the rest of the map for marks on its edge.
const LEFT: i32 = 92;
const RIGHT: i32 = 28;
const TOP: i32 = 20;
/// Margin for the names of meridians.
const FOOT: i32 = 44;
/// The map: a degree of latitude is as long as one of longitude.
const MAP_WIDTH: i32 = WIDTH as i32 - LEFT - RIGHT;
const MAP_HEIGHT: i32 = MAP_WIDTH / 2;
const PER_DEGREE: f64 = MAP_WIDTH as f64 / 360.0;
const HEIGHT: i32 = TOP + MAP_HEIGHT + FOOT;
/// Degrees between lines, and between meridians with a name.
const STEP_DEG: i32 = 30;
const NAMED_DEG: i32 = 60;
/// Half the size of a mark.
const MARK_SIZE: i32 = 12;
/// Side of a cell that has one mark on a map of many sites, and its size on the ground.
const CELL: i32 = 20;
const CELL_DEG: f64 = CELL as f64 / PER_DEGREE;
/// Colours of valid sites and of those with remarks.
const VALID: usize = 2;
const REMARKS: usize = 1;
/// Size of the letters of names other than sites.
const SMALL: i32 = 21;
/// Radius of the ring of a landing site.
const RING: i32 = 4;
/// Number of corners of the outline of a feature.
const CORNERS: i32 = 60;

/// Describes the ground of Mars.
const GROUND: &str = "Ground: MOLA heights, shaded, in cells of one degree (MEGDR, NASA PDS), east longitude and areocentric \
                      latitude.";

/// A site on the map.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) name: &'a str,
    pub(super) tone: Tone,
    /// East longitude, 0 to 360, and areocentric latitude, degrees.
    pub(super) place_deg: (f64, f64),
}

/// Marks of sites whose place is that of a window.
pub(super) const OF_WINDOWS: &str = "Centres of the first windows of the sites; sites whose window is an outline are listed in the table only.";

/// The map; empty without a place.
///
/// * `of_sites` – what the marks are, a sentence
///
/// # Errors
/// A drawing that cannot be made.
pub(super) fn figure(body: Body, places: &[Place], of_sites: &str) -> Result<Markup> {
    if places.is_empty() {
        return Ok(Markup::default());
    }
    let features: Vec<&Feature> = FEATURES.iter().filter(|of| of.body == body).collect();
    let (names, unnamed) = names(places, &features);
    let mut words = String::new();
    if !unnamed.is_empty() {
        words = format!(" Not labelled for lack of space: {}.", unnamed.join(", "));
    }
    map(body, places, (&features, &names), of_sites, &words)
}

/// The map of many sites, without their names: one mark for each cell of the map, for the worst site in it.
///
/// # Errors
/// A drawing that cannot be made.
pub(super) fn figure_of_many(body: Body, places: &[Place]) -> Result<Markup> {
    let mut cells: BTreeMap<(i32, i32), &Place> = BTreeMap::new();
    for place in places {
        let (x, y) = pixel(place.place_deg);
        let cell = cells.entry((x / CELL, y / CELL)).or_insert(place);
        if (cell.tone as u8) < place.tone as u8 {
            *cell = place;
        }
    }
    let marks: Vec<Place> = cells.into_values().copied().collect();
    let features: Vec<&Feature> = FEATURES.iter().filter(|of| of.body == body).collect();
    let mut labels = labels_beside(&marks);
    labels.set_letters(SMALL);
    for feature in &features {
        name_feature(feature, &mut labels);
    }
    let of_sites = format!(
        "{} sites; where several lie within {CELL_DEG:.0}° of each other, one mark shows the worst of them.",
        whole(places.len())
    );
    map(body, &marks, (&features, &labels), &of_sites, "")
}

/// The map with these marks and names; `of_sites` states what marks are, `more` follows the words on the ground.
fn map(
    body: Body,
    places: &[Place],
    (features, names): (&[&Feature], &Labels),
    of_sites: &str,
    more: &str,
) -> Result<Markup> {
    let is_seen = |of: &&Feature| match of.kind {
        // Discs stand for large features where the ground is not drawn.
        Kind::Extent(_) => body.relief().is_none(),
        // A ring without a name has no meaning.
        Kind::Landing => names.placed.iter().any(|label| label.text == of.name),
    };
    let seen: Vec<&Feature> = features.iter().copied().filter(is_seen).collect();
    let mut svg = drawn(HEIGHT as u32, |area| draw(places, &seen, names, area))?;
    place_behind(&mut svg, &ground(body));
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
    let of_ground = match body.relief() {
        Some(_) => GROUND,
        None => "Grey: large features with their extent, whole degrees.",
    };
    let words = format!(
        "{of_sites} {of_ground} Names of features by the IAU gazetteer; rings: landing sites.{more}"
    );
    Ok(figure_html(
        &format!("Sites on {body}"),
        &svg,
        &keys,
        &words,
        &csv,
    ))
}

/// The ground of a body as an element of the SVG of a map; empty where its relief is not known.
fn ground(body: Body) -> String {
    let edges = [LEFT, TOP, MAP_WIDTH, MAP_HEIGHT].map(f64::from);
    body.relief()
        .map_or_else(String::new, |png| image(edges, png))
}

/// A position on the map; positions beyond it are at its edge.
fn pixel((longitude, latitude): (f64, f64)) -> (i32, i32) {
    let x = PER_DEGREE * longitude.clamp(0.0, 360.0);
    let y = PER_DEGREE * (90.0 - latitude);
    (LEFT + x.round() as i32, TOP + y.round() as i32)
}

/// Labels that keep off the marks of sites.
fn labels_beside(places: &[Place]) -> Labels {
    let mut labels = Labels::new(WIDTH as i32 - 4, TOP + MAP_HEIGHT);
    // The left side is reserved for the names of parallels.
    for y in (TOP..TOP + MAP_HEIGHT).step_by(LETTERS as usize) {
        labels.keep_off((LEFT / 2, y), LEFT / 2 - 4);
    }
    for place in places {
        labels.keep_off(pixel(place.place_deg), MARK_SIZE);
    }
    labels
}

/// Names of the sites, then of as many features as fit between them; and the sites without a name.
fn names<'a>(places: &[Place<'a>], features: &[&Feature]) -> (Labels, Vec<&'a str>) {
    let mut names = labels_beside(places);
    let mut unnamed = Vec::new();
    for place in places {
        if !names.place_around(place.name, INK, pixel(place.place_deg)) {
            unnamed.push(place.name);
        }
    }
    for landing in features
        .iter()
        .filter(|feature| matches!(feature.kind, Kind::Landing))
    {
        names.keep_off(pixel(landing.place_deg), RING);
    }
    names.set_letters(SMALL);
    for feature in features {
        name_feature(feature, &mut names);
    }
    (names, unnamed)
}

/// The name of a wide feature on it, of another one beside it, if there is room.
fn name_feature(feature: &Feature, names: &mut Labels) {
    let (x, y) = pixel(feature.place_deg);
    let wide = labels::width_in(feature.name, SMALL);
    let (half_width, half_height) = match feature.kind {
        Kind::Extent([east_deg, north_deg]) => (
            (0.5 * east_deg * PER_DEGREE) as i32,
            (0.5 * north_deg * PER_DEGREE) as i32,
        ),
        Kind::Landing => (RING, RING),
    };
    let (aside, up) = (half_width + 6, half_height + SMALL / 2 + 2);
    let middle = x - wide / 2;
    let on =
        (2 * half_width > wide).then_some([(middle, y), (middle, y - SMALL), (middle, y + SMALL)]);
    let beside = [
        (x + aside, y),
        (x - wide - aside, y),
        (middle, y - up),
        (middle, y + up),
    ];
    names.place(feature.name, SOFT, on.into_iter().flatten().chain(beside));
}

fn draw<'a>(
    places: &[Place],
    features: &[&Feature],
    names: &Labels,
    area: &Canvas<'a>,
) -> Drawn<'a> {
    draw_features(features, area)?;
    draw_lines(area)?;
    // The worst above the others, where sites are close together.
    let order = [Tone::Good, Tone::Remarks, Tone::Bad];
    let sorted = order
        .into_iter()
        .flat_map(|tone| places.iter().filter(move |place| place.tone == tone));
    for place in sorted {
        let (x, y) = pixel(place.place_deg);
        // A light edge sets marks off any ground.
        match place.tone {
            Tone::Good => {
                area.draw(&Circle::new((x, y), 11, WHITE.filled()))?;
                area.draw(&Circle::new((x, y), 9, COLOURS[VALID].filled()))?;
            }
            Tone::Remarks => {
                area.draw(&TriangleMarker::new((x, y), 17, WHITE.filled()))?;
                area.draw(&TriangleMarker::new((x, y), 13, COLOURS[REMARKS].filled()))?;
            }
            Tone::Bad => {
                area.draw(&Cross::new((x, y), 10, WHITE.stroke_width(9)))?;
                area.draw(&Cross::new((x, y), 9, MARK.stroke_width(5)))?;
            }
        }
    }
    names.draw(area)
}

/// The extent of large features on this map, and rings at landing sites.
fn draw_features<'a>(features: &[&Feature], area: &Canvas<'a>) -> Drawn<'a> {
    for feature in features {
        match feature.kind {
            Kind::Extent(across_deg) => {
                for ring in outline(feature, across_deg) {
                    area.draw(&Polygon::new(ring, COLOURS[GREY].mix(0.13).filled()))?;
                }
            }
            Kind::Landing => {
                let place = pixel(feature.place_deg);
                area.draw(&Circle::new(place, RING, SOFT.stroke_width(2)))?;
            }
        }
    }
    Ok(())
}

/// The outline of a round feature, cut at the edge of the map.
fn outline(feature: &Feature, [east_deg, north_deg]: [f64; 2]) -> Vec<Vec<(i32, i32)>> {
    let (longitude, latitude) = feature.place_deg;
    let ring = |turn_deg: f64| {
        let corner = move |step: i32| {
            let (sine, cosine) = (f64::from(step) * TAU / f64::from(CORNERS)).sin_cos();
            let east = longitude + turn_deg + 0.5 * east_deg * cosine;
            (east, latitude + 0.5 * north_deg * sine)
        };
        let ring: Vec<(f64, f64)> = (0..CORNERS).map(corner).collect();
        let seen = ring.iter().any(|(east, _)| (0.0..360.0).contains(east));
        seen.then(|| ring.into_iter().map(pixel).collect())
    };
    [-360.0, 0.0, 360.0].into_iter().filter_map(ring).collect()
}

/// Meridians and parallels with their names, and the frame.
fn draw_lines<'a>(area: &Canvas<'a>) -> Drawn<'a> {
    let [left, top, right, bottom] = [LEFT, TOP, LEFT + MAP_WIDTH, TOP + MAP_HEIGHT];
    for longitude in (0..=360).step_by(STEP_DEG as usize) {
        let (x, _) = pixel((f64::from(longitude), 0.0));
        let line = vec![(x, top), (x, bottom)];
        area.draw(&PathElement::new(line, GRID.mix(0.6).stroke_width(2)))?;
        if longitude % NAMED_DEG == 0 && longitude < 360 {
            let name = format!("{longitude}° E");
            write(area, &name, (x, bottom + FOOT / 2), HPos::Center, INK)?;
        }
    }
    for latitude in (STEP_DEG - 90..90).step_by(STEP_DEG as usize) {
        let (_, y) = pixel((0.0, f64::from(latitude)));
        let line = vec![(left, y), (right, y)];
        area.draw(&PathElement::new(line, GRID.mix(0.6).stroke_width(2)))?;
        let name = match latitude {
            0 => "0°".to_owned(),
            south if south < 0 => format!("{}° S", -south),
            north => format!("{north}° N"),
        };
        write(area, &name, (left - 10, y), HPos::Right, INK)?;
    }
    let frame = [(left, top), (right, bottom)];
    area.draw(&Rectangle::new(frame, INK.stroke_width(2)))
}

#[cfg(test)]
mod tests;
