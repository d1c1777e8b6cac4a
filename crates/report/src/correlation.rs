//! Correlations of the adjusted orientation of an image as a picture.

use std::fmt::Write as _;

use plotters::{prelude::*, style::text_anchor::HPos};

use super::{
    html::{Markup, folded_unless, html},
    map::labels::{LETTERS, write},
    plots::{Canvas, Drawn, INK, Key, WIDTH, drawn, figure_html, label, quoted},
};
use areograph_base::error::Result;
use areograph_geom::bundle::{ORIENTATION_UNKNOWNS, Unknown};
use areograph_products::SiteProducts;
use areograph_stages::adjust::{Adjusted, CorrectedImage};

/// Number of images whose matrix is drawn; `correlations.parquet` has all.
const IMAGES_DRAWN: usize = 4;
/// Correlation from which the matrices are shown unfolded.
const OF_INTEREST: f64 = 0.95;
/// Start of the matrix, after the names of its rows.
const LEFT: i32 = 520;
/// Colours of −1, 0 and 1: distinct for every colour vision, and the signs distinct in grey too.
const COLOURS: [[f64; 3]; 3] = [
    [5.0, 48.0, 97.0],
    [247.0, 247.0, 247.0],
    [230.0, 120.0, 20.0],
];

/// A picture of each image's matrix.
///
/// # Errors
/// A drawing that cannot be made.
pub(super) fn figures(site: &SiteProducts, adjusted: &Adjusted) -> Result<Markup> {
    let images = site.shown_images().into_iter().take(IMAGES_DRAWN);
    let matrices: Vec<Matrix> = images
        .filter_map(|index| Matrix::of(index, adjusted.images.get(index)?))
        .collect();
    let largest = matrices.iter().filter_map(Matrix::largest);
    let largest = largest.fold(0.0, |most: f64, (_, value)| most.max(value.abs()));
    if matrices.is_empty() {
        return Ok(Markup::default());
    }
    Ok(folded_unless(
        largest >= OF_INTEREST,
        &format!(
            "Correlations within an image, at most {}",
            label(largest, 2)
        ),
        &html! { div.plots { @for matrix in matrices { (matrix.figure()?) } } },
    ))
}

/// The unknowns of an image that are solved for, and their correlations, row by row.
struct Matrix<'a> {
    image: &'a str,
    names: Vec<String>,
    values: Vec<f64>,
    /// Whether the covariance contains the uncertainty of line times.
    has_line_times: bool,
}

impl<'a> Matrix<'a> {
    /// `None` for an image with fewer than two unknowns.
    fn of(index: usize, image: &'a CorrectedImage) -> Option<Self> {
        let variance = |unknown: usize| image.covariance[(unknown, unknown)];
        let solved: Vec<usize> = (0..ORIENTATION_UNKNOWNS)
            .filter(|unknown| variance(*unknown) > 0.0)
            .collect();
        let name = |coefficient: &usize| {
            let unknown = Unknown::Orientation {
                image: index,
                coefficient: *coefficient,
            };
            unknown.quantity()
        };
        let each = solved
            .iter()
            .flat_map(|row| solved.iter().map(move |column| (*row, *column)));
        let values = each.map(|(row, column)| {
            let sigmas = (variance(row) * variance(column)).sqrt();
            (image.covariance[(row, column)] / sigmas).clamp(-1.0, 1.0)
        });
        (solved.len() > 1).then(|| Self {
            image: &image.id,
            names: solved.iter().map(name).collect(),
            values: values.collect(),
            has_line_times: image.line_time_sigma_s > 0.0,
        })
    }

    fn count(&self) -> usize {
        self.names.len()
    }

    /// The largest correlation of two unknowns by absolute value, with its place.
    fn largest(&self) -> Option<(usize, f64)> {
        let count = self.count();
        let off_diagonal = (0..count * count).filter(|place| place / count < place % count);
        let values = off_diagonal.map(|place| (place, self.values[place]));
        values.max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()))
    }

    /// Side of a cell.
    fn cell(&self) -> i32 {
        (WIDTH as i32 - LEFT - 20) / self.count() as i32
    }

    /// Height of a row: of a cell, or of its name.
    fn row(&self) -> i32 {
        self.cell().clamp(LETTERS + 4, 60)
    }

    fn figure(&self) -> Result<Markup> {
        let height = self.count() as i32 * self.row() + 20;
        let svg = drawn(height as u32, |area| self.draw(area))?;
        let keys = [("−1", -1.0), ("0", 0.0), ("1", 1.0)].map(|(name, value)| {
            let [red, green, blue] = colour(value);
            Key::fixed(name, RGBColor(red, green, blue))
        });
        Ok(figure_html(
            &format!("Correlations of {}", self.image),
            &svg,
            &keys,
            &self.words(),
            &self.csv(),
        ))
    }

    fn draw<'b>(&self, area: &Canvas<'b>) -> Drawn<'b> {
        let (wide, high) = (self.cell(), self.row());
        for (row, name) in self.names.iter().enumerate() {
            let top = 10 + row as i32 * high;
            write(area, name, (LEFT - 14, top + high / 2), HPos::Right, INK)?;
            for column in 0..self.count() {
                let left = LEFT + column as i32 * wide;
                let [red, green, blue] = colour(self.values[row * self.count() + column]);
                let corners = [(left, top), (left + wide, top + high)];
                area.draw(&Rectangle::new(
                    corners,
                    RGBColor(red, green, blue).filled(),
                ))?;
            }
        }
        let corners = [
            (LEFT, 10),
            (
                LEFT + self.count() as i32 * wide,
                10 + self.count() as i32 * high,
            ),
        ];
        area.draw(&Rectangle::new(corners, INK.stroke_width(2)))
    }

    fn words(&self) -> String {
        let count = self.count();
        let most = self.largest().map_or_else(String::new, |(place, value)| {
            format!(
                " Largest: {} for {} and {}.",
                label(value, 4),
                self.names[place / count],
                self.names[place % count]
            )
        });
        let of = if self.has_line_times {
            "Orientation of the camera at the exposure of the lines. Line times, which are not unknowns of the \
             adjustment, correlate position coefficients. Columns are in the order of the rows."
        } else {
            "Adjusted orientation unknowns. Columns are in the order of the rows."
        };
        format!("{of}{most}")
    }

    fn csv(&self) -> String {
        let mut csv = "unknown,and,correlation\n".to_owned();
        for (place, value) in self.values.iter().enumerate() {
            let (row, column) = (place / self.count(), place % self.count());
            if row < column {
                let [one, other] = [row, column].map(|at| quoted(&self.names[at]));
                // Writing to a string cannot fail.
                let _ = writeln!(csv, "{one},{other},{value:.6}");
            }
        }
        csv
    }
}

/// The colour of a correlation.
fn colour(correlation: f64) -> [u8; 3] {
    let [negative, none, positive] = COLOURS;
    let full = if correlation < 0.0 {
        negative
    } else {
        positive
    };
    let share = correlation.abs();
    [0, 1, 2].map(|channel| (none[channel] + share * (full[channel] - none[channel])).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_differ_in_colour_and_in_grey() {
        let grey = |value: f64| {
            let [red, green, blue] = colour(value).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        assert_eq!(colour(0.0), [247; 3]);
        assert!(grey(-1.0) + 50.0 < grey(1.0) && grey(1.0) + 50.0 < grey(0.0));
    }
}
