//! Tables of ground control points of an image: places in the image with their ground coordinates.

use std::path::Path;

use nalgebra::{Matrix2, Vector2};

use super::table_rows::{columns, name, numbers, read_rows};
use areograph_base::{
    body::Body,
    error::{Cause, Locate as _, Result},
};

/// File that describes the columns.
const EXAMPLE: &str = "docs/products.md";
const COLUMNS: &str = "body, image, line, sample, longitude_deg, latitude_deg, height_m";
/// A plane map of an image needs three points; a fourth one shows a reader whether they agree.
const POINTS_MIN: usize = 4;
/// Readers of control points solve equations of this size.
const POINTS_MAX: usize = 10_000;
/// Part of the largest extent of the points in the image that they extend across it at least: otherwise, they lie on a line.
const ACROSS_MIN: f64 = 1e-3;
/// Heights on a planet above its sphere, metres.
const HEIGHT_MAX_M: f64 = 100_000.0;

/// Ground control points of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageControl {
    /// The body.
    pub body: Body,
    /// Identifier of the image.
    pub image: String,
    /// The points, at least four, in the order of the file.
    pub points: Vec<ControlPoint>,
}

/// A place in an image and on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlPoint {
    /// Line, 0 at the outer edge of the first.
    pub line: f64,
    /// Sample, 0 at the outer edge of the first.
    pub sample: f64,
    /// East longitude, degrees.
    pub longitude_deg: f64,
    /// Areocentric latitude, degrees.
    pub latitude_deg: f64,
    /// Height above the sphere of the body's maps, metres.
    pub height_m: f64,
}

/// A table that does not describe one image.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "give control_points.csv of the image, or a table with its columns")]
enum Refused {
    #[error("line {line}: {text}")]
    Row { line: u64, text: String },
    #[error("it has points of the images {one} and {other}; expected one image")]
    Images { one: String, other: String },
    #[error("it has points on two bodies; expected one")]
    Bodies,
    #[error("the table contains {found} points; expected {POINTS_MIN} to {POINTS_MAX}")]
    Number { found: usize },
    #[error("two points are at line {line} and sample {sample}; expected different places")]
    Twice { line: f64, sample: f64 },
    #[error("all points lie on a line of the image; expected points on both sides of one")]
    Line,
    #[error(
        "longitudes span {span_deg}°; expected less than 180°: write those of one image continuously, beyond 180° if necessary"
    )]
    Span { span_deg: f64 },
}

/// Reads the ground control points of an image. A row that cannot be read is an error: the others would leave a part of the image
/// without control.
///
/// # Errors
/// The file cannot be read; missing columns; an invalid row; several images or bodies; fewer than four points; points twice, on a line of
/// the image, or over half of the body.
pub fn read_image_control(path: &Path) -> Result<ImageControl> {
    let table = read_rows(path, EXAMPLE, |header| {
        let named = columns(header, ["body", "image"], COLUMNS)?;
        let places = columns(
            header,
            [
                "line",
                "sample",
                "longitude_deg",
                "latitude_deg",
                "height_m",
            ],
            COLUMNS,
        )?;
        Ok(move |row: &csv::StringRecord| control_row(row, named, &places))
    })?;
    image_control(table.rows, table.complaints).in_file(path)
}

type Row = (Body, String, ControlPoint);

fn control_row(
    row: &csv::StringRecord,
    [body, image]: [usize; 2],
    places: &[usize],
) -> std::result::Result<Row, String> {
    let word = name(row, body, "a point must have a body")?;
    let known = Body::WORDS.into_iter().find(|(name, _)| *name == word);
    let (_, body) =
        known.ok_or_else(|| format!("{word:?} is not a body; expected mars or moon"))?;
    let image = name(row, image, "a point must have an image")?;
    let [line, sample, longitude_deg, latitude_deg, height_m] = numbers(row, places)?[..] else {
        return Err("five numbers".to_owned());
    };
    let within = |what: &str, value: f64, [least, largest]: [f64; 2]| {
        if (least..=largest).contains(&value) {
            return Ok(());
        }
        Err(format!("{what} is {value}; expected {least} to {largest}"))
    };
    within("longitude_deg", longitude_deg, [-360.0, 360.0])?;
    within("latitude_deg", latitude_deg, [-90.0, 90.0])?;
    within("height_m", height_m, [-HEIGHT_MAX_M, HEIGHT_MAX_M])?;
    let point = ControlPoint {
        line,
        sample,
        longitude_deg,
        latitude_deg,
        height_m,
    };
    Ok((body, image, point))
}

fn image_control(
    rows: Vec<Row>,
    complaints: Vec<(u64, String)>,
) -> std::result::Result<ImageControl, Refused> {
    if let Some((line, text)) = complaints.into_iter().next() {
        return Err(Refused::Row { line, text });
    }
    let found = rows.len();
    let mut all = rows.into_iter();
    let (body, image, first) = all.next().ok_or(Refused::Number { found })?;
    let mut points = vec![first];
    for (other_body, other, point) in all {
        if other != image {
            return Err(Refused::Images { one: image, other });
        }
        if other_body != body {
            return Err(Refused::Bodies);
        }
        points.push(point);
    }
    if !(POINTS_MIN..=POINTS_MAX).contains(&found) {
        return Err(Refused::Number { found });
    }
    require_area(&points)?;
    Ok(ImageControl {
        body,
        image,
        points,
    })
}

/// Points at different places, not on a line, and on one side of the body.
fn require_area(points: &[ControlPoint]) -> std::result::Result<(), Refused> {
    let mut places: Vec<[f64; 2]> = points.iter().map(|of| [of.line, of.sample]).collect();
    places.sort_by(|one, other| {
        one[0]
            .total_cmp(&other[0])
            .then(one[1].total_cmp(&other[1]))
    });
    if let Some(pair) = places
        .windows(2)
        .find(|pair| pair[0].map(f64::to_bits) == pair[1].map(f64::to_bits))
    {
        let [line, sample] = pair[0];
        return Err(Refused::Twice { line, sample });
    }
    let count = places.len() as f64;
    let middle = places
        .iter()
        .map(|of| Vector2::from(*of))
        .sum::<Vector2<f64>>()
        / count;
    let about = places.iter().map(|of| Vector2::from(*of) - middle);
    let spread: Matrix2<f64> = about.map(|of| of * of.transpose()).sum();
    let extents = spread.symmetric_eigenvalues();
    if extents.min().max(0.0).sqrt() < ACROSS_MIN * extents.max().sqrt() {
        return Err(Refused::Line);
    }
    let longitudes = || points.iter().map(|of| of.longitude_deg);
    let span_deg = longitudes().fold(f64::MIN, f64::max) - longitudes().fold(f64::MAX, f64::min);
    if span_deg >= 180.0 {
        return Err(Refused::Span { span_deg });
    }
    Ok(())
}
