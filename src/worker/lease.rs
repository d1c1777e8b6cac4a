//! The lease of a worker on another computer: without lines of the service for some time, it ends.
//!
//! The end of its input does not reach a worker whose node or `srun` was lost; a service that has lost its worker begins
//! another attempt.

use std::{
    sync::{Arc, Mutex, PoisonError, atomic::AtomicBool},
    thread,
    time::{Duration, Instant},
};

use super::end_orphaned;

/// Interval at which a lease is examined.
const LOOK: Duration = Duration::from_millis(100);

/// The instant at which the service was heard.
#[derive(Debug)]
pub(super) struct Lease(Mutex<Instant>);

impl Lease {
    /// A lease that begins now.
    pub(super) fn new() -> Self {
        Self(Mutex::new(Instant::now()))
    }

    /// The service was heard now.
    pub(super) fn renew(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    fn age(&self) -> Duration {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .elapsed()
    }

    /// Stops the worker once the service has not been heard for `lease_s`.
    ///
    /// # Errors
    /// The system starts no thread.
    pub(super) fn require(
        self: &Arc<Self>,
        lease_s: f64,
        stop: &Arc<AtomicBool>,
    ) -> std::io::Result<()> {
        let (lease, stop) = (Arc::clone(self), Arc::clone(stop));
        let longest = Duration::try_from_secs_f64(lease_s).unwrap_or(Duration::MAX);
        let observe = move || {
            while lease.age() <= longest {
                thread::sleep(LOOK);
            }
            tracing::warn!("the service has not been heard for {lease_s} s: this worker ends");
            end_orphaned(&stop)
        };
        thread::Builder::new().spawn(observe).map(drop)
    }
}
