//! The end of a worker: by itself, or by the service.

use std::{path::Path, process::ExitStatus};

use super::protocol::{Answer, Failure};
use areograph_base::error::Kind;

/// End of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum How {
    /// By itself, with this code.
    Exited(i32),
    /// By a signal that the service did not send.
    Signalled(i32),
    /// Ended: no heartbeat for too long.
    Silent,
    /// Ended: the task took too long.
    DeadlinePassed,
    /// Ended: cancelled by the caller.
    Cancelled,
    /// Ended, or exited by itself, without a hello.
    NoHello,
    /// Ended: its version differs from the service's.
    ForeignVersion(String),
    /// Ended: it sent an invalid message.
    Garbled(String),
    /// It could not be started, for this reason.
    NotStarted(String),
}

/// Result of a worker.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// Its end; an answer counts in any case.
    pub how: How,
    /// Its last line.
    pub answer: Option<Result<Answer, Failure>>,
    /// Largest reported memory, kibibytes.
    pub rss_peak_kib: u64,
}

/// The failure of a worker that aborted because its limit refused memory.
pub(super) fn out_of_memory(memory_mib: u32) -> Failure {
    Failure {
        code: Kind::Configuration.exit_code(),
        busy: false,
        site: None,
        stage: None,
        file: None,
        text: format!(
            "the worker needs more memory than workers.memory_mib = {memory_mib} allows; raise this limit, and restart or reload \
             the service"
        ),
    }
}

pub(super) fn exited(status: Option<ExitStatus>) -> How {
    use std::os::unix::process::ExitStatusExt as _;
    let code = status.and_then(|status| status.code()).map(How::Exited);
    let signal = status.and_then(|status| status.signal());
    code.or(signal.map(How::Signalled))
        .unwrap_or(How::Exited(-1))
}

/// The end of a worker on a node: `srun` states a signal as a code above 128, as shells do.
pub(super) fn exited_on_node(status: Option<ExitStatus>) -> How {
    match exited(status) {
        How::Exited(code) if code > 128 && code != i32::from(Kind::Interrupted.exit_code()) => {
            How::Signalled(code - 128)
        }
        how => how,
    }
}

/// The last messages of an `srun` that started no worker.
pub(super) async fn last_lines(log: &Path) -> String {
    const LINES: usize = 3;
    let log = tokio::fs::read_to_string(log).await.unwrap_or_default();
    let mut lines: Vec<&str> = log.lines().filter(|line| !line.trim().is_empty()).collect();
    if lines.is_empty() {
        return "srun stated no reason".to_owned();
    }
    lines.drain(..lines.len().saturating_sub(LINES));
    lines.join("; ")
}
