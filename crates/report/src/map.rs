//! Map of the site: shaded ground by its own shots, profiles by name, windows, image outlines, tie points.

mod ellipses;
pub(super) mod globe;
pub(super) mod keys;
pub(super) mod labels;
mod legend;
mod names;
pub(super) mod relief;
mod sheets;
mod words;

use std::collections::BTreeMap;

use geo::Simplify as _;
use plotters::prelude::*;

use self::{
    ellipses::Ellipses,
    legend::{Legend, STRIP},
    relief::Relief,
    sheets::{Shown, sheets},
    words::names,
};
use super::{
    graticule::{View, graticule},
    html::{Markup, counted, html},
    many,
    plots::{COLOURS, Canvas, Drawn, GRID, INK, WIDTH, drawn, figure_html, place_behind, thinned},
    section::Section,
};
use areograph_base::error::Result;
use areograph_geom::{ellipsoid::Spherical, map_projection::MapProjection};
use areograph_products::SiteProducts;

/// Largest number of shots of a map, drawn and listed; about 140 bytes each.
const MAP_SHOTS: usize = 2_500;
/// Largest number of tie points on a map.
const MAP_TIES: usize = 400;
/// Least and greatest height of the picture against its width.
const RATIO: (f64, f64) = (0.5, 0.78);
/// Largest offset of a point from its line by rounding, units of the drawing.
const ROUNDING: f64 = 0.75;
/// Shots farther apart, in units of the drawing, are not joined.
const TRACK_GAP: f64 = 60.0;
/// Colour of shots, which the page's style does not change.
const TRACK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
/// Colours of image outlines, of tie points and of their ellipses; the ground has no similar ones.
const IMAGE: usize = 3;
const TIE: usize = 1;
const ELLIPSE: usize = 5;

/// The maps after the first, which is in the lead.
pub(super) const SECTION: Section = Section {
    title: "Further maps",
    anchor: "further-maps",
    checks: &[],
    appears: |site| sheets(site).len() > 1,
    write: |site| {
        let further = sheets(site).into_iter().skip(1);
        Ok(html! { div.plots { @for shown in further { (figure(site, shown, false)?) } } })
    },
};

/// The map of the lead; empty for a site without windows, shots and images.
///
/// # Errors
/// The map cannot be drawn.
pub(super) fn first(site: &SiteProducts) -> Result<Markup> {
    let mut all = sheets(site).into_iter();
    let shown = all.next().filter(|shown| {
        !(shown.windows.is_empty() && shown.images.is_empty() && shown.rows.is_empty())
    });
    let Some(shown) = shown else {
        return Ok(Markup::default());
    };
    let only = all.next().is_none();
    Ok(html! { (figure(site, shown, only)?) (without_outline(site)) })
}

/// The images that are not on any map.
fn without_outline(site: &SiteProducts) -> Markup {
    let missing: Vec<&str> = site
        .images
        .iter()
        .filter(|image| image.orientation.outline.is_none())
        .map(|image| &*image.times.id)
        .collect();
    let named = match missing.len() {
        0 => return Markup::default(),
        count if many::are_many(site) => counted(count, "image"),
        _ => missing.join(", "),
    };
    html! { p { "Not drawn, because an image corner shows no ground: " (named) "." } }
}

fn figure(site: &SiteProducts, shown: Shown, only: bool) -> Result<Markup> {
    let sheet = Sheet::of(site, shown);
    let relief = sheet.relief(site);
    let mut svg = drawn((sheet.height() + STRIP) as u32, |area| sheet.draw(area))?;
    if let Some(relief) = &relief {
        let (width, height) = (f64::from(WIDTH), f64::from(sheet.height()));
        place_behind(&mut svg, &relief.svg(sheet.heights_m, width, height)?);
    }
    place_behind(&mut svg, &sheet.legend().globe().relief(site.config.body)?);
    let mut title = "Windows, footprints and images".to_owned();
    if !only {
        title += &format!(": {}", names(&sheet.shown.windows));
    }
    let words = sheet.words(relief.as_ref()) + &many::drawn_in_words(site);
    Ok(figure_html(
        &title,
        &svg,
        &sheet.keys(),
        &words,
        &sheet.csv(),
    ))
}

struct Shot {
    place_rad: (f64, f64),
    height_m: f64,
}

/// Everything on a map.
struct Sheet {
    map: MapProjection,
    view: View,
    shown: Shown,
    shots: Vec<Shot>,
    /// Name and places of every profile on the sheet, its first and last shot among them.
    profiles: Vec<(String, Vec<(f64, f64)>)>,
    ties_rad: Vec<(f64, f64)>,
    ellipses: Ellipses,
    /// Lowest and highest shot, including those not drawn.
    heights_m: (f64, f64),
    /// Surface that heights refer to.
    areoid: &'static str,
    /// Frame and kind of latitudes.
    frame: String,
}

impl Sheet {
    fn of(site: &SiteProducts, shown: Shown) -> Self {
        let (footprints, terms) = (site.footprints, site.config.terms());
        let place_rad = |row: usize| {
            (
                footprints.longitude_rad.at(row),
                footprints.latitude_rad.at(row),
            )
        };
        let height_m = |row: usize| footprints.topography_of_m(row);
        let step = shown.rows.len().div_ceil(MAP_SHOTS).max(1);
        let shots: Vec<Shot> = (shown.rows.iter().step_by(step))
            .map(|row| row as usize)
            .map(|row| Shot {
                place_rad: place_rad(row),
                height_m: height_m(row),
            })
            .collect();
        let points: Vec<(f64, f64)> = shown
            .windows
            .iter()
            .chain(&shown.images)
            .flat_map(|outline| outline.ring.iter().copied())
            .chain(shots.iter().map(|shot| shot.place_rad))
            .collect();
        let map = MapProjection::of_points(
            points.iter().copied(),
            site.config.body.model().equatorial_radius_m,
        );
        let places = points
            .iter()
            .filter_map(|point| map.project(point.0, point.1));
        let view = View::of(places);
        let ratio = (view.height_m() / view.width_m()).clamp(RATIO.0, RATIO.1);
        let heights_m = shown.rows.iter().map(|row| height_m(row as usize)).fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(low, high), height_m| (low.min(height_m), high.max(height_m)),
        );
        let view = view.with_ratio(ratio);
        let adjustment = site.adjustment();
        // Ellipses by the a priori accuracy of another spacecraft would state an accuracy that is withheld elsewhere.
        let stated = adjustment
            .iter()
            .filter(|_| site.accuracy_withheld().is_none());
        let ties = stated.flat_map(|(_, of)| of.adjusted_ties());
        Self {
            map,
            ellipses: Ellipses::of(ties, view.width_m()),
            view,
            profiles: profiles(site, &shown, place_rad),
            ties_rad: ties_rad(site),
            shown,
            shots,
            heights_m,
            areoid: terms.areoid(),
            frame: format!("{}, {}", terms.short_frame(), terms.latitude()),
        }
    }

    /// The ground by all shots of the site, on other sheets or not.
    fn relief(&self, site: &SiteProducts) -> Option<Relief> {
        let footprints = site.footprints;
        let places = footprints
            .longitude_rad
            .iter()
            .zip(&footprints.latitude_rad);
        let shots = places
            .enumerate()
            .filter_map(|(row, (longitude, latitude))| {
                let place = self.map.project(longitude, latitude)?;
                Some((place, footprints.topography_of_m(row)))
            });
        Relief::of(&self.view, shots)
    }

    /// Height of the map without the strip below it, in units of the drawing.
    fn height(&self) -> i32 {
        (f64::from(WIDTH) * self.view.height_m() / self.view.width_m()).round() as i32
    }

    fn pixel(&self, (x, y): (f64, f64)) -> (i32, i32) {
        let scale = f64::from(WIDTH) / self.view.width_m();
        let right = (x - self.view.west_m) * scale;
        let down = (self.view.north_m - y) * scale;
        (right.round() as i32, down.round() as i32)
    }

    /// Position of longitude and latitude on the drawing; `None` for the antipode of the centre.
    fn place(&self, (longitude_rad, latitude_rad): (f64, f64)) -> Option<(i32, i32)> {
        let place = self.map.project(longitude_rad, latitude_rad)?;
        Some(self.pixel(place))
    }

    fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let lines = graticule(&self.map, &self.view);
        for segment in lines.iter().flat_map(|line| &line.segments) {
            let ends = segment.map(|place| self.pixel(place)).to_vec();
            area.draw(&PathElement::new(ends, GRID.stroke_width(2)))?;
        }
        self.draw_shots(area)?;
        for window in &self.shown.windows {
            self.draw_ring(&window.ring, INK.stroke_width(3), area)?;
        }
        for image in &self.shown.images {
            self.draw_ring(&image.ring, COLOURS[IMAGE].stroke_width(5), area)?;
        }
        for place in self.ties_rad.iter().filter_map(|tie| self.place(*tie)) {
            area.draw(&Cross::new(place, 5, COLOURS[TIE].stroke_width(2)))?;
        }
        for ring_m in &self.ellipses.rings_m {
            let places = ring_m.iter().map(Spherical::from_xyz_m);
            let ring: Vec<(f64, f64)> = places
                .map(|place| (place.longitude_rad, place.latitude.0))
                .collect();
            self.draw_ring(&ring, COLOURS[ELLIPSE].stroke_width(2), area)?;
        }
        let frame = [(0, 0), (WIDTH as i32 - 1, self.height() - 1)];
        area.draw(&Rectangle::new(frame, INK.stroke_width(2)))?;
        self.names(&lines).0.draw(area)?;
        self.legend().draw(area)
    }

    fn legend(&self) -> Legend<'_> {
        let has_shots = !self.shown.rows.is_empty();
        Legend {
            top: self.height(),
            view: &self.view,
            heights_m: has_shots.then_some(self.heights_m),
            areoid: self.areoid,
            centre_rad: (self.map.longitude_rad(), self.map.latitude_rad()),
        }
    }

    /// Dark dots on a light band: both are the same on light and dark pages, as the ground is, which may be either.
    fn draw_shots<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        for (_, places) in &self.profiles {
            let places: Vec<Option<(i32, i32)>> =
                places.iter().map(|place| self.place(*place)).collect();
            for track in tracks(&places) {
                area.draw(&PathElement::new(track, WHITE.mix(0.55).stroke_width(9)))?;
            }
        }
        let places = self
            .shots
            .iter()
            .filter_map(|shot| self.place(shot.place_rad));
        let dots = places.map(|place| Circle::new(place, 2, TRACK.filled()));
        for dot in dots {
            area.draw(&dot)?;
        }
        Ok(())
    }

    fn draw_ring<'a>(
        &self,
        ring: &[(f64, f64)],
        style: ShapeStyle,
        area: &Canvas<'a>,
    ) -> Drawn<'a> {
        let closed = ring.iter().chain(ring.first());
        let places: Vec<Option<(i32, i32)>> = closed.map(|point| self.place(*point)).collect();
        for run in places.split(Option::is_none) {
            let pixels = straightened(run.iter().copied().flatten());
            if pixels.len() > 1 {
                area.draw(&PathElement::new(pixels, style))?;
            }
        }
        Ok(())
    }
}

/// Lines along the shots of a profile, with a gap where shots are missing.
fn tracks(places: &[Option<(i32, i32)>]) -> Vec<Vec<(i32, i32)>> {
    let mut tracks: Vec<Vec<(i32, i32)>> = Vec::new();
    for place in places.iter().copied().flatten() {
        let is_near = |last: &(i32, i32)| {
            f64::from(place.0 - last.0).hypot(f64::from(place.1 - last.1)) < TRACK_GAP
        };
        match tracks.last_mut() {
            Some(track) if track.last() == Some(&place) => {}
            Some(track) if track.last().is_some_and(is_near) => track.push(place),
            _ => tracks.push(vec![place]),
        }
    }
    let lines = tracks
        .into_iter()
        .map(|track| straightened(track.into_iter()));
    lines.filter(|line| line.len() > 1).collect()
}

/// A line without points that are off it only by rounding: straight edges stay straight.
fn straightened(pixels: impl Iterator<Item = (i32, i32)>) -> Vec<(i32, i32)> {
    let line: geo::LineString = pixels.map(|(x, y)| (f64::from(x), f64::from(y))).collect();
    let kept = line.simplify(ROUNDING);
    kept.coords()
        .map(|place| (place.x as i32, place.y as i32))
        .collect()
}

/// Orbit and places of the profiles with shots on the sheet; for two passes of an orbit the first.
fn profiles(
    site: &SiteProducts,
    shown: &Shown,
    place_rad: impl Fn(usize) -> (f64, f64),
) -> Vec<(String, Vec<(f64, f64)>)> {
    let mut on_sheet = vec![false; site.footprints.len()];
    for row in &shown.rows {
        on_sheet[row as usize] = true;
    }
    let mut named: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
    for profile in site.profiles {
        let rows = profile.rows.iter().map(|row| *row as usize);
        let places = rows.filter(|row| on_sheet[*row]).map(&place_rad);
        let places: Vec<(f64, f64)> = places.collect();
        if !places.is_empty() {
            named.entry(profile.orbit).or_insert(places);
        }
    }
    let named = named.into_iter();
    named
        .map(|(orbit, places)| (orbit.to_string(), places))
        .collect()
}

/// Tie points, adjusted if available, thinned.
fn ties_rad(site: &SiteProducts) -> Vec<(f64, f64)> {
    let Some(geometric) = &site.geometric else {
        return Vec::new();
    };
    let points_m: Vec<nalgebra::Vector3<f64>> = if let Some(of) = &geometric.adjustment {
        of.adjusted_ties().map(|tie| tie.ground.xyz_m).collect()
    } else {
        let points = geometric.intersected.points.iter();
        points.map(|point| point.ground.xyz_m).collect()
    };
    let shown = thinned(&points_m, MAP_TIES);
    let places = shown.iter().map(Spherical::from_xyz_m);
    places
        .map(|place| (place.longitude_rad, place.latitude.0))
        .collect()
}

/// 1, 2 or 5 times a power of ten, at most `length`.
#[must_use]
pub fn round_length_m(length: f64) -> f64 {
    let power = 10_f64.powf(length.log10().floor());
    let lead = [5.0, 2.0]
        .into_iter()
        .find(|lead| lead * power <= length)
        .unwrap_or(1.0);
    lead * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_have_gaps_where_shots_are_missing() {
        let places = [
            Some((0, 0)),
            Some((3, 20)),
            Some((6, 40)),
            None,
            Some((30, 200)),
            Some((33, 220)),
            Some((500, 500)),
        ];
        assert_eq!(
            tracks(&places),
            [vec![(0, 0), (6, 40)], vec![(30, 200), (33, 220)]]
        );
    }

    #[test]
    fn scales_have_round_lengths() {
        for (room, length) in [(13_000.0, 10_000.0), (2_400.0, 2_000.0), (999.0, 500.0)] {
            assert!((round_length_m(room) - length).abs() < 1e-6, "{room}"); // rounding
        }
    }
}
