//! A body from above a site, with the place of the site: over its relief where that is known, else meridians and parallels.

use std::{
    f64::consts::{PI, TAU},
    io::Cursor,
};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use plotters::prelude::*;

use super::{
    super::{
        html::{Markup, html},
        plots::{Canvas, Drawn, GRID, INK, MARK, image},
    },
    relief,
};
use areograph_base::{
    body::Body,
    error::Result,
    units::{RADIANS_PER_DEGREE, wrap_two_pi},
};
use areograph_products::error::ProductError;

/// Its radius, in units of a drawing.
const RADIUS: f64 = 76.0;
/// Share of the latitude of the site by which the globe is tilted.
const TILT: f64 = 0.6;
/// Rows and columns of its picture.
const PIXELS: u32 = 228;

/// A sphere from infinitely far.
pub(super) struct Globe {
    /// Its middle on the drawing.
    pub(super) centre: (i32, i32),
    /// East longitude and latitude of the site.
    pub(super) place_rad: (f64, f64),
}

impl Globe {
    /// Latitude in the middle of the disc; the longitude there is that of the site.
    fn middle_rad(&self) -> f64 {
        TILT * self.place_rad.1
    }

    /// Place on a disc of radius 1, to the right and up; `None` behind the limb.
    ///
    /// # Source
    /// Snyder 1987, eq. 20-3 to 20-5.
    fn project(&self, longitude_rad: f64, latitude_rad: f64) -> Option<(f64, f64)> {
        let (sin_middle, cos_middle) = self.middle_rad().sin_cos();
        let (sin_latitude, cos_latitude) = latitude_rad.sin_cos();
        let (sin_turn, cos_turn) = (longitude_rad - self.place_rad.0).sin_cos();
        let towards = sin_middle * sin_latitude + cos_middle * cos_latitude * cos_turn;
        let up = cos_middle * sin_latitude - sin_middle * cos_latitude * cos_turn;
        (towards >= 0.0).then_some((cos_latitude * sin_turn, up))
    }

    /// East longitude and latitude of a place on the disc; `None` beside it.
    ///
    /// # Source
    /// Snyder 1987, eq. 20-14 and 20-15, as rotations.
    fn unproject(&self, (right, up): (f64, f64)) -> Option<(f64, f64)> {
        let towards = (1.0 - right * right - up * up).max(0.0).sqrt();
        if right.hypot(up) > 1.0 {
            return None;
        }
        let (sin_middle, cos_middle) = self.middle_rad().sin_cos();
        let north = cos_middle * up + sin_middle * towards;
        let out = cos_middle * towards - sin_middle * up;
        let longitude_rad = self.place_rad.0 + right.atan2(out);
        Some((wrap_two_pi(longitude_rad), north.clamp(-1.0, 1.0).asin()))
    }

    /// Position of a place on the drawing; `None` behind the limb.
    fn pixel(&self, longitude_rad: f64, latitude_rad: f64) -> Option<(i32, i32)> {
        let (right, up) = self.project(longitude_rad, latitude_rad)?;
        let [right, down] = [right, -up].map(|share| (RADIUS * share).round() as i32);
        Some((self.centre.0 + right, self.centre.1 + down))
    }

    /// Its relief as an element of the SVG, below what [`Self::draw`] draws; empty where it is not known.
    ///
    /// # Errors
    /// A picture that the library rejects, which is a bug in areograph.
    pub(super) fn relief(&self, body: Body) -> Result<String> {
        let [left, top] = [self.centre.0, self.centre.1].map(|middle| f64::from(middle) - RADIUS);
        let png = self.png(body)?;
        Ok(png.map_or_else(String::new, |png| {
            image([left, top, 2.0 * RADIUS, 2.0 * RADIUS], &png)
        }))
    }

    /// Its relief, transparent beside the disc.
    fn png(&self, body: Body) -> Result<Option<Vec<u8>>> {
        let Some(ground) = Ground::of(body)? else {
            return Ok(None);
        };
        let share = |pixel: u32| (f64::from(pixel) + 0.5) / f64::from(PIXELS) * 2.0 - 1.0;
        let places = (0..PIXELS).flat_map(|row| (0..PIXELS).map(move |column| (column, row)));
        let pixels = places.flat_map(|(column, row)| {
            let place = self.unproject((share(column), -share(row)));
            place.map_or([0; 4], |place_rad| {
                let grey = ground.grey(place_rad);
                [grey, grey, grey, u8::MAX]
            })
        });
        let pixels: Vec<u8> = pixels.collect();
        let png = relief::png(&pixels, PIXELS, PIXELS);
        Ok(Some(png.map_err(ProductError::refused("draw a globe"))?))
    }

    /// Parallels and meridians every 30°, the limb, and the site.
    pub(super) fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let degrees = |from: i32, to: i32, step: usize| {
            (from..=to)
                .step_by(step)
                .map(|degree| f64::from(degree) * RADIANS_PER_DEGREE)
        };
        let steps = || (0..=72).map(|step| f64::from(step) / 72.0);
        for latitude in degrees(-60, 60, 30) {
            self.draw_line(steps().map(|share| (TAU * share, latitude)), area)?;
        }
        for longitude in degrees(0, 330, 30) {
            self.draw_line(steps().map(|share| (longitude, PI * (share - 0.5))), area)?;
        }
        area.draw(&Circle::new(
            self.centre,
            RADIUS as i32,
            INK.stroke_width(3),
        ))?;
        let (longitude, latitude) = self.place_rad;
        if let Some(place) = self.pixel(longitude, latitude) {
            area.draw(&Circle::new(place, 11, WHITE.filled()))?;
            area.draw(&Circle::new(place, 9, MARK.filled()))?;
        }
        Ok(())
    }

    fn draw_line<'a>(
        &self,
        places: impl Iterator<Item = (f64, f64)>,
        area: &Canvas<'a>,
    ) -> Drawn<'a> {
        let pixels: Vec<Option<(i32, i32)>> = places
            .map(|(longitude, latitude)| self.pixel(longitude, latitude))
            .collect();
        for run in pixels.split(Option::is_none) {
            let run: Vec<(i32, i32)> = run.iter().copied().flatten().collect();
            if run.len() > 1 {
                area.draw(&PathElement::new(run, GRID.stroke_width(1)))?;
            }
        }
        Ok(())
    }
}

/// The globe of a body above a place (east longitude and latitude) as a part of a page; empty where its relief is not known.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn globe(body: Body, place_rad: (f64, f64)) -> Result<Markup> {
    let globe = Globe {
        centre: (0, 0),
        place_rad,
    };
    let Some(png) = globe.png(body)? else {
        return Ok(Markup::default());
    };
    let [longitude_deg, latitude_deg] =
        [wrap_two_pi(place_rad.0), place_rad.1].map(|angle| angle / RADIANS_PER_DEGREE);
    let side = if latitude_deg < 0.0 { "S" } else { "N" };
    let words = format!(
        "The site on {body}: {longitude_deg:.1}° E, {:.1}° {side}",
        latitude_deg.abs()
    );
    let down = globe
        .project(place_rad.0, place_rad.1)
        .map_or(50.0, |(_, up)| 50.0 - 50.0 * up);
    Ok(html! {
        div.globe role="img" aria-label=(words) title=(words) {
            img src={ "data:image/png;base64," (STANDARD.encode(png)) } alt="" width=(PIXELS) height=(PIXELS);
            i style={ "top:" (format!("{down:.1}")) "%" } {}
        }
    })
}

/// The relief of a body, from 0° E and 90° N on.
struct Ground {
    columns: usize,
    rows: usize,
    greys: Vec<u8>,
}

impl Ground {
    fn of(body: Body) -> Result<Option<Self>> {
        let read = |file: &'static [u8]| -> std::result::Result<Self, png::DecodingError> {
            let mut reader = png::Decoder::new(Cursor::new(file)).read_info()?;
            let mut greys = vec![0; reader.output_buffer_size().unwrap_or_default()];
            let frame = reader.next_frame(&mut greys)?;
            Ok(Self {
                columns: frame.width as usize,
                rows: frame.height as usize,
                greys,
            })
        };
        let ground = body.relief().map(read).transpose();
        Ok(ground.map_err(ProductError::refused("draw a globe"))?)
    }

    /// Brightness at an east longitude, 0 to 2π, and a latitude.
    fn grey(&self, (longitude_rad, latitude_rad): (f64, f64)) -> u8 {
        let [east, south] = [longitude_rad / TAU, 0.5 - latitude_rad / PI];
        let held = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
        self.greys[held(south, self.rows) * self.columns + held(east, self.columns)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLOBE: Globe = Globe {
        centre: (0, 0),
        place_rad: (3.0, 0.2 / TILT),
    };

    #[test]
    fn the_far_side_of_the_globe_is_not_drawn() {
        assert_eq!(GLOBE.pixel(3.0, 0.2), Some((0, 0)));
        assert_eq!(GLOBE.pixel(3.0 + PI, -0.2), None);
        // North is up, east to the right.
        assert!(GLOBE.pixel(3.0, 0.5).unwrap().1 < 0);
        assert!(GLOBE.pixel(3.5, 0.2).unwrap().0 > 0);
        assert!(GLOBE.unproject((0.8, 0.7)).is_none());
    }

    #[test]
    fn places_on_the_disc_are_those_that_are_drawn_there() {
        for (longitude_rad, latitude_rad) in [(3.0, 0.2), (4.2, -0.5), (2.0, 1.1), (3.0, -1.2)] {
            let place = GLOBE.project(longitude_rad, latitude_rad).unwrap();
            let (longitude, latitude) = GLOBE.unproject(place).unwrap();
            // Rounding.
            assert!((longitude - longitude_rad).abs() < 1e-9, "{longitude}");
            assert!((latitude - latitude_rad).abs() < 1e-9, "{latitude}");
        }
    }

    /// Summits and plains by the IAU gazetteer.
    #[test]
    fn mountains_of_mars_are_light_and_plains_dark() {
        let ground = Ground::of(Body::Mars).unwrap().unwrap();
        let grey = |longitude_deg: f64, latitude_deg: f64| {
            ground.grey((longitude_deg.to_radians(), latitude_deg.to_radians()))
        };
        for (name, longitude_deg, latitude_deg) in [
            ("Olympus Mons", 226.2, 18.65),
            ("Ascraeus Mons", 255.9, 11.9),
            ("Arsia Mons", 239.1, -8.3),
        ] {
            let found = grey(longitude_deg, latitude_deg);
            assert!(found > 200, "{name}: {found}");
        }
        for (name, longitude_deg, latitude_deg) in [
            ("Hellas Planitia", 70.5, -42.4),
            ("Acidalia Planitia", 339.3, 49.8),
            ("Utopia Planitia", 117.5, 46.7),
        ] {
            let found = grey(longitude_deg, latitude_deg);
            assert!(found < 135, "{name}: {found}");
        }
        assert!(Ground::of(Body::Moon).unwrap().is_none());
        assert_eq!(globe(Body::Moon, (0.0, 0.0)).unwrap().0, "");
    }
}
