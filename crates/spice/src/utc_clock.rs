//! UTC of many instants.

use areograph_base::{error::Result, time::Et, utc::Utc};

use super::{error::SpiceError, session::Session};

/// Digits of a second: programs read the time from it, and MGS flies 3 m in a millisecond.
const DECIMALS: u8 = 6;
/// Microseconds of a second.
const SECOND_US: u32 = 1_000_000;
/// Last second of an hour whose length no leap second changes.
const LAST_S: u32 = 3_599;

/// UTC as `et2utc` gives it, to a microsecond. CSPICE, which takes 3 µs per call, is called once per hour of UTC; other
/// instants of the hour are computed from its result.
///
/// From the full hour to its last regular second ET − UTC changes only by TDB − TT: by at most 1.2 µs, and linearly within
/// 2e-10 s. A leap second follows that last second. Times differ from CSPICE's only by the rounding of the last digit.
#[derive(Debug)]
pub struct UtcClock<'a> {
    session: &'a Session,
    hour: Option<Hour>,
}

#[derive(Debug)]
struct Hour {
    start: Utc,
    start_s: f64,
    /// Seconds of UTC in a second of ET.
    rate: f64,
}

impl Hour {
    /// Microseconds since the hour, rounded; `None` outside its regular seconds.
    fn microseconds(&self, et: Et) -> Option<u32> {
        let since_us = (et.seconds() - self.start_s) * self.rate * f64::from(SECOND_US);
        let rounded_us = since_us.round();
        let is_inside = rounded_us >= 0.0 && rounded_us < f64::from(LAST_S * SECOND_US);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "3.6e9 microseconds at most"
        )]
        is_inside.then_some(rounded_us as u32)
    }
}

impl<'a> UtcClock<'a> {
    /// By the leap seconds of `session`.
    #[must_use]
    pub const fn new(session: &'a Session) -> Self {
        Self {
            session,
            hour: None,
        }
    }

    /// UTC of an instant.
    ///
    /// # Errors
    /// As [`Session::et_to_utc_with`]; also an error of CSPICE for years before 1 or after 9999.
    pub fn utc(&mut self, et: Et) -> Result<Utc> {
        let hour = self.hour.as_ref();
        if let Some((start, since_us)) = hour.and_then(|of| Some((of.start, of.microseconds(et)?)))
        {
            let since_us = i64::from(since_us);
            return Ok(Utc::from_microseconds(start.microseconds() + since_us));
        }
        let text = self.session.et_to_utc_with(et, DECIMALS)?;
        let not_iso = || SpiceError::NotIso(text.clone());
        let utc = Utc::parse(&text).ok_or_else(not_iso)?;
        let (hour, _) = text.split_once(':').ok_or_else(not_iso)?;
        let full_hour = format!("{hour}:00:00.0");
        let start_s = self.session.utc_to_et(&full_hour)?.seconds();
        let last_s = self.session.utc_to_et(&format!("{hour}:59:59"))?.seconds();
        self.hour = Some(Hour {
            start: Utc::parse(&full_hour).ok_or_else(not_iso)?,
            start_s,
            rate: f64::from(LAST_S) / (last_s - start_s),
        });
        Ok(utc)
    }
}
