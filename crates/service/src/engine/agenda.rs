//! Activities of the engine in progress, and times of the last ones.

use std::sync::{Mutex, MutexGuard, PoisonError};

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
    /// Whether its comparisons have begun, and whether they have ended.
    pub(super) comparing: bool,
    pub(super) compared: bool,
    /// Its comparisons wait for settling files until this time.
    pub(super) settles_until_ms: Option<i64>,
    pub(super) upkeep: bool,
    pub(super) upkeep_ms: Option<i64>,
    pub(super) trim_ms: Option<i64>,
    pub(super) letters: bool,
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
            self.settles_until_ms = settles_until_ms;
        }
    }
}

/// Each entry is complete, so that a panic of another thread leaves no partial state.
pub(super) fn lock(agenda: &Mutex<Agenda>) -> MutexGuard<'_, Agenda> {
    agenda.lock().unwrap_or_else(PoisonError::into_inner)
}
