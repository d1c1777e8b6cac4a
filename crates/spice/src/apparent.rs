//! Apparent states from Mars (`LT+S`), as CSPICE computes them.
//!
//! The correction for aberration contains the acceleration of the observer, which CSPICE differentiates at every call.
//! That of Mars changes so slowly that its value of the nearest whole minute serves a spacecraft: this saves two of
//! three states of Mars in each call. Positions do not depend on it.

use std::cell::Cell;

use super::ffi::{Called, Cspice, StateKm};
use areograph_base::constants::NAIF_MARS;

/// Time between instants at which the acceleration of Mars is computed, seconds.
const GRID_S: f64 = 60.0;
/// Half the time over which velocities are differentiated, seconds, as in CSPICE's `SPKACS`.
const HALF_STEP_S: f64 = 1.0;

/// Acceleration of Mars relative to the barycentre of the solar system, km/s², with its instant.
#[derive(Debug, Default)]
pub(super) struct MarsAcceleration(Cell<Option<(f64, [f64; 3])>>);

impl MarsAcceleration {
    /// At the whole minute nearest to `et`, or at `et` where the kernels end before.
    fn near(&self, cspice: &Cspice, et: f64) -> Called<[f64; 3]> {
        let minute = (et / GRID_S).round() * GRID_S;
        if let Some((at, known)) = self.0.get()
            && at.total_cmp(&minute).is_eq()
        {
            return Ok(known);
        }
        let Ok(found) = acceleration(cspice, minute) else {
            return acceleration(cspice, et);
        };
        self.0.set(Some((minute, found)));
        Ok(found)
    }
}

fn acceleration(cspice: &Cspice, et: f64) -> Called<[f64; 3]> {
    let [[_, _, _, before @ ..], [_, _, _, after @ ..]] = [
        cspice.barycentric_state(NAIF_MARS, et - HALF_STEP_S)?,
        cspice.barycentric_state(NAIF_MARS, et + HALF_STEP_S)?,
    ];
    let change = |axis: usize| (after[axis] - before[axis]) / (2.0 * HALF_STEP_S);
    Ok([0, 1, 2].map(change))
}

/// A body as seen from Mars.
pub(super) fn seen_from_mars(cspice: &Cspice, target: i32, et: f64) -> Called<StateKm> {
    seen_by(cspice, target, et, acceleration(cspice, et)?)
}

/// A spacecraft close to Mars as seen from there.
///
/// # Accuracy
/// An acceleration half a minute old changes the velocity of a spacecraft 4,000 km from the centre by 1e-10 m/s.
pub(super) fn orbiter_seen_from_mars(
    cspice: &Cspice,
    mars: &MarsAcceleration,
    target: i32,
    et: f64,
) -> Called<StateKm> {
    seen_by(cspice, target, et, mars.near(cspice, et)?)
}

fn seen_by(cspice: &Cspice, target: i32, et: f64, acceleration: [f64; 3]) -> Called<StateKm> {
    let mars = cspice.barycentric_state(NAIF_MARS, et)?;
    cspice.apparent_state(target, et, mars, acceleration)
}
