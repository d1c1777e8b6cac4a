//! What every part of the engine works with: the shared service, workers, random numbers, and work that belongs to no job.

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

use super::workers::{Effort, Ended, How, Workers};
use crate::{
    error::{IoError, Locate as _, Result},
    service::{
        random::Random,
        shared::Shared,
        worker::protocol::{CancelWhy, PROTOCOL, Task, What},
    },
};

/// Time after a cancel within which a worker is ended by force.
const ENDED_WITHIN: Duration = Duration::from_secs(25);

/// The engine, as its parts see it.
#[derive(Debug)]
pub struct Core<W> {
    /// The service.
    pub shared: Arc<Shared>,
    /// Those who do the work.
    pub workers: W,
    /// Random numbers.
    pub random: Random,
    /// Work that was given up and has not ended: a dead mount holds its processes.
    stuck: Mutex<BTreeSet<String>>,
    scratch: AtomicU64,
}

impl<W: Workers> Core<W> {
    /// A core over a service; files of work that was under way are removed.
    ///
    /// # Errors
    /// The folder of the state cannot be written.
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

    /// The time, milliseconds of UTC since 1970.
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        self.shared.now_ms()
    }

    /// A path for a file of work under way.
    #[must_use]
    pub fn scratch(&self) -> PathBuf {
        let number = self.scratch.fetch_add(1, Ordering::Relaxed);
        let state = &self.shared.config().outputs.state;
        state.join(WORK).join(number.to_string())
    }

    /// A task of a job, or with number 0 of none.
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

    /// Has work done that belongs to no job. After `limit` it is asked to stop; what does not stop even then, since a dead mount
    /// holds it, is given up, and nothing is begun for the same subject before it ends.
    pub async fn ask(self: &Arc<Self>, subject: &str, what: What, limit: Duration) -> Ended {
        if !self.stuck().insert(subject.to_owned()) {
            return silent();
        }
        let (stop, cancel) = watch::channel(None);
        let log = self.scratch();
        let effort = Effort {
            silence: self.silence(),
            log: log.clone(),
            log_max_bytes: self.log_max_bytes(),
            cancel,
        };
        let (core, task) = (Arc::clone(self), self.task(0, 1, what));
        let subject = subject.to_owned();
        let mut work = tokio::spawn(async move {
            let ended = core.workers.work(task, effort, |_| ()).await;
            core.stuck().remove(&subject);
            let _ = fs::remove_file(log);
            ended
        });
        let ended = tokio::select! {
            ended = timeout(limit, &mut work) => ended.ok(),
            () = self.shared.ending.cancelled() => None,
        };
        if let Some(ended) = ended {
            return ended.unwrap_or_else(|error| lost(&error.to_string()));
        }
        let ending = self.shared.ending.is_cancelled();
        let why = if ending {
            CancelWhy::Shutdown
        } else {
            CancelWhy::Deadline
        };
        stop.send_replace(Some(why));
        match timeout(ENDED_WITHIN, work).await {
            Ok(Ok(ended)) => ended,
            Ok(Err(error)) => lost(&error.to_string()),
            Err(_) => silent(),
        }
    }

    /// How long a worker may give no sign of life.
    #[must_use]
    pub fn silence(&self) -> Duration {
        Duration::from_secs_f64(self.shared.config().workers.silence_s)
    }

    /// Longest log.
    #[must_use]
    pub fn log_max_bytes(&self) -> u64 {
        u64::from(self.shared.config().workers.log_max_kib) << 10
    }

    fn stuck(&self) -> MutexGuard<'_, BTreeSet<String>> {
        self.stuck.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Folder of files of work under way, in the folder of the state.
const WORK: &str = "work";
/// Folder of logs of attempts, in the folder of the state.
pub const LOGS: &str = "logs";
/// Folder of copies of the database, in the folder of the state.
pub const COPIES: &str = "copies";

/// Where the log of an attempt lies in the folder of the state.
#[must_use]
pub fn log_of(job: i64, attempt: i64) -> String {
    format!("{LOGS}/{job}-{attempt}.jsonl")
}

/// Folder of a site.
#[must_use]
pub fn site_folder(products: &Path, site: &str) -> PathBuf {
    products.join(site)
}

/// Folder whose subfolder of the site's name a site's worker works in.
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
        exit: None,
        signal: None,
    }
}

fn lost(why: &str) -> Ended {
    Ended {
        how: How::Lost(why.to_owned()),
        exit: None,
        signal: None,
    }
}

/// Why a worker did not answer, in words.
#[must_use]
pub fn words(ended: &Ended) -> String {
    match (&ended.how, ended.signal) {
        (How::Answered(_), _) => "done".to_owned(),
        (How::Failed(failure), _) => failure.text.clone(),
        (How::Lost(why), Some(signal)) => format!("the worker was ended by signal {signal}: {why}"),
        (How::Lost(why), None) => format!("the worker ended without an answer: {why}"),
        (How::Silent, _) => "the worker did not answer in time".to_owned(),
        (How::OtherVersion(version), _) => format!("the worker is of areograph {version}"),
        (How::NotStarted(why), _) => format!("the worker could not be started: {why}"),
    }
}
