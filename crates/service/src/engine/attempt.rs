//! Jobs are taken, one attempt each, and followed to their end.

use std::{
    collections::BTreeMap,
    fs,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use rusqlite::Transaction;
use serde_json::json;
use tokio::{sync::watch, time::sleep};

use super::{
    core::{Core, log_of, runs, working},
    ending::{Attempt, finish},
    hold::{hold, not_ready},
    runs::run_id,
    workers::Workers,
};
use crate::{
    database::{
        About, Job, Moved, Priority, Stored, advance, append,
        attempts::{begin_attempt, put_beat, put_process},
        job, jobs_in, next_queued,
        runs::Run,
        sites::site,
    },
    state::JobState,
    worker::{
        parent::Heard,
        protocol::{CancelWhy, Line, What},
        srun::Srun,
    },
};
use areograph_config::ExecutorKind;
use areograph_store::hashes::HASHES;

/// Time between two tries to record the end of an attempt while the database cannot be written.
const NOTE_AGAIN: Duration = Duration::from_secs(1);

/// Active attempts, by job.
#[derive(Debug, Default)]
pub struct AtWork {
    by_job: Mutex<BTreeMap<i64, Place>>,
}

#[derive(Debug)]
struct Place {
    backfill: bool,
    cancel: watch::Sender<Option<CancelWhy>>,
}

impl AtWork {
    /// Their number.
    #[must_use]
    pub fn count(&self) -> usize {
        self.lock().len()
    }

    fn backfills(&self) -> usize {
        self.lock().values().filter(|place| place.backfill).count()
    }

    /// Asks the worker of a job, if any, to stop; the first reason is kept.
    pub fn cancel(&self, job: i64, why: CancelWhy) -> bool {
        let places = self.lock();
        let Some(place) = places.get(&job) else {
            return false;
        };
        place.cancel.send_if_modified(|asked| {
            let first = asked.is_none();
            asked.get_or_insert(why);
            first
        });
        true
    }

    /// Removes the job: it has no worker.
    pub fn leave(&self, job: i64) {
        self.lock().remove(&job);
    }

    /// Asks all to stop.
    pub fn cancel_all(&self, why: CancelWhy) {
        let jobs: Vec<i64> = self.lock().keys().copied().collect();
        for job in jobs {
            self.cancel(job, why);
        }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<i64, Place>> {
        self.by_job.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A job taken from the queue, and the channel that stops its worker.
#[derive(Debug)]
pub struct Taken {
    job: Job,
    site_file: String,
    config_blake3: String,
    attempt: Attempt,
    cancel: watch::Receiver<Option<CancelWhy>>,
}

impl Taken {
    /// The number of the job.
    #[must_use]
    pub const fn job(&self) -> i64 {
        self.job.id
    }
}

/// Takes the next job, if one can be taken now.
///
/// # Errors
/// The database cannot be written.
pub fn take<W: Workers>(core: &Core<W>, at_work: &AtWork) -> Stored<Option<Taken>> {
    let config = core.shared.config();
    let count = usize::from(config.workers.count);
    let is_on_cluster = config.executor.kind == ExecutorKind::Slurm;
    let queued = core
        .shared
        .read(|connection| jobs_in(connection, JobState::Queued))?;
    if at_work.count() >= count || queued.is_empty() {
        return Ok(None);
    }
    // A backfill leaves capacity for changes.
    let backfill = at_work.backfills() < count.saturating_sub(1).max(1);
    let now_ms = core.now_ms();
    let taken = core.shared.write(|transaction| {
        let waits = not_ready(transaction)?;
        // Jobs that cannot begin now leave the queue.
        while let Some(next) = next_queued(transaction, now_ms, backfill)? {
            if let Some(why) = waits.of(&next.site) {
                hold(transaction, now_ms, &next, &why)?;
            } else if let Some(begun) = begin(transaction, now_ms, &next, is_on_cluster)? {
                return Ok(Some(begun));
            }
        }
        Ok(None)
    })?;
    Ok(taken.map(|(job, site_file, config_blake3)| {
        let (stop, cancel) = watch::channel(None);
        let place = Place {
            backfill: job.priority == Priority::Backfill,
            cancel: stop,
        };
        at_work.lock().insert(job.id, place);
        let attempt = Attempt {
            job: job.id,
            n: job.attempt,
            site: job.site.clone(),
            run: run_id(now_ms, job.id, job.attempt),
            is_on_cluster,
            ..Attempt::default()
        };
        Taken {
            job,
            site_file,
            config_blake3,
            attempt,
            cancel,
        }
    }))
}

/// A job whose site was removed ends here.
fn begin(
    transaction: &Transaction<'_>,
    now_ms: i64,
    next: &Job,
    is_on_cluster: bool,
) -> Stored<Option<(Job, String, String)>> {
    let site = site(transaction, &next.site)?.filter(|site| site.enabled);
    let Some(site) = site else {
        let moved = Moved {
            outcome: Some(json!({ "text": "the site file was removed" })),
            ..Moved::default()
        };
        advance(transaction, now_ms, next.id, JobState::Cancelled, &moved)?;
        return Ok(None);
    };
    advance(
        transaction,
        now_ms,
        next.id,
        JobState::Starting,
        &Moved::default(),
    )?;
    let Some(job) = job(transaction, next.id)? else {
        return Ok(None);
    };
    begin_attempt(
        transaction,
        now_ms,
        (job.id, job.attempt),
        is_on_cluster,
        &log_of(job.id, job.attempt),
    )?;
    Ok(Some((job, site.file, site.config_blake3)))
}

/// Follows an attempt to its end; returns the run that it published.
pub async fn follow<W: Workers>(core: Arc<Core<W>>, taken: Taken) -> Option<Run> {
    let Taken {
        job,
        site_file,
        config_blake3,
        mut attempt,
        cancel,
    } = taken;
    let config = core.shared.config();
    let products = &config.outputs.products;
    // The worker reports a folder that cannot be created.
    let _ = fs::create_dir_all(runs(products, &job.site));
    let what = What::Run {
        site_file: site_file.into(),
        config_blake3,
        out: working(products, &job.site),
        runs: runs(products, &job.site),
        run: attempt.run.clone(),
        force: job.force,
    };
    tracing::info!(
        site = job.site,
        job = job.id,
        attempt = attempt.n,
        "started"
    );
    let ended = {
        let mut task = core.task(job.id, attempt.n, what);
        if attempt.is_on_cluster {
            // Nodes do not have the folder of the state.
            task.hashes_file = products.join(HASHES);
        }
        let limits = core.limits(config.workers.deadline_s);
        let log = config.outputs.state.join(log_of(job.id, attempt.n));
        let srun = attempt
            .is_on_cluster
            .then(|| Srun::of(&config, &attempt.run));
        let heard = |heard: Heard<'_>| hear(&core, &mut attempt, heard);
        core.workers
            .work(srun.as_ref(), task, limits, &log, cancel.clone(), heard)
            .await
    };
    let why = *cancel.borrow();
    loop {
        // A full disk: the outcome is kept until it can be recorded.
        match finish(&core, &attempt, &ended, why) {
            Ok(run) => return run,
            Err(error) => tracing::error!(
                job = job.id,
                "the end of an attempt could not be recorded: {error}"
            ),
        }
        if core.shared.ending.is_cancelled() {
            // The next service finds the run on the disk.
            return None;
        }
        sleep(NOTE_AGAIN).await;
    }
}

/// Records a message of a worker; a line that cannot be recorded is lost, but not its work.
fn hear<W: Workers>(core: &Core<W>, attempt: &mut Attempt, heard: Heard<'_>) {
    let now_ms = core.now_ms();
    let at = (attempt.job, attempt.n);
    let line = match heard {
        Heard::Started(process) => {
            let noted = core
                .shared
                .write(|transaction| put_process(transaction, at, process));
            return told(noted, attempt);
        }
        Heard::Line(line) => line,
    };
    let noted = core.shared.write(|transaction| match line {
        Line::Hello { .. } => {
            let stands = job(transaction, attempt.job)?.map(|job| job.state);
            if stands == Some(JobState::Starting) {
                let running = Moved::default();
                advance(
                    transaction,
                    now_ms,
                    attempt.job,
                    JobState::Running,
                    &running,
                )?;
            }
            Ok(())
        }
        Line::Stage {
            stage,
            state,
            because,
            seconds,
        } => {
            attempt.stage = Some(stage.clone());
            put_beat(transaction, now_ms, at, None, Some(stage))?;
            let about = About {
                site: Some(&attempt.site),
                job: Some(attempt.job),
                run: None,
            };
            let data =
                json!({ "stage": stage, "state": state, "because": because, "seconds": seconds });
            append(transaction, now_ms, "stage", about, &data).map(|_| ())
        }
        Line::Beat { rss_kib } => put_beat(transaction, now_ms, at, Some(*rss_kib), None),
        Line::Answer(_) | Line::Failure(_) | Line::Piece { .. } => Ok(()),
    });
    told(noted, attempt);
}

fn told(noted: Stored<()>, attempt: &Attempt) {
    if let Err(error) = noted {
        tracing::warn!(
            job = attempt.job,
            "a line from a worker could not be recorded: {error}"
        );
    }
}
