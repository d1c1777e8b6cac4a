//! The stereo sky plot: viewing directions of the images, and the geometry of each pair.

use std::{f64::consts::TAU, fmt::Write as _};

use nalgebra::Vector3;
use plotters::prelude::*;

use super::{
    html::{Markup, counted},
    many::{self, DrawnImage},
    map::labels::{self, Labels},
    misregistration::BeforeAfter,
    plots::{COLOURS, Canvas, Drawn, GRID, INK, WIDTH, drawn, figure_html, label, quoted},
};
use areograph_base::{error::Result, units::RADIANS_PER_DEGREE};
use areograph_geom::ellipsoid::{local_axes, on_ellipsoid_m, spherical_to_xyz_m};
use areograph_products::{ImageProducts, SiteProducts};
use areograph_stages::sample_orientation::{BoresightGround, OrientationSample};

/// Height of the picture, its centre and the radius of the outermost circle.
const HEIGHT: u32 = 720;
const CENTRE: (i32, i32) = (520, 360);
const RADIUS: f64 = 310.0;
/// Number of circles between the zenith and the outermost.
const CIRCLES: i32 = 3;
/// Possible emission angles of the outermost circle, degrees.
const OUTERMOST_DEG: [f64; 8] = [3.0, 6.0, 12.0, 30.0, 45.0, 60.0, 75.0, 90.0];
/// Number of pairs in the caption; the table has all.
const PAIRS_LISTED: usize = 3;
/// Radius of the dot of an image.
const DOT: i32 = 9;
/// Colour of the images.
const IMAGE: usize = 3;

/// Position of an image in the sky of the ground at its middle.
struct Seen<'a> {
    image: &'a str,
    is_named: bool,
    azimuth_rad: f64,
    emission_rad: f64,
}

/// The plot, if two or more images see the ground.
///
/// # Errors
/// A drawing that cannot be made.
pub(super) fn figure(site: &SiteProducts) -> Result<Markup> {
    let drawn_images = many::drawn(site);
    let seen: Vec<Seen> = drawn_images.iter().filter_map(seen).collect();
    if seen.len() < 2 {
        return Ok(Markup::default());
    }
    let sky = Sky::of(&seen);
    let svg = drawn(HEIGHT, |area| sky.draw(area))?;
    let mut csv = "image,azimuth_deg,emission_deg\n".to_owned();
    for of in &seen {
        let [azimuth, emission] =
            [of.azimuth_rad, of.emission_rad].map(|angle| angle / RADIANS_PER_DEGREE);
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{},{azimuth:.4},{emission:.4}", quoted(of.image));
    }
    let title = "Viewing directions of the images";
    Ok(figure_html(
        title,
        &svg,
        &[],
        &words(site, &sky.unnamed),
        &csv,
    ))
}

/// Azimuth and emission of the camera at the middle of the image, as seen from the ground.
fn seen<'a>(drawn: &DrawnImage<'a>) -> Option<Seen<'a>> {
    let image = drawn.image;
    let (sample, ground) = middle(image)?;
    let up = spherical_to_xyz_m(ground.longitude_rad, ground.latitude_rad, 1.0);
    let ground_m = on_ellipsoid_m(image.times.body.model(), &up);
    Some(Seen {
        image: &image.times.id,
        is_named: drawn.is_named,
        azimuth_rad: azimuth_rad(&ground_m, &sample.position.xyz_m),
        emission_rad: ground.emission_rad,
    })
}

/// The sample at the middle of an image, and the ground that it sees.
fn middle<'a>(image: &ImageProducts<'a>) -> Option<(&'a OrientationSample, &'a BoresightGround)> {
    let samples = &image.orientation.samples;
    let sample = samples.get(samples.len() / 2)?;
    Some((sample, sample.boresight.as_ref()?))
}

/// Direction towards `camera_m` from `ground_m`, from north over east, radians.
fn azimuth_rad(ground_m: &Vector3<f64>, camera_m: &Vector3<f64>) -> f64 {
    let towards = local_axes(ground_m) * (camera_m - ground_m);
    towards.x.atan2(towards.y).rem_euclid(TAU)
}

fn words(site: &SiteProducts, unnamed: &[&str]) -> String {
    let images = site.images.iter().filter_map(middle).count();
    let mut words = format!(
        "{}, as seen from the ground at the image middle; zenith at the centre.",
        counted(images, "image")
    );
    words += &many::drawn_in_words(site);
    if !unnamed.is_empty() {
        words += &format!(" Not labelled for lack of space: {}.", unnamed.join(", "));
    }
    let Some(geometric) = &site.geometric else {
        return words;
    };
    let pairs = BeforeAfter::all(geometric);
    for pair in pairs.iter().take(PAIRS_LISTED) {
        words += &format!(
            " {}: convergence {}°, base-to-height ratio {}, {} in common.",
            pair.name(),
            label(pair.before.convergence_rad / RADIANS_PER_DEGREE, 1),
            label(pair.before.height_over_base.recip(), 2),
            counted(pair.before.ties as usize, "tie point")
        );
    }
    words
}

/// The plot, laid out.
struct Sky<'a> {
    outermost_deg: f64,
    images: Vec<(i32, i32)>,
    names: Labels,
    /// Images whose names do not fit.
    unnamed: Vec<&'a str>,
}

impl<'a> Sky<'a> {
    fn of(seen: &[Seen<'a>]) -> Self {
        let emission_deg = |of: &Seen| of.emission_rad / RADIANS_PER_DEGREE;
        let largest_deg = seen.iter().map(emission_deg).fold(0.0, f64::max);
        let outermost = OUTERMOST_DEG.iter().find(|angle| **angle >= largest_deg);
        let mut sky = Self {
            outermost_deg: outermost.copied().unwrap_or(90.0),
            images: Vec::new(),
            names: Labels::new(WIDTH as i32, HEIGHT as i32),
            unnamed: Vec::new(),
        };
        let at = |of: &Seen| sky.place(of.azimuth_rad, emission_deg(of));
        sky.images = seen.iter().map(at).collect();
        for image in &sky.images {
            sky.names.keep_off(*image, DOT);
        }
        let [north, east] = [0.0, TAU / 4.0].map(|azimuth| sky.place(azimuth, sky.outermost_deg));
        let above = (north.0 - labels::width("N") / 2, north.1 - 22);
        let mut names = sky.names;
        names.place("N", INK, std::iter::once(above));
        names.place("E", INK, std::iter::once((east.0 + 12, east.1)));
        let named = seen.iter().zip(&sky.images).filter(|(of, _)| of.is_named);
        for (of, image) in named {
            if !names.place_around(of.image, INK, *image) {
                sky.unnamed.push(of.image);
            }
        }
        sky.names = names;
        sky.name_circles();
        sky
    }

    fn place(&self, azimuth_rad: f64, emission_deg: f64) -> (i32, i32) {
        let far = RADIUS * emission_deg / self.outermost_deg;
        let (sine, cosine) = azimuth_rad.sin_cos();
        (
            CENTRE.0 + (far * sine).round() as i32,
            CENTRE.1 - (far * cosine).round() as i32,
        )
    }

    /// Emission angles of the circles, degrees.
    fn circles(&self) -> impl Iterator<Item = f64> + use<> {
        let outermost_deg = self.outermost_deg;
        (1..=CIRCLES).map(move |circle| outermost_deg * f64::from(circle) / f64::from(CIRCLES))
    }

    /// The angle of each circle, on the first diagonal with room for it.
    fn name_circles(&mut self) {
        for emission_deg in self.circles() {
            let text = format!("{}°", label(emission_deg, 0));
            let diagonals = [1.0, 3.0, 5.0, 7.0].map(|eighth| {
                let (x, y) = self.place(eighth * TAU / 8.0, emission_deg);
                (x + 4, y - 14)
            });
            self.names.place(&text, INK, diagonals.into_iter());
        }
    }

    fn draw<'b>(&self, area: &Canvas<'b>) -> Drawn<'b> {
        for spoke in 0..12 {
            let end = self.place(f64::from(spoke) * TAU / 12.0, self.outermost_deg);
            area.draw(&PathElement::new(vec![CENTRE, end], GRID.stroke_width(2)))?;
        }
        for emission_deg in self.circles() {
            let radius = (RADIUS * emission_deg / self.outermost_deg).round() as i32;
            area.draw(&Circle::new(CENTRE, radius, INK.mix(0.5).stroke_width(2)))?;
        }
        for image in &self.images {
            area.draw(&Circle::new(*image, DOT, COLOURS[IMAGE].filled()))?;
        }
        self.names.draw(area)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuths_run_from_north_over_east() {
        let ground_m = Vector3::new(3.4e6, 0.0, 0.0);
        let up = Vector3::new(3.8e5, 0.0, 0.0);
        let at = |aside: Vector3<f64>| {
            azimuth_rad(&ground_m, &(ground_m + up + aside)) / RADIANS_PER_DEGREE
        };
        assert!((at(Vector3::new(0.0, 1e5, 0.0)) - 90.0).abs() < 1e-9); // degrees, rounding
        assert!((at(Vector3::new(0.0, -1e5, 0.0)) - 270.0).abs() < 1e-9);
        assert!(at(Vector3::new(0.0, 0.0, 1e5)).abs() < 1e-9);
    }

    #[test]
    fn images_from_nearly_the_same_direction_are_all_named() {
        let seen: Vec<Seen> = (0..9)
            .map(|image| Seen {
                image: "M00-00001",
                is_named: true,
                // Beside the letter of the east, and at the zenith.
                azimuth_rad: TAU / 4.0,
                emission_rad: f64::from(image % 3) * 15.0 * RADIANS_PER_DEGREE,
            })
            .collect();
        let sky = Sky::of(&seen);
        assert_eq!(sky.unnamed, Vec::<&str>::new());
        // North, east, nine images, three circles.
        assert_eq!(sky.names.placed.len(), 2 + 9 + 3);
    }
}
