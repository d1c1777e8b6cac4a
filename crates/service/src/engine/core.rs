//! Common parts of the engine: the shared service, workers, random numbers, and work that belongs to no job.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use tokio::{sync::watch, time::timeout};

use super::workers::Workers;
use crate::{
    random::Random,
    shared::Shared,
    worker::{
        parent::{Ended, How, Times, WorkerLimits},
        protocol::{CancelWhy, PROTOCOL, Task, What},
    },
};
use areograph_base::error::{IoError, Locate as _, Result};

/// Time within which an overdue worker is ended by force, unless an unresponsive mount blocks it.
const ENDED_WITHIN: Duration = Duration::from_secs(25);

/// The engine, as its parts see it.
#[derive(Debug)]
pub struct Core<W> {
    /// The service.
    pub shared: Arc<Shared>,
    /// The workers.
    pub workers: W,
    /// Random numbers.
    pub random: Random,
    /// Work that was abandoned and has not ended: an unresponsive mount blocks its processes.
    stuck: Mutex<BTreeSet<String>>,
    scratch: AtomicU64,
}

impl<W: Workers> Core<W> {
    /// Creates a core for a service; temporary files of earlier work are removed.
    ///
    /// # Errors
    /// The state folder cannot be written.
    pub fn new(shared: Arc<Shared>, workers: W, random: Random) -> Result<Self> {
        let state = shared.config().outputs.state.clone();
        let _ = fs::remove_dir_all(state.join(WORK));
        for folder in [WORK, LOGS, COPIES] {
            let folder = state.join(folder);
            fs::create_dir_all(&folder)
                .map_err(IoError::on("create the folder"))
                .in_file(&folder)?;
        }
        Ok(Self {
            shared,
            workers,
            random,
            stuck: Mutex::new(BTreeSet::new()),
            scratch: AtomicU64::new(0),
        })
    }

    /// The current time, milliseconds of UTC since 1970.
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        self.shared.now_ms()
    }

    /// A path for a temporary file of current work.
    #[must_use]
    pub fn scratch(&self) -> PathBuf {
        let number = self.scratch.fetch_add(1, Ordering::Relaxed);
        let state = &self.shared.config().outputs.state;
        state.join(WORK).join(number.to_string())
    }

    /// A task of a job; number 0 stands for none.
    #[must_use]
    pub fn task(&self, job: i64, attempt: i64, what: What) -> Task {
        let config = self.shared.config();
        let inputs = &config.inputs;
        let roots = inputs.sites.iter().chain(&inputs.kernels);
        Task {
            v: PROTOCOL,
            job,
            attempt,
            what,
            hashes_file: config.outputs.state.join("hashes"),
            roots: roots.chain(&inputs.data).cloned().collect(),
            threads: config.workers.threads,
            memory_mib: config.workers.memory_mib,
        }
    }

    /// Has work done that belongs to no job. After `limit` it is ended. Work that an unresponsive mount blocks is
    /// abandoned, and no work on the same subject begins before it ends.
    pub async fn ask(self: &Arc<Self>, subject: &str, what: What, limit: Duration) -> Ended {
        if !self.stuck().insert(subject.to_owned()) {
            return silent();
        }
        let (stop, cancel) = watch::channel(None);
        let limits = self.limits(limit.as_secs_f64());
        let (core, task) = (Arc::clone(self), self.task(0, 1, what));
        let of_work = subject.to_owned();
        let mut work = tokio::spawn(async move {
            let log = core.scratch();
            // Also if the work panics: otherwise no work on this subject would ever begin again.
            let _free = Free {
                core: &core,
                subject: &of_work,
            };
            let ended = core
                .workers
                .work(None, task, limits, &log, cancel, |_| ())
                .await;
            let _ = fs::remove_file(log);
            ended
        });
        let ended = tokio::select! {
            ended = timeout(limit + ENDED_WITHIN, &mut work) => ended.ok(),
            () = self.shared.ending.cancelled() => {
                stop.send_replace(Some(CancelWhy::Shutdown));
                timeout(ENDED_WITHIN, &mut work).await.ok()
            }
        };
        match ended {
            Some(Ok(ended)) => ended,
            Some(Err(panicked)) => {
                tracing::error!("work for {subject} failed: {panicked}");
                silent()
            }
            None => silent(),
        }
    }

    /// Limits of a worker.
    #[must_use]
    pub fn limits(&self, deadline_s: f64) -> WorkerLimits {
        let workers = &self.shared.config().workers;
        WorkerLimits {
            deadline_s,
            silence_s: workers.silence_s,
            log_max_kib: workers.log_max_kib,
            times: Times::USUAL,
        }
    }

    fn stuck(&self) -> MutexGuard<'_, BTreeSet<String>> {
        self.stuck.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Frees a subject for other work when it is dropped.
struct Free<'a, W> {
    core: &'a Core<W>,
    subject: &'a str,
}

impl<W> Drop for Free<'_, W> {
    fn drop(&mut self) {
        let stuck = self.core.stuck.lock();
        stuck
            .unwrap_or_else(PoisonError::into_inner)
            .remove(self.subject);
    }
}

/// Folder of temporary files of current work, in the state folder.
const WORK: &str = "work";
/// Folder of logs of attempts, in the state folder.
pub const LOGS: &str = "logs";
/// Folder of copies of the database, in the state folder.
pub const COPIES: &str = "copies";

/// Path of the log of an attempt in the state folder.
#[must_use]
pub fn log_of(job: i64, attempt: i64) -> String {
    format!("{LOGS}/{job}-{attempt}.jsonl")
}

/// Folder of a site.
#[must_use]
pub fn site_folder(products: &Path, site: &str) -> PathBuf {
    products.join(site)
}

/// The folder whose subfolder with the site's name is the working folder of a site's worker.
#[must_use]
pub fn working(products: &Path, site: &str) -> PathBuf {
    site_folder(products, site).join("working")
}

/// Folder of the runs of a site.
#[must_use]
pub fn runs(products: &Path, site: &str) -> PathBuf {
    site_folder(products, site).join("runs")
}

fn silent() -> Ended {
    Ended {
        how: How::Silent,
        answer: None,
        rss_peak_kib: 0,
    }
}
