//! The state of a spacecraft.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::ffi::StateKm;
use areograph_base::{
    frames::{J2000, Position},
    units::METRES_PER_KM,
};

/// Position and velocity relative to the centre of Mars, inertial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Position, metres.
    pub position: Position<J2000>,
    /// Velocity in J2000, metres per second.
    pub velocity_m_s: Vector3<f64>,
}

impl State {
    pub(super) fn from_km(state_km: StateKm) -> Self {
        let [x, y, z, vx, vy, vz] = state_km.map(|value| value * METRES_PER_KM);
        Self {
            position: Position::new(Vector3::new(x, y, z)),
            velocity_m_s: Vector3::new(vx, vy, vz),
        }
    }
}
