//! The synthetic orbit: an unperturbed ellipse like the mapping orbit.

use nalgebra::{Matrix3, Vector3};

use areograph_base::{body::MARS_IAU2000, time::Et, units::RADIANS_PER_DEGREE};
use areograph_geom::body_rotation::{body_matrix, frame_rotation_1, frame_rotation_3};

/// Gravitational parameter of Mars, m³/s². Source: MGS gravity models, 42 828.37 km³/s².
pub(super) const MARS_GM_M3_S2: f64 = 42_828.37e9;
/// Semi-major axis of the mapping orbit, metres.
const SEMI_MAJOR_AXIS_M: f64 = 3_773.5e3;
/// Eccentricity of the mapping orbit.
const ECCENTRICITY: f64 = 0.0080;
/// Argument of periapsis: the frozen orbit is lowest over the south.
const ARGUMENT_OF_PERIAPSIS_RAD: f64 = -90.0 * RADIANS_PER_DEGREE;
/// Inclination to the equator of Mars.
const INCLINATION_RAD: f64 = 92.896 * RADIANS_PER_DEGREE;

/// Position and velocity of the spacecraft, in J2000 from the centre of Mars.
#[derive(Debug, Clone, Copy)]
pub(super) struct OrbitState {
    /// Position, metres.
    pub position_m: Vector3<f64>,
    /// Velocity, metres per second.
    pub velocity_m_s: Vector3<f64>,
}

/// One elliptical arc.
#[derive(Debug, Clone)]
pub(super) struct Orbit {
    /// Instant of the mean anomaly; the equator of Mars is frozen there.
    epoch: Et,
    /// From the perifocal frame to J2000.
    perifocal_to_j2000: Matrix3<f64>,
    /// Mean anomaly at the epoch, radians.
    mean_anomaly_rad: f64,
}

impl Orbit {
    /// The mapping orbit whose ascending node lies at the east longitude `node_rad` (IAU 2000) at
    /// `epoch`, with the spacecraft at `mean_anomaly_rad` from its southernmost point.
    pub(super) fn new(epoch: Et, node_rad: f64, mean_anomaly_rad: f64) -> Self {
        let equator_to_j2000 = body_matrix(&MARS_IAU2000, epoch).transpose();
        let perifocal_to_equator = frame_rotation_3(-node_rad)
            * frame_rotation_1(-INCLINATION_RAD)
            * frame_rotation_3(-ARGUMENT_OF_PERIAPSIS_RAD);
        Self {
            epoch,
            perifocal_to_j2000: equator_to_j2000 * perifocal_to_equator,
            mean_anomaly_rad,
        }
    }

    /// Mean motion, radians per second.
    pub(super) fn mean_motion_rad_s() -> f64 {
        (MARS_GM_M3_S2 / SEMI_MAJOR_AXIS_M.powi(3)).sqrt()
    }

    /// Seconds of a revolution.
    pub(super) fn period_s() -> f64 {
        std::f64::consts::TAU / Self::mean_motion_rad_s()
    }

    /// Seconds since the southernmost point was last passed at `et`.
    pub(super) fn since_southernmost_s(&self, et: Et) -> f64 {
        let anomaly_rad = self.mean_anomaly(et).rem_euclid(std::f64::consts::TAU);
        anomaly_rad / Self::mean_motion_rad_s()
    }

    /// Mean anomaly at `et`, radians, growing without wrapping.
    fn mean_anomaly(&self, et: Et) -> f64 {
        self.mean_anomaly_rad + Self::mean_motion_rad_s() * et.since(self.epoch)
    }

    /// Revolutions completed at `et`, counted at the southernmost point.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "an arc contains a few revolutions"
    )]
    pub(super) fn revolution(&self, et: Et) -> i32 {
        (self.mean_anomaly(et) / std::f64::consts::TAU).floor() as i32
    }

    /// State at `et`, two-body motion.
    pub(super) fn state(&self, et: Et) -> OrbitState {
        let eccentric_rad = eccentric_anomaly(self.mean_anomaly(et), ECCENTRICITY);
        let (sin, cos) = eccentric_rad.sin_cos();
        let minor = (1.0 - ECCENTRICITY * ECCENTRICITY).sqrt();
        let rate_rad_s = Self::mean_motion_rad_s() / (1.0 - ECCENTRICITY * cos);
        let position = SEMI_MAJOR_AXIS_M * Vector3::new(cos - ECCENTRICITY, minor * sin, 0.0);
        let velocity = SEMI_MAJOR_AXIS_M * rate_rad_s * Vector3::new(-sin, minor * cos, 0.0);
        OrbitState {
            position_m: self.perifocal_to_j2000 * position,
            velocity_m_s: self.perifocal_to_j2000 * velocity,
        }
    }
}

/// Eccentric anomaly of an ellipse by Newton's method, radians.
///
/// Started at the mean anomaly it converges for every eccentricity below 0.1 within five steps.
pub(super) fn eccentric_anomaly(mean_anomaly_rad: f64, eccentricity: f64) -> f64 {
    let mut eccentric_rad = mean_anomaly_rad;
    for _ in 0..6 {
        let (sin, cos) = eccentric_rad.sin_cos();
        eccentric_rad -=
            (eccentric_rad - eccentricity * sin - mean_anomaly_rad) / (1.0 - eccentricity * cos);
    }
    eccentric_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_arc_obeys_two_body_motion(
            node_rad in 0.0..std::f64::consts::TAU, anomaly_rad in -3.1..3.1_f64, later_s in -90_000.0..90_000.0_f64,
        ) {
            let orbit = Orbit::new(Et::from_seconds(3.7e7), node_rad, anomaly_rad);
            let at = Et::from_seconds(3.7e7 + later_s);
            let state = orbit.state(at);
            // Central differences of velocity over 1 s: the third derivative leaves 1e-7 m/s².
            let step_s = 0.5;
            let acceleration = (orbit.state(at.plus(step_s)).velocity_m_s
                - orbit.state(at.plus(-step_s)).velocity_m_s) / (2.0 * step_s);
            let gravity = -MARS_GM_M3_S2 / state.position_m.norm().powi(3) * state.position_m;
            prop_assert!((acceleration - gravity).norm() < 1e-6, "{}", (acceleration - gravity).norm());
            let energy = 0.5 * state.velocity_m_s.norm_squared() - MARS_GM_M3_S2 / state.position_m.norm();
            prop_assert!((energy / (-MARS_GM_M3_S2 / (2.0 * SEMI_MAJOR_AXIS_M)) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_arc_flies_north_over_the_node_at_epoch() {
        // A quarter turn past the southernmost point, and slightly more for the eccentricity.
        let epoch = Et::from_seconds(3.7e7);
        let orbit = Orbit::new(epoch, 0.5, 90.0 * RADIANS_PER_DEGREE - 2.0 * 0.0080);
        let fixed = body_matrix(&MARS_IAU2000, epoch);
        let state = orbit.state(epoch);
        let position = fixed * state.position_m;
        let velocity = fixed * state.velocity_m_s;
        assert!(position.z.abs() < 1e3); // metres; the anomaly above is good to e²
        assert!((position.y.atan2(position.x) - 0.5).abs() < 1e-4);
        assert!(velocity.z > 3.3e3 && velocity.norm() < 3.45e3);
    }
}
