//! UTC of shots as stored in tables.

use std::fmt;

use chrono::{DateTime, NaiveDateTime};
use serde::{Deserialize, Serialize};

use crate::packed::Packed;

/// An instant of UTC, microseconds since 1970 without leap seconds; a leap second maps to the following second.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Utc(i64);

impl Utc {
    /// Marks an unknown instant; a table that contains it is refused.
    pub const UNKNOWN: Self = Self(i64::MIN);

    /// The instant this many microseconds after the start of 1970.
    #[must_use]
    pub const fn from_microseconds(microseconds: i64) -> Self {
        Self(microseconds)
    }

    /// Microseconds since 1970.
    #[must_use]
    pub const fn microseconds(self) -> i64 {
        self.0
    }

    /// Parses an ISO 8601 text with one to six decimals of a second and without a zone letter, such as
    /// `1999-08-24T14:12:13.046`; `None` for any other text.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        // The library also reads spaces, short numbers and leap seconds of any minute.
        let form = b"0000-00-00T00:00:00.";
        let has_form = text.bytes().zip(form).all(|(byte, of_form)| match of_form {
            b'0' => byte.is_ascii_digit(),
            mark => byte == *mark,
        });
        let is_leap = text.get(17..19) == Some("60");
        let is_last = text.get(11..16) == Some("23:59");
        if !has_form || !(21..=26).contains(&text.len()) || (is_leap && !is_last) {
            return None;
        }
        let time = NaiveDateTime::parse_from_str(text, "%Y-%m-%dT%H:%M:%S%.f").ok()?;
        Some(Self(time.and_utc().timestamp_micros()))
    }

    /// The instant as a date and time of the calendar.
    #[must_use]
    pub fn calendar(self) -> NaiveDateTime {
        DateTime::from_timestamp_micros(self.0)
            .unwrap_or_default()
            .naive_utc()
    }
}

/// ISO 8601 to a microsecond, without a zone letter.
impl fmt::Display for Utc {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "{}", self.calendar().format("%Y-%m-%dT%H:%M:%S%.6f"))
    }
}

impl Packed for Utc {
    type Number = i64;

    fn number(self) -> i64 {
        self.0
    }

    fn of(number: i64) -> Self {
        Self(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_read_from_texts_and_written() {
        let of = |text: &str| Utc::parse(text).map(|utc| utc.to_string());
        let written = |text: &str| Some(text.to_owned());
        let second = of("1999-08-24T14:12:13.046");
        assert_eq!(second, written("1999-08-24T14:12:13.046000"));
        let before = of("1969-12-31T23:59:59.999999");
        assert_eq!(before, written("1969-12-31T23:59:59.999999"));
        let leap = of("1998-12-31T23:59:60.500");
        assert_eq!(leap, written("1999-01-01T00:00:00.500000"));
        for text in [
            "",
            "1999-08-24 14:12:13.046",
            "1999-02-30T14:12:13.046",
            "1999-08-24T25:12:13.046",
            "1999-08-24T14:12:60.046",
            "1999-08-24T14:12:13.0460000",
            "1999-08-24T14:12:13,046",
            "1999-08-24T+4:12:13.046",
            "1999-8-24T14:12:13.0461",
        ] {
            assert_eq!(Utc::parse(text), None, "{text}");
        }
    }
}
