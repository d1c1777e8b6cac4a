//! How a command is told to stop: Ctrl-C, or SIGTERM from systemd, Slurm or a person.

use std::{
    process,
    sync::atomic::{AtomicBool, Ordering},
};

use tokio::signal::unix::{SignalKind, signal};

use crate::error::Kind;

/// Sets `stop` at the first signal and ends the program at the second.
pub(super) async fn on_signals(stop: &AtomicBool) {
    if told().await.is_ok() {
        tracing::warn!("stopping when the running stages allow it; press again to stop at once");
        stop.store(true, Ordering::Relaxed);
    }
    if told().await.is_ok() {
        // Nothing half-made stands under a final name at any moment, so this is safe.
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
