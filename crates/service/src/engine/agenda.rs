//! Activities of the engine in progress, and times of the last ones.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::retry::milliseconds;
use areograph_config::ChangesConfig;

/// Time that new files may take to settle: three polls find them quiet, each of which lasts as long as its folders take
/// to list.
///
/// * `lists_s` – time for listing them, seconds
pub(super) fn patience_ms(changes: &ChangesConfig, lists_s: f64) -> i64 {
    milliseconds(changes.quiet_period_s + 3.0 * changes.scan_interval_s + lists_s)
}

/// State shared by the turns of the engine.
#[derive(Debug, Default)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each entry describes its own task"
)]
pub(super) struct Agenda {
    pub(super) round: bool,
    pub(super) round_ms: Option<i64>,
    /// The current night.
    pub(super) night: Option<i64>,
    /// Whether files of archives are to be fetched before its comparisons, and whether that is in progress.
    pub(super) to_fetch: bool,
    pub(super) fetching: bool,
    /// Whether its comparisons have begun, and whether they have ended.
    pub(super) comparing: bool,
    pub(super) compared: bool,
    /// Its comparisons wait for settling files until this time.
    pub(super) settles_until_ms: Option<i64>,
    pub(super) upkeep: bool,
    pub(super) upkeep_ms: Option<i64>,
    pub(super) trim_ms: Option<i64>,
    pub(super) notifications: bool,
    /// Whether runs wait for comparison with their predecessors, and whether one is in progress.
    pub(super) to_compare: bool,
    pub(super) comparison: bool,
    /// Whether a night ended whose check of products has not begun, and whether one is in progress.
    pub(super) to_scrub: bool,
    pub(super) scrub: bool,
    pub(super) has_room: bool,
}

impl Agenda {
    /// Begins a night.
    pub(super) fn begin(&mut self, night: Option<i64>, settles_until_ms: Option<i64>) {
        if night.is_some() {
            self.night = night;
            (self.comparing, self.compared) = (false, false);
            self.to_fetch = true;
            self.settles_until_ms = settles_until_ms;
        }
    }

    /// Begins to fetch files for the night, if that is to be done.
    ///
    /// * `is_wanted` – by the configuration
    pub(super) fn begin_fetch(&mut self, is_wanted: bool) -> bool {
        // A new configuration does not end work in progress.
        self.to_fetch &= is_wanted || self.fetching;
        let begins = self.to_fetch && !self.fetching && self.night.is_some();
        self.fetching |= begins;
        begins
    }

    /// Ends it; a night that waits for settling files waits for the new ones as well.
    pub(super) fn end_fetch(&mut self, now_ms: i64, patience_ms: i64) {
        (self.to_fetch, self.fetching) = (false, false);
        let until_ms = now_ms.saturating_add(patience_ms);
        self.settles_until_ms = self.settles_until_ms.map(|known_ms| known_ms.max(until_ms));
    }
}

/// Each entry is complete, so that a panic of another thread leaves no partial state.
pub(super) fn lock(agenda: &Mutex<Agenda>) -> MutexGuard<'_, Agenda> {
    agenda.lock().unwrap_or_else(PoisonError::into_inner)
}
