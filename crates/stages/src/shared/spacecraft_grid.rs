//! The spacecraft between states at whole multiples of four seconds.
//!
//! In the rotating frame of Mars the orbit is so smooth that six states give those between them, for a fifth of the cost
//! of the tabulated trajectory and of the rotation of Mars.

use nalgebra::{Matrix3, Vector3};

use areograph_base::{
    frames::{BodyFixed, Position},
    time::{Et, Interval},
};
use areograph_geom::range_residuals::SpacecraftState;
use areograph_spice::Trajectory;

/// Time between the states of the grid, seconds, and how many of them give a state between.
pub(crate) const GRID_S: f64 = 4.0;
pub(crate) const GRID_STATES: usize = 6;
/// Steps from the first of them to the last one at or before an instant, and to the last.
pub(crate) const GRID_BEFORE: i64 = 2;
pub(crate) const GRID_LAST: i64 = 5;
/// Largest number of a state: of times thirty million years away, which a spoiled record may state.
pub(crate) const GRID_END: f64 = 2.5e14;

/// Most states of a grid, of three days; beyond, the trajectory gives all states.
const NODES_MAX: f64 = 65_536.0;

/// States over an interval, for times in any order.
pub(crate) struct SpacecraftGrid<'a> {
    trajectory: &'a Trajectory,
    /// Number of the first of `states`.
    first: i64,
    states: Vec<Option<SpacecraftState>>,
    /// Whether one polynomial of the trajectory gives the states of each and of the five after it.
    is_smooth: Vec<bool>,
}

impl<'a> SpacecraftGrid<'a> {
    /// The grid for instants in `interval`.
    pub(crate) fn over(trajectory: &'a Trajectory, interval: Interval) -> Self {
        let [start, stop] =
            [interval.start, interval.stop].map(|at| (at.seconds() / GRID_S).floor());
        // Written so that NaN counts as too many.
        let is_bounded = start.abs() < GRID_END && stop - start < NODES_MAX;
        #[allow(clippy::cast_possible_truncation, reason = "numbers below GRID_END")]
        let numbers = if is_bounded {
            start as i64 - GRID_BEFORE..stop as i64 - GRID_BEFORE + GRID_LAST + 1
        } else {
            0..0
        };
        let at = |number: i64| Et::from_seconds(number as f64 * GRID_S);
        let is_smooth = |number: i64| {
            trajectory.is_smooth_over(Interval::new(at(number), at(number + GRID_LAST)))
        };
        Self {
            trajectory,
            first: numbers.start,
            states: numbers
                .clone()
                .map(|number| state(at(number), trajectory))
                .collect(),
            is_smooth: numbers.map(is_smooth).collect(),
        }
    }

    /// The trajectory of the states.
    pub(crate) const fn trajectory(&self) -> &'a Trajectory {
        self.trajectory
    }

    /// The state at one instant; by the trajectory itself close to the ends of its polynomials, where the orbit of the
    /// kernels may have a step, and outside the interval. `None` where the kernels have none.
    ///
    /// # Accuracy
    /// 1e-6 m: the sixth derivative of an orbit of 3,800 km in the rotating frame of Mars is 3e-12 m/s⁶, which leaves
    /// 1e-9 m; more is from the error of the polynomials of the trajectory, which oscillates faster.
    pub(crate) fn state(&self, at: Et) -> Option<SpacecraftState> {
        match self.around(at) {
            Some((states, late)) => Some(combined(&states, &grid_weights(late))),
            None => state(at, self.trajectory),
        }
    }

    /// The position of [`state`](Self::state).
    pub(crate) fn position(&self, at: Et) -> Option<Position<BodyFixed>> {
        let Some((states, late)) = self.around(at) else {
            return state(at, self.trajectory).map(|state| state.position);
        };
        let mut position_m = Vector3::zeros();
        for (state, weight) in states.iter().zip(grid_weights(late)) {
            position_m += weight * state.position.xyz_m;
        }
        Some(Position::new(position_m))
    }

    /// The states of the polynomial at an instant, and how many steps after the first of them it lies.
    fn around(&self, at: Et) -> Option<([&SpacecraftState; GRID_STATES], f64)> {
        let place = at.seconds() / GRID_S;
        // Written so that NaN does not count as within.
        if !(place.abs() < GRID_END) {
            return None;
        }
        #[allow(clippy::cast_possible_truncation, reason = "a number below GRID_END")]
        let first = place.floor() as i64 - GRID_BEFORE;
        let index = usize::try_from(first.checked_sub(self.first)?).ok()?;
        if !*self.is_smooth.get(index)? {
            return None;
        }
        let states: &[_; GRID_STATES] = self.states.get(index..)?.first_chunk()?;
        let [a, b, c, d, e, f] = states.each_ref().map(Option::as_ref);
        Some(([a?, b?, c?, d?, e?, f?], place - first as f64))
    }
}

/// Weights of the states of a grid in the polynomial through them, `late` steps after the first.
pub(crate) fn grid_weights(late: f64) -> [f64; GRID_STATES] {
    let from: [f64; GRID_STATES] = std::array::from_fn(|node| late - node as f64);
    let [a, b, c, d, e, f] = from;
    let (abc, def) = (a * b * c, d * e * f);
    [
        b * c * def / -120.0,
        a * c * def / 24.0,
        a * b * def / -12.0,
        abc * e * f / 12.0,
        abc * d * f / -24.0,
        abc * d * e / 120.0,
    ]
}

/// Sum of states with these weights, which add up to 1.
pub(crate) fn combined<const N: usize>(
    states: &[&SpacecraftState; N],
    weights: &[f64; N],
) -> SpacecraftState {
    let (mut position_m, mut axes) = (Vector3::zeros(), Matrix3::zeros());
    for (state, weight) in states.iter().zip(weights) {
        position_m += *weight * state.position.xyz_m;
        axes += *weight * state.axes;
    }
    SpacecraftState {
        position: Position::new(position_m),
        axes,
    }
}

/// The state at one instant.
pub(crate) fn state(at: Et, trajectory: &Trajectory) -> Option<SpacecraftState> {
    let (position, velocity_m_s) = trajectory.state(at)?;
    Some(SpacecraftState::of(at, &position, &velocity_m_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_the_fifth_degree_are_met_by_the_weights_of_the_grid() {
        for degree in 0..6 {
            for late in [0.0, 2.0, 2.3, 2.9, 3.0, 5.0] {
                let through: f64 = grid_weights(late)
                    .iter()
                    .enumerate()
                    .map(|(node, weight)| weight * (node as f64).powi(degree))
                    .sum();
                assert!((through - late.powi(degree)).abs() < 1e-11); // rounding of numbers up to 3,125
            }
        }
    }
}
