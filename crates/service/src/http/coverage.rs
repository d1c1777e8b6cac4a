//! Coverage of kernels, and its gaps.

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use areograph_base::time::Interval;

/// An interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub(super) struct Span {
    /// Its start, seconds of ephemeris time past J2000.
    pub(super) start_et_s: f64,
    /// Its end.
    pub(super) stop_et_s: f64,
}

/// Coverage of one kind by a kernel.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub(super) struct Covered {
    /// Intervals, in order.
    pub(super) intervals: Vec<Span>,
    /// Gaps between them.
    pub(super) gaps: Vec<Span>,
}

impl Covered {
    /// `position` or `attitude` of a kernel's coverage.
    pub(super) fn of(coverage: &Value, kind: &str) -> Self {
        let given = coverage.get(kind).cloned().unwrap_or_default();
        let given: Vec<Interval> = serde_json::from_value(given).unwrap_or_default();
        let intervals: Vec<Span> = given
            .into_iter()
            .map(|interval| Span {
                start_et_s: interval.start.seconds(),
                stop_et_s: interval.stop.seconds(),
            })
            .collect();
        let gaps = intervals.windows(2).map(|pair| Span {
            start_et_s: pair[0].stop_et_s,
            stop_et_s: pair[1].start_et_s,
        });
        Self {
            gaps: gaps.collect(),
            intervals,
        }
    }
}
