//! Observers of a run.

use crate::{stage::Reason, watch::Count};

/// An event of a stage of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum StageEvent<'a> {
    /// It begins, for this reason.
    Begins(&'a Reason),
    /// Its stored output is used.
    Kept,
    /// Its progress.
    Counts(Count),
    /// It is done, after this time in seconds.
    Done(f64),
}

/// Receives the events of stages, each by its label, in the order of the flow and on the thread of the run. Counts
/// arrive on any thread; counts of files that are hashed for a stage arrive before it begins.
pub trait Observer: std::fmt::Debug + Sync {
    /// One event.
    fn hear(&self, stage: &str, event: &StageEvent<'_>);
}

/// No observer.
impl Observer for () {
    fn hear(&self, _stage: &str, _event: &StageEvent<'_>) {}
}
