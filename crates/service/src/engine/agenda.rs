//! What is under way in the engine, and when what was done last.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// What turns of the engine must know of each other.
#[derive(Debug, Default)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is about a task of its own"
)]
pub(super) struct Agenda {
    pub(super) round: bool,
    pub(super) round_ms: Option<i64>,
    /// The night that has begun.
    pub(super) night: Option<i64>,
    /// Whether its comparisons have begun, and whether they are done.
    pub(super) comparing: bool,
    pub(super) compared: bool,
    /// Its comparisons are not done while files settle, until then.
    pub(super) settles_until_ms: Option<i64>,
    pub(super) upkeep: bool,
    pub(super) upkeep_ms: Option<i64>,
    pub(super) trim_ms: Option<i64>,
    pub(super) letters: bool,
    /// Whether runs wait to be compared with their predecessors, and whether some are.
    pub(super) to_compare: bool,
    pub(super) comparison: bool,
    pub(super) has_room: bool,
}

impl Agenda {
    /// A night has begun.
    pub(super) fn begin(&mut self, night: Option<i64>, settles_until_ms: Option<i64>) {
        if night.is_some() {
            self.night = night;
            (self.comparing, self.compared) = (false, false);
            self.settles_until_ms = settles_until_ms;
        }
    }
}

/// Each entry is whole, whatever happened to the thread that wrote another one.
pub(super) fn lock(agenda: &Mutex<Agenda>) -> MutexGuard<'_, Agenda> {
    agenda.lock().unwrap_or_else(PoisonError::into_inner)
}
