//! State shared by all requests.

use std::{
    net::SocketAddr,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use rusqlite::{Connection, Transaction};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::{metrics::Metrics, plans::Plans, problem::Problem, rate::Rates, redactor::Redactor};
use crate::{database::Stored, shared::Shared};
use areograph_config::ServiceConfig;

/// Concurrent reads of the database.
const READS: usize = 8;
/// Concurrent streams of events.
pub(super) const STREAMS: usize = 64;

/// Time after which a request is worth repeating while a lost database is rebuilt.
const RECOVERY_S: u32 = 10;
/// Concurrent workers for plans and searches.
const WORKERS: usize = 2;

/// State shared by all requests.
pub(super) struct App {
    pub(super) shared: Arc<Shared>,
    /// Address of the service.
    pub(super) local: SocketAddr,
    pub(super) metrics: Metrics,
    pub(super) rates: Rates,
    pub(super) streams: Arc<Semaphore>,
    pub(super) connections: AtomicUsize,
    /// Workers for plans and searches.
    pub(super) workers: Arc<Semaphore>,
    pub(super) plans: Plans,
    reads: Arc<Semaphore>,
    /// With the configuration from which they were derived.
    redactor: Mutex<(Arc<ServiceConfig>, Arc<Redactor>)>,
}

impl App {
    pub(super) fn new(shared: Arc<Shared>, local: SocketAddr) -> Self {
        let config = shared.config();
        let redactor = Arc::new(Redactor::of(&config, &shared.program));
        Self {
            redactor: Mutex::new((config, redactor)),
            shared,
            local,
            metrics: Metrics::new(),
            rates: Rates::default(),
            streams: Arc::new(Semaphore::new(STREAMS)),
            connections: AtomicUsize::new(0),
            workers: Arc::new(Semaphore::new(WORKERS)),
            plans: Plans::default(),
            reads: Arc::new(Semaphore::new(READS)),
        }
    }

    pub(super) fn config(&self) -> Arc<ServiceConfig> {
        self.shared.config()
    }

    pub(super) fn now_ms(&self) -> i64 {
        self.shared.now_ms()
    }

    /// Removes the paths of this machine from answers.
    pub(super) fn redactor(&self) -> Arc<Redactor> {
        let config = self.config();
        let mut kept = self.redactor.lock().unwrap_or_else(PoisonError::into_inner);
        if !Arc::ptr_eq(&kept.0, &config) {
            let redactor = Arc::new(Redactor::of(&config, &self.shared.program));
            *kept = (config, redactor);
        }
        Arc::clone(&kept.1)
    }

    /// The answer to a request for a site or run that is unknown: while a lost database is rebuilt, it may appear.
    pub(super) fn unknown(&self, detail: &'static str) -> Problem {
        if self.shared.is_recovering() {
            return Problem::busy(
                "The database is being rebuilt from the products. Try again.",
                RECOVERY_S,
            );
        }
        Problem::not_found(detail)
    }

    /// Number of open streams of events.
    pub(super) fn open_streams(&self) -> usize {
        STREAMS - self.streams.available_permits()
    }

    /// Number of open connections.
    pub(super) fn open_connections(&self) -> usize {
        self.connections.load(Ordering::Relaxed)
    }

    /// Reads the database without blocking other requests.
    pub(super) async fn read<T: Send + 'static>(
        &self,
        look: impl FnOnce(&Connection) -> Stored<T> + Send + 'static,
    ) -> Result<T, Problem> {
        let permit = self.turn().await?;
        let shared = Arc::clone(&self.shared);
        blocking(move || {
            let seen = shared.read(look);
            drop(permit);
            seen
        })
        .await?
        .map_err(Problem::from)
    }

    /// Changes the database and wakes the engine.
    pub(super) async fn write<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Transaction<'_>) -> Stored<T> + Send + 'static,
    ) -> Result<T, Problem> {
        let permit = self.turn().await?;
        let shared = Arc::clone(&self.shared);
        blocking(move || {
            let done = shared.write(work);
            drop(permit);
            done
        })
        .await?
        .map_err(Problem::from)
    }

    async fn turn(&self) -> Result<OwnedSemaphorePermit, Problem> {
        let turn = Arc::clone(&self.reads).acquire_owned();
        turn.await.map_err(Problem::internal)
    }
}

/// Performs `work` on a thread that may block on the disk.
pub(super) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(Problem::internal)
}
