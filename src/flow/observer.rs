//! Whoever wants to hear how a run goes on.

use crate::{stage::Reason, watch::Count};

/// What happens to a stage of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum StageEvent<'a> {
    /// It begins, for this reason.
    Begins(&'a Reason),
    /// Its stored output is used.
    Kept,
    /// It is so far.
    Counts(Count),
    /// It is done, after so many seconds.
    Done(f64),
}

/// Hears what happens to stages, each by its label, in the order of the flow and on the thread of the run; but counts come
/// on any thread, and of files that are hashed for a stage before it begins.
pub trait Observer: std::fmt::Debug + Sync {
    /// One event.
    fn hear(&self, stage: &str, event: &StageEvent<'_>);
}

/// Nobody.
impl Observer for () {
    fn hear(&self, _stage: &str, _event: &StageEvent<'_>) {}
}
