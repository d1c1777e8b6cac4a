//! Tables for camera models, with as many nodes as interpolation needs.

use crate::orientation::CameraReader;
use crate::{
    orientation::{CameraTables, InterpolationCheck, RayOrigin},
    tag_times::ImageTimes,
};
use areograph_base::{body::Body, error::Result, time::Et};

/// Initial spacing of nodes of the camera-model tables, image lines; ALE's spacing for long images.
const TABLE_LINES: u32 = 10;
/// Fewest nodes over the image; usgscsm resamples tables with fewer than 25.
const TABLE_NODES_MIN: u32 = 31;
/// Nodes beyond each end of the image, so that an eighth-order interpolation never runs out.
const TABLE_NODES_BEYOND: u32 = 8;

/// Tables whose interpolation keeps [`InterpolationCheck::LIMIT_PX`], or the densest ones: a node per line. With the
/// distance of each node from the intervals of the C-kernels, seconds.
pub(super) fn camera_tables(
    reader: &CameraReader<'_>,
    image: &ImageTimes,
    padding_s: f64,
) -> Result<(CameraTables, Vec<f64>)> {
    let mut steps = first_steps(image);
    loop {
        let (mut tables, held_s) = tables(reader, &table_epochs(image, steps, padding_s))?;
        tables.interpolation = InterpolationCheck::of(image, &tables, |et| reader.camera(et))?;
        if tables.interpolation.keeps_limit() || steps >= image.line_times.lines() {
            return Ok((tables, held_s));
        }
        steps = (2 * steps).min(image.line_times.lines());
    }
}

/// Makes sure that the tables can be read at both of their ends, the Sun included.
pub(super) fn require_ends(
    reader: &CameraReader<'_>,
    image: &ImageTimes,
    padding_s: f64,
) -> Result<()> {
    let epochs = table_epochs(image, first_steps(image), padding_s);
    tables(reader, &[epochs[0], epochs[epochs.len() - 1]]).map(|_| ())
}

/// Initial number of steps over the image.
fn first_steps(image: &ImageTimes) -> u32 {
    let steps = image.line_times.lines().div_ceil(TABLE_LINES);
    steps.max(TABLE_NODES_MIN - 1)
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
            let start = image.line_times.start();
            start.plus((f64::from(k) - f64::from(beyond)) * step_s)
        })
        .collect()
}

/// Tables at two or more epochs, and the distance of each from the intervals of the C-kernels, seconds.
fn tables(reader: &CameraReader<'_>, epochs: &[Et]) -> Result<(CameraTables, Vec<f64>)> {
    let session = reader.session;
    let [first, last] = [epochs[0], epochs[epochs.len() - 1]];
    let suns = [session.sun_state(first)?, session.sun_state(last)?];
    // Sites of a thousand images hold them all.
    let nodes = epochs.len();
    let mut tables = CameraTables {
        et_s: Vec::with_capacity(nodes),
        position_m: Vec::with_capacity(nodes),
        velocity_m_s: Vec::with_capacity(nodes),
        sun_position_m: suns.map(|sun| sun.position.xyz_m),
        sun_velocity_m_s: suns.map(|sun| sun.velocity_m_s),
        inertial_to_bus: Vec::with_capacity(nodes),
        bus_angular_velocity_rad_s: Vec::with_capacity(nodes),
        inertial_to_mars: Vec::with_capacity(nodes),
        mars_angular_velocity_rad_s: Vec::with_capacity(nodes),
        bus_to_camera: session.mounting(reader.instrument, first)?,
        interpolation: InterpolationCheck::default(),
    };
    let mut held_s = Vec::with_capacity(nodes);
    for epoch in epochs {
        let attitude = reader.attitude(*epoch)?;
        let looks = tables.bus_to_camera.matrix() * attitude.inertial_to_bus.matrix();
        let boresight = looks.row(2).transpose();
        let RayOrigin { state, to_mars } =
            RayOrigin::at(session, reader.light_time, *epoch, &boresight)?;
        held_s.push(attitude.distance_s);
        tables.et_s.push(epoch.seconds());
        tables.position_m.push(state.position.xyz_m);
        tables.velocity_m_s.push(state.velocity_m_s);
        tables.inertial_to_bus.push(attitude.inertial_to_bus);
        tables
            .bus_angular_velocity_rad_s
            .push(attitude.angular_velocity_rad_s);
        tables.inertial_to_mars.push(to_mars);
        tables
            .mars_angular_velocity_rad_s
            .push(CameraTables::spin_rad_s(Body::Mars, to_mars.matrix()));
    }
    Ok((tables, held_s))
}
