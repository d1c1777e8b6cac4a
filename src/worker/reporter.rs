//! Messages of a worker to the service.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    sync::{Mutex, PoisonError},
};

use rustix::{
    io::fcntl_dupfd_cloexec,
    stdio::{dup2_stdout, stderr, stdout},
};

use crate::{
    flow::{Observer, StageEvent},
    service::worker::protocol::{LINE_MAX, Line},
};

/// Bytes of a piece: with every character escaped, and with the rest of the message, it fits into a line.
const PIECE: usize = LINE_MAX / 2 - 1024;
/// Descriptors below this one are the standard ones.
const BEYOND_STANDARD: i32 = 3;

/// The pipe to the service.
#[derive(Debug)]
pub(super) struct Reporter {
    pipe: Mutex<File>,
}

impl Reporter {
    /// Reserves standard output for the service; from now on, C code writes to standard error.
    pub(super) fn take() -> io::Result<Self> {
        let pipe = fcntl_dupfd_cloexec(stdout(), BEYOND_STANDARD)?;
        dup2_stdout(stderr())?;
        Ok(Self {
            pipe: Mutex::new(File::from(pipe)),
        })
    }

    /// Sends a line, in pieces if it is long. If the service has ended, the end of the worker's input shows it.
    pub(super) fn send(&self, line: &Line) {
        let Ok(text) = serde_json::to_string(line) else {
            return;
        };
        let mut pipe = self.pipe.lock().unwrap_or_else(PoisonError::into_inner);
        if text.len() < LINE_MAX {
            let _ = pipe.write_all((text + "\n").as_bytes());
            return;
        }
        let mut rest = &*text;
        while !rest.is_empty() {
            let (piece, after) = rest.split_at(rest.floor_char_boundary(PIECE));
            rest = after;
            let piece = Line::Piece {
                text: piece.to_owned(),
                more: !rest.is_empty(),
            };
            if let Ok(piece) = serde_json::to_string(&piece) {
                let _ = pipe.write_all((piece + "\n").as_bytes());
            }
        }
    }

    /// Reports that a stage begins or has ended.
    pub(super) fn stage(&self, stage: &str, state: &str, because: &str, seconds: f64) {
        self.send(&Line::Stage {
            stage: stage.to_owned(),
            state: state.to_owned(),
            because: because.to_owned(),
            seconds,
        });
    }

    /// Sends a heartbeat.
    pub(super) fn beat(&self) {
        self.send(&Line::Beat {
            rss_kib: rss_kib().unwrap_or(0),
        });
    }
}

impl Observer for Reporter {
    fn hear(&self, stage: &str, event: &StageEvent<'_>) {
        match event {
            StageEvent::Begins(reason) => self.stage(stage, "running", &reason.to_string(), 0.0),
            // The clock sends the heartbeats.
            StageEvent::Counts(_) => {}
            StageEvent::Kept => self.stage(stage, "kept", "unchanged", 0.0),
            StageEvent::Done(seconds) => {
                self.stage(stage, "done", "", *seconds);
                tracing::info!(stage, seconds, "done");
                // A short run would end between two heartbeats, and its memory would not be known.
                self.beat();
            }
        }
    }
}

/// Memory in use, as the kernel counts it.
fn rss_kib() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_ascii_whitespace().nth(1)?.parse().ok()
}
