//! Adjusted tie points as a control network of ISIS in text form (PVL), for `cnetpvl2bin`.
//!
//! Version 5 of the format. Coordinates are Mars-fixed metres, covariances the upper triangles of their matrices, m².
//! Lines and samples have the middle of the first pixel at 1. Standard deviations and residuals of measurements count
//! lines and samples of the image. A point that the adjustment rejected is included with
//! `JigsawRejected = True`, and so are its measurements: `jigsaw` writes this flag and clears it before the next adjustment.
//! `Ignore` excludes a point from all adjustments; only users set it. The format has no radii of the target: ISIS takes
//! them from its kernels by `TargetName`.
//!
//! Source: `ControlNetVersioner.cpp` of ISIS.

use std::{fmt::Write as _, path::Path};

use nalgebra::{Matrix3, Vector3};

use super::points::{GroundEstimate, ImageMeasure};
use crate::{error::ProductError, files::write_text};
use areograph_base::{
    body::Body,
    error::{Locate, Result},
    ties::KnownGround,
};

/// The outer edge of the first pixel is 0 here; ISIS has its middle at 1.
pub(super) const EDGE_TO_ISIS: f64 = 0.5;

/// A network with its header.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlNetwork<'a> {
    /// Identifier.
    pub id: &'a str,
    /// The body that its points lie on.
    pub body: Body,
    /// Description.
    pub description: String,
    /// UTC given as its creation, ISO 8601.
    pub created_utc: String,
    /// Its points.
    pub points: Vec<NetworkPoint<'a>>,
}

/// A point of a network.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkPoint<'a> {
    /// Identifier.
    pub id: &'a str,
    /// A priori coordinates; a network that is read again takes them as known.
    pub known: Option<KnownGround>,
    /// Initial coordinates of the adjustment, where no a priori ones were known.
    pub initial_m: Option<Vector3<f64>>,
    /// Adjusted coordinates; `None` for a rejected point, and before an adjustment.
    pub adjusted: Option<GroundEstimate>,
    /// Whether an adjustment rejected it.
    pub is_rejected: bool,
    /// Its measurements; images by serial numbers.
    pub measures: Vec<NetworkMeasure<'a>>,
}

/// A measurement of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkMeasure<'a> {
    /// The measurement.
    pub measure: ImageMeasure<'a>,
    /// Standard deviations of line and sample, lines and pixels of the image, if stated.
    pub sigma_px: Option<[f64; 2]>,
    /// Measured minus adjusted line and sample, lines and pixels of the image, if stated.
    pub residual_px: Option<[f64; 2]>,
}

/// Writes `network` to `path`; returns the number of its points.
///
/// # Errors
/// [`Kind::Bug`](areograph_base::error::Kind::Bug) for names that no quotes of the format can hold and numbers that are not
/// finite; [`Kind::Io`](areograph_base::error::Kind::Io).
pub fn write_control_network(path: &Path, network: &ControlNetwork) -> Result<u64> {
    let text = text(network).in_file(path)?;
    write_text(path, &text)?;
    Ok(network.points.len() as u64)
}

/// Lines of nested objects, two blanks deeper in each.
#[derive(Default)]
pub(super) struct Lines {
    pub(super) text: String,
    depth: usize,
}

impl Lines {
    pub(super) fn line(&mut self, line: &str) {
        let indent = 2 * self.depth;
        let _infallible = writeln!(self.text, "{:indent$}{line}", "");
    }

    pub(super) fn key(&mut self, key: &str, value: &str) {
        self.line(&format!("{key} = {value}"));
    }

    pub(super) fn open(&mut self, kind: &str, name: &str) {
        self.key(kind, name);
        self.depth += 1;
    }

    pub(super) fn close(&mut self, end: &str) {
        self.depth -= 1;
        self.line(end);
    }

    /// A number with its unit.
    fn number(
        &mut self,
        key: &str,
        value: f64,
        unit: &str,
    ) -> std::result::Result<(), ProductError> {
        if !value.is_finite() {
            return Err(refused(format!(
                "{key} is {value}; expected a finite number"
            )));
        }
        self.key(key, &format!("{value}{unit}"));
        Ok(())
    }

    /// The three coordinates of a point and the matrix that goes with them.
    fn coordinates(
        &mut self,
        prefix: &str,
        xyz_m: &Vector3<f64>,
        covariance_m2: Option<&Matrix3<f64>>,
    ) -> std::result::Result<(), ProductError> {
        for (axis, value_m) in ["X", "Y", "Z"].iter().zip(xyz_m) {
            self.number(&format!("{prefix}{axis}"), *value_m, " <meters>")?;
        }
        let Some(matrix) = covariance_m2 else {
            return Ok(());
        };
        let triangle = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|at| matrix[at]);
        if !triangle.iter().all(|value| value.is_finite()) {
            return Err(refused(format!("{prefix}CovarianceMatrix is {triangle:?}")));
        }
        let numbers = triangle.map(|value| format!("{value:e}"));
        let value = format!("({})", numbers.join(", "));
        self.key(&format!("{prefix}CovarianceMatrix"), &value);
        Ok(())
    }
}

pub(super) fn refused(reason: String) -> ProductError {
    ProductError::Refused {
        action: "write a control network",
        reason,
    }
}

/// A text in the kind of quotes that it does not contain.
pub(super) fn quoted(text: &str) -> std::result::Result<String, ProductError> {
    let quote = ['"', '\''].into_iter().find(|quote| !text.contains(*quote));
    match quote.filter(|_| !text.contains(char::is_control)) {
        Some(quote) => Ok(format!("{quote}{text}{quote}")),
        None => Err(refused(format!(
            "{text:?}: expected a name without control characters and with at most one kind of quotation mark"
        ))),
    }
}

fn text(network: &ControlNetwork) -> std::result::Result<String, ProductError> {
    let mut lines = Lines::default();
    lines.open("Object", "ControlNetwork");
    lines.key("NetworkId", &quoted(network.id)?);
    lines.key("TargetName", &network.body.names().name);
    lines.key("UserName", "areograph");
    lines.key("Created", &network.created_utc);
    lines.key("LastModified", &network.created_utc);
    lines.key("Description", &quoted(&network.description)?);
    lines.key("Version", "5");
    for point in &network.points {
        lines.open("Object", "ControlPoint");
        add_point(&mut lines, point)?;
        for measure in &point.measures {
            lines.open("Group", "ControlMeasure");
            add_measure(&mut lines, measure, point.is_rejected)?;
            lines.close("End_Group");
        }
        lines.close("End_Object");
    }
    lines.close("End_Object");
    lines.line("End");
    Ok(lines.text)
}

fn add_point(lines: &mut Lines, point: &NetworkPoint) -> std::result::Result<(), ProductError> {
    let kind = match &point.known {
        None => "Free",
        Some(known) if known.covariance_m2.is_some() => "Constrained",
        Some(_) => "Fixed",
    };
    lines.key("PointType", kind);
    lines.key("PointId", &quoted(point.id)?);
    if point.is_rejected {
        lines.key("JigsawRejected", "True");
    }
    let source = if point.known.is_some() {
        "User"
    } else {
        "AverageOfMeasures"
    };
    let known_m = point.known.map(|known| known.ground.xyz_m);
    if let Some(apriori_m) = known_m.or(point.initial_m) {
        lines.key("AprioriXYZSource", source);
        lines.key("AprioriRadiusSource", source);
        let covariance_m2 = point.known.and_then(|known| known.covariance_m2);
        lines.coordinates("Apriori", &apriori_m, covariance_m2.as_ref())?;
    }
    if kind == "Constrained" {
        for coordinate in ["Latitude", "Longitude", "Radius"] {
            lines.key(&format!("{coordinate}Constrained"), "True");
        }
    }
    match &point.adjusted {
        Some(ground) => {
            let GroundEstimate {
                position,
                covariance_m2,
            } = ground;
            lines.coordinates("Adjusted", &position.xyz_m, Some(covariance_m2))
        }
        None => Ok(()),
    }
}

fn add_measure(
    lines: &mut Lines,
    of: &NetworkMeasure,
    rejected: bool,
) -> std::result::Result<(), ProductError> {
    lines.key("SerialNumber", &quoted(of.measure.image)?);
    lines.key("MeasureType", "RegisteredSubPixel");
    lines.number("Sample", of.measure.sample + EDGE_TO_ISIS, "")?;
    lines.number("Line", of.measure.line + EDGE_TO_ISIS, "")?;
    for (what, pair) in [("Sigma", of.sigma_px), ("Residual", of.residual_px)] {
        if let Some([line, sample]) = pair {
            lines.number(&format!("Sample{what}"), sample, " <pixels>")?;
            lines.number(&format!("Line{what}"), line, " <pixels>")?;
        }
    }
    if rejected {
        lines.key("JigsawRejected", "True");
    }
    Ok(())
}
