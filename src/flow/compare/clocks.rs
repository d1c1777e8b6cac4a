//! Whether rival sets read the same clocks.

use std::fmt;

use super::CompareError;
use crate::{error::Result, spice::Session, time::Et};

/// Instants at which clocks are compared.
const CLOCK_PROBES: usize = 100;
/// Clocks that differ by less read the same times, seconds: 3 cm of flight.
const CLOCK_TOLERANCE_S: f64 = 1e-5;

/// A text that a clock reads.
pub(super) enum Reading {
    Utc(String),
    Sclk(String),
}

impl Reading {
    fn et(&self, session: &Session) -> Result<Et> {
        match self {
            Self::Utc(text) => session.utc_to_et(text),
            Self::Sclk(text) => session.sclk_to_et(text),
        }
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Utc(text) => write!(formatter, "UTC {text}"),
            Self::Sclk(text) => write!(formatter, "clock {text}"),
        }
    }
}

/// Clock readings over `epochs`, with their instants by the set of `session`.
pub(super) fn read_clocks(
    session: &Session,
    epochs: &[Et],
    spacecraft: bool,
) -> Result<Vec<(Reading, Et)>> {
    let step = epochs.len().div_ceil(CLOCK_PROBES).max(1);
    let mut readings = Vec::new();
    for et in epochs.iter().step_by(step) {
        readings.push(Reading::Utc(session.et_to_utc(*et)?));
        if spacecraft {
            readings.push(Reading::Sclk(session.et_to_sclk(*et)?));
        }
    }
    let meant = readings.into_iter().map(|reading| {
        let et = reading.et(session)?;
        Ok((reading, et))
    });
    meant.collect()
}

/// Ensures that the clocks of the set `other` give the same instants.
pub(super) fn check_clocks(
    session: &Session,
    readings: &[(Reading, Et)],
    [first, other]: [&str; 2],
) -> Result<()> {
    for (reading, et) in readings {
        let apart_s = reading.et(session)?.since(*et);
        if apart_s.abs() > CLOCK_TOLERANCE_S {
            return Err(CompareError::Clocks {
                first: first.to_owned(),
                other: other.to_owned(),
                reading: reading.to_string(),
                apart_s,
            }
            .into());
        }
    }
    Ok(())
}
