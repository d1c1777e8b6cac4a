//! State shared by the engine and the HTTP service.

use std::{
    path::PathBuf,
    sync::{
        Arc, PoisonError, RwLock,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use rusqlite::{Connection, Transaction};
use tokio::sync::{Notify, watch};
use tokio_util::sync::CancellationToken;

use super::{
    clock::Clock,
    contents::Contents,
    database::{Database, Stored, newest_event},
};
use areograph_config::ServiceConfig;

/// A running service, as every part of it sees it.
#[derive(Debug)]
pub struct Shared {
    config: RwLock<Arc<ServiceConfig>>,
    problem: RwLock<Option<String>>,
    database: Database,
    newest: watch::Sender<i64>,
    recovering: AtomicBool,
    progress: AtomicU64,
    /// Contents of products.
    pub contents: Contents,
    /// The clock.
    pub clock: Clock,
    /// The program of the workers: this one.
    pub program: PathBuf,
    /// Wakes the engine.
    pub wake: Notify,
    /// Set when the service ends: no job is taken, streams of events end.
    pub ending: CancellationToken,
}

impl Shared {
    /// A service that has just begun.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn new(
        config: ServiceConfig,
        database: Database,
        clock: Clock,
        program: PathBuf,
    ) -> Stored<Self> {
        let newest = database.read(newest_event)?;
        Ok(Self {
            config: RwLock::new(Arc::new(config)),
            problem: RwLock::new(None),
            database,
            newest: watch::Sender::new(newest),
            recovering: AtomicBool::new(false),
            progress: AtomicU64::new(0),
            contents: Contents::default(),
            clock,
            program,
            wake: Notify::new(),
            ending: CancellationToken::new(),
        })
    }

    /// The configuration in force.
    #[must_use]
    pub fn config(&self) -> Arc<ServiceConfig> {
        let config = self.config.read().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(&config)
    }

    /// Sets another configuration in force.
    pub fn set_config(&self, config: ServiceConfig) {
        *self.config.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(config);
        self.set_problem(None);
    }

    /// The reason for which the configuration in force differs from the configuration in the file.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let problem = self.problem.read().unwrap_or_else(PoisonError::into_inner);
        problem.clone()
    }

    /// Records why the configuration of the file was rejected.
    pub fn set_problem(&self, problem: Option<String>) {
        *self.problem.write().unwrap_or_else(PoisonError::into_inner) = problem;
    }

    /// Whether runs on the disk are being recorded in a new database.
    #[must_use]
    pub fn is_recovering(&self) -> bool {
        self.recovering.load(Ordering::Acquire)
    }

    /// Records whether runs on the disk are being recorded in a new database.
    pub fn set_recovering(&self, recovering: bool) {
        self.recovering.store(recovering, Ordering::Release);
    }

    /// A number that grows while runs on the disk are being recorded, as a heartbeat.
    #[must_use]
    pub fn progress(&self) -> u64 {
        self.progress.load(Ordering::Relaxed)
    }

    /// Records progress.
    pub fn note_progress(&self) {
        self.progress.fetch_add(1, Ordering::Relaxed);
    }

    /// The current time, milliseconds of UTC since 1970.
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        self.clock.now_ms()
    }

    /// The database; writes with events use [`Self::write`].
    #[must_use]
    pub fn database(&self) -> &Database {
        &self.database
    }

    /// Performs `look` on one state of the database.
    ///
    /// # Errors
    /// An error of `look`, or an SQLite error.
    pub fn read<T>(&self, look: impl FnOnce(&Connection) -> Stored<T>) -> Stored<T> {
        self.database.read(look)
    }

    /// Performs `work` as one transaction and notifies the subscribers of events.
    ///
    /// # Errors
    /// An error of `work`, in which case nothing is written; or an SQLite error.
    pub fn write<T>(&self, work: impl FnOnce(&Transaction<'_>) -> Stored<T>) -> Stored<T> {
        let (done, newest) = self.database.write(|transaction| {
            let done = work(transaction)?;
            Ok((done, newest_event(transaction)?))
        })?;
        self.newest.send_if_modified(|known| {
            let newer = newest > *known;
            *known = newest.max(*known);
            newer
        });
        Ok(done)
    }

    /// Follows the number of the newest event.
    #[must_use]
    pub fn follow(&self) -> watch::Receiver<i64> {
        self.newest.subscribe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::{About, append};
    use areograph_config::Document as _;

    #[test]
    fn whoever_follows_hears_of_an_event_and_of_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let text = "[inputs]\nsites = [\".\"]\nkernels = [\"kernels\"]\ndata = [\"data\"]\n";
        let config = ServiceConfig::parse(text, &folder.path().join("areograph.toml"))
            .unwrap()
            .config;
        let database = Database::open(folder.path()).unwrap();
        let clock = Clock::set_to(7);
        let shared = Shared::new(config, database, clock, PathBuf::new()).unwrap();
        let mut newest = shared.follow();
        shared
            .write(|transaction| Ok(transaction.execute("INSERT INTO fact VALUES ('a', 'b')", [])?))
            .unwrap();
        assert!(!newest.has_changed().unwrap());
        let note = |transaction: &Transaction<'_>| {
            append(transaction, 7, "config", About::default(), &().into())
        };
        let seq = shared.write(note).unwrap();
        assert!(newest.has_changed().unwrap());
        assert_eq!(*newest.borrow_and_update(), seq);
    }
}
