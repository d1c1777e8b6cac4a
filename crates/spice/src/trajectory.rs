//! The motion of MGS as polynomials, so that parallel work does not need CSPICE.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{error::SpiceError, origin, session::Session};
use areograph_base::{
    error::{Error, Result},
    frames::{J2000, Position},
    time::{Et, Interval, Intervals},
};
use areograph_geom::chebyshev::ChebyshevVector;

/// Length of the longest pieces, a twelfth of an orbit.
const PIECE_LONGEST_S: f64 = 600.0;
/// Shortest pieces: a motion that needs shorter ones has a discontinuity.
const PIECE_SHORTEST_S: f64 = 1.0;

/// Position of MGS relative to the centre of Mars in J2000, in Chebyshev pieces over disjoint intervals.
///
/// It needs no session, and threads may share it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trajectory {
    pieces: Vec<ChebyshevVector>,
    max_error_m: f64,
}

impl Trajectory {
    /// Largest distance from CSPICE at instants not used for the fit, metres.
    #[must_use]
    pub const fn max_error_m(&self) -> f64 {
        self.max_error_m
    }

    /// Geometric position at `et`; `None` outside the requested intervals.
    #[must_use]
    pub fn position(&self, et: Et) -> Option<Position<J2000>> {
        self.piece(et).map(|piece| Position::new(piece.value(et)))
    }

    /// Velocity at `et` in J2000, metres per second; `None` outside the intervals.
    #[must_use]
    pub fn velocity_m_s(&self, et: Et) -> Option<Vector3<f64>> {
        self.piece(et).map(|piece| piece.derivative(et))
    }

    /// Geometric position, and velocity in metres per second, at `et` in J2000; `None` outside the intervals.
    #[must_use]
    pub fn state(&self, et: Et) -> Option<(Position<J2000>, Vector3<f64>)> {
        let piece = self.piece(et)?;
        Some((Position::new(piece.value(et)), piece.derivative(et)))
    }

    /// Whether one polynomial gives all positions of this time: segments of the kernels do not end in it.
    #[must_use]
    pub fn is_smooth_over(&self, interval: Interval) -> bool {
        let piece = self.piece(interval.start);
        piece.is_some_and(|piece| piece.interval().contains(interval.stop))
    }

    fn piece(&self, et: Et) -> Option<&ChebyshevVector> {
        let index = self
            .pieces
            .partition_point(|piece| piece.interval().stop < et);
        self.pieces
            .get(index)
            .filter(|piece| piece.interval().contains(et))
    }
}

impl Session {
    /// Tabulates the position of MGS over `intervals` to within `tolerance_m` of CSPICE, metres.
    ///
    /// Pieces end where segments of the kernels end, since the motion may be discontinuous there, and are halved until
    /// instants apart from the samples agree.
    ///
    /// # Errors
    /// [`SpiceError::CoverageGap`] when the kernels do not cover an interval; [`SpiceError::NoConvergence`] when pieces
    /// of a second still exceed the tolerance.
    pub fn trajectory(&self, intervals: &Intervals, tolerance_m: f64) -> Result<Trajectory> {
        let mut trajectory = Trajectory {
            pieces: Vec::new(),
            max_error_m: 0.0,
        };
        for interval in intervals.as_slice() {
            self.require_position(*interval)?;
            for part in split_at(*interval, self.coverage()?.seams()) {
                let mut to_do = equal_pieces(part);
                while let Some(piece) = to_do.pop() {
                    self.tabulate(piece, tolerance_m, &mut trajectory, &mut to_do)?;
                }
            }
        }
        Ok(trajectory)
    }

    /// Appends the polynomial of `interval`, or puts its halves on the stack.
    fn tabulate(
        &self,
        interval: Interval,
        tolerance_m: f64,
        trajectory: &mut Trajectory,
        to_do: &mut Vec<Interval>,
    ) -> Result<()> {
        let position = |et: Et| -> Result<Vector3<f64>> { Ok(self.state(et)?.position.xyz_m) };
        let polynomial = ChebyshevVector::interpolate(interval, position)?;
        let mut error_m = 0.0_f64;
        for et in polynomial.check_instants() {
            let distance_m = (polynomial.value(et) - position(et)?).norm();
            // `max` would ignore NaN, which huge coordinates can cause.
            error_m = error_m.max(if distance_m.is_nan() {
                f64::INFINITY
            } else {
                distance_m
            });
        }
        if error_m <= tolerance_m {
            trajectory.max_error_m = trajectory.max_error_m.max(error_m);
            trajectory.pieces.push(polynomial);
            return Ok(());
        }
        let piece_s = interval.duration_s();
        let middle = interval.start.plus(0.5 * piece_s);
        if piece_s < 2.0 * PIECE_SHORTEST_S {
            let error = SpiceError::NoConvergence {
                near: middle,
                error_m,
                piece_s,
                tolerance_m,
            };
            let failure = Error::from(error);
            return Err(
                match origin::of_spacecraft(self.kernels(), self.spacecraft().naif, middle) {
                    Some(kernel) => failure.in_file(kernel),
                    None => failure,
                },
            );
        }
        to_do.push(Interval::new(middle, interval.stop));
        to_do.push(Interval::new(interval.start, middle));
        Ok(())
    }
}

/// The parts of `interval` between the instants `seams`, which are in order of time.
fn split_at(interval: Interval, seams: &[Et]) -> Vec<Interval> {
    let mut parts = Vec::new();
    let mut start = interval.start;
    for seam in seams {
        if start < *seam && *seam < interval.stop {
            parts.push(Interval::new(start, *seam));
            start = *seam;
        }
    }
    parts.push(Interval::new(start, interval.stop));
    parts
}

/// `interval` in equal pieces no longer than the maximum, the last one first.
fn equal_pieces(interval: Interval) -> Vec<Interval> {
    let count = (interval.duration_s() / PIECE_LONGEST_S).ceil().max(1.0);
    let length_s = interval.duration_s() / count;
    let mut pieces = Vec::new();
    let mut stop = interval.stop;
    while interval.start.plus(1.5 * length_s) < stop {
        let start = stop.plus(-length_s);
        pieces.push(Interval::new(start, stop));
        stop = start;
    }
    pieces.push(Interval::new(interval.start, stop));
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval(start_s: f64, stop_s: f64) -> Interval {
        Interval::new(Et::from_seconds(start_s), Et::from_seconds(stop_s))
    }

    #[test]
    fn pieces_fill_the_interval_from_its_end() {
        assert_eq!(
            equal_pieces(interval(0.0, 1_500.0)),
            [
                interval(1_000.0, 1_500.0),
                interval(500.0, 1_000.0),
                interval(0.0, 500.0)
            ]
        );
        assert_eq!(equal_pieces(interval(3.0, 3.0)), [interval(3.0, 3.0)]);
    }

    #[test]
    fn seams_inside_split_and_others_do_not() {
        let seams = [0.0, 1.0, 1.0, 2.0, 5.0].map(Et::from_seconds);
        assert_eq!(
            split_at(interval(0.0, 3.0), &seams),
            [interval(0.0, 1.0), interval(1.0, 2.0), interval(2.0, 3.0)]
        );
    }
}
