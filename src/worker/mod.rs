//! A worker process: one task, from its input line to the answer.
//!
//! It can be killed at any moment: no incomplete file has a final name.

mod hash;
mod kernels;
mod lease;
mod limits;
mod list;
mod reporter;
mod shots;
mod site;

use std::{
    any::Any,
    io::{BufRead as _, Read as _},
    panic::{AssertUnwindSafe, catch_unwind},
    path::PathBuf,
    process::{self, ExitCode},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use crate::service::worker::protocol::{
    ANSWER_MAX, Answer, Cancel, Failure, Here, Line, PROTOCOL, Task, What,
};
use crate::{
    column::lost_values,
    difference::{Limits, Outcome, compare},
    error::{Error, Kind, Result},
    report::difference_page,
    store::{hashes::HashCache, lock::Busy, page::PagePath},
};
use lease::Lease;
use reporter::Reporter;
use shots::{Search, search};

/// Interval of heartbeats.
const BEAT: Duration = Duration::from_secs(2);
/// Time that a worker has to stop gracefully after the service has ended.
const ORPHANED: Duration = Duration::from_secs(10);

/// State that the parts of a worker share.
struct Worker {
    task: Task,
    reporter: Arc<Reporter>,
    stop: Arc<AtomicBool>,
    hashes: HashCache,
    /// Folders below which input files must lie, links resolved.
    roots: Vec<PathBuf>,
}

/// Announces itself, reads a task from standard input, performs it and answers.
///
/// * `parent` – the process of the service; the worker ends with it
/// * `lease_s` – longest time without a line of the service, for a worker on another computer
#[must_use]
pub fn main(parent: Option<u32>, lease_s: Option<f64>) -> ExitCode {
    let interrupted = ExitCode::from(Kind::Interrupted.exit_code());
    if !limits::end_with(parent) {
        return interrupted;
    }
    let reporter = match Reporter::take() {
        Ok(reporter) => Arc::new(reporter),
        Err(error) => {
            tracing::error!("standard output cannot be reserved for the service: {error}");
            return ExitCode::from(Kind::Io.exit_code());
        }
    };
    reporter.send(&Line::Hello {
        v: PROTOCOL,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        pid: process::id(),
    });
    let task = match read_task() {
        None => return interrupted,
        Some(Err(text)) => return fail(&reporter, bug(text)),
        Some(Ok(task)) => task,
    };
    let stop = Arc::new(AtomicBool::new(false));
    let lease = Arc::new(Lease::new());
    // Without these threads the worker could not be stopped, nor distinguished from one that hangs.
    let threads = listen(&stop, &lease)
        .and_then(|()| beat(&reporter))
        .and_then(|()| match lease_s {
            Some(lease_s) => lease.require(lease_s, &stop),
            None => Ok(()),
        });
    if let Err(error) = threads {
        return fail(&reporter, bug(format!("no thread can be started: {error}")));
    }
    if let Err(text) = limits::keep_to(&task) {
        return fail(&reporter, unfit(text));
    }
    let worker = Worker {
        hashes: HashCache::new(&task.hashes_file, false),
        roots: task
            .roots
            .iter()
            .map(|root| root.canonicalize().unwrap_or_else(|_| root.clone()))
            .collect(),
        task,
        reporter,
        stop,
    };
    match catch_unwind(AssertUnwindSafe(|| worker.work())) {
        Ok(Ok(answer)) => {
            // Short tasks end before the first heartbeat.
            worker.reporter.beat();
            worker.reporter.send(&Line::Answer(answer));
            ExitCode::SUCCESS
        }
        Ok(Err(failure)) => fail(&worker.reporter, described(&failure)),
        Err(panic) => {
            let lost = lost_values(&*panic).map(|lost| described(&lost));
            fail(&worker.reporter, lost.unwrap_or_else(|| panicked(&*panic)))
        }
    }
}

/// The task, or why it is invalid; `None` if the service has ended.
fn read_task() -> Option<std::result::Result<Task, String>> {
    let mut line = Vec::new();
    let input = std::io::stdin().lock();
    let read = input.take(ANSWER_MAX as u64).read_until(b'\n', &mut line);
    if read.is_err() || line.is_empty() {
        return None;
    }
    let task =
        serde_json::from_slice::<Task>(&line).map_err(|error| format!("malformed task: {error}"));
    Some(task.and_then(|task| {
        if task.v == PROTOCOL {
            Ok(task)
        } else {
            Err(format!(
                "the task has version {}; expected {PROTOCOL}",
                task.v
            ))
        }
    }))
}

/// Sets `stop` when the service requests it or has ended.
fn listen(stop: &Arc<AtomicBool>, lease: &Arc<Lease>) -> std::io::Result<()> {
    let (stop, lease) = (Arc::clone(stop), Arc::clone(lease));
    let listener = move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            lease.renew();
            if serde_json::from_str::<Here>(&line).is_ok() {
                continue;
            }
            match serde_json::from_str::<Cancel>(&line) {
                Ok(Cancel { cancel }) => {
                    tracing::info!(?cancel, "the service requests a stop");
                    stop.store(true, Ordering::Relaxed);
                }
                Err(error) => tracing::warn!("malformed message from the service: {error}"),
            }
        }
        tracing::warn!("the service has ended");
        end_orphaned(&stop);
    };
    thread::Builder::new().spawn(listener).map(drop)
}

/// Stops, and ends the process if it does not stop in time.
fn end_orphaned(stop: &AtomicBool) -> ! {
    stop.store(true, Ordering::Relaxed);
    thread::sleep(ORPHANED);
    process::exit(i32::from(Kind::Interrupted.exit_code()))
}

/// Starts the heartbeats.
fn beat(reporter: &Arc<Reporter>) -> std::io::Result<()> {
    let reporter = Arc::clone(reporter);
    let beats = move || {
        loop {
            reporter.beat();
            thread::sleep(BEAT);
        }
    };
    thread::Builder::new().spawn(beats).map(drop)
}

impl Worker {
    fn work(&self) -> Result<Answer> {
        match &self.task.what {
            What::Run { .. } => self.run().map(Answer::Run),
            What::Plan { site_file, out } => self.plan(site_file, out).map(Answer::Plan),
            What::Diff {
                before,
                after,
                page,
                limit_m,
                limit_arcsec,
            } => {
                let page = page.as_deref().map(PagePath::new).transpose()?;
                let limits = Limits {
                    movement_m: Some(*limit_m),
                    pointing_arcsec: Some(*limit_arcsec),
                };
                let difference = compare(before, after, &limits)?;
                if let Some(page) = page {
                    page.write(&difference_page(&[&difference], &[])?)?;
                }
                Ok(Answer::Diff {
                    headline: difference.headline(),
                    sentences: difference.sentences(),
                    beyond_limit: difference.outcome == Outcome::BeyondLimit,
                })
            }
            What::Probe { files } => self.probe(files).map(|kernels| Answer::Probe { kernels }),
            What::Hash { files, rehash } => self
                .hash(files, *rehash)
                .map(|files| Answer::Hash { files }),
            What::List { roots, into } => {
                list::list(roots, into, &self.stop).map(|files| Answer::List { files })
            }
            What::Shots {
                runs,
                polygon,
                rows_max,
                format,
                into,
            } => {
                let asked = Search {
                    runs,
                    polygon,
                    rows_max: *rows_max,
                    format,
                    into,
                };
                let (rows, complete) = search(&asked, &self.stop)?;
                Ok(Answer::Shots { rows, complete })
            }
        }
    }
}

/// Reports a failure; returns its exit code.
fn fail(reporter: &Reporter, failure: Failure) -> ExitCode {
    let code = failure.code;
    tracing::error!("{}", failure.text);
    reporter.send(&Line::Failure(failure));
    ExitCode::from(code)
}

fn described(failure: &Error) -> Failure {
    Failure {
        code: failure.kind().exit_code(),
        busy: Busy::is_cause_of(failure),
        site: failure.site.clone(),
        stage: failure.stage.clone(),
        file: failure.file.clone(),
        text: failure.to_string(),
    }
}

fn panicked(panic: &(dyn Any + Send)) -> Failure {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or(panic.downcast_ref::<&str>().copied());
    bug(format!(
        "internal error of areograph: {}",
        text.unwrap_or("without a message")
    ))
}

/// A refusal of the system to start the worker's threads.
fn unfit(text: String) -> Failure {
    Failure {
        code: Kind::Io.exit_code(),
        ..bug(text)
    }
}

/// A failure that no input causes: of areograph, or of the service.
fn bug(text: String) -> Failure {
    Failure {
        code: Kind::Bug.exit_code(),
        busy: false,
        site: None,
        stage: None,
        file: None,
        text,
    }
}
