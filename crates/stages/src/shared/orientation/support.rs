//! Orientation by support data: the tables of the file on a uniform grid, interpolated as in camera models.

use super::tables::{CameraTables, InterpolationCheck};
use areograph_base::{frames::Rotation, time::Et};
use areograph_pds::isd::SupportTables;

/// Fewest intervals of the grid; usgscsm resamples tables with fewer than 25 nodes.
const INTERVALS_MIN: usize = 30;

impl CameraTables {
    /// The uniform tables of `support`, a node for every row of its attitudes.
    ///
    /// Attitudes between rows lie on arcs, as in usgscsm's resampling; positions are cubics. Uniform rows are
    /// unchanged. The grid then defines the orientation: its interpolation has no reference.
    pub(crate) fn of_support(support: &SupportTables) -> Self {
        let span = support.span();
        let intervals = (support.pointing.et_s.len() - 1).max(INTERVALS_MIN);
        let step_s = span.duration_s() / intervals as f64;
        let epochs = (0..=intervals).map(|node| span.start.plus(node as f64 * step_s));
        let ends = [span.start, span.stop].map(|end| support.sun.at(end.seconds()));
        let body = &support.body_rotation;
        let mut tables = Self {
            et_s: epochs.clone().map(Et::seconds).collect(),
            position_m: Vec::new(),
            velocity_m_s: Vec::new(),
            sun_position_m: ends.map(|sun| sun.0),
            sun_velocity_m_s: ends.map(|sun| sun.1),
            inertial_to_bus: Vec::new(),
            bus_angular_velocity_rad_s: Vec::new(),
            inertial_to_mars: Vec::new(),
            mars_angular_velocity_rad_s: Vec::new(),
            bus_to_camera: Rotation::new(support.pointing.constant, span.start),
            interpolation: InterpolationCheck::default(),
        };
        for epoch in epochs {
            let et_s = epoch.seconds();
            let (position_m, velocity_m_s) = support.position.at(et_s);
            let (to_bus, bus_rad_s) = support.pointing.at(et_s);
            let (turned, body_rad_s) = body.at(et_s);
            tables.position_m.push(position_m);
            tables.velocity_m_s.push(velocity_m_s);
            tables.inertial_to_bus.push(Rotation::new(to_bus, epoch));
            tables.bus_angular_velocity_rad_s.push(bus_rad_s);
            let to_mars = body.constant * turned;
            tables.inertial_to_mars.push(Rotation::new(to_mars, epoch));
            tables.mars_angular_velocity_rad_s.push(body_rad_s);
        }
        tables
    }
}
