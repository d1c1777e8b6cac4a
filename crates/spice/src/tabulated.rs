//! States over the time of an image as polynomials: an image reads thousands, each of which costs CSPICE a search of its
//! segments.

use std::cell::OnceCell;

use nalgebra::Vector3;

use super::state::State;
use areograph_base::{
    error::Result,
    frames::Position,
    time::{Et, Interval},
};
use areograph_geom::chebyshev::ChebyshevVector;

/// Length of the longest piece, seconds: over 120 s, polynomials of degree 12 follow an orbit within 1e-9 m.
const PIECE_LONGEST_S: f64 = 120.0;
/// Most pieces: line times that reach further are read from CSPICE.
const PIECES_MAX: f64 = 32.0;
/// Largest difference from CSPICE, metres: ten times the rounding of positions relative to the barycentre of the
/// solar system, which apparent positions contain; of geometric ones, it shows a step in the orbit of a kernel.
const TOLERANCE_M: f64 = 3e-4;
/// Largest difference of velocities, metres per second: within the time of an image, 0.1 mm.
const TOLERANCE_M_S: f64 = 1e-5;

/// Geometric and apparent states over an interval.
#[derive(Debug)]
pub(super) struct Tabulated {
    interval: Interval,
    /// Made when the first state is requested; `None` if polynomials do not follow CSPICE.
    geometric: OnceCell<Option<Pieces>>,
    apparent: OnceCell<Option<Pieces>>,
}

impl Tabulated {
    pub(super) const fn new(interval: Interval) -> Self {
        Self {
            interval,
            geometric: OnceCell::new(),
            apparent: OnceCell::new(),
        }
    }

    /// The geometric state at `et`, of the states that `read` reads; `None` where it has to be read.
    pub(super) fn geometric(&self, et: Et, read: impl Fn(Et) -> Result<State>) -> Option<State> {
        self.of(&self.geometric, et, read)
    }

    /// The apparent state at `et`, likewise.
    pub(super) fn apparent(&self, et: Et, read: impl Fn(Et) -> Result<State>) -> Option<State> {
        self.of(&self.apparent, et, read)
    }

    fn of(
        &self,
        pieces: &OnceCell<Option<Pieces>>,
        et: Et,
        read: impl Fn(Et) -> Result<State>,
    ) -> Option<State> {
        if !self.interval.contains(et) {
            return None;
        }
        let pieces = pieces.get_or_init(|| Pieces::of(self.interval, read));
        pieces.as_ref()?.state(et)
    }
}

/// Polynomials of position and velocity, in order of time.
#[derive(Debug)]
struct Pieces(Vec<[ChebyshevVector; 2]>);

impl Pieces {
    fn of(interval: Interval, read: impl Fn(Et) -> Result<State>) -> Option<Self> {
        let count = (interval.duration_s() / PIECE_LONGEST_S).ceil().max(1.0);
        // Written so that NaN is not tabulated.
        if !(count <= PIECES_MAX) {
            return None;
        }
        let length_s = interval.duration_s() / count;
        let mut pieces = Vec::new();
        let mut start = interval.start;
        while pieces.len() as f64 + 1.5 < count {
            let stop = start.plus(length_s);
            pieces.push(piece(Interval::new(start, stop), &read)?);
            start = stop;
        }
        pieces.push(piece(Interval::new(start, interval.stop), &read)?);
        Some(Self(pieces))
    }

    fn state(&self, et: Et) -> Option<State> {
        let [position_m, velocity_m_s] =
            self.0.iter().find(|[of, _]| of.interval().contains(et))?;
        Some(State {
            position: Position::new(position_m.value(et)),
            velocity_m_s: velocity_m_s.value(et),
        })
    }
}

/// Polynomials of position and velocity that agree with `read` at instants apart from their nodes.
fn piece(interval: Interval, read: impl Fn(Et) -> Result<State>) -> Option<[ChebyshevVector; 2]> {
    let mut velocities_m_s = Vec::new();
    let position = ChebyshevVector::interpolate(interval, |et| {
        let state = read(et)?;
        velocities_m_s.push(state.velocity_m_s);
        Result::Ok(state.position.xyz_m)
    });
    let mut velocities_m_s = velocities_m_s.into_iter();
    let velocity: std::result::Result<_, ()> =
        ChebyshevVector::interpolate(interval, |_| velocities_m_s.next().ok_or(()));
    let [position, velocity] = [position.ok()?, velocity.ok()?];
    let agrees = |et: Et| {
        let state = read(et).ok()?;
        let within = |of: &ChebyshevVector, read: &Vector3<f64>, tolerance: f64| {
            // Written so that NaN does not agree.
            (of.value(et) - read).norm() <= tolerance
        };
        let agrees = within(&position, &state.position.xyz_m, TOLERANCE_M)
            && within(&velocity, &state.velocity_m_s, TOLERANCE_M_S);
        agrees.then_some(())
    };
    let agree = position.check_instants().try_for_each(agrees);
    agree.map(|()| [position, velocity])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radius, metres, and rate, radians per second, of a circular orbit.
    const RADIUS_M: f64 = 3.8e6;
    const RATE_RAD_S: f64 = 8.9e-4;

    /// A circular orbit that is displaced along the flight from `from_s` on.
    fn orbit(et: Et, step_m: f64, from_s: f64) -> State {
        let late_m = if et.seconds() < from_s { 0.0 } else { step_m };
        let angle_rad = RATE_RAD_S * et.seconds() + late_m / RADIUS_M;
        let direction = Vector3::new(angle_rad.cos(), angle_rad.sin(), 0.0);
        let along = Vector3::new(-angle_rad.sin(), angle_rad.cos(), 0.0);
        State {
            position: Position::new(RADIUS_M * direction),
            velocity_m_s: RADIUS_M * RATE_RAD_S * along,
        }
    }

    fn interval(start_s: f64, stop_s: f64) -> Interval {
        Interval::new(Et::from_seconds(start_s), Et::from_seconds(stop_s))
    }

    #[test]
    fn states_of_an_orbit_are_met_in_every_piece() {
        let tabulated = Tabulated::new(interval(-100.0, 431.0));
        for k in 0..=531 {
            let et = Et::from_seconds(f64::from(k) - 100.0);
            let state = tabulated
                .geometric(et, |et| Ok(orbit(et, 0.0, 0.0)))
                .unwrap();
            let expected = orbit(et, 0.0, 0.0);
            let apart_m = (state.position.xyz_m - expected.position.xyz_m).norm();
            let apart_m_s = (state.velocity_m_s - expected.velocity_m_s).norm();
            assert!(
                apart_m < 1e-8 && apart_m_s < 1e-11,
                "{et}: {apart_m} m, {apart_m_s} m/s"
            ); // rounding
        }
    }

    #[test]
    fn an_orbit_with_a_step_is_read() {
        for (step_m, is_read) in [(0.0, false), (0.01, true), (f64::NAN, true)] {
            let tabulated = Tabulated::new(interval(0.0, 20.0));
            let et = Et::from_seconds(3.0);
            let found = tabulated.geometric(et, |et| Ok(orbit(et, step_m, 7.3)));
            assert_eq!(found.is_none(), is_read, "{step_m} m");
        }
    }

    #[test]
    fn other_times_and_endless_ones_are_read() {
        let read = |et| Ok(orbit(et, 0.0, 0.0));
        let tabulated = Tabulated::new(interval(0.0, 20.0));
        assert!(tabulated.apparent(Et::from_seconds(20.1), read).is_none());
        assert!(tabulated.apparent(Et::from_seconds(20.0), read).is_some());
        let endless = Tabulated::new(interval(0.0, 1e9));
        assert!(endless.geometric(Et::from_seconds(20.0), read).is_none());
    }
}
