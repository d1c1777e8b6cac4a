//! The strip below a map: its scale, its colours of heights, and its location on Mars.

use std::f64::consts::{PI, TAU};

use plotters::prelude::*;

use super::{
    super::{
        graticule::View,
        plots::{Canvas, Drawn, GRID, INK, MARK, WIDTH},
    },
    keys::{ColourBar, draw_scale},
    relief, round_length_m,
};
use areograph_base::units::RADIANS_PER_DEGREE;

/// Height of the strip.
pub(super) const STRIP: i32 = 176;
/// Left and right end of the bar of colours.
const BAR: (i32, i32) = (330, 800);
/// Radius of the globe.
const GLOBE: f64 = 76.0;

/// The strip, from the height `top` down.
pub(super) struct Legend<'a> {
    pub(super) top: i32,
    pub(super) view: &'a View,
    /// Heights of the first and last colour, metres; `None` without shots.
    pub(super) heights_m: Option<(f64, f64)>,
    /// Surface that they refer to.
    pub(super) areoid: &'static str,
    /// East longitude and areocentric latitude of the map's centre, radians.
    pub(super) centre_rad: (f64, f64),
}

impl Legend<'_> {
    pub(super) fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        self.draw_scale(area)?;
        if let Some(heights_m) = self.heights_m {
            self.draw_bar(heights_m, area)?;
        }
        self.draw_globe(area)
    }

    /// A bar of a round length, true at the centre.
    fn draw_scale<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let length_m = round_length_m(0.24 * self.view.width_m());
        let pixels = (length_m / self.view.width_m() * f64::from(WIDTH)).round() as i32;
        draw_scale(area, (12, self.top + 74), length_m, pixels)
    }

    fn draw_bar<'a>(&self, (low, high): (f64, f64), area: &Canvas<'a>) -> Drawn<'a> {
        let bar = ColourBar {
            ends: BAR,
            top: self.top + 62,
            words: &format!("height above the {}, m", self.areoid),
            numbers: [low, high],
            colour: relief::colour,
        };
        // Heights that agree to half a metre have one colour and one name.
        let shares: &[f64] = if high - low < 0.5 {
            &[0.5]
        } else {
            &[0.0, 0.5, 1.0]
        };
        bar.draw(shares, area)
    }

    /// Mars from above the site, tilted towards the equator, with parallels and meridians every 30°.
    fn draw_globe<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let globe = Globe {
            centre: (WIDTH as i32 - 100, self.top + STRIP / 2 + 4),
            longitude_rad: self.centre_rad.0,
            latitude_rad: 0.6 * self.centre_rad.1,
        };
        let degrees = |from: i32, to: i32, step: usize| {
            (from..=to)
                .step_by(step)
                .map(|degree| f64::from(degree) * RADIANS_PER_DEGREE)
        };
        let steps = || (0..=72).map(|step| f64::from(step) / 72.0);
        for latitude in degrees(-60, 60, 30) {
            globe.draw_line(steps().map(|share| (TAU * share, latitude)), area)?;
        }
        for longitude in degrees(0, 330, 30) {
            globe.draw_line(steps().map(|share| (longitude, PI * (share - 0.5))), area)?;
        }
        area.draw(&Circle::new(
            globe.centre,
            GLOBE as i32,
            INK.stroke_width(3),
        ))?;
        let (longitude, latitude) = self.centre_rad;
        if let Some(place) = globe.pixel(longitude, latitude) {
            area.draw(&Circle::new(place, 9, MARK.filled()))?;
        }
        Ok(())
    }
}

/// A sphere from infinitely far.
struct Globe {
    centre: (i32, i32),
    longitude_rad: f64,
    latitude_rad: f64,
}

impl Globe {
    /// Position of a place on the drawing; `None` behind the limb.
    ///
    /// # Source
    /// Snyder 1987, eq. 20-3 to 20-5.
    fn pixel(&self, longitude_rad: f64, latitude_rad: f64) -> Option<(i32, i32)> {
        let (sin_centre, cos_centre) = self.latitude_rad.sin_cos();
        let (sin_latitude, cos_latitude) = latitude_rad.sin_cos();
        let (sin_turn, cos_turn) = (longitude_rad - self.longitude_rad).sin_cos();
        let towards = sin_centre * sin_latitude + cos_centre * cos_latitude * cos_turn;
        let up = cos_centre * sin_latitude - sin_centre * cos_latitude * cos_turn;
        (towards >= 0.0).then(|| {
            let right = (GLOBE * cos_latitude * sin_turn).round() as i32;
            (
                self.centre.0 + right,
                self.centre.1 - (GLOBE * up).round() as i32,
            )
        })
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
                area.draw(&PathElement::new(run, GRID.stroke_width(2)))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_far_side_of_the_globe_is_not_drawn() {
        let globe = Globe {
            centre: (0, 0),
            longitude_rad: 3.0,
            latitude_rad: 0.2,
        };
        assert_eq!(globe.pixel(3.0, 0.2), Some((0, 0)));
        assert_eq!(globe.pixel(3.0 + PI, -0.2), None);
        // North is up, east to the right.
        assert!(globe.pixel(3.0, 0.5).unwrap().1 < 0);
        assert!(globe.pixel(3.5, 0.2).unwrap().0 > 0);
    }
}
