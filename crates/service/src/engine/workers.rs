//! Workers: processes, or their substitutes in tests.

use std::{
    future::Future,
    path::{Path, PathBuf},
};

use tokio::sync::watch;

use crate::worker::{
    parent::{Ended, Heard, How, WorkerLimits, work_at},
    protocol::{CancelWhy, Task},
    srun::Srun,
};

/// Workers.
pub trait Workers: Send + Sync + 'static {
    /// Performs a task to its end, as [`work_at`] describes.
    fn work(
        &self,
        srun: Option<&Srun>,
        task: Task,
        limits: WorkerLimits,
        log: &Path,
        cancel: watch::Receiver<Option<CancelWhy>>,
        heard: impl FnMut(Heard<'_>) + Send,
    ) -> impl Future<Output = Ended> + Send;
}

/// Worker processes of a program.
#[derive(Debug, Clone)]
pub struct Processes {
    /// The program: this one.
    pub program: PathBuf,
}

impl Workers for Processes {
    async fn work(
        &self,
        srun: Option<&Srun>,
        task: Task,
        limits: WorkerLimits,
        log: &Path,
        cancel: watch::Receiver<Option<CancelWhy>>,
        heard: impl FnMut(Heard<'_>) + Send,
    ) -> Ended {
        work_at(&self.program, srun, &task, &limits, log, cancel, heard).await
    }
}

/// End of a worker, as text.
#[must_use]
pub fn words(ended: &Ended) -> String {
    match (&ended.answer, &ended.how) {
        (Some(Ok(_)), _) => "done".to_owned(),
        (Some(Err(failure)), _) => failure.text.clone(),
        (None, How::Exited(code)) => format!("the worker ended with code {code} and no answer"),
        (None, How::Signalled(signal)) => format!("the worker was ended by signal {signal}"),
        (None, How::Silent) => "the worker stopped responding, and the service ended it".to_owned(),
        (None, How::DeadlinePassed) => {
            "the worker exceeded its time limit, and the service ended it".to_owned()
        }
        (None, How::Cancelled) => "the worker was stopped".to_owned(),
        (None, How::NoHello) => "the worker did not identify itself".to_owned(),
        (None, How::ForeignVersion(version)) => format!("the worker runs areograph {version}"),
        (None, How::Garbled(what)) => format!("the worker sent an invalid message: {what}"),
        (None, How::NotStarted(why)) => format!("the worker could not be started: {why}"),
    }
}
