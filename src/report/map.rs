//! Map of windows, footprints coloured by height, and image outlines.

use std::{f64::consts::FRAC_PI_2, fmt::Write as _};

use plotters::{prelude::*, style::text_anchor::HPos};

use super::{
    graticule::{GridLine, View, graticule},
    html::paragraph,
    outlines::{Outline, images, windows},
    plots::{
        COLOURS, Canvas, Drawn, GRID, INK, Key, WIDTH, draw_text, drawn, figure_html, quoted,
        thinned,
    },
    section::Section,
};
use crate::{
    constants::MARS_IAU2000,
    error::Result,
    geom::map_projection::MapProjection,
    products::SiteProducts,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};

/// Shots of the map, drawn and listed; about 140 bytes each.
const MAP_SHOTS: usize = 5_000;
/// Colours of heights, the lowest first; clear on light and dark pages.
const HEIGHTS: [RGBColor; 7] = [
    RGBColor(0x3f, 0x68, 0xb5),
    RGBColor(0x4f, 0x94, 0xc4),
    RGBColor(0x6d, 0xb3, 0xae),
    RGBColor(0xa9, 0xb0, 0x6a),
    RGBColor(0xd3, 0x9a, 0x45),
    RGBColor(0xcf, 0x6c, 0x3c),
    RGBColor(0xb0, 0x3f, 0x43),
];
/// Least and greatest height of the picture against its width.
const RATIO: (f64, f64) = (0.5, 1.15);

pub(super) const SECTION: Section = Section {
    title: "Map",
    anchor: "map",
    appears: |site| {
        let outlined = !windows(site).is_empty() || !images(site).is_empty();
        outlined || !site.footprints.is_empty()
    },
    write,
};

fn write(site: &SiteProducts) -> Result<String> {
    let sheet = Sheet::of(site);
    let svg = drawn(sheet.height() as u32, |area| sheet.draw(area))?;
    let mut words = sheet.words(site);
    if site.footprints.len() > sheet.shots.len() {
        words += " Some are left out of the drawing, equally spaced.";
    }
    let figure = figure_html(
        "Windows, footprints and images",
        &svg,
        &sheet.keys(),
        &words,
        &sheet.csv(),
    );
    let missing: Vec<&str> = site
        .images
        .iter()
        .filter(|image| image.orientation.outline.is_none())
        .map(|image| &*image.times.id)
        .collect();
    if missing.is_empty() {
        return Ok(figure);
    }
    let words = format!(
        "Not drawn, because a corner sees no ground: {}.",
        missing.join(", ")
    );
    Ok(figure + &paragraph(&words))
}

struct Shot {
    place_rad: (f64, f64),
    height_m: f64,
}

/// Everything on the map.
struct Sheet {
    map: MapProjection,
    view: View,
    windows: Vec<Outline>,
    images: Vec<Outline>,
    shots: Vec<Shot>,
    /// Lowest and highest shot, those that are not drawn included.
    heights_m: (f64, f64),
}

impl Sheet {
    fn of(site: &SiteProducts) -> Self {
        let windows = windows(site);
        let images = images(site);
        let rows: Vec<usize> = (0..site.footprints.len()).collect();
        let topography_m = site.footprints.topography_m();
        let shots: Vec<Shot> = thinned(&rows, MAP_SHOTS)
            .into_iter()
            .map(|row| Shot {
                place_rad: (
                    site.footprints.longitude_rad[row],
                    site.footprints.latitude_rad[row],
                ),
                height_m: topography_m[row],
            })
            .collect();
        let rings = windows.iter().chain(&images);
        let points: Vec<(f64, f64)> = rings
            .flat_map(|outline| outline.ring.iter().copied())
            .chain(shots.iter().map(|shot| shot.place_rad))
            .collect();
        let map =
            MapProjection::of_points(points.iter().copied(), MARS_IAU2000.equatorial_radius_m);
        let places = points
            .iter()
            .filter_map(|point| map.project(point.0, point.1));
        let view = View::of(places);
        let ratio = (view.height_m() / view.width_m()).clamp(RATIO.0, RATIO.1);
        let heights_m = range(&topography_m);
        Self {
            map,
            view: view.with_ratio(ratio),
            windows,
            images,
            shots,
            heights_m,
        }
    }

    fn height(&self) -> f64 {
        (f64::from(WIDTH) * self.view.height_m() / self.view.width_m()).round()
    }

    fn pixel(&self, (x, y): (f64, f64)) -> (i32, i32) {
        let scale = f64::from(WIDTH) / self.view.width_m();
        let right = (x - self.view.west_m) * scale;
        let down = (self.view.north_m - y) * scale;
        (right.round() as i32, down.round() as i32)
    }

    /// Colour of a height: the range in equal steps.
    fn colour(&self, height_m: f64) -> RGBColor {
        let (low, high) = self.heights_m;
        let share = (height_m - low) / (high - low).max(f64::MIN_POSITIVE);
        let step = (share * HEIGHTS.len() as f64) as usize;
        HEIGHTS[step.min(HEIGHTS.len() - 1)]
    }

    fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        self.draw_graticule(area)?;
        for shot in &self.shots {
            let (longitude, latitude) = shot.place_rad;
            if let Some(place) = self.map.project(longitude, latitude) {
                let style = self.colour(shot.height_m).filled();
                area.draw(&Circle::new(self.pixel(place), 4, style))?;
            }
        }
        for window in &self.windows {
            self.draw_ring(&window.ring, INK.stroke_width(3), area)?;
        }
        for (place, image) in self.images.iter().enumerate() {
            let colour = COLOURS[image_colour(place)];
            self.draw_ring(&image.ring, colour.stroke_width(5), area)?;
        }
        self.draw_scale(area)
    }

    fn draw_ring<'a>(
        &self,
        ring: &[(f64, f64)],
        style: ShapeStyle,
        area: &Canvas<'a>,
    ) -> Drawn<'a> {
        let closed = ring.iter().chain(ring.first());
        let places: Vec<Option<(f64, f64)>> = closed
            .map(|(longitude, latitude)| self.map.project(*longitude, *latitude))
            .collect();
        for run in places.split(Option::is_none) {
            let pixels: Vec<(i32, i32)> = run
                .iter()
                .flatten()
                .map(|place| self.pixel(*place))
                .collect();
            if pixels.len() > 1 {
                area.draw(&PathElement::new(pixels, style))?;
            }
        }
        Ok(())
    }

    fn draw_graticule<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let lines = graticule(&self.map, &self.view);
        for line in &lines {
            for segment in &line.segments {
                let ends = segment.map(|place| self.pixel(place)).to_vec();
                area.draw(&PathElement::new(ends, GRID.stroke_width(2)))?;
            }
        }
        let frame = [(0, 0), (WIDTH as i32 - 1, self.height() as i32 - 1)];
        area.draw(&Rectangle::new(frame, INK.stroke_width(2)))?;
        lines.iter().try_for_each(|line| self.draw_name(line, area))
    }

    /// Names a parallel where it is farthest left, a meridian where it is lowest or, when meridians run
    /// together in a pole, where it leaves the sheet.
    fn draw_name<'a>(&self, line: &GridLine, area: &Canvas<'a>) -> Drawn<'a> {
        let (width, height) = (WIDTH as i32, self.height() as i32);
        let ends = || {
            let places = line.segments.iter().flatten();
            places.map(|place| self.pixel(*place))
        };
        let at = if line.is_parallel {
            ends().min_by_key(|(x, _)| *x).map(|(_, y)| (10, y - 18))
        } else if self.pole() {
            ends().max_by_key(|(x, y)| (x - width / 2).pow(2) + (y - height / 2).pow(2))
        } else {
            ends()
                .max_by_key(|(_, y)| *y)
                .map(|(x, _)| (x + 6, height - 22))
        };
        at.map_or(Ok(()), |(x, y)| {
            let at = (x.clamp(10, width - 120), y.clamp(22, height - 22));
            draw_text(area, &line.name, at, HPos::Left)
        })
    }

    /// Whether a pole lies on the sheet.
    fn pole(&self) -> bool {
        [FRAC_PI_2, -FRAC_PI_2].into_iter().any(|pole| {
            let place = self.map.project(0.0, pole);
            place.is_some_and(|place| self.view.contains(place))
        })
    }

    /// A bar of a round length at the upper right.
    fn draw_scale<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let length_m = round_length_m(0.22 * self.view.width_m());
        let pixels = (length_m / self.view.width_m() * f64::from(WIDTH)).round() as i32;
        let (right, y) = (WIDTH as i32 - 24, 30);
        let bar = vec![
            (right - pixels, y - 10),
            (right - pixels, y),
            (right, y),
            (right, y - 10),
        ];
        area.draw(&PathElement::new(bar, INK.stroke_width(4)))?;
        let text = if length_m < METRES_PER_KM {
            format!("{length_m} m")
        } else {
            format!("{} km", length_m / METRES_PER_KM)
        };
        draw_text(area, &text, (right, y + 22), HPos::Right)
    }

    fn keys(&self) -> Vec<Key> {
        let mut keys: Vec<Key> = self
            .images
            .iter()
            .enumerate()
            .map(|(place, image)| {
                Key::colour(&format!("image {}", image.name), image_colour(place))
            })
            .collect();
        if !self.shots.is_empty() {
            let (low, high) = self.heights_m;
            let step = (high - low) / HEIGHTS.len() as f64;
            if step < 0.5 {
                keys.push(Key::fixed(&format!("{low:.1} to {high:.1} m"), HEIGHTS[0]));
                return keys;
            }
            keys.extend(HEIGHTS.iter().enumerate().map(|(place, colour)| {
                let [from, to] = [place, place + 1].map(|edge| low + edge as f64 * step);
                Key::fixed(&format!("{from:.0} to {to:.0} m"), *colour)
            }));
        }
        keys
    }

    fn words(&self, site: &SiteProducts) -> String {
        let names = |outlines: &[Outline]| -> String {
            let mut names: Vec<&str> = outlines.iter().map(|outline| &*outline.name).collect();
            // Holes and islands are rings of the same window.
            names.dedup();
            names.join(", ")
        };
        let mut words = String::new();
        if !self.windows.is_empty() {
            words += &format!("Windows (black or white lines): {}. ", names(&self.windows));
        }
        if !self.images.is_empty() {
            words += &format!("Outlines of images: {}. ", names(&self.images));
        }
        if !self.shots.is_empty() {
            words += &format!(
                "{} footprints, {:.0} to {:.0} m above the areoid. ",
                site.footprints.len(),
                self.heights_m.0,
                self.heights_m.1
            );
        }
        words
            + &format!(
                "IAU 2000, areocentric; equal-area map about {:.2}° E {:.2}° {}, north up at the centre, where the \
                 scale is true.",
                self.map.longitude_rad() / RADIANS_PER_DEGREE,
                self.map.latitude_rad().abs() / RADIANS_PER_DEGREE,
                if self.map.latitude_rad() < 0.0 {
                    "S"
                } else {
                    "N"
                }
            )
    }

    fn csv(&self) -> String {
        let mut csv = "what,name,longitude_deg,latitude_deg,height_m\n".to_owned();
        for (what, outlines) in [("window", &self.windows), ("image", &self.images)] {
            for outline in outlines {
                let name = quoted(&outline.name);
                for (longitude, latitude) in &outline.ring {
                    let [longitude, latitude] =
                        [longitude, latitude].map(|angle| angle / RADIANS_PER_DEGREE);
                    // Writing to a string cannot fail.
                    let _ = writeln!(csv, "{what},{name},{longitude:.6},{latitude:.6},");
                }
            }
        }
        for shot in &self.shots {
            let (longitude, latitude) = shot.place_rad;
            let [longitude, latitude] =
                [longitude, latitude].map(|angle| angle / RADIANS_PER_DEGREE);
            let _ = writeln!(
                csv,
                "shot,,{longitude:.6},{latitude:.6},{:.2}",
                shot.height_m
            );
        }
        csv
    }
}

/// Colours of image outlines that no height has.
const fn image_colour(place: usize) -> usize {
    const APART: [usize; 3] = [3, 2, super::plots::GREY];
    APART[place % APART.len()]
}

/// Lowest and highest of `values`.
fn range(values: &[f64]) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    values.iter().fold(start, |(low, high), value| {
        (low.min(*value), high.max(*value))
    })
}

/// 1, 2 or 5 times a power of ten, at most `length_m`.
fn round_length_m(length_m: f64) -> f64 {
    let power = 10_f64.powf(length_m.log10().floor());
    let lead = [5.0, 2.0]
        .into_iter()
        .find(|lead| lead * power <= length_m)
        .unwrap_or(1.0);
    lead * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_have_round_lengths() {
        for (room, length) in [(13_000.0, 10_000.0), (2_400.0, 2_000.0), (999.0, 500.0)] {
            assert!((round_length_m(room) - length).abs() < 1e-6, "{room}"); // rounding
        }
    }
}
