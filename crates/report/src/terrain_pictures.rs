//! A terrain model as pictures: shaded, by its standard deviations, and with the altimeter's shots on it.

use std::fmt::Write as _;

use plotters::prelude::*;

use super::{
    html::{Markup, html},
    map::{
        keys::{ColourBar, draw_scale},
        relief, round_length_m,
    },
    plots::{Canvas, Drawn, INK, WIDTH, drawn, figure_html, image, label, place_behind, thinned},
};
use areograph_base::{error::Result, terms::Terms, units::RADIANS_PER_DEGREE};
use areograph_products::error::ProductError;
use areograph_stages::map_surface::{ShotOnSurface, SurfaceAccount, SurfaceLook};

/// Greatest height of a picture, units of the drawing; narrower ground gets a narrower picture.
const HEIGHT_MAX: f64 = 1_300.0;
/// Height of the strip below it: scale and colours.
const STRIP: i32 = 130;
/// Left and right end of the bar of colours.
const BAR: (i32, i32) = (460, 1_000);
/// Largest number of shots drawn.
const SHOTS: usize = 1_500;
/// Radius of a shot.
const SHOT: i32 = 6;
/// Share of the numbers beyond each end of their colours.
const CLIPPED: f64 = 0.02;
/// Slope for shading: lower relief is exaggerated up to it.
const SLOPE: f64 = 0.35;
const EXAGGERATION_MAX: f64 = 100.0;
/// Colours of differences below 0, of 0 and above.
const DIFFERENCES: [[f64; 3]; 3] = [
    [33.0, 102.0, 172.0],
    [247.0, 247.0, 247.0],
    [178.0, 24.0, 43.0],
];
/// Grey of level ground below shots.
const GROUND: u8 = 190;

/// Numbers of the first and the last colour, their meaning, and the colours by their share.
struct Bar<'a> {
    ends: [f64; 2],
    words: &'a str,
    colour: fn(f64) -> [u8; 3],
}

/// The three pictures: shaded heights, standard deviations, and the altimeter's shots on the model.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn terrain_pictures(account: &SurfaceAccount, terms: &Terms<'_>) -> Result<Markup> {
    let frame = Frame::of(&account.look);
    let exaggeration = frame.exaggeration();
    // Every figure of a page refers to the same surface, by which people judge heights.
    let known = account.reference.as_ref();
    let surface = known.map_or("map sphere", |_| terms.areoid());
    let heights = account.above_reference(&account.look.heights).heights_m;
    let above = format!("height above the {surface}, m");
    let bar = Bar {
        ends: ends(&heights),
        words: &above,
        colour: relief::colour,
    };
    let light = |at: usize| frame.light(at, exaggeration);
    let shaded = frame.figure(
        "Terrain model, shaded",
        &format!(
            "Heights above the {surface}, lit from the north-west; slopes are exaggerated {} times. {} % of the ground that \
             both images show has a height.",
            label(exaggeration, 0),
            label(100.0 * account.filled_share(), 1)
        ),
        &bar,
        |at| lit(relief::colour(bar.share(heights[at])), light(at)),
        &[],
    )?;
    let sigmas = &account.look.sigmas_m;
    let bar = Bar {
        ends: [0.0, ends(sigmas)[1]],
        words: "standard deviation, m",
        colour: relief::colour,
    };
    let of_sigmas = frame.figure(
        "Standard deviations of the terrain model",
        &format!(
            "Standard deviation of each cell; root mean square {} m. Errors that all heights share are not included.",
            label(account.sigma_m, 2)
        ),
        &bar,
        |at| relief::colour(bar.share(sigmas[at])),
        &[],
    )?;
    if account.shots.shots.is_empty() {
        return Ok(html! { (shaded) (of_sigmas) });
    }
    let above_m: Vec<f32> = account
        .shots
        .shots
        .iter()
        .map(|shot| small(shot.above_m))
        .collect();
    let [low, high] = ends(&above_m);
    let most_m = low.abs().max(high.abs());
    let bar = Bar {
        ends: [-most_m, most_m],
        words: "shots minus the model, m",
        colour: difference,
    };
    let compared = frame.figure(
        &format!("{} minus the terrain model", terms.altimeter),
        &format!(
            "{} footprints on the model. Median {} m, robust spread {} m.",
            account.shots.above_m.n,
            label(account.shots.above_m.median, 1),
            label(account.shots.above_m.nmad, 1)
        ),
        &bar,
        |at| lit([GROUND; 3], light(at)),
        &account.shots.shots,
    )?;
    Ok(html! { (shaded) (of_sigmas) (compared) })
}

/// Placement of a model on the drawing.
struct Frame<'a> {
    look: &'a SurfaceLook,
    left: f64,
    width: f64,
    height: f64,
}

impl<'a> Frame<'a> {
    fn of(look: &'a SurfaceLook) -> Self {
        let [rows, columns] = look.heights.size.map(|length| length as f64);
        let [east_m, north_m] = look.heights.cell_m();
        let ratio = rows * north_m / (columns * east_m);
        let height = (f64::from(WIDTH) * ratio).min(HEIGHT_MAX);
        let width = height / ratio;
        Self {
            look,
            left: 0.5 * (f64::from(WIDTH) - width),
            width,
            height,
        }
    }

    /// Slopes towards east and south at a cell, of neighbours that have heights.
    fn slopes(&self, at: usize) -> [f64; 2] {
        let grid = &self.look.heights;
        let [rows, columns] = grid.size;
        let [row, column] = [at / columns, at % columns];
        let height_m = |row: usize, column: usize| {
            let known = row < rows && column < columns;
            let height_m = known.then(|| f64::from(grid.heights_m[row * columns + column]));
            height_m.filter(|height_m| !height_m.is_nan())
        };
        let slope = |ahead: Option<f64>, back: Option<f64>, cell_m: f64| match (ahead, back) {
            (Some(ahead), Some(back)) => (ahead - back) / (2.0 * cell_m),
            _ => 0.0,
        };
        let [east_m, north_m] = grid.cell_m();
        [
            slope(
                height_m(row, column + 1),
                height_m(row, column.wrapping_sub(1)),
                east_m,
            ),
            slope(
                height_m(row + 1, column),
                height_m(row.wrapping_sub(1), column),
                north_m,
            ),
        ]
    }

    /// 1, 2 or 5 times a power of ten that brings slopes up to the slope for shading.
    fn exaggeration(&self) -> f64 {
        let known = (0..self.look.heights.heights_m.len())
            .filter(|at| !self.look.heights.heights_m[*at].is_nan());
        let (mut squares, mut count) = (0.0, 0.0);
        for at in known {
            let [east, south] = self.slopes(at);
            squares += east * east + south * south;
            count += 1.0;
        }
        let slope = (squares / f64::max(count, 1.0)).sqrt();
        let wanted = (SLOPE / slope.max(f64::MIN_POSITIVE)).clamp(1.0, EXAGGERATION_MAX);
        round_length_m(wanted)
    }

    fn light(&self, at: usize, exaggeration: f64) -> f64 {
        let [east, south] = self.slopes(at);
        relief::shade(exaggeration * east, exaggeration * south)
    }

    /// A figure of all cells with a height in these colours, and shots on them.
    fn figure(
        &self,
        title: &str,
        caption: &str,
        bar: &Bar<'_>,
        colour: impl Fn(usize) -> [u8; 3],
        shots: &[ShotOnSurface],
    ) -> Result<Markup> {
        let heights = &self.look.heights;
        let mut pixels = vec![0_u8; 4 * heights.heights_m.len()];
        for (at, pixel) in pixels.chunks_exact_mut(4).enumerate() {
            if !heights.heights_m[at].is_nan() {
                pixel[..3].copy_from_slice(&colour(at));
                pixel[3] = u8::MAX;
            }
        }
        let [rows, columns] = heights.size.map(|length| length as u32);
        let png = relief::png(&pixels, columns, rows)
            .map_err(ProductError::refused("draw a terrain model"))?;
        let mut svg = drawn(self.height as u32 + STRIP as u32, |area| {
            self.draw_shots(bar, shots, area)?;
            let (left, right) = (self.left as i32, (self.left + self.width) as i32 - 1);
            let frame = [(left, 0), (right, self.height as i32 - 1)];
            area.draw(&Rectangle::new(frame, INK.stroke_width(2)))?;
            self.draw_scale(area)?;
            bar.draw(self.height as i32, area)
        })?;
        place_behind(
            &mut svg,
            &image([self.left, 0.0, self.width, self.height], &png),
        );
        Ok(figure_html(title, &svg, &[], caption, &csv(bar, shots)))
    }

    fn draw_shots<'b>(
        &self,
        bar: &Bar<'_>,
        shots: &[ShotOnSurface],
        area: &Canvas<'b>,
    ) -> Drawn<'b> {
        let grid = &self.look.heights;
        let [rows, columns] = grid.size.map(|length| length as f64);
        for shot in thinned(shots, SHOTS) {
            let [row, column] = grid.cell_of(shot.place_rad[0], shot.place_rad[1]);
            let x = self.left + (column + 0.5) / columns * self.width;
            let y = (row + 0.5) / rows * self.height;
            let place = (x.round() as i32, y.round() as i32);
            let [red, green, blue] = (bar.colour)(bar.share(small(shot.above_m)));
            area.draw(&Circle::new(
                place,
                SHOT,
                RGBColor(red, green, blue).filled(),
            ))?;
            area.draw(&Circle::new(place, SHOT, INK.stroke_width(1)))?;
        }
        Ok(())
    }

    /// A bar of a round length, true in the middle.
    fn draw_scale<'b>(&self, area: &Canvas<'b>) -> Drawn<'b> {
        let [east_m, _] = self.look.heights.cell_m();
        let width_m = self.look.heights.size[1] as f64 * east_m;
        let length_m = round_length_m(width_m.min(0.35 * f64::from(WIDTH) / self.width * width_m));
        let pixels = (length_m / width_m * self.width).round() as i32;
        draw_scale(area, (12, self.height as i32 + 56), length_m, pixels)
    }
}

impl Bar<'_> {
    fn share(&self, number: f32) -> f64 {
        let [low, high] = self.ends;
        ((f64::from(number) - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }

    fn draw<'b>(&self, top: i32, area: &Canvas<'b>) -> Drawn<'b> {
        let bar = ColourBar {
            ends: BAR,
            top: top + 46,
            words: self.words,
            numbers: self.ends,
            colour: self.colour,
        };
        bar.draw(&[0.0, 0.5, 1.0], area)
    }
}

/// Range that contains almost all numbers.
fn ends(numbers: &[f32]) -> [f64; 2] {
    let mut known: Vec<f32> = numbers.iter().copied().filter(|of| !of.is_nan()).collect();
    known.sort_by(f32::total_cmp);
    let Some(last) = known.len().checked_sub(1) else {
        return [0.0, 1.0];
    };
    let clipped = (CLIPPED * last as f64) as usize;
    [known[clipped], known[last - clipped]].map(f64::from)
}

fn lit(colour: [u8; 3], light: f64) -> [u8; 3] {
    colour.map(|channel| relief::lit(channel, light))
}

/// The colour of a difference by its share of the range, 0.5 for no difference.
fn difference(share: f64) -> [u8; 3] {
    let place = 2.0 * share.clamp(0.0, 1.0);
    let below = usize::from(place >= 1.0);
    let rest = place - below as f64;
    [0, 1, 2].map(|channel| {
        let (from, to) = (DIFFERENCES[below][channel], DIFFERENCES[below + 1][channel]);
        (from + rest * (to - from)).round() as u8
    })
}

fn small(number: f64) -> f32 {
    number as f32
}

/// The numbers of a figure: of its shots, or of the ends of its colours.
fn csv(bar: &Bar<'_>, shots: &[ShotOnSurface]) -> String {
    if shots.is_empty() {
        let [low, high] = bar.ends;
        return format!(
            "\"{}\",value\nfirst colour,{low:.3}\nlast colour,{high:.3}\n",
            bar.words
        );
    }
    let mut csv = "footprint row,longitude_deg,latitude_deg,above_m,sigma_m\n".to_owned();
    for shot in thinned(shots, SHOTS) {
        let [longitude_deg, latitude_deg] = shot.place_rad.map(|rad| rad / RADIANS_PER_DEGREE);
        // Writing to a string cannot fail.
        let _ = writeln!(
            csv,
            "{},{longitude_deg:.5},{latitude_deg:.5},{:.2},{:.2}",
            shot.row, shot.above_m, shot.sigma_m
        );
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_blue_below_zero_and_red_above() {
        assert_eq!(difference(0.0), [33, 102, 172]);
        assert_eq!(difference(0.5), [247; 3]);
        assert_eq!(difference(1.0), [178, 24, 43]);
    }

    #[test]
    fn colours_leave_out_a_few_numbers_and_what_is_none() {
        let mut numbers: Vec<f32> = (0..=100_u8).map(f32::from).collect();
        numbers.push(f32::NAN);
        assert_eq!(ends(&numbers).map(|end| end as i32), [2, 98]);
        assert_eq!(ends(&[f32::NAN]).map(|end| end as i32), [0, 1]);
    }
}
