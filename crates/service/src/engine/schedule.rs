//! Instants of the scheduled comparison of all sites.

use std::str::FromStr as _;

use chrono::{DateTime, Utc};
use chrono_tz::Tz;
use croner::Cron;

use areograph_base::error::Cause;
use areograph_config::ScheduleConfig;

/// Most instants examined: a cron of every minute over the longest time to catch up.
const INSTANTS_MAX: usize = 1_000_000;
/// Missed instants that are named individually; older ones are omitted.
pub const MISSED_MAX: usize = 100;

/// Cron fields in a time zone, checked.
#[derive(Debug, Clone)]
pub struct Schedule {
    cron: Cron,
    zone: Tz,
    text: String,
}

/// Fields without an instant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[error("schedule.cron is `{cron}`: {reason}")]
#[cause(Configuration: "give five fields, such as `30 2 * * *`, that match a future instant")]
pub struct BadSchedule {
    cron: String,
    reason: String,
}

/// Due instants.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Due {
    /// The instant to catch up now, milliseconds of UTC since 1970.
    pub instant_ms: Option<i64>,
    /// Whether it is one of several, or is late.
    pub late: bool,
    /// Skipped instants, the newest of them.
    pub missed_ms: Vec<i64>,
}

/// Largest delay of a punctual night.
const ON_TIME_MS: i64 = 5 * 60_000;

impl Schedule {
    /// Parses the fields, and checks that they have an instant after `now_ms`.
    ///
    /// # Errors
    /// [`BadSchedule`].
    pub fn of(config: &ScheduleConfig, now_ms: i64) -> Result<Self, BadSchedule> {
        let bad = |reason: String| BadSchedule {
            cron: config.cron.clone(),
            reason,
        };
        let cron = Cron::from_str(&config.cron).map_err(|error| bad(error.to_string()))?;
        let zone = Tz::from_str(&config.zone).map_err(|error| bad(error.to_string()))?;
        let schedule = Self {
            cron,
            zone,
            text: format!("{} {}", config.cron, config.zone),
        };
        match schedule.next_after(now_ms) {
            Some(_) => Ok(schedule),
            None => Err(bad("it matches no future instant".to_owned())),
        }
    }

    /// Fields and zone, to detect edits.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The first instant after `after_ms`.
    #[must_use]
    pub fn next_after(&self, after_ms: i64) -> Option<i64> {
        let after = DateTime::<Utc>::from_timestamp_millis(after_ms)?.with_timezone(&self.zone);
        let next = self.cron.find_next_occurrence(&after, false).ok()?;
        Some(next.timestamp_millis())
    }

    /// Due instants at `now_ms` if the instant `last_ms` was the last one handled.
    #[must_use]
    pub fn due(&self, last_ms: i64, now_ms: i64, catch_up_ms: i64) -> Due {
        let mut instants = Vec::new();
        let mut seen_ms = last_ms;
        while let Some(next_ms) = self.next_after(seen_ms)
            && next_ms <= now_ms
            && instants.len() < INSTANTS_MAX
        {
            instants.push(next_ms);
            seen_ms = next_ms;
        }
        let newest = instants.pop();
        let instant_ms =
            newest.filter(|instant_ms| now_ms - instant_ms <= catch_up_ms.max(ON_TIME_MS));
        if instant_ms.is_none() {
            instants.extend(newest);
        }
        let missed_ms = instants.split_off(instants.len().saturating_sub(MISSED_MAX));
        let late = instant_ms.is_some_and(|instant_ms| now_ms - instant_ms > ON_TIME_MS);
        Due {
            instant_ms,
            late,
            missed_ms,
        }
    }
}

/// The next instant of a schedule after `now_ms`, if the schedule is valid.
#[must_use]
pub fn next_night_ms(config: &ScheduleConfig, now_ms: i64) -> Option<i64> {
    Schedule::of(config, now_ms).ok()?.next_after(now_ms)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_MS: i64 = 3_600_000;

    fn schedule(cron: &str, zone: &str) -> Result<Schedule, BadSchedule> {
        let config = ScheduleConfig {
            cron: cron.to_owned(),
            zone: zone.to_owned(),
            catch_up_h: 36.0,
        };
        Schedule::of(&config, at("2026-01-01T00:00:00Z"))
    }

    fn at(text: &str) -> i64 {
        DateTime::parse_from_rfc3339(text)
            .unwrap()
            .timestamp_millis()
    }

    /// Instants from one to the other, UTC.
    fn between(cron: &str, zone: &str, from: &str, to: &str) -> Vec<String> {
        let schedule = schedule(cron, zone).unwrap();
        let (mut seen_ms, to_ms) = (at(from), at(to));
        let mut found = Vec::new();
        while let Some(next_ms) = schedule.next_after(seen_ms).filter(|next| *next <= to_ms) {
            let next = DateTime::<Utc>::from_timestamp_millis(next_ms).unwrap();
            found.push(next.format("%dT%H:%M").to_string());
            seen_ms = next_ms;
        }
        found
    }

    #[test]
    fn no_night_is_lost_or_doubled_when_clocks_change() {
        // An omitted hour is caught up at its end; of a repeated hour the first one counts.
        for (zone, spring, expected) in [
            (
                "Europe/Berlin",
                "2026-03-28T12:00:00Z",
                ["29T01:00", "30T00:30"],
            ),
            (
                "America/New_York",
                "2026-03-07T12:00:00Z",
                ["08T07:00", "09T06:30"],
            ),
            (
                "Australia/Sydney",
                "2026-10-03T12:00:00Z",
                ["03T16:00", "04T15:30"],
            ),
        ] {
            let end = at(spring) + 48 * HOUR_MS;
            let end = crate::clock::utc_text(end);
            assert_eq!(
                between("30 2 * * *", zone, spring, &end),
                expected,
                "{zone}"
            );
        }
        for (zone, autumn, expected) in [
            (
                "Europe/Berlin",
                "2026-10-24T12:00:00Z",
                ["25T00:30", "26T01:30"],
            ),
            (
                "America/New_York",
                "2026-10-31T12:00:00Z",
                ["01T05:30", "02T06:30"],
            ),
            (
                "Australia/Sydney",
                "2026-04-04T12:00:00Z",
                ["04T15:30", "05T16:30"],
            ),
        ] {
            let end = at(autumn) + 48 * HOUR_MS;
            let end = crate::clock::utc_text(end);
            let cron = if zone == "America/New_York" {
                "30 1 * * *"
            } else {
                "30 2 * * *"
            };
            assert_eq!(between(cron, zone, autumn, &end), expected, "{zone}");
        }
    }

    #[test]
    fn of_several_missed_nights_the_newest_is_caught_up_with() {
        let schedule = schedule("30 2 * * *", "UTC").unwrap();
        let last = at("2026-05-01T02:30:00Z");
        let due = |now: &str| schedule.due(last, at(now), 36 * HOUR_MS);
        assert_eq!(due("2026-05-02T02:29:59Z"), Due::default());
        let on_time = due("2026-05-02T02:30:01Z");
        assert_eq!(
            (on_time.instant_ms, on_time.late),
            (Some(at("2026-05-02T02:30:00Z")), false)
        );
        let late = due("2026-05-05T20:00:00Z");
        assert_eq!(
            (late.instant_ms, late.late),
            (Some(at("2026-05-05T02:30:00Z")), true)
        );
        assert_eq!(late.missed_ms.len(), 3);
        // A monthly one, missed for longer than can be caught up.
        let monthly = super::tests::schedule("0 0 1 * *", "UTC").unwrap();
        let due = monthly.due(last, at("2026-06-10T00:00:00Z"), 36 * HOUR_MS);
        assert_eq!(due.instant_ms, None);
        assert_eq!(due.missed_ms, [at("2026-06-01T00:00:00Z")]);
    }

    #[test]
    fn a_date_that_never_comes_is_refused() {
        let refused = schedule("0 0 31 2 *", "UTC").unwrap_err().to_string();
        assert!(refused.contains("`0 0 31 2 *`"), "{refused}");
        schedule("0 25 * * *", "UTC").unwrap_err();
    }
}
