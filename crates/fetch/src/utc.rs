//! Instants of indexes.

use std::fmt;

use chrono::{DateTime, NaiveDate, NaiveDateTime, TimeDelta};

/// An instant as indexes state it: UTC by the calendar, without leap seconds, to the millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Utc(i64);

impl Utc {
    /// A date, or a date with a time: `1999-08-24`, `1999-08-24T14:12:13.64`, also with the day of the year.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim().trim_end_matches('Z');
        let times = ["%Y-%m-%dT%H:%M:%S%.f", "%Y-%jT%H:%M:%S%.f"].iter();
        let mut times = times.map(|form| NaiveDateTime::parse_from_str(text, form));
        let days = ["%Y-%m-%d", "%Y-%j"].iter();
        let mut days = days.map(|form| NaiveDate::parse_from_str(text, form));
        times
            .find_map(Result::ok)
            .or_else(|| days.find_map(Result::ok)?.and_hms_opt(0, 0, 0))
            .map(Self::from)
    }

    /// So many seconds later.
    #[must_use]
    pub fn plus(self, seconds: f64) -> Self {
        // A longer time than this is none of an archive.
        let seconds = seconds.clamp(-1e10, 1e10);
        let later = TimeDelta::try_milliseconds(whole(seconds * 1e3));
        Self(
            self.0
                .saturating_add(later.map_or(0, |later| later.num_milliseconds())),
        )
    }

    /// Seconds since `earlier`.
    #[must_use]
    pub fn since(self, earlier: Self) -> f64 {
        whole_seconds(self.0.saturating_sub(earlier.0))
    }
}

#[allow(clippy::cast_possible_truncation, reason = "clamped by the caller")]
fn whole(milliseconds: f64) -> i64 {
    milliseconds.round() as i64
}

fn whole_seconds(milliseconds: i64) -> f64 {
    milliseconds as f64 * 1e-3
}

impl From<NaiveDateTime> for Utc {
    fn from(time: NaiveDateTime) -> Self {
        Self(time.and_utc().timestamp_millis())
    }
}

impl fmt::Display for Utc {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match DateTime::from_timestamp_millis(self.0) {
            Some(time) => write!(formatter, "{}", time.format("%Y-%m-%dT%H:%M:%S%.3f")),
            None => formatter.write_str("an unknown time"),
        }
    }
}

/// Parts of `required` that none of `held` covers, in order.
#[must_use]
pub(crate) fn gaps(required: [Utc; 2], held: impl IntoIterator<Item = [Utc; 2]>) -> Vec<[Utc; 2]> {
    let mut held: Vec<[Utc; 2]> = held.into_iter().collect();
    held.sort_unstable();
    let (mut gaps, mut covered) = (Vec::new(), required[0]);
    for [start, stop] in held {
        if start > covered && covered < required[1] {
            gaps.push([covered, start.min(required[1])]);
        }
        covered = covered.max(stop);
    }
    if covered < required[1] {
        gaps.push([covered, required[1]]);
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_indexes_are_read_in_every_form() {
        let at = |text: &str| Utc::parse(text).unwrap().to_string();
        assert_eq!(at("1999-08-24T14:12:13.64"), "1999-08-24T14:12:13.640");
        assert_eq!(at("1999-236T14:12:13.64Z"), "1999-08-24T14:12:13.640");
        assert_eq!(at(" 1999-08-24 "), "1999-08-24T00:00:00.000");
        for refused in ["N/A", "", "1999-13-01", "1999-08-24T25:00:00"] {
            assert_eq!(Utc::parse(refused), None, "{refused}");
        }
        let day = Utc::parse("1999-03-01").unwrap();
        assert_eq!(day.plus(-1.5).to_string(), "1999-02-28T23:59:58.500");
        assert!((day.since(day.plus(-1.5)) - 1.5).abs() < 1e-9); // milliseconds are exact
    }

    #[test]
    fn gaps_are_what_no_interval_covers() {
        let day = |day: u32| Utc::parse(&format!("2000-01-{day:02}")).unwrap();
        let of = |held: &[[u32; 2]]| {
            let held = held.iter().map(|[start, stop]| [day(*start), day(*stop)]);
            gaps([day(5), day(10)], held)
        };
        assert!(of(&[[1, 20]]).is_empty());
        assert!(of(&[[7, 12], [1, 7]]).is_empty());
        assert_eq!(of(&[]), [[day(5), day(10)]]);
        assert_eq!(
            of(&[[6, 7], [8, 9]]),
            [[day(5), day(6)], [day(7), day(8)], [day(9), day(10)]]
        );
        assert_eq!(of(&[[11, 12], [1, 2]]), [[day(5), day(10)]]);
    }
}
