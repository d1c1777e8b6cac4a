//! UTC times in tables.

use std::{fmt, ops::Range};

use chrono::{DateTime, NaiveDate, NaiveTime};

/// An instant of UTC, microseconds since 1970 without leap seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Utc(pub(super) i64);

impl Utc {
    /// Marks an invalid instant; a table that contains it is refused.
    pub(super) const UNKNOWN: Self = Self(i64::MIN);

    /// Of an ISO 8601 text with a fraction of the second and without a zone letter. A leap second
    /// maps to the following second. Any other text makes its table invalid.
    pub(super) fn of(text: &str) -> Self {
        Self::parsed(text).unwrap_or(Self::UNKNOWN)
    }

    /// See [`Utc::of`]. A million shots are parsed, a date format at a time would take as long as writing them.
    fn parsed(text: &str) -> Option<Self> {
        let number = |range: Range<usize>| {
            let digits = text.get(range)?;
            let is_number = digits.bytes().all(|digit| digit.is_ascii_digit());
            is_number.then(|| digits.parse::<u32>().ok())?
        };
        let marks = [
            (4, b'-'),
            (7, b'-'),
            (10, b'T'),
            (13, b':'),
            (16, b':'),
            (19, b'.'),
        ];
        let has_form = marks
            .iter()
            .all(|(at, mark)| text.as_bytes().get(*at) == Some(mark));
        if !has_form || !(21..=26).contains(&text.len()) {
            return None;
        }
        let scale = 10_u32.pow(26 - u32::try_from(text.len()).ok()?);
        let year = i32::try_from(number(0..4)?).ok()?;
        let date = NaiveDate::from_ymd_opt(year, number(5..7)?, number(8..10)?)?;
        let midnight = date.and_time(NaiveTime::MIN).and_utc().timestamp_micros();
        let [hours, minutes, seconds] = [number(11..13)?, number(14..16)?, number(17..19)?];
        let is_leap = [hours, minutes, seconds] == [23, 59, 60];
        let is_time = hours < 24 && minutes < 60 && (seconds < 60 || is_leap);
        let second_of_day = i64::from((hours * 60 + minutes) * 60 + seconds);
        let fraction = i64::from(number(20..text.len())? * scale);
        is_time.then_some(Self(midnight + 1_000_000 * second_of_day + fraction))
    }
}

impl Utc {
    /// The instant as a `GeoPackage` has it, to a millisecond.
    pub(super) fn to_milliseconds(self) -> String {
        self.written("%Y-%m-%dT%H:%M:%S%.3fZ")
    }

    fn written(self, form: &str) -> String {
        let time = DateTime::from_timestamp_micros(self.0).unwrap_or_default();
        time.format(form).to_string()
    }
}

impl fmt::Display for Utc {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(&self.written("%Y-%m-%dT%H:%M:%S%.6fZ"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{Table, Unit, column};

    #[test]
    fn instants_are_read_from_texts_and_written_with_their_zone() {
        let of = |text: &str| Utc::of(text).to_string();
        assert_eq!(of("1999-08-24T14:12:13.046"), "1999-08-24T14:12:13.046000Z");
        let before = of("1969-12-31T23:59:59.999999");
        assert_eq!(before, "1969-12-31T23:59:59.999999Z");
        // A leap second.
        assert_eq!(of("1998-12-31T23:59:60.500"), "1999-01-01T00:00:00.500000Z");
        for text in [
            "",
            "1999-08-24 14:12:13.046",
            "1999-02-30T14:12:13.046",
            "1999-08-24T25:12:13.046",
            "1999-08-24T14:12:60.046",
            "1999-08-24T14:12:13.0460000",
            "1999-08-24T14:12:13,046",
            "1999-08-24T+4:12:13.046",
        ] {
            assert_eq!(Utc::of(text), Utc::UNKNOWN, "{text}");
        }
        let columns = vec![column("utc", Unit::None, "", |text: &&str| Utc::of(text))];
        let table = Table::new(columns, vec!["1999-08-24T14:12:13.046", "yesterday"]);
        let refused = table.values(0..2).unwrap_err().to_string();
        assert!(refused.contains("column utc, row 2 of 2"), "{refused}");
    }
}
