//! The stereo sky plot: from where the images see the ground, and what that makes of each pair.

use std::{f64::consts::TAU, fmt::Write as _};

use nalgebra::Vector3;
use plotters::prelude::*;

use super::{
    html::counted,
    map::labels::{self, Labels, write},
    misregistration::BeforeAfter,
    plots::{COLOURS, Canvas, Drawn, GRID, INK, WIDTH, drawn, figure_html, label, quoted},
};
use crate::{
    error::Result,
    geom::ellipsoid::{local_axes, on_ellipsoid_m, spherical_to_xyz_m},
    products::{ImageProducts, SiteProducts},
    units::RADIANS_PER_DEGREE,
};
use plotters::style::text_anchor::HPos;

/// Height of the picture, its centre and the radius of the outermost circle.
const HEIGHT: u32 = 720;
const CENTRE: (i32, i32) = (520, 360);
const RADIUS: f64 = 310.0;
/// Circles between the zenith and the outermost.
const CIRCLES: i32 = 3;
/// Emission angles that the outermost circle may have, degrees.
const OUTERMOST_DEG: [f64; 8] = [3.0, 6.0, 12.0, 30.0, 45.0, 60.0, 75.0, 90.0];
/// Pairs that the caption tells; the table has all.
const PAIRS_TOLD: usize = 3;
/// Colour of the images.
const IMAGE: usize = 3;

/// Where an image is in the sky of what it shows at its middle.
struct Seen<'a> {
    image: &'a str,
    azimuth_rad: f64,
    emission_rad: f64,
}

/// The plot, where there are two images or more that see the ground.
///
/// # Errors
/// A drawing that cannot be made.
pub(super) fn figure(site: &SiteProducts) -> Result<String> {
    let seen: Vec<Seen> = site.images.iter().filter_map(seen).collect();
    if seen.len() < 2 {
        return Ok(String::new());
    }
    let svg = drawn(HEIGHT, |area| draw(&seen, area))?;
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
        &words(site, seen.len()),
        &csv,
    ))
}

/// Azimuth and emission of the camera at the middle of the image, as seen from the ground.
fn seen<'a>(image: &ImageProducts<'a>) -> Option<Seen<'a>> {
    let samples = &image.orientation.samples;
    let sample = samples.get(samples.len() / 2)?;
    let ground = sample.boresight.as_ref()?;
    let up = spherical_to_xyz_m(ground.longitude_rad, ground.latitude_rad, 1.0);
    let ground_m = on_ellipsoid_m(image.times.body.model(), &up);
    Some(Seen {
        image: &image.times.id,
        azimuth_rad: azimuth_rad(&ground_m, &sample.position.xyz_m),
        emission_rad: ground.emission_rad,
    })
}

/// Direction towards `camera_m` from `ground_m`, from north over east, radians.
fn azimuth_rad(ground_m: &Vector3<f64>, camera_m: &Vector3<f64>) -> f64 {
    let towards = local_axes(ground_m) * (camera_m - ground_m);
    towards.x.atan2(towards.y).rem_euclid(TAU)
}

fn words(site: &SiteProducts, images: usize) -> String {
    let mut words = format!(
        "{} seen from the ground at their middle; zenith at the centre.",
        counted(images, "image")
    );
    let Some(geometric) = &site.geometric else {
        return words;
    };
    let pairs = BeforeAfter::all(geometric);
    for pair in pairs.iter().take(PAIRS_TOLD) {
        words += &format!(
            " {}: convergence {}°, base-to-height {}, {} in common.",
            pair.name(),
            label(pair.before.convergence_rad / RADIANS_PER_DEGREE, 1),
            label(pair.before.height_over_base.recip(), 2),
            counted(pair.before.ties as usize, "tie point")
        );
    }
    words
}

fn draw<'a>(seen: &[Seen], area: &Canvas<'a>) -> Drawn<'a> {
    let largest_deg = seen.iter().map(|of| of.emission_rad / RADIANS_PER_DEGREE);
    let largest_deg = largest_deg.fold(0.0, f64::max);
    let outermost = OUTERMOST_DEG.iter().find(|angle| **angle >= largest_deg);
    let outermost_deg = outermost.copied().unwrap_or(90.0);
    let place = |azimuth_rad: f64, emission_deg: f64| {
        let far = RADIUS * emission_deg / outermost_deg;
        let (sine, cosine) = azimuth_rad.sin_cos();
        (
            CENTRE.0 + (far * sine).round() as i32,
            CENTRE.1 - (far * cosine).round() as i32,
        )
    };
    for spoke in 0..12 {
        let ends = vec![CENTRE, place(f64::from(spoke) * TAU / 12.0, outermost_deg)];
        area.draw(&PathElement::new(ends, GRID.stroke_width(2)))?;
    }
    let mut names = Labels::new(WIDTH as i32, HEIGHT as i32);
    for of in seen {
        let (x, y) = place(of.azimuth_rad, of.emission_rad / RADIANS_PER_DEGREE);
        area.draw(&Circle::new((x, y), 9, COLOURS[IMAGE].filled()))?;
        let wide = labels::width(of.image);
        let beside = [
            (x + 16, y),
            (x - wide - 16, y),
            (x - wide / 2, y - 30),
            (x - wide / 2, y + 30),
        ];
        names.place(of.image, COLOURS[IMAGE], beside.into_iter());
    }
    for circle in 1..=CIRCLES {
        let emission_deg = outermost_deg * f64::from(circle) / f64::from(CIRCLES);
        let radius = (RADIUS * emission_deg / outermost_deg).round() as i32;
        area.draw(&Circle::new(CENTRE, radius, INK.mix(0.5).stroke_width(2)))?;
        let text = format!("{}°", label(emission_deg, 0));
        let (x, y) = place(TAU / 8.0, emission_deg);
        names.place(&text, INK, [(x + 4, y - 14), (x - 50, y + 16)].into_iter());
    }
    let (north, east) = (place(0.0, outermost_deg), place(TAU / 4.0, outermost_deg));
    write(area, "N", (north.0, north.1 - 22), HPos::Center, INK)?;
    write(area, "E", (east.0 + 12, east.1), HPos::Left, INK)?;
    names.draw(area)
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
}
