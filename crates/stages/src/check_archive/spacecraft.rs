//! The spacecraft over a frame: four states, and the cubics through them. The states follow from those of a grid of whole
//! steps, which frames share.

use crate::spacecraft_grid::{
    GRID_BEFORE, GRID_END, GRID_LAST, GRID_S, GRID_STATES, combined, grid_weights, state,
};
use areograph_base::time::{Et, Interval};
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
    pub(super) fn around(middle: Et, grid: &mut StateGrid<'_>) -> Option<Self> {
        let [a, b, c, d] = NODES_S.map(|late_s| grid.state(middle.plus(late_s)));
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
        combined(&self.states.each_ref(), &weights(late_s))
    }
}

/// States at whole multiples of [`GRID_S`], each computed once for times in order.
pub(super) struct StateGrid<'a> {
    trajectory: &'a Trajectory,
    /// Number of the first of `states`.
    first: i64,
    states: [Option<SpacecraftState>; GRID_STATES],
    /// Whether one polynomial gives all of them.
    is_smooth: bool,
}

impl<'a> StateGrid<'a> {
    pub(super) const fn new(trajectory: &'a Trajectory) -> Self {
        Self {
            trajectory,
            first: i64::MIN,
            states: [None; GRID_STATES],
            is_smooth: false,
        }
    }

    /// The state at one instant; by the trajectory itself close to the ends of its polynomials, where the orbit of the
    /// kernels may have a step.
    ///
    /// # Accuracy
    /// 1e-6 m: the sixth derivative of an orbit of 3,800 km in the rotating frame of Mars is 3e-12 m/s⁶, which leaves 1e-9 m;
    /// more is from the error of the polynomials of the trajectory, which oscillates faster.
    fn state(&mut self, at: Et) -> Option<SpacecraftState> {
        let place = at.seconds() / GRID_S;
        // Written so that NaN does not count as within.
        if !(place.abs() < GRID_END) {
            return state(at, self.trajectory);
        }
        #[allow(clippy::cast_possible_truncation, reason = "a number below GRID_END")]
        let first = place.floor() as i64 - GRID_BEFORE;
        self.move_to(first);
        let late = place - first as f64;
        match self.states {
            [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] if self.is_smooth => {
                Some(combined(&[&a, &b, &c, &d, &e, &f], &grid_weights(late)))
            }
            _ => state(at, self.trajectory),
        }
    }

    /// Keeps the states that remain in use, and computes the others.
    fn move_to(&mut self, first: i64) {
        if first == self.first {
            return;
        }
        let known = (self.first, self.states);
        self.first = first;
        let at = |number: i64| Et::from_seconds(number as f64 * GRID_S);
        self.is_smooth = self
            .trajectory
            .is_smooth_over(Interval::new(at(first), at(first + GRID_LAST)));
        for (slot, number) in self.states.iter_mut().zip(first..) {
            let of_known = number
                .checked_sub(known.0)
                .and_then(|place| usize::try_from(place).ok());
            *slot = match of_known.and_then(|place| known.1.get(place)) {
                Some(state) => *state,
                None => state(at(number), self.trajectory),
            };
        }
    }
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
