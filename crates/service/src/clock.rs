//! The current time; tests set it.

use std::sync::{
    Arc,
    atomic::{AtomicI64, Ordering},
};

use chrono::{DateTime, SecondsFormat, Utc};

/// The clock; copies show the same time.
#[derive(Debug, Clone, Default)]
pub struct Clock {
    /// Milliseconds of UTC since 1970, if not from the system.
    set: Option<Arc<AtomicI64>>,
}

impl Clock {
    /// A clock that shows the time to which it is set.
    #[must_use]
    pub fn set_to(utc_ms: i64) -> Self {
        Self {
            set: Some(Arc::new(AtomicI64::new(utc_ms))),
        }
    }

    /// Sets a clock created by [`Self::set_to`].
    pub fn set(&self, utc_ms: i64) {
        if let Some(set) = &self.set {
            set.store(utc_ms, Ordering::SeqCst);
        }
    }

    /// Milliseconds of UTC since 1970.
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        let shown = self.set.as_ref().map(|set| set.load(Ordering::SeqCst));
        shown.unwrap_or_else(|| Utc::now().timestamp_millis())
    }
}

/// An instant as RFC 3339 in UTC, to the millisecond.
#[must_use]
pub fn utc_text(utc_ms: i64) -> String {
    let instant = DateTime::<Utc>::from_timestamp_millis(utc_ms).unwrap_or_default();
    instant.to_rfc3339_opts(SecondsFormat::Millis, true)
}

/// An instant in UTC, to the minute, for a sentence.
#[must_use]
pub fn minute_text(utc_ms: i64) -> String {
    let instant = DateTime::<Utc>::from_timestamp_millis(utc_ms).unwrap_or_default();
    instant.format("%Y-%m-%d %H:%M UTC").to_string()
}
