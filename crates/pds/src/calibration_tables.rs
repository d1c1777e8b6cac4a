//! Tables of a calibration: tie points and laser control points in the lines of a camera.

use std::path::Path;

use super::table_rows::{Rows, TableError, columns, name, numbers, read_rows};
use areograph_base::constants::{CONTROL_SIGMA_MAX_M, SIGMA_MIN};
use areograph_base::error::Result;

/// File that describes the columns.
const EXAMPLE: &str = "config/calibrations/example.toml";
/// Largest standard deviation of a line or sample, pixels: the range of the key.
const SIGMA_MAX_PX: f64 = 100.0;
/// Names required in every row.
const NAMED: &str = "a point and a camera must have names";
/// Possible radii of a point on a planet, metres; heights above a sphere are smaller.
const RADIUS_M: [f64; 2] = [100_000.0, 1e9];

/// A point in an image of a line of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageRow {
    /// Name of the point.
    pub point: String,
    /// Name of the line of the camera.
    pub camera: String,
    /// Line of the image, 0 at the outer edge of the first.
    pub line: f64,
    /// Sample, 0 at the outer edge of the first.
    pub sample: f64,
    /// Standard deviations of line and sample, where the table has them.
    pub sigma_px: [Option<f64>; 2],
}

/// A laser point in such an image.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlRow {
    /// Image point.
    pub image: ImageRow,
    /// East longitude and areocentric latitude, degrees.
    pub longitude_deg: f64,
    /// Areocentric latitude, degrees.
    pub latitude_deg: f64,
    /// Distance from the centre of the body, metres.
    pub radius_m: f64,
    /// Standard deviations of a horizontal coordinate and of the radius, where the table has them, metres.
    pub sigma_m: [Option<f64>; 2],
    /// Additional standard deviations of finding the point in the image, where the table has them, metres.
    pub matching_m: [Option<f64>; 2],
    /// Name of the laser profile, where the table has it.
    pub profile: Option<String>,
    /// The part of the standard deviations that all points of the profile share, where the table has it, metres.
    pub shared_m: [Option<f64>; 2],
}

/// Reads a table of tie points.
///
/// # Errors
/// The file cannot be read; columns that are missing; a table of which no row can be read.
pub fn read_ties(path: &Path) -> Result<Rows<ImageRow>> {
    read_rows(path, EXAMPLE, |header| {
        let image = ImageColumns::of(header, "point, camera, line, sample")?;
        Ok(move |row: &csv::StringRecord| image.row(row))
    })
}

/// Reads a table of laser control points.
///
/// # Errors
/// As [`read_ties`].
pub fn read_control(path: &Path) -> Result<Rows<ControlRow>> {
    const COLUMNS: &str = "point, camera, line, sample, longitude_deg, latitude_deg, radius_m (heights depend on a datum)";
    read_rows(path, EXAMPLE, |header| {
        let image = ImageColumns::of(header, COLUMNS)?;
        let place = columns(
            header,
            ["longitude_deg", "latitude_deg", "radius_m"],
            COLUMNS,
        )?;
        let sigma = ["sigma_horizontal_m", "sigma_vertical_m"].map(|name| optional(header, name));
        let matching = ["sigma_matching_horizontal_m", "sigma_matching_vertical_m"];
        let matching = matching.map(|name| optional(header, name));
        let profile = optional(header, "profile");
        let shared = ["sigma_shared_horizontal_m", "sigma_shared_vertical_m"];
        let shared = shared.map(|name| optional(header, name));
        Ok(move |row: &csv::StringRecord| {
            let values = numbers(row, &place)?;
            if !(values[0] >= -180.0 && values[0] <= 360.0 && values[1].abs() <= 90.0) {
                return Err(format!(
                    "longitude_deg {}, latitude_deg {}: expected -180 to 360 and -90 to 90 degrees",
                    values[0], values[1]
                ));
            }
            if !(RADIUS_M[0]..=RADIUS_M[1]).contains(&values[2]) {
                return Err(format!(
                    "radius_m {}: expected the distance from the centre of the body in metres",
                    values[2]
                ));
            }
            Ok(ControlRow {
                image: image.row(row)?,
                longitude_deg: values[0],
                latitude_deg: values[1],
                radius_m: values[2],
                sigma_m: deviations(row, sigma, CONTROL_SIGMA_MAX_M)?,
                matching_m: deviations(row, matching, CONTROL_SIGMA_MAX_M)?,
                profile: profile
                    .and_then(|at| row.get(at))
                    .filter(|name| !name.is_empty())
                    .map(str::to_owned),
                shared_m: deviations(row, shared, CONTROL_SIGMA_MAX_M)?,
            })
        })
    })
}

/// Positions of the columns of an image point.
#[derive(Clone, Copy)]
struct ImageColumns {
    names: [usize; 2],
    place: [usize; 2],
    sigma: [Option<usize>; 2],
}

impl ImageColumns {
    fn of(
        header: &csv::StringRecord,
        expected: &'static str,
    ) -> std::result::Result<Self, TableError> {
        Ok(Self {
            names: columns(header, ["point", "camera"], expected)?,
            place: columns(header, ["line", "sample"], expected)?,
            sigma: ["sigma_line", "sigma_sample"].map(|name| optional(header, name)),
        })
    }

    fn row(&self, row: &csv::StringRecord) -> std::result::Result<ImageRow, String> {
        let place = numbers(row, &self.place)?;
        Ok(ImageRow {
            point: name(row, self.names[0], NAMED)?,
            camera: name(row, self.names[1], NAMED)?,
            line: place[0],
            sample: place[1],
            sigma_px: deviations(row, self.sigma, SIGMA_MAX_PX)?,
        })
    }
}

fn optional(header: &csv::StringRecord, name: &str) -> Option<usize> {
    header.iter().position(|column_name| column_name == name)
}

/// Standard deviations of optional columns, which may be empty in a row.
fn deviations(
    row: &csv::StringRecord,
    of: [Option<usize>; 2],
    largest: f64,
) -> std::result::Result<[Option<f64>; 2], String> {
    let mut deviations = [None; 2];
    for (deviation, column) in deviations.iter_mut().zip(of) {
        let written = column.filter(|at| row.get(*at).is_some_and(|text| !text.is_empty()));
        if let Some(column) = written {
            let sigma = numbers(row, &[column])?[0];
            if !(sigma >= SIGMA_MIN && sigma <= largest) {
                return Err(format!(
                    "standard deviation {sigma}: expected a number from {SIGMA_MIN} to {largest}"
                ));
            }
            *deviation = Some(sigma);
        }
    }
    Ok(deviations)
}
