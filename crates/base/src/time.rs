//! Instants, intervals and the two Mars Global Surveyor clock corrections.
//!
//! Every instant is ephemeris time (TDB seconds past J2000). UTC and spacecraft clock strings exist
//! only in labels, configuration and reports; `spice::Session` converts them.
//!
//! Only `PointingBias::lookup` makes a `CkLookup`, and only `Session::attitude` takes one, so that the −1.15 s of MOC
//! shifts only attitudes, and only once.

use std::fmt;

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Ephemeris time: TDB seconds past 2000-01-01 12:00:00 TDB.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(transparent)]
pub struct Et(f64);

impl Et {
    /// The instant `seconds` TDB seconds past J2000.
    #[must_use]
    pub const fn from_seconds(seconds: f64) -> Self {
        Self(seconds)
    }

    /// TDB seconds past J2000.
    #[must_use]
    pub const fn seconds(self) -> f64 {
        self.0
    }

    /// The instant `seconds` later (earlier when negative).
    #[must_use]
    pub fn plus(self, seconds: f64) -> Self {
        Self(self.0 + seconds)
    }

    /// Seconds from `earlier` to this instant.
    #[must_use]
    pub fn since(self, earlier: Self) -> f64 {
        self.0 - earlier.0
    }
}

impl fmt::Display for Et {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "ET {:.6}", self.0)
    }
}

/// The instant of an attitude look-up in a C-kernel for an exposure.
///
/// It is not an exposure instant: only [`PointingBias::lookup`] makes one, and only
/// `spice::Session::attitude` takes one, so the bias cannot be applied twice or to a position.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct CkLookup(Et);

impl CkLookup {
    /// The instant in the time of the C-kernel.
    #[must_use]
    pub const fn kernel_time(self) -> Et {
        self.0
    }
}

/// Time correction of MGS attitude kernels: the attitude of an exposure at `t` is read at `t + seconds`.
///
/// Source: ISIS addendum `mocAddendum004.ti`, `INS-94031_CK_TIME_BIAS = -1.15`; Shan et al. 2005.
/// Position, Mars rotation and instrument mounting stay at `t`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PointingBias {
    seconds: f64,
}

impl PointingBias {
    /// A bias of `seconds` (for MGS −1.15).
    #[must_use]
    pub const fn from_seconds(seconds: f64) -> Self {
        Self { seconds }
    }

    /// The bias in seconds.
    #[must_use]
    pub const fn seconds(self) -> f64 {
        self.seconds
    }

    /// The instant at which the C-kernel contains the attitude of the exposure at `exposure`.
    #[must_use]
    pub fn lookup(self, exposure: Et) -> CkLookup {
        CkLookup(exposure.plus(self.seconds))
    }
}

/// A closed interval of ephemeris time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct Interval {
    /// First instant.
    pub start: Et,
    /// Last instant, not before `start`.
    pub stop: Et,
}

impl Interval {
    /// The interval from `start` to `stop`.
    #[must_use]
    pub const fn new(start: Et, stop: Et) -> Self {
        Self { start, stop }
    }

    /// Length in seconds.
    #[must_use]
    pub fn duration_s(self) -> f64 {
        self.stop.since(self.start)
    }

    /// The interval extended by `seconds` at both ends.
    #[must_use]
    pub fn padded(self, seconds: f64) -> Self {
        Self::new(self.start.plus(-seconds), self.stop.plus(seconds))
    }

    /// The interval moved by `seconds`.
    #[must_use]
    pub fn shifted(self, seconds: f64) -> Self {
        Self::new(self.start.plus(seconds), self.stop.plus(seconds))
    }

    /// Whether `instant` lies inside or on an end.
    #[must_use]
    pub fn contains(self, instant: Et) -> bool {
        self.start <= instant && instant <= self.stop
    }

    /// Whether the two intervals share an instant.
    #[must_use]
    pub fn overlaps(self, other: Self) -> bool {
        self.start <= other.stop && other.start <= self.stop
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "ET {:.3} .. {:.3}",
            self.start.seconds(),
            self.stop.seconds()
        )
    }
}

/// Disjoint intervals in time order, as in kernel coverage.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Intervals(Vec<Interval>);

impl Intervals {
    /// The union of any intervals; touching or overlapping ones become one.
    #[must_use]
    pub fn union_of(intervals: impl IntoIterator<Item = Interval>) -> Self {
        let mut sorted: Vec<Interval> = intervals.into_iter().collect();
        sorted.sort_by(|a, b| a.start.seconds().total_cmp(&b.start.seconds()));
        let mut merged: Vec<Interval> = Vec::with_capacity(sorted.len());
        for interval in sorted {
            match merged.last_mut() {
                Some(last) if interval.start <= last.stop => {
                    if interval.stop > last.stop {
                        last.stop = interval.stop;
                    }
                }
                _ => merged.push(interval),
            }
        }
        Self(merged)
    }

    /// The intervals in time order.
    #[must_use]
    pub fn as_slice(&self) -> &[Interval] {
        &self.0
    }

    /// Whether one interval covers all of `required`.
    #[must_use]
    pub fn cover(&self, required: Interval) -> bool {
        self.0
            .iter()
            .any(|held| held.start <= required.start && required.stop <= held.stop)
    }

    /// The parts of `required` that no interval covers, in time order.
    #[must_use]
    pub fn gaps_in(&self, required: Interval) -> Vec<Interval> {
        let mut gaps = Vec::new();
        let mut reached = required.start;
        for held in self.0.iter().filter(|held| held.overlaps(required)) {
            if held.start > reached {
                gaps.push(Interval::new(reached, held.start));
            }
            if held.stop > reached {
                reached = held.stop;
            }
        }
        if reached < required.stop {
            gaps.push(Interval::new(reached, required.stop));
        }
        gaps
    }

    /// The instants of this set that `other` does not cover.
    #[must_use]
    pub fn without(&self, other: &Self) -> Self {
        Self::union_of(self.0.iter().flat_map(|own| other.gaps_in(*own)))
    }

    /// The instants, `seconds` later.
    #[must_use]
    pub fn shifted(&self, seconds: f64) -> Self {
        Self(self.0.iter().map(|one| one.shifted(seconds)).collect())
    }

    /// Total time, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        // An empty sum of floats would be −0.
        self.0
            .iter()
            .fold(0.0, |sum, interval| sum + interval.duration_s())
    }

    /// The instants that both sets cover.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let mut shared = Vec::new();
        for a in &self.0 {
            for b in other.0.iter().filter(|b| a.overlaps(**b)) {
                let start = if a.start > b.start { a.start } else { b.start };
                let stop = if a.stop < b.stop { a.stop } else { b.stop };
                shared.push(Interval::new(start, stop));
            }
        }
        Self::union_of(shared)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval(start: f64, stop: f64) -> Interval {
        Interval::new(Et::from_seconds(start), Et::from_seconds(stop))
    }

    #[test]
    fn pointing_bias_reads_the_kernel_earlier() {
        let lookup = PointingBias::from_seconds(-1.15).lookup(Et::from_seconds(100.0));
        assert!((lookup.kernel_time().seconds() - 98.85).abs() < 1e-12);
    }

    #[test]
    fn gaps_inside_and_at_both_ends_are_seen() {
        let held =
            Intervals::union_of([interval(4.0, 6.0), interval(1.0, 2.0), interval(5.0, 7.0)]);
        assert_eq!(held.as_slice(), [interval(1.0, 2.0), interval(4.0, 7.0)]);
        assert_eq!(
            held.gaps_in(interval(0.0, 8.0)),
            [interval(0.0, 1.0), interval(2.0, 4.0), interval(7.0, 8.0)]
        );
        assert!(held.cover(interval(4.0, 7.0)) && !held.cover(interval(1.5, 4.5)));
        assert!(held.gaps_in(interval(4.5, 6.5)).is_empty());
    }

    #[test]
    fn without_keeps_what_the_other_does_not_hold() {
        let own = Intervals::union_of([interval(0.0, 10.0), interval(20.0, 30.0)]);
        let other = Intervals::union_of([interval(2.0, 3.0), interval(8.0, 25.0)]);
        let left = own.without(&other);
        let expected = [interval(0.0, 2.0), interval(3.0, 8.0), interval(25.0, 30.0)];
        assert_eq!(left.as_slice(), expected);
        assert!((left.duration_s() - 12.0).abs() < 1e-12); // rounding of small numbers
        assert_eq!(own.without(&Intervals::default()), own);
        assert_eq!(own.shifted(1.0).as_slice()[0], interval(1.0, 11.0));
    }

    #[test]
    fn intersection_keeps_the_shared_parts() {
        let a = Intervals::union_of([interval(0.0, 3.0), interval(5.0, 9.0)]);
        let b = Intervals::union_of([interval(2.0, 6.0)]);
        assert_eq!(
            a.intersection(&b).as_slice(),
            [interval(2.0, 3.0), interval(5.0, 6.0)]
        );
    }
}
