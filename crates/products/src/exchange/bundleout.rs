//! Tables in jigsaw's format: residuals, points, images. Its columns and their head lines come first, areograph's
//! follow.
//!
//! Source: `BundleSolutionInfo.cpp` of ISIS.

use std::path::Path;

use nalgebra::Vector3;

use super::{DEGREE_DECIMALS, points::GroundEstimate};
use crate::{error::ProductError, files::write_bytes};
use areograph_base::{
    error::{Error, Locate, Result},
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use areograph_geom::{bundle::ORIENTATION_UNKNOWNS, ellipsoid::local_axes};

/// Decimals of jigsaw's numbers.
const DECIMALS: usize = 8;

/// A measurement and its residuals after the adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ResidualRow<'a> {
    pub(super) point: &'a str,
    pub(super) file: &'a str,
    pub(super) serial: &'a str,
    /// Measured position in the focal plane as ISIS defines it, along the track and along the samples, millimetres.
    pub(super) focal_mm: [f64; 2],
    /// Measured sample and line, the middle of the first pixel at 1.
    pub(super) place: [f64; 2],
    /// Measured minus adjusted sample and line; `None` for a rejected point without a ground point.
    pub(super) residual_px: Option<[f64; 2]>,
    /// Standard deviations of sample and line.
    pub(super) sigma_px: [f64; 2],
    /// Redundancy numbers across and along the track, and standardised residuals, of used measurements.
    pub(super) redundancy: Option<[f64; 2]>,
    pub(super) standardised: [Option<f64>; 2],
    pub(super) rejected: bool,
}

/// A tie point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PointRow<'a> {
    pub(super) id: &'a str,
    /// `FREE`, `CONSTRAINED` or `FIXED`.
    pub(super) status: &'static str,
    pub(super) measures: usize,
    /// Root mean square of the residuals of its measurements, pixels.
    pub(super) rms_px: f64,
    pub(super) ground: GroundEstimate,
    /// Standard deviations in east, north and height without the error that all points share, metres, where that is known.
    pub(super) relative_sigmas_m: Option<[f64; 3]>,
    pub(super) initial_m: Vector3<f64>,
}

/// An image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImageRow<'a> {
    pub(super) file: &'a str,
    /// Root mean square residuals of samples, lines and both.
    pub(super) rms_px: [f64; 3],
    /// The orientation that was corrected, over the one that ISIS reads from the kernels, as `correction`.
    pub(super) initial: [f64; ORIENTATION_UNKNOWNS],
    /// Corrections with their standard deviations before and after; metres and radians, see
    /// [`areograph_stages::adjust::CorrectedImage`].
    pub(super) correction: &'a [f64; ORIENTATION_UNKNOWNS],
    pub(super) prior_sigmas: &'a [f64; ORIENTATION_UNKNOWNS],
    pub(super) sigmas: &'a [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviations of the camera's position at the exposure of the middle line in east, north and height, metres.
    pub(super) local_sigmas_m: [f64; 3],
    /// Numbers of used and of rejected measurements.
    pub(super) measures: [usize; 2],
}

fn number(value: f64) -> String {
    format!("{value:.DECIMALS$}")
}

fn optional(value: Option<f64>) -> String {
    value.map_or_else(String::new, number)
}

/// Writes lines of fields; rejects values that the format cannot hold.
fn write(path: &Path, heads: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Result<u64> {
    let refused = |error: csv::Error| Error::from(ProductError::refused("encode CSV")(error));
    let mut writer = csv::WriterBuilder::new()
        .flexible(true)
        .from_writer(Vec::new());
    for head in heads {
        writer
            .write_record(head.split(','))
            .map_err(refused)
            .in_file(path)?;
    }
    let mut count = 0;
    for row in rows {
        writer.write_record(row).map_err(refused).in_file(path)?;
        count += 1;
    }
    let bytes = writer.into_inner().unwrap_or_default();
    write_bytes(path, &bytes)?;
    Ok(count)
}

/// Head lines of the residuals.
const RESIDUAL_HEADS: [&str; 3] = [
    ",,,x image,y image,Measured,Measured,sample,line,Residual Vector,,sample,line,sample,line,sample,line",
    "Point,Image,Image,coordinate,coordinate,Sample,Line,residual,residual,Magnitude,,sigma,sigma,redundancy,redundancy,\
     standardised,standardised",
    "Label,Filename,Serial Number,(mm),(mm),(pixels),(pixels),(pixels),(pixels),(pixels),Rejected,(pixels),(pixels),,,,",
];

pub(super) fn write_residuals(path: &Path, rows: &[ResidualRow]) -> Result<u64> {
    let fields = |row: &ResidualRow| {
        let mut fields: Vec<String> = [row.point, row.file, row.serial].map(str::to_owned).into();
        fields.extend(row.focal_mm.map(number));
        fields.extend(row.place.map(number));
        let residual = row.residual_px;
        let length = residual.map(|[sample, line]| sample.hypot(line));
        fields.extend([0, 1].map(|axis| optional(residual.map(|residual| residual[axis]))));
        fields.push(optional(length));
        fields.push(if row.rejected { "*" } else { "" }.to_owned());
        fields.extend(row.sigma_px.map(number));
        fields
            .extend([0, 1].map(|axis| optional(row.redundancy.map(|redundancy| redundancy[axis]))));
        fields.extend(row.standardised.map(optional));
        fields
    };
    write(path, &RESIDUAL_HEADS, rows.iter().map(fields))
}

/// Head lines of the points.
const POINT_HEADS: [&str; 3] = [
    "Point,Point,Accepted,Rejected,Residual,3-d,3-d,3-d,Sigma,Sigma,Sigma,Correction,Correction,Correction,Coordinate,\
     Coordinate,Coordinate,Sigma,Sigma,Sigma,Correlation,Correlation,Correlation,Relative Sigma,Relative Sigma,Relative Sigma",
    "ID,,,,,Latitude,Longitude,Radius,Latitude,Longitude,Radius,Latitude,Longitude,Radius,X,Y,Z,X,Y,Z,X Y,X Z,Y Z,Latitude,Longitude,Radius",
    "Label,Status,Measures,Measures,RMS,(dd),(dd),(km),(m),(m),(m),(m),(m),(m),(km),(km),(km),(m),(m),(m),,,,(m),(m),(m)",
];

pub(super) fn write_points(path: &Path, rows: &[PointRow]) -> Result<u64> {
    let fields = |row: &PointRow| {
        let spherical = row.ground.spherical();
        let (xyz_m, covariance_m2) = (row.ground.position.xyz_m, row.ground.covariance_m2);
        // North, east and up: what jigsaw calls latitude, longitude and radius in metres.
        let local = local_axes(&xyz_m);
        let local_m2 = local * covariance_m2 * local.transpose();
        let moved_m = local * (xyz_m - row.initial_m);
        let degrees =
            |angle_rad: f64| format!("{:.DEGREE_DECIMALS$}", angle_rad / RADIANS_PER_DEGREE);
        let mut fields = vec![
            row.id.to_owned(),
            row.status.to_owned(),
            row.measures.to_string(),
            "0".to_owned(),
            format!("{:.2}", row.rms_px),
            degrees(spherical.latitude.0),
            degrees(spherical.longitude_rad),
            number(spherical.radius_m / METRES_PER_KM),
        ];
        let north_east_up = [1, 0, 2];
        fields.extend(north_east_up.map(|axis| number(local_m2[(axis, axis)].sqrt())));
        fields.extend(north_east_up.map(|axis| number(moved_m[axis])));
        fields.extend([0, 1, 2].map(|axis| number(xyz_m[axis] / METRES_PER_KM)));
        let sigmas_m = [0, 1, 2].map(|axis| covariance_m2[(axis, axis)].sqrt());
        fields.extend(sigmas_m.map(number));
        let correlation =
            |(a, b): (usize, usize)| covariance_m2[(a, b)] / (sigmas_m[a] * sigmas_m[b]);
        fields.extend([(0, 1), (0, 2), (1, 2)].map(|pair| number(correlation(pair))));
        let relative_m = row.relative_sigmas_m;
        fields.extend(north_east_up.map(|axis| optional(relative_m.map(|of| of[axis]))));
        fields
    };
    write(path, &POINT_HEADS, rows.iter().map(fields))
}

/// Names of the six quantities of an image.
const QUANTITIES: [&str; 6] = ["X", "Y", "Z", "ROTATION X", "ROTATION Y", "ROTATION Z"];
/// Columns of each coefficient.
const OF_COEFFICIENT: [&str; 5] = [
    "Initial",
    "Correction",
    "Final",
    "Apriori Sigma",
    "Adj Sigma",
];

pub(super) fn write_images(path: &Path, rows: &[ImageRow]) -> Result<u64> {
    let mut heads: [Vec<String>; 2] = [
        ["Image", "rms", "rms", "rms"].map(str::to_owned).into(),
        ["Filename", "sample res", "line res", "total res"]
            .map(str::to_owned)
            .into(),
    ];
    for unknown in 0..ORIENTATION_UNKNOWNS {
        let (quantity, power) = (QUANTITIES[unknown / 3], unknown % 3);
        for column in OF_COEFFICIENT {
            heads[0].push(format!("{quantity}(t{power})"));
            heads[1].push(column.to_owned());
        }
    }
    for (first, second) in [
        ("Sigma", "East (m)"),
        ("Sigma", "North (m)"),
        ("Sigma", "Up (m)"),
        ("Measures", "Accepted"),
        ("Measures", "Rejected"),
    ] {
        heads[0].push(first.to_owned());
        heads[1].push(second.to_owned());
    }
    let heads = heads.map(|head| head.join(","));
    write(
        path,
        &heads.each_ref().map(String::as_str),
        rows.iter().map(image_fields),
    )
}

/// Positions become kilometres and rotations degrees, as jigsaw has them.
fn image_fields(row: &ImageRow) -> Vec<String> {
    let mut fields = vec![row.file.to_owned()];
    fields.extend(row.rms_px.map(number));
    for unknown in 0..ORIENTATION_UNKNOWNS {
        let unit = if unknown < 9 {
            METRES_PER_KM
        } else {
            RADIANS_PER_DEGREE
        };
        let of = |value: f64| format!("{:.12}", value / unit);
        let prior = row.prior_sigmas[unknown];
        let [before, after] = if prior == 0.0 {
            ["N/A", "N/A"].map(str::to_owned)
        } else if prior.is_finite() {
            [of(prior), of(row.sigmas[unknown])]
        } else {
            ["FREE".to_owned(), of(row.sigmas[unknown])]
        };
        let [initial, correction] = [row.initial[unknown], row.correction[unknown]];
        let values = [initial, correction, initial + correction].map(of);
        fields.extend(values);
        fields.extend([before, after]);
    }
    fields.extend(row.local_sigmas_m.map(number));
    fields.extend(row.measures.map(|count| count.to_string()));
    fields
}
