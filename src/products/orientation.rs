//! Orientation of an image: samples as Parquet, times and polynomials as JSON.

use serde::Serialize;

use super::{
    Writer,
    coordinates::degrees,
    files::write_json,
    parquet,
    site::ImageProducts,
    table::{Column, Table, Values},
};
use crate::{
    error::Result,
    geom::{attitude::continuous_quaternions, polynomial::Fit},
    stages::{
        fit_sensor_model::{EulerModel, RotationVectorModel, SensorModel},
        sample_orientation::{BoresightGround, GroundPoint, Orientation, OrientationSample},
        tag_times::{ImageTimes, StartFrom},
    },
    units::RADIANS_PER_ARCSECOND,
};

const CONVENTIONS: [&str; 6] = [
    "frame: Mars body-fixed, IAU 2000; positions are geometric (no light time, no aberration), metres",
    "abscissa x: lines from the middle of the header image, positive along flight; x = (t - t_middle) / line period",
    "polynomial: value = c0 + c1 x + c2 x^2, coefficients from the constant upwards; residual = sample - polynomial; \
     RMSE divides by the number of samples (Shan et al. 2005, Table 4)",
    "angles: camera to Mars = [kappa]3 [phi]2 [omega]1, rotations of the frame; the matrix M from Mars to camera has \
     m13 = sin phi, m23 = -sin omega cos phi, m12 = -cos phi sin kappa; radians, continuous over the image",
    "quaternions: (w, x, y, z) in SPICE's convention, camera to Mars, continuous over the image",
    "rotation vector: M(x) = exp([r(x)]x) M_reference, M from Mars to camera components; positions as in the second \
     order; to be used near gimbal lock, where |cos phi| < 0.1 leaves omega and kappa badly determined",
];

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    image: &'a str,
    valid: bool,
    invalid_because: Vec<&'a str>,
    times: Times<'a>,
    conventions: [&'static str; 6],
    samples: usize,
    /// East longitude and areocentric latitude, degrees: along the first edge and back along the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    outline_deg: Option<Vec<[f64; 2]>>,
    first_order: Euler<'a>,
    second_order: Euler<'a>,
    rotation_vector: RotationVector<'a>,
    cos_phi_min: f64,
    near_gimbal_lock: bool,
}

#[derive(Serialize)]
struct Times<'a> {
    start_et_s: f64,
    start_from: StartFrom,
    #[serde(skip_serializing_if = "Option::is_none")]
    sclk_start: Option<&'a str>,
    utc_start: &'a str,
    middle_et_s: f64,
    stop_et_s: f64,
    line_period_s: f64,
    exposure_s: f64,
    downtrack_summing: u32,
    crosstrack_summing: u32,
    lines_header: u32,
    lines_delivered: u32,
    samples_per_line: u32,
    first_detector: u32,
    notes: &'a [String],
}

#[derive(Serialize)]
struct Euler<'a> {
    position_rmse_m: f64,
    /// Root mean square on the ellipsoid of what the residuals of the angles do there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pointing_ground_rmse_m: Option<f64>,
    x_m: Polynomial<'a>,
    y_m: Polynomial<'a>,
    z_m: Polynomial<'a>,
    omega_rad: Polynomial<'a>,
    phi_rad: Polynomial<'a>,
    kappa_rad: Polynomial<'a>,
}

#[derive(Serialize)]
struct RotationVector<'a> {
    reference: [[f64; 3]; 3],
    x_rad: Polynomial<'a>,
    y_rad: Polynomial<'a>,
    z_rad: Polynomial<'a>,
}

/// A fit; RMSE and residuals in the unit of the samples.
#[derive(Serialize)]
struct Polynomial<'a> {
    coefficients: &'a [f64],
    rmse: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_arcsec: Option<f64>,
    residuals: &'a [f64],
}

/// Writes samples and models of an image; the names of the files begin with `prefix`.
pub(super) fn write(written: &mut Writer, image: &ImageProducts, prefix: &str) -> Result<()> {
    let folder = format!("images/{}", image.times.id);
    let table = Table::new(columns(&image.orientation.samples))?;
    written.add(format!("{folder}/{prefix}orientation.parquet"), |path| {
        parquet::write(path, &table, Vec::new())
    })?;
    written.add(format!("{folder}/{prefix}orientation.json"), |path| {
        write_json(path, &document(image))?;
        Ok(table.rows() as u64)
    })
}

fn columns(samples: &[OrientationSample]) -> Vec<Column> {
    let number = |name, description, value: fn(&OrientationSample) -> f64| {
        Column::new(
            name,
            description,
            Values::F64(samples.iter().map(value).collect()),
        )
    };
    let rotations = samples.iter().map(|sample| sample.camera_to_mars.matrix());
    let quaternions = continuous_quaternions(rotations);
    let quaternion = |name, description, component: usize| {
        let values = quaternions.iter().map(|quaternion| quaternion[component]);
        Column::new(name, description, Values::F64(values.collect()))
    };
    let boresight = |name, description, value: fn(&BoresightGround) -> f64| {
        let values = samples
            .iter()
            .map(|sample| sample.boresight.as_ref().map(value));
        Column::new(name, description, Values::OptionalF64(values.collect()))
    };
    vec![
        number("et_s", "epoch, TDB seconds past J2000", |s| s.et.seconds()),
        number(
            "line_offset",
            "lines from the middle of the header image",
            |s| s.line_offset,
        ),
        number("x_m", "perspective centre, IAU 2000 X, metres", |s| {
            s.position.xyz_m.x
        }),
        number("y_m", "perspective centre, IAU 2000 Y, metres", |s| {
            s.position.xyz_m.y
        }),
        number("z_m", "perspective centre, IAU 2000 Z, metres", |s| {
            s.position.xyz_m.z
        }),
        number("omega_rad", "omega, radians", |s| s.angles.omega_rad),
        number("phi_rad", "phi, radians", |s| s.angles.phi_rad),
        number("kappa_rad", "kappa, radians", |s| s.angles.kappa_rad),
        quaternion("quaternion_w", "camera to Mars, SPICE convention, w", 0),
        quaternion("quaternion_x", "camera to Mars, SPICE convention, x", 1),
        quaternion("quaternion_y", "camera to Mars, SPICE convention, y", 2),
        quaternion("quaternion_z", "camera to Mars, SPICE convention, z", 3),
        boresight(
            "boresight_longitude_deg",
            "east longitude where the boresight meets the ellipsoid",
            |ground| degrees(ground.longitude_rad),
        ),
        boresight(
            "boresight_latitude_deg",
            "areocentric latitude where the boresight meets the ellipsoid",
            |ground| degrees(ground.latitude_rad),
        ),
        boresight(
            "boresight_range_m",
            "distance of that point, metres",
            |ground| ground.range_m,
        ),
        boresight(
            "boresight_emission_deg",
            "angle between normal and camera there, degrees",
            |ground| degrees(ground.emission_rad),
        ),
    ]
}

fn document<'a>(image: &ImageProducts<'a>) -> Document<'a> {
    let model: &SensorModel = image.model;
    Document {
        format: "areograph orientation 1",
        image: &image.times.id,
        valid: image.invalid_because().is_empty(),
        invalid_because: image.invalid_because(),
        times: times(image.times),
        conventions: CONVENTIONS,
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

fn times(times: &ImageTimes) -> Times<'_> {
    let exposures = times.exposures();
    Times {
        start_et_s: times.start.seconds(),
        start_from: times.start_from,
        sclk_start: times.sclk_start.as_deref(),
        utc_start: &times.utc_start,
        middle_et_s: times.middle().seconds(),
        stop_et_s: exposures.stop.seconds(),
        line_period_s: times.line_period_s,
        exposure_s: times.exposure_s,
        downtrack_summing: times.downtrack_summing,
        crosstrack_summing: times.crosstrack_summing,
        lines_header: times.lines_header,
        lines_delivered: times.lines_delivered,
        samples_per_line: times.samples,
        first_detector: times.first_detector,
        notes: &times.notes,
    }
}

fn length(fit: &Fit) -> Polynomial<'_> {
    Polynomial {
        coefficients: fit.polynomial.coefficients(),
        rmse: fit.rmse,
        rmse_arcsec: None,
        residuals: &fit.residuals,
    }
}

fn angle(fit: &Fit) -> Polynomial<'_> {
    Polynomial {
        rmse_arcsec: Some(fit.rmse / RADIANS_PER_ARCSECOND),
        ..length(fit)
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
