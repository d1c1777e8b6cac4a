//! The spacecraft over a frame: four states, and the cubics through them.

use nalgebra::{Matrix3, Vector3};

use areograph_base::{frames::Position, time::Et};
use areograph_geom::range_residuals::SpacecraftState;
use areograph_spice::Trajectory;

/// Times of the states, seconds from the middle of the frame; shots lie within 0.96 s.
const NODES_S: [f64; 4] = [-1.0, -1.0 / 3.0, 1.0 / 3.0, 1.0];

/// The spacecraft around the middle of a frame.
pub(super) struct FrameSpacecraft {
    states: [SpacecraftState; 4],
}

impl FrameSpacecraft {
    /// `None` where the trajectory does not cover the complete frame.
    pub(super) fn around(middle: Et, trajectory: &Trajectory) -> Option<Self> {
        let [a, b, c, d] = NODES_S.map(|late_s| state(middle.plus(late_s), trajectory));
        Some(Self {
            states: [a?, b?, c?, d?],
        })
    }

    /// The state `late_s` seconds after the middle.
    ///
    /// # Accuracy
    /// 1e-6 m: of an orbit of 3,800 km in the rotating frame of Mars, whose fourth derivative is 3e-6 m/s⁴, a cubic
    /// through nodes 0.67 s apart leaves 3e-8 m.
    pub(super) fn at(&self, late_s: f64) -> SpacecraftState {
        let (mut position_m, mut axes) = (Vector3::zeros(), Matrix3::zeros());
        for (state, weight) in self.states.iter().zip(weights(late_s)) {
            position_m += weight * state.position.xyz_m;
            axes += weight * state.axes;
        }
        SpacecraftState {
            position: Position::new(position_m),
            axes,
        }
    }
}

/// The state at one instant.
pub(super) fn state(at: Et, trajectory: &Trajectory) -> Option<SpacecraftState> {
    let (position, velocity_m_s) = trajectory.state(at)?;
    Some(SpacecraftState::of(at, &position, &velocity_m_s))
}

/// Weights of the states in the cubic through them.
fn weights(late_s: f64) -> [f64; 4] {
    let [a, b, c, d] = NODES_S.map(|node_s| late_s - node_s);
    [
        -9.0 / 16.0 * b * c * d,
        27.0 / 16.0 * a * c * d,
        -27.0 / 16.0 * a * b * d,
        9.0 / 16.0 * a * b * c,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_met_and_the_weights_are_those_of_the_nodes() {
        let cubic = |t: f64| 3.0 - t + 2.0 * t * t - 0.5 * t.powi(3);
        for late_s in [-0.95, -0.2, 0.0, 0.7, 1.0] {
            let through: f64 = NODES_S
                .iter()
                .zip(weights(late_s))
                .map(|(node_s, weight)| weight * cubic(*node_s))
                .sum();
            assert!((through - cubic(late_s)).abs() < 1e-14); // rounding
        }
    }
}
