//! Tables for camera models, with as many nodes as they need to be interpolated.

use nalgebra::{Matrix3, Vector3};

use super::{CameraTables, InterpolationCheck, Reader};
use crate::{
    constants::MARS_IAU2000,
    error::Result,
    frames::MarsIau2000,
    geom::{
        attitude::{make_continuous, matrix_of_spice_quaternion, spice_quaternion},
        lagrange::lagrange,
        mars_rotation::mars_rotation,
        statistics::largest,
    },
    stages::tag_times::ImageTimes,
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY},
};

/// Image lines between two nodes of the camera-model tables to begin with; ALE's spacing for long images.
const TABLE_LINES: u32 = 10;
/// Fewest nodes over the image; usgscsm resamples tables with fewer than 25.
const TABLE_NODES_MIN: u32 = 31;
/// Nodes beyond each end of the image, so that an eighth-order interpolation never runs out.
const TABLE_NODES_BEYOND: u32 = 8;
/// Where between two nodes the interpolation is compared with the kernels, shares of their distance.
const CHECKED_AT: [f64; 3] = [0.25, 0.5, 0.75];

/// Tables whose interpolation keeps [`InterpolationCheck::LIMIT_PX`], or the densest ones: a node per line.
pub(super) fn camera_tables(
    reader: &Reader,
    image: &ImageTimes,
    padding_s: f64,
) -> Result<CameraTables> {
    let mut steps = image
        .lines_header
        .div_ceil(TABLE_LINES)
        .max(TABLE_NODES_MIN - 1);
    loop {
        let mut tables = tables(reader, &table_epochs(image, steps, padding_s))?;
        tables.interpolation =
            check_interpolation(image, &tables, |et| apparent_camera(reader, et))?;
        if tables.interpolation.keeps_limit() || steps >= image.lines_header {
            return Ok(tables);
        }
        steps = (2 * steps).min(image.lines_header);
    }
}

/// Epochs of the camera tables: uniform, both image ends on the grid, beyond them within the padding.
fn table_epochs(image: &ImageTimes, steps: u32, padding_s: f64) -> Vec<Et> {
    let step_s = image.duration_s() / f64::from(steps);
    let beyond = (1..=TABLE_NODES_BEYOND)
        .take_while(|nodes| f64::from(*nodes) * step_s <= padding_s)
        .last()
        .unwrap_or(0);
    (0..=steps + 2 * beyond)
        .map(|k| {
            image
                .start
                .plus((f64::from(k) - f64::from(beyond)) * step_s)
        })
        .collect()
}

/// Tables at two or more epochs.
fn tables(reader: &Reader, epochs: &[Et]) -> Result<CameraTables> {
    let session = reader.session;
    let [first, last] = [epochs[0], epochs[epochs.len() - 1]];
    let suns = [session.sun_state(first)?, session.sun_state(last)?];
    let mut tables = CameraTables {
        et_s: Vec::new(),
        position_m: Vec::new(),
        velocity_m_s: Vec::new(),
        sun_position_m: suns.map(|sun| sun.position.xyz_m.into()),
        sun_velocity_m_s: suns.map(|sun| sun.velocity_m_s.into()),
        inertial_to_bus: Vec::new(),
        bus_angular_velocity_rad_s: Vec::new(),
        inertial_to_mars: Vec::new(),
        mars_angular_velocity_rad_s: Vec::new(),
        bus_to_camera: rows(session.mounting(reader.instrument, first)?.matrix()),
        interpolation: InterpolationCheck::default(),
    };
    for epoch in epochs {
        let apparent = session.apparent_state(*epoch)?;
        let attitude = reader.attitude(*epoch)?;
        let to_mars = mars_rotation::<MarsIau2000>(*epoch);
        tables.et_s.push(epoch.seconds());
        tables.position_m.push(apparent.position.xyz_m.into());
        tables.velocity_m_s.push(apparent.velocity_m_s.into());
        tables
            .inertial_to_bus
            .push(spice_quaternion(attitude.inertial_to_bus.matrix()));
        tables
            .bus_angular_velocity_rad_s
            .push(attitude.angular_velocity_rad_s.into());
        tables
            .inertial_to_mars
            .push(spice_quaternion(to_mars.matrix()));
        tables
            .mars_angular_velocity_rad_s
            .push(mars_angular_velocity(to_mars.matrix()).into());
    }
    make_continuous(&mut tables.inertial_to_bus);
    make_continuous(&mut tables.inertial_to_mars);
    Ok(tables)
}

/// Spin of Mars in J2000: its rate along its pole (the pole's own motion is 1e-14 rad/s).
fn mars_angular_velocity(inertial_to_mars: &Matrix3<f64>) -> Vector3<f64> {
    let rate_rad_s = MARS_IAU2000.meridian_deg_per_day * RADIANS_PER_DEGREE / SECONDS_PER_DAY;
    inertial_to_mars.row(2).transpose() * rate_rad_s
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// Camera position in IAU 2000, metres, and the rotation from the camera to it.
pub(in crate::stages) type Camera = (Vector3<f64>, Matrix3<f64>);

/// What a camera model makes of the nodes: rotated to Mars first, then interpolated.
pub(in crate::stages) struct Nodes {
    start_s: f64,
    step_s: f64,
    position_m: Vec<[f64; 3]>,
    camera_to_mars: Vec<[f64; 4]>,
}

impl Nodes {
    /// Nodes of `tables`, which hold two or more.
    pub(in crate::stages) fn new(tables: &CameraTables) -> Self {
        let bus_to_camera = Matrix3::from_fn(|row, column| tables.bus_to_camera[row][column]);
        let matrices: Vec<(Matrix3<f64>, Matrix3<f64>)> = tables
            .inertial_to_mars
            .iter()
            .zip(&tables.inertial_to_bus)
            .map(|(to_mars, to_bus)| {
                let to_camera = bus_to_camera * matrix_of_spice_quaternion(*to_bus);
                (matrix_of_spice_quaternion(*to_mars), to_camera)
            })
            .collect();
        let mut camera_to_mars: Vec<[f64; 4]> = matrices
            .iter()
            .map(|(to_mars, to_camera)| spice_quaternion(&(to_mars * to_camera.transpose())))
            .collect();
        make_continuous(&mut camera_to_mars);
        let last = tables.et_s.len() - 1;
        Self {
            start_s: tables.et_s[0],
            step_s: (tables.et_s[last] - tables.et_s[0]) / last as f64,
            position_m: matrices
                .iter()
                .zip(&tables.position_m)
                .map(|((to_mars, _), position_m)| (to_mars * Vector3::from(*position_m)).into())
                .collect(),
            camera_to_mars,
        }
    }

    /// The camera between the nodes.
    pub(in crate::stages) fn camera(&self, et: Et) -> Camera {
        let at = (et.seconds() - self.start_s) / self.step_s;
        let position_m = lagrange(&self.position_m, at).into();
        let camera_to_mars = matrix_of_spice_quaternion(lagrange(&self.camera_to_mars, at));
        (position_m, camera_to_mars)
    }
}

/// Compares the interpolated camera with `camera` between all nodes over the image.
pub(in crate::stages) fn check_interpolation(
    image: &ImageTimes,
    tables: &CameraTables,
    camera: impl Fn(Et) -> Result<Camera>,
) -> Result<InterpolationCheck> {
    let nodes = Nodes::new(tables);
    let mut check = InterpolationCheck::default();
    for pair in tables.et_s.windows(2) {
        for share in CHECKED_AT {
            let et = Et::from_seconds(pair[0] + share * (pair[1] - pair[0]));
            if !image.exposures().contains(et) {
                continue;
            }
            let error_px = error_px(image, &camera(et)?, &nodes.camera(et));
            check.error_max_px = largest([check.error_max_px, error_px]).unwrap_or_default();
            check.epochs += 1;
        }
    }
    Ok(check)
}

/// What the kernels say of the camera, its position with light time and aberration as the tables have it.
fn apparent_camera(reader: &Reader, et: Et) -> Result<Camera> {
    let to_mars = mars_rotation::<MarsIau2000>(et);
    let position = to_mars.apply(&reader.session.apparent_state(et)?.position);
    let camera_to_mars = to_mars * reader.inertial_to_camera(et)?.inverse();
    Ok((position.xyz_m, *camera_to_mars.matrix()))
}

/// How far apart two cameras see the same ground, in image pixels, at most over the middle and both ends
/// of a line; the ground is taken as near as it can be, straight below.
fn error_px(image: &ImageTimes, kernels: &Camera, interpolated: &Camera) -> f64 {
    let (position_m, camera_to_mars) = kernels;
    let distance_m = position_m.norm() - MARS_IAU2000.equatorial_radius_m;
    let detector = image.detector();
    let pixel_rad =
        image.instrument.optics.pixel_pitch_mm / image.instrument.optics.focal_length_mm;
    let errors_px = [0.0, 0.5, 1.0].map(|share| {
        let look = detector.look(share * detector.samples);
        let ground_m = position_m + camera_to_mars * look * distance_m;
        let seen = interpolated.1.transpose() * (ground_m - interpolated.0);
        let missed = seen.xy() / seen.z - look.xy();
        let lines = missed.x / f64::from(image.downtrack_summing);
        let samples = missed.y / f64::from(image.crosstrack_summing);
        lines.hypot(samples) / pixel_rad
    });
    largest(errors_px).unwrap_or_default()
}
