//! Search criteria.

use std::f64::consts::FRAC_PI_2;

use crate::pedr::Record;
use areograph_base::{
    altimetry::ShotFilter, body::Datum, time::Interval, units::RADIANS_PER_DEGREE,
};
use areograph_geom::window::{Region, WindowGrid};

/// Largest rotation between two of the known datums, radians: 0.271° and 0.003° per decade, and pole differences of
/// 0.0006°.
const DATUM_MARGIN_RAD: f64 = 0.3 * RADIANS_PER_DEGREE;
/// Largest time from a shot to its frame's mid-point, seconds: 9.5 shots with a clock error of one per cent.
const FRAME_MARGIN_S: f64 = 1.0;

/// Records that are checked and reported when invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judged {
    /// All of them.
    All,
    /// Records that may contain a shot in a window; of the others only the mid-point is examined.
    Near,
}

/// Windows and further conditions on shots.
#[derive(Debug)]
pub struct Query<'a> {
    pub(super) windows: WindowGrid,
    /// Shots to keep; without a filter all with a return.
    pub(super) filter: Option<&'a ShotFilter>,
    /// Corrected times of shots to keep; without an interval all.
    pub(super) time: Option<Interval>,
    /// Seconds to add to time tags.
    pub(super) correction_s: f64,
    pub(super) judged: Judged,
}

impl<'a> Query<'a> {
    /// Shots in any of the windows that pass the filter.
    #[must_use]
    pub fn new(windows: Vec<Region>, filter: &'a ShotFilter, judged: Judged) -> Self {
        Self {
            filter: Some(filter),
            ..Self::unfiltered(windows, judged)
        }
    }

    /// Shots in any of the windows, of every class, channel and attitude.
    #[must_use]
    pub fn unfiltered(windows: Vec<Region>, judged: Judged) -> Self {
        Self {
            windows: WindowGrid::new(windows, DATUM_MARGIN_RAD),
            filter: None,
            time: None,
            correction_s: 0.0,
            judged,
        }
    }

    /// The query with `correction_s` added to time tags.
    #[must_use]
    pub fn corrected(self, correction_s: f64) -> Self {
        Self {
            correction_s,
            ..self
        }
    }

    /// The query, limited to shots within an interval of corrected time.
    #[must_use]
    pub fn within(self, time: Option<Interval>) -> Self {
        Self { time, ..self }
    }

    /// Margin around a window for directions in the coordinates of a file, radians.
    pub(super) fn margin_rad(datum: Datum) -> f64 {
        if datum == Datum::Iau2000 {
            0.0
        } else {
            DATUM_MARGIN_RAD
        }
    }

    /// Whether a record may contain a requested shot; records in doubt, or with an impossible position, are included.
    pub(super) fn may_matter(&self, record: &Record, datum: Datum) -> bool {
        let mid = record.mid_point();
        let margin_rad = mid.reach_rad + Self::margin_rad(datum);
        let may_be_inside = mid.latitude_rad.abs() > FRAC_PI_2
            || self
                .windows
                .any_within(mid.longitude_rad, mid.latitude_rad, margin_rad);
        may_be_inside && {
            // Most records have already been skipped without a test of their time.
            let tag_s = record.time_s.get();
            self.may_have_time(tag_s, tag_s)
        }
    }

    /// Whether shots of frames with these tags may be within the requested time; tags that are not finite are included.
    pub(super) fn may_have_time(&self, first_tag_s: f64, last_tag_s: f64) -> bool {
        self.time.is_none_or(|time| {
            let time = time.padded(FRAME_MARGIN_S);
            !(first_tag_s + self.correction_s > time.stop.seconds()
                || last_tag_s + self.correction_s < time.start.seconds())
        })
    }
}
