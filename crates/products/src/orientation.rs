//! Orientation of an image: samples as Parquet, times and polynomials as JSON.

use std::{borrow::Cow, path::Path};

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    coordinates::degrees,
    files::write_json,
    light_time, parquet,
    product::{Content, Context, Declaration, Role, Write},
    site::ImageProducts,
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::{
    error::Result,
    line_times::{LinePiece, LineTimes},
    schema::DocumentSchema,
    terms::Terms,
    units::RADIANS_PER_ARCSECOND,
};
use areograph_geom::{attitude::continuous_quaternions, polynomial::Fit};
use areograph_stages::{
    fit_sensor_model::{EulerModel, RotationVectorModel, SensorModel},
    sample_orientation::{
        BoresightGround, GroundPoint, LightTimeEffect, Orientation, OrientationSample,
    },
    tag_times::{ImageTimes, StartFrom},
};

const CONVENTIONS: [&str; 6] = [
    "frame: {body_name} body-fixed, {frame}, metres; straight rays to the ground start at the positions, see light_time",
    "abscissa x: lines from the middle of the header image, positive along the flight; x = (t - t_middle) / (line \
     period)",
    "polynomial: value = c0 + c1 x + c2 x^2, coefficients from the constant upwards; residual = sample - polynomial; \
     RMSE divides by the number of samples (Shan et al. 2005, Table 4)",
    "angles: camera to {body} = [kappa]3 [phi]2 [omega]1, rotations of the frame; the matrix M from {body} to camera has \
     m13 = sin phi, m23 = -sin omega cos phi, m12 = -cos phi sin kappa; radians, continuous over the image",
    "quaternions: (w, x, y, z) in SPICE's convention, camera to {body}, continuous over the image",
    "rotation vector: M(x) = exp([r(x)]x) M_reference, M from {body} to camera components; positions as in the \
     second-order model; to be used near gimbal lock, where |cos phi| < 0.1 leaves omega and kappa poorly determined",
];

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Exterior orientation of an image",
    description = "images/<id>/orientation.json of areograph: times, polynomial sensor models of first and second order with \
    residuals (Table 4 of Shan et al. 2005), and the rotation-vector form."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph orientation 1"))]
    format: &'static str,
    image: &'a str,
    valid: bool,
    invalid_because: Vec<&'a str>,
    times: Times<'a>,
    conventions: [Cow<'static, str>; 6],
    /// Image offsets of the other conventions, with the orientation from the kernels: shifts of the boresight's ground
    /// point in the middle of the image, positive towards later lines and larger samples.
    light_time: &'a LightTimeEffect,
    #[schemars(range(min = 3))]
    samples: usize,
    /// Outline: east longitude and areocentric latitude, degrees, along the first edge and back along the last edge.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 3))]
    outline_deg: Option<Vec<[f64; 2]>>,
    first_order: Euler<'a>,
    second_order: Euler<'a>,
    rotation_vector: RotationVector<'a>,
    #[schemars(range(min = 0.0, max = 1.0))]
    cos_phi_min: f64,
    near_gimbal_lock: bool,
}

#[derive(Serialize, JsonSchema)]
struct Times<'a> {
    start_et_s: f64,
    start_from: StartFrom,
    #[serde(skip_serializing_if = "Option::is_none")]
    sclk_start: Option<&'a str>,
    utc_start: &'a str,
    middle_et_s: f64,
    stop_et_s: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    line_period_s: f64,
    /// Pieces of the image in order, if the exposure changes inside the image; `line_period_s` is then their mean line period.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    line_pieces: Vec<LinePieceDocument>,
    exposure_s: f64,
    downtrack_summing: u32,
    crosstrack_summing: u32,
    lines_header: u32,
    lines_delivered: u32,
    samples_per_line: u32,
    first_detector: u32,
    notes: &'a [String],
}

#[derive(Serialize, JsonSchema)]
struct LinePieceDocument {
    /// Counted from 0.
    first_line: u32,
    start_et_s: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    line_period_s: f64,
}

#[derive(Serialize, JsonSchema)]
struct Euler<'a> {
    #[schemars(range(min = 0.0))]
    position_rmse_m: f64,
    /// Root mean square effect of the angle residuals on the ellipsoid.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pointing_ground_rmse_m: Option<f64>,
    x_m: Length<'a>,
    y_m: Length<'a>,
    z_m: Length<'a>,
    omega_rad: Angle<'a>,
    phi_rad: Angle<'a>,
    kappa_rad: Angle<'a>,
}

#[derive(Serialize, JsonSchema)]
struct RotationVector<'a> {
    reference: [[f64; 3]; 3],
    x_rad: Angle<'a>,
    y_rad: Angle<'a>,
    z_rad: Angle<'a>,
}

/// Coefficients from the constant upwards in metres per power of a line; residual = sample - polynomial.
#[derive(Serialize, JsonSchema)]
struct Length<'a> {
    #[schemars(length(min = 2, max = 3))]
    coefficients: &'a [f64],
    #[schemars(range(min = 0.0))]
    rmse: f64,
    residuals: &'a [f64],
}

/// Coefficients from the constant upwards in radians per power of a line; RMSE in arcseconds as well.
#[derive(Serialize, JsonSchema)]
struct Angle<'a> {
    #[schemars(length(min = 2, max = 3))]
    coefficients: &'a [f64],
    #[schemars(range(min = 0.0))]
    rmse: f64,
    #[schemars(range(min = 0.0))]
    rmse_arcsec: f64,
    residuals: &'a [f64],
}

macro_rules! declared {
    ($path:literal, $what:literal, $content:expr, $write:expr) => {
        Declaration {
            path: $path,
            what: $what,
            readers: "scripts",
            rows: "samples",
            role: Role::Data,
            content: $content,
            write: $write,
            uses: &[],
        }
    };
}

pub(super) static TABLE: Declaration = declared!(
    "images/<image>/orientation.parquet",
    "positions and rotations of the camera, sampled along the image",
    Content::Table(|| meanings(&columns())),
    Write::Image(write_table)
);

pub(super) static DOCUMENT: Declaration = declared!(
    "images/<image>/orientation.json",
    "times and sensor models: polynomials of first and second order with residuals, and rotation-vector form",
    Content::Document(schema),
    Write::Image(write_document)
);

pub(super) static ADJUSTED_TABLE: Declaration = declared!(
    "images/<image>/adjusted_orientation.parquet",
    "adjusted positions and rotations of the camera",
    Content::Table(|| meanings(&columns())),
    Write::AdjustedImage(write_table)
);

pub(super) static ADJUSTED_DOCUMENT: Declaration = declared!(
    "images/<image>/adjusted_orientation.json",
    "sensor models fitted to the adjusted positions and rotations",
    Content::Document(schema),
    Write::AdjustedImage(write_document)
);

fn write_table(path: &Path, of: &Context, image: &ImageProducts) -> Result<u64> {
    let samples = &image.orientation.samples;
    let rotations = samples.iter().map(|sample| sample.camera_to_mars.matrix());
    let quaternions = continuous_quaternions(rotations);
    let rows = samples.iter().zip(quaternions);
    let table = Table::new(columns(), rows.collect()).in_terms(&of.site.config.terms());
    parquet::write(path, &table, light_time::metadata(of.site))
}

fn write_document(path: &Path, of: &Context, image: &ImageProducts) -> Result<u64> {
    write_json(path, &document(image, &of.site.config.terms()))?;
    Ok(image.orientation.samples.len() as u64)
}

/// A sample and its quaternion, camera to Mars, continuous over the image.
type Sample<'a> = (&'a OrientationSample, [f64; 4]);

/// Schema of the document.
pub(super) fn schema() -> DocumentSchema {
    DocumentSchema::of::<Document>("orientation")
}

fn columns<'a>() -> Vec<Column<Sample<'a>>> {
    fn boresight<'a>(
        name: &'static str,
        unit: Unit,
        description: &'static str,
        of: fn(&BoresightGround) -> f64,
    ) -> Column<Sample<'a>> {
        column(name, unit, description, move |s: &Sample| {
            s.0.boresight.as_ref().map(of)
        })
    }
    vec![
        column(
            "et_s",
            Unit::Second,
            "epoch, TDB seconds past J2000",
            |s: &Sample| s.0.et.seconds(),
        ),
        column(
            "line_offset",
            Unit::Line,
            "line offset from the middle of the header image",
            |s: &Sample| s.0.line_offset,
        ),
        column(
            "x_m",
            Unit::Metre,
            "perspective centre, {frame} X, metres",
            |s: &Sample| s.0.position.xyz_m.x,
        ),
        column(
            "y_m",
            Unit::Metre,
            "perspective centre, {frame} Y, metres",
            |s: &Sample| s.0.position.xyz_m.y,
        ),
        column(
            "z_m",
            Unit::Metre,
            "perspective centre, {frame} Z, metres",
            |s: &Sample| s.0.position.xyz_m.z,
        ),
        column("omega_rad", Unit::Radian, "omega, radians", |s: &Sample| {
            s.0.angles.omega_rad
        }),
        column("phi_rad", Unit::Radian, "phi, radians", |s: &Sample| {
            s.0.angles.phi_rad
        }),
        column("kappa_rad", Unit::Radian, "kappa, radians", |s: &Sample| {
            s.0.angles.kappa_rad
        }),
        column(
            "quaternion_w",
            Unit::None,
            "quaternion from camera to {body}, SPICE convention, w",
            |s: &Sample| s.1[0],
        ),
        column(
            "quaternion_x",
            Unit::None,
            "quaternion from camera to {body}, SPICE convention, x",
            |s: &Sample| s.1[1],
        ),
        column(
            "quaternion_y",
            Unit::None,
            "quaternion from camera to {body}, SPICE convention, y",
            |s: &Sample| s.1[2],
        ),
        column(
            "quaternion_z",
            Unit::None,
            "quaternion from camera to {body}, SPICE convention, z",
            |s: &Sample| s.1[3],
        ),
        boresight(
            "boresight_longitude_deg",
            Unit::Degree,
            "east longitude of the point where the boresight meets the ellipsoid",
            |ground| degrees(ground.longitude_rad),
        ),
        boresight(
            "boresight_latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the point where the boresight meets the ellipsoid",
            |ground| degrees(ground.latitude_rad),
        ),
        boresight(
            "boresight_range_m",
            Unit::Metre,
            "distance from the camera to the point where the boresight meets the ellipsoid, metres",
            |ground| ground.range_m,
        ),
        boresight(
            "boresight_emission_deg",
            Unit::Degree,
            "angle between the surface normal and the direction to the camera where the boresight meets the \
             ellipsoid, degrees",
            |ground| degrees(ground.emission_rad),
        ),
    ]
}

fn document<'a>(image: &ImageProducts<'a>, terms: &Terms) -> Document<'a> {
    let model: &SensorModel = image.model;
    Document {
        format: "areograph orientation 1",
        image: &image.times.id,
        valid: image.invalid_because().is_empty(),
        invalid_because: image.invalid_because(),
        times: times(image.times),
        conventions: CONVENTIONS.map(|convention| terms.fill(convention)),
        light_time: &image.orientation.light_time,
        samples: image.orientation.samples.len(),
        outline_deg: outline_deg(image.orientation),
        first_order: euler(&model.first_order),
        second_order: euler(&model.second_order),
        rotation_vector: rotation_vector(&model.rotation_vector),
        cos_phi_min: model.cos_phi_min,
        near_gimbal_lock: model.near_gimbal_lock,
    }
}

fn outline_deg(orientation: &Orientation) -> Option<Vec<[f64; 2]>> {
    let outline = orientation.outline.as_deref()?;
    let corner = |point: &GroundPoint| [point.longitude_rad, point.latitude_rad].map(degrees);
    Some(outline.iter().map(corner).collect())
}

/// The line-time pieces of an image that has more than one.
fn line_pieces(line_times: &LineTimes) -> Vec<LinePieceDocument> {
    let pieces = line_times.pieces();
    if pieces.len() == 1 {
        return Vec::new();
    }
    let document = |piece: LinePiece| LinePieceDocument {
        first_line: piece.first_line,
        start_et_s: piece.start.seconds(),
        line_period_s: piece.period_s,
    };
    pieces.map(document).collect()
}

fn times(times: &ImageTimes) -> Times<'_> {
    let exposures = times.exposures();
    Times {
        start_et_s: times.line_times.start().seconds(),
        start_from: times.start_from,
        sclk_start: times.sclk_start.as_deref(),
        utc_start: &times.utc_start,
        middle_et_s: times.middle().seconds(),
        stop_et_s: exposures.stop.seconds(),
        line_period_s: times.line_times.mean_period_s(),
        line_pieces: line_pieces(&times.line_times),
        exposure_s: times.exposure_s,
        downtrack_summing: times.downtrack_summing,
        crosstrack_summing: times.crosstrack_summing,
        lines_header: times.line_times.lines(),
        lines_delivered: times.lines_delivered,
        samples_per_line: times.samples,
        first_detector: times.first_detector,
        notes: &times.notes,
    }
}

fn length(fit: &Fit) -> Length<'_> {
    Length {
        coefficients: fit.polynomial.coefficients(),
        rmse: fit.rmse,
        residuals: &fit.residuals,
    }
}

fn angle(fit: &Fit) -> Angle<'_> {
    Angle {
        coefficients: fit.polynomial.coefficients(),
        rmse: fit.rmse,
        rmse_arcsec: fit.rmse / RADIANS_PER_ARCSECOND,
        residuals: &fit.residuals,
    }
}

fn euler(model: &EulerModel) -> Euler<'_> {
    let [x, y, z] = &model.position_m;
    let [omega, phi, kappa] = &model.angles_rad;
    Euler {
        position_rmse_m: model.position_rmse_m(),
        pointing_ground_rmse_m: model.pointing_ground_rmse_m(),
        x_m: length(x),
        y_m: length(y),
        z_m: length(z),
        omega_rad: angle(omega),
        phi_rad: angle(phi),
        kappa_rad: angle(kappa),
    }
}

fn rotation_vector(model: &RotationVectorModel) -> RotationVector<'_> {
    let [x, y, z] = &model.vector_rad;
    RotationVector {
        reference: model.reference.transpose().into(),
        x_rad: angle(x),
        y_rad: angle(y),
        z_rad: angle(z),
    }
}
