//! What the engine asks of worker processes, so that tests can do the work themselves.

use std::{future::Future, path::PathBuf, time::Duration};

use tokio::sync::watch;

use crate::service::worker::protocol::{Answer, CancelWhy, Failure, Line, Task};

/// What a worker gets besides its task.
#[derive(Debug)]
pub struct Effort {
    /// A worker without a sign of life for so long is ended.
    pub silence: Duration,
    /// Where its log goes.
    pub log: PathBuf,
    /// Longest log, bytes.
    pub log_max_bytes: u64,
    /// Set when it is to stop.
    pub cancel: watch::Receiver<Option<CancelWhy>>,
}

/// How a worker ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// With what.
    pub how: How,
    /// Exit code.
    pub exit: Option<i32>,
    /// Signal that ended it.
    pub signal: Option<i32>,
}

/// With what a worker ended.
#[derive(Debug, Clone, PartialEq)]
pub enum How {
    /// The work was done.
    Answered(Answer),
    /// The work failed, and the worker says why.
    Failed(Failure),
    /// It ended without an answer, for example by a signal; in words.
    Lost(String),
    /// It gave no sign of life, or never said hello, and was ended.
    Silent,
    /// It is of another version.
    OtherVersion(String),
    /// It could not be started.
    NotStarted(String),
}

/// Those who do the work.
pub trait Workers: Send + Sync + 'static {
    /// Does a task to its end; `heard` is given every line of the worker at once.
    fn work(
        &self,
        task: Task,
        effort: Effort,
        heard: impl FnMut(&Line) + Send,
    ) -> impl Future<Output = Ended> + Send;
}
