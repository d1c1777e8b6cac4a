//! Signals that stop a command: Ctrl-C, or SIGTERM from systemd, Slurm or a user.

use std::{
    process,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use tokio::{
    runtime::{Builder, Runtime},
    signal::unix::{SignalKind, signal},
};

use crate::error::{IoError, Kind, Result};

/// A thread that waits for signals on behalf of a command that is not asynchronous.
pub(super) struct Signals {
    stop: Arc<AtomicBool>,
    _waiting: Runtime,
}

impl Signals {
    /// Starts to wait.
    pub(super) fn heard() -> Result<Self> {
        let mut builder = Builder::new_multi_thread();
        let runtime = builder.worker_threads(1).enable_all().build();
        let runtime = runtime.map_err(IoError::on("start threads"))?;
        let stop = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&stop);
        runtime.spawn(async move { on_signals(&told).await });
        Ok(Self {
            stop,
            _waiting: runtime,
        })
    }

    /// Set after the first signal.
    pub(super) const fn stop(&self) -> &Arc<AtomicBool> {
        &self.stop
    }
}

/// Sets `stop` at the first signal and ends the program at the second.
pub(super) async fn on_signals(stop: &AtomicBool) {
    if told().await.is_ok() {
        tracing::warn!("stopping when the running stages allow it; press again to stop at once");
        stop.store(true, Ordering::Relaxed);
    }
    if told().await.is_ok() {
        // No incomplete file ever has a final name, so this is safe.
        process::exit(i32::from(Kind::Interrupted.exit_code()));
    }
}

/// Waits for a signal.
pub(super) async fn told() -> std::io::Result<()> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
    }
    Ok(())
}
