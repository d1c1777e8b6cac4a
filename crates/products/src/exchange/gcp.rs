//! Adjusted points as ground control of Ames Stereo Pipeline, for `bundle_adjust --datum D_MARS`.
//!
//! A line per point: number, latitude, longitude, height, three standard deviations, and for each image its
//! file, column, row and two standard deviations. The datum is a sphere, so latitudes are areocentric and
//! heights radii minus 3396190 m. The standard deviations belong to Mars-fixed x, y, z (not to latitude,
//! longitude and height, as `--use-lon-lat-height-gcp-error` would have them). Columns and rows have the
//! middle of the first pixel at 0. Numbers count from 1; the comment line before a point states its identifier.
//!
//! The points share the error of the orientations, which their standard deviations contain and the format cannot state:
//! comments give it, and the standard deviations without it. A reader that takes the points as independent would average
//! an error of 110 m to 9 m over 145 points.
//!
//! Source: manual of `bundle_adjust`, section on ground control points; lines beginning with `#` are skipped
//! by its reader (`ControlNetworkLoader.cc` of Vision Workbench).

use std::{fmt::Write as _, path::Path};

use super::{
    DEGREE_DECIMALS, METRE_DECIMALS,
    points::{GroundEstimate, ImageMeasure, SharedSigmas, above_zero, shared_in_words},
};
use crate::{error::ProductError, files::write_text};
use areograph_base::{
    body::Body,
    error::{Locate, Result},
    units::RADIANS_PER_DEGREE,
};

/// The outer edge of the first pixel is 0 here; Ames Stereo Pipeline has its middle at 0.
const EDGE_TO_MIDDLE: f64 = -0.5;
/// Decimals of pixels.
const PIXEL_DECIMALS: usize = 4;

/// A point with its measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlPoint<'a> {
    /// Identifier; written as a comment, since the format requires numbers.
    pub id: &'a str,
    /// Position.
    pub ground: GroundEstimate,
    /// Its standard deviations along X, Y and Z without the error that all points share, metres, where that is known.
    pub relative_sigma_m: Option<[f64; 3]>,
    /// Measurements in images, by their files as given to `bundle_adjust`.
    pub measures: Vec<ControlMeasure<'a>>,
}

/// A measurement with its standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlMeasure<'a> {
    /// The measurement.
    pub measure: ImageMeasure<'a>,
    /// Standard deviations of sample and line, image pixels.
    pub sigma_px: [f64; 2],
}

/// Writes the points that were measured in any image to `path`, which must end in `.gcp`; returns their number.
///
/// * `shared` – the error that all points share
///
/// # Errors
/// [`Kind::Bug`](areograph_base::error::Kind::Bug) for values that the reader would reject or misread:
/// standard deviations that are not above 0, numbers that are not finite, names of files with spaces or
/// commas; [`Kind::Io`](areograph_base::error::Kind::Io).
pub fn write_gcp(
    path: &Path,
    body: Body,
    shared: Option<&SharedSigmas>,
    points: &[ControlPoint],
) -> Result<u64> {
    let map = body.map();
    let mut text = format!(
        "# bundle_adjust --datum {} (sphere of {} m, {} {}); pixels from 0\n\
         # number latitude longitude height_m sigma_x_m sigma_y_m sigma_z_m, and for each image: \
         file column row sigma_column sigma_row\n",
        map.asp_datum,
        map.radius_m,
        body.names().name,
        body.names().short_frame
    );
    let _infallible = writeln!(text, "# {}", shared_in_words(shared));
    if shared.is_some() {
        text += "# after the identifier of a point: standard deviations along x, y, z without the shared error, metres\n";
    }
    let measured = points.iter().filter(|point| !point.measures.is_empty());
    let mut number = 0;
    for point in measured {
        number += 1;
        let line = line(number, map.radius_m, point).in_file(path)?;
        let relative = point.relative_sigma_m.map_or_else(String::new, |sigma_m| {
            let [x, y, z] = sigma_m;
            format!(": {x:.METRE_DECIMALS$} {y:.METRE_DECIMALS$} {z:.METRE_DECIMALS$}")
        });
        let id = comment(point.id);
        let _infallible = writeln!(text, "# {number} is {id}{relative}\n{line}");
    }
    write_text(path, &text)?;
    Ok(number)
}

/// An identifier without line breaks.
fn comment(id: &str) -> String {
    id.replace(char::is_control, " ")
}

fn line(
    number: u64,
    datum_m: f64,
    point: &ControlPoint,
) -> std::result::Result<String, ProductError> {
    let id = point.id;
    let spherical = point.ground.spherical();
    let sigmas_m = point.ground.covariance_m2.diagonal().map(f64::sqrt);
    let mut line = format!(
        "{number} {:.DEGREE_DECIMALS$} {:.DEGREE_DECIMALS$} {:.METRE_DECIMALS$}",
        spherical.latitude.0 / RADIANS_PER_DEGREE,
        spherical.longitude_rad / RADIANS_PER_DEGREE,
        spherical.radius_m - datum_m,
    );
    above_zero(&format!("radius of {id}, metres,"), spherical.radius_m)?;
    for sigma_m in sigmas_m.iter() {
        above_zero(&format!("standard deviation of {id}, metres,"), *sigma_m)?;
        let _infallible = write!(line, " {sigma_m}");
    }
    for ControlMeasure { measure, sigma_px } in &point.measures {
        let file = measure.image;
        let splits = |character: char| character.is_whitespace() || character == ',';
        let place = [measure.sample, measure.line].map(|at| at + EDGE_TO_MIDDLE);
        if file.is_empty() || file.contains(splits) || !place.iter().all(|at| at.is_finite()) {
            let reason = format!(
                "{id} is measured in {file:?} at line {} and sample {}; expected a file without spaces and commas, \
                 and finite numbers",
                measure.line, measure.sample
            );
            let action = "write a point";
            return Err(ProductError::Refused { action, reason });
        }
        let [column, row] = place;
        let _infallible = write!(
            line,
            " {file} {column:.PIXEL_DECIMALS$} {row:.PIXEL_DECIMALS$}"
        );
        for sigma in sigma_px {
            above_zero(
                &format!("standard deviation of {id} in {file}, pixels,"),
                *sigma,
            )?;
            let _infallible = write!(line, " {sigma}");
        }
    }
    Ok(line)
}
