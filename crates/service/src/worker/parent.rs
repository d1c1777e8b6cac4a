//! The service's side of one worker process: it starts the process, sends its task, reads its messages, ends it in time
//! and waits for it.

use std::{
    future::pending,
    path::{Path, PathBuf},
    process::ExitStatus,
    time::Duration,
};

use rustix::process::Signal;
use tokio::{
    io::{AsyncWriteExt as _, BufReader},
    process::{ChildStderr, ChildStdin, ChildStdout},
    sync::watch,
    task::JoinHandle,
    time::{Instant, sleep_until, timeout},
};

pub use super::ended::{Ended, How};
use super::{
    ended::{exited, exited_on_node, last_lines, out_of_memory},
    fork::fork,
    lines::{Garbled, LineReader},
    log,
    process::{ProcessIdentity, signal_group},
    protocol::{Answer, Cancel, CancelWhy, Failure, Here, Line, PROTOCOL, Task},
    srun::{self, Srun},
};

/// Renewals of a lease in its time.
const RENEWALS: u32 = 5;

/// Waiting times of the service's side, independent of the task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// Longest time until a worker's hello.
    pub hello: Duration,
    /// Times until a worker that was asked to stop receives a signal, and until it is killed, both from the request.
    pub patience: [Duration; 2],
    /// Longest time that the pipes of an ended worker may stay open.
    pub drain: Duration,
}

impl Times {
    /// Limits of the service.
    pub const USUAL: Self = Self {
        hello: Duration::from_secs(20),
        patience: [Duration::from_secs(10), Duration::from_secs(20)],
        drain: Duration::from_secs(2),
    };
}

impl Default for Times {
    fn default() -> Self {
        Self::USUAL
    }
}

/// Limits of a worker's time and output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkerLimits {
    /// Longest time for the task.
    pub deadline_s: f64,
    /// Longest time without a heartbeat.
    pub silence_s: f64,
    /// Longest log, kibibytes.
    pub log_max_kib: u32,
    /// Waiting times.
    pub times: Times,
}

/// Reports of a running worker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard<'a> {
    /// First: its process.
    Started(&'a ProcessIdentity),
    /// A complete line; no pieces.
    Line(&'a Line),
}

/// Has `task` done by its own process, and waits for its end.
///
/// * `program` – areograph
/// * `log` – a new file for the worker's standard error; its folder exists
/// * `cancel` – a reason asks the worker to stop; it is ended by force if it does not
/// * `heard` – receives reports of the worker at once
///
/// Returns when the process has ended. A process in uninterruptible sleep in the kernel cannot be ended; the call then
/// waits for it.
pub async fn work(
    program: &Path,
    task: &Task,
    limits: &WorkerLimits,
    log: &Path,
    cancel: watch::Receiver<Option<CancelWhy>>,
    heard: impl FnMut(Heard<'_>) + Send,
) -> Ended {
    work_at(program, None, task, limits, log, cancel, heard).await
}

/// As [`work`], on a node of a cluster if `srun` states its resources.
///
/// The worker may wait in the queue of the cluster for any time: its limits apply from its hello on.
pub async fn work_at(
    program: &Path,
    srun: Option<&Srun>,
    task: &Task,
    limits: &WorkerLimits,
    log: &Path,
    mut cancel: watch::Receiver<Option<CancelWhy>>,
    mut heard: impl FnMut(Heard<'_>) + Send,
) -> Ended {
    let mut worker = match Worker::start(program, srun, task.memory_mib, limits, log).await {
        Ok(worker) => worker,
        Err(error) => {
            return Ended {
                how: How::NotStarted(error.to_string()),
                answer: None,
                rss_peak_kib: 0,
            };
        }
    };
    if let Some(process) = &worker.process {
        heard(Heard::Started(process));
    }
    // A worker that reads no task sends no hello.
    worker.say(task).await;
    let status = loop {
        let next = worker.next_instant();
        tokio::select! {
            line = worker.lines.next(), if worker.speaks => match line {
                Ok(Some(line)) => {
                    worker.take(&line);
                    heard(Heard::Line(&line));
                }
                Ok(None) => worker.speaks = false,
                Err(garbled) => worker.garbled(&garbled),
            },
            why = asked(&mut cancel), if worker.ending.is_none() => {
                worker.cancel(why).await;
            }
            () = sleep_until(next) => worker.wake().await,
            status = &mut worker.exit => break status.ok().flatten(),
        }
    };
    worker.finish(status, &mut heard).await
}

/// Waits for a reason.
async fn asked(cancel: &mut watch::Receiver<Option<CancelWhy>>) -> CancelWhy {
    match cancel.wait_for(Option::is_some).await.map(|why| *why) {
        Ok(Some(why)) => why,
        // No sender is left.
        _ => pending().await,
    }
}

/// A running worker.
struct Worker {
    pid: u32,
    process: Option<ProcessIdentity>,
    /// Of a worker on a node.
    srun: Option<Srun>,
    times: Times,
    input: Option<ChildStdin>,
    lines: LineReader<BufReader<ChildStdout>>,
    /// Whether its standard output is open and valid.
    speaks: bool,
    log: JoinHandle<std::io::Result<bool>>,
    memory_mib: u32,
    exit: JoinHandle<Option<ExitStatus>>,
    log_path: PathBuf,
    hello: bool,
    hello_by: Instant,
    silence: Duration,
    heard_at: Instant,
    longest: Duration,
    deadline: Instant,
    /// When the lease of a worker on a node is renewed.
    renew_at: Instant,
    ending: Option<Ending>,
    answer: Option<Result<Answer, Failure>>,
    rss_peak_kib: u64,
}

/// Reason why a worker is being ended, and since when.
struct Ending {
    how: How,
    since: Instant,
    /// Signals that were sent.
    sent: usize,
}

impl Worker {
    async fn start(
        program: &Path,
        srun: Option<&Srun>,
        memory_mib: u32,
        limits: &WorkerLimits,
        log: &Path,
    ) -> std::io::Result<Self> {
        let mut child = fork(program, srun).await?;
        let pid = child.id();
        let (input, output, errors) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take());
        // Before it is waited for, its process number cannot be reused.
        let process = ProcessIdentity::of(pid);
        let exit = tokio::task::spawn_blocking(move || child.wait().ok());
        let output = output.ok_or(std::io::ErrorKind::BrokenPipe)?;
        let errors = errors.ok_or(std::io::ErrorKind::BrokenPipe)?;
        let errors = ChildStderr::from_std(errors)?;
        let (log_path, max_kib) = (log.to_owned(), limits.log_max_kib);
        let now = Instant::now();
        let after = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        Ok(Self {
            pid,
            process,
            srun: srun.cloned(),
            times: limits.times,
            input: input.map(ChildStdin::from_std).transpose()?,
            lines: LineReader::new(BufReader::new(ChildStdout::from_std(output)?)),
            speaks: true,
            log: {
                let path = log_path.clone();
                tokio::spawn(async move { log::copy(errors, &path, max_kib).await })
            },
            memory_mib,
            exit,
            log_path: log_path.clone(),
            hello: false,
            hello_by: now + limits.times.hello,
            silence: after(limits.silence_s),
            heard_at: now,
            longest: after(limits.deadline_s),
            deadline: far(now, after(limits.deadline_s)),
            renew_at: now,
            ending: None,
            answer: None,
            rss_peak_kib: 0,
        })
    }

    /// Writes a line to the worker; only its own lines show whether it is read.
    async fn say(&mut self, what: &impl serde::Serialize) {
        let Some(input) = &mut self.input else { return };
        let Ok(mut line) = serde_json::to_vec(what) else {
            return;
        };
        line.push(b'\n');
        // A hanging worker does not read: its pipe must not block the service.
        let _ = timeout(self.times.drain, input.write_all(&line)).await;
    }

    /// Asks the worker to stop; one that has not begun is ended at once.
    async fn cancel(&mut self, why: CancelWhy) {
        if self.srun.is_some() && !self.hello {
            return self.end_at_once(How::Cancelled);
        }
        self.say(&Cancel { cancel: why }).await;
        self.end(How::Cancelled, Instant::now());
    }

    fn take(&mut self, line: &Line) {
        self.heard_at = Instant::now();
        match line {
            Line::Hello { v, version, .. } => {
                self.hello = true;
                if self.srun.is_some() {
                    self.deadline = far(self.heard_at, self.longest);
                    self.renew_at = self.heard_at;
                }
                if *v != PROTOCOL || version != env!("CARGO_PKG_VERSION") {
                    self.end_at_once(How::ForeignVersion(version.clone()));
                }
            }
            _ if !self.hello => {
                let garbled = "the first line does not identify the worker".to_owned();
                self.end_at_once(How::Garbled(garbled));
            }
            Line::Beat { rss_kib } => self.rss_peak_kib = self.rss_peak_kib.max(*rss_kib),
            Line::Answer(answer) => self.answer = Some(Ok(answer.clone())),
            Line::Failure(failure) => self.answer = Some(Err(failure.clone())),
            Line::Stage { .. } | Line::Piece { .. } => {}
        }
    }

    fn garbled(&mut self, garbled: &Garbled) {
        self.speaks = false;
        self.end_at_once(How::Garbled(garbled.to_string()));
    }

    /// Begins to end the worker, unless that has begun.
    fn end(&mut self, how: How, since: Instant) {
        self.ending.get_or_insert(Ending {
            how,
            since,
            sent: 0,
        });
    }

    /// Ends the worker without waiting for a graceful stop.
    fn end_at_once(&mut self, how: How) {
        let now = Instant::now();
        self.end(how, now.checked_sub(self.times.patience[0]).unwrap_or(now));
    }

    /// The next instant with a due action, independent of messages.
    fn next_instant(&self) -> Instant {
        if let Some(ending) = &self.ending {
            let patience = self.times.patience.get(ending.sent).copied();
            return far(ending.since, patience.unwrap_or(Duration::MAX));
        }
        let silent = far(self.heard_at, self.silence);
        let next = silent.min(self.deadline);
        match (self.hello, self.srun.is_some()) {
            (true, true) => next.min(self.renew_at),
            (true, false) => next,
            (false, false) => next.min(self.hello_by),
            // It waits in the queue of the cluster.
            (false, true) => far(self.heard_at, Duration::MAX),
        }
    }

    /// Performs the actions due at this instant.
    async fn wake(&mut self) {
        let now = Instant::now();
        if let Some(ending) = &mut self.ending {
            if now < far(ending.since, self.times.patience[ending.sent.min(1)]) {
                return;
            }
            let signal = [Signal::TERM, Signal::KILL][ending.sent.min(1)];
            signal_group(self.pid, signal);
            ending.sent += 1;
        } else if self.srun.is_some() && !self.hello {
            // It waits in the queue of the cluster.
        } else if !self.hello && now >= self.hello_by {
            self.end_at_once(How::NoHello);
        } else if now >= self.deadline {
            self.say(&Cancel {
                cancel: CancelWhy::Deadline,
            })
            .await;
            self.end(How::DeadlinePassed, now);
        } else if now >= far(self.heard_at, self.silence) {
            self.end_at_once(How::Silent);
        } else if self.srun.is_some() && now >= self.renew_at {
            self.renew_at = far(now, self.silence / RENEWALS);
            self.say(&Here { here: true }).await;
        }
    }

    /// Collects the remaining messages of an ended worker, and its result.
    async fn finish(
        mut self,
        status: Option<ExitStatus>,
        heard: &mut (impl FnMut(Heard<'_>) + Send),
    ) -> Ended {
        drop(self.input.take());
        let drain = self.times.drain;
        let rest = async {
            while self.speaks {
                match self.lines.next().await {
                    Ok(Some(line)) => {
                        self.take(&line);
                        heard(Heard::Line(&line));
                    }
                    Ok(None) => self.speaks = false,
                    Err(garbled) => self.garbled(&garbled),
                }
            }
        };
        let _ = timeout(drain, rest).await;
        let mut refused_memory = false;
        match timeout(drain, &mut self.log).await {
            Ok(Ok(Ok(refused))) => refused_memory = refused,
            // The pipe is still open elsewhere, or the disk is full: the written part of the log is kept.
            Err(_) => self.log.abort(),
            Ok(failed) => tracing::warn!("the log of a worker was not kept: {failed:?}"),
        }
        // Processes started by the worker end with it.
        signal_group(self.pid, Signal::KILL);
        if let Some(srun) = &self.srun
            && status.is_none_or(|status| status.code().is_none())
        {
            srun::cancel(&srun.job_name);
        }
        let answered = matches!(self.answer, Some(Ok(_)));
        let how = match self.ending {
            Some(ending) if !answered => ending.how,
            _ if self.srun.is_some() => match exited_on_node(status) {
                How::Exited(_) if !self.hello => How::NotStarted(last_lines(&self.log_path).await),
                how => how,
            },
            _ if !self.hello => How::NoHello,
            _ => exited(status),
        };
        if refused_memory && self.answer.is_none() && matches!(how, How::Signalled(_)) {
            self.answer = Some(Err(out_of_memory(self.memory_mib)));
        }
        Ended {
            how,
            answer: self.answer,
            rss_peak_kib: self.rss_peak_kib,
        }
    }
}

/// A later instant, or the latest useful one.
fn far(from: Instant, later: Duration) -> Instant {
    const YEAR: Duration = Duration::from_hours(366 * 24);
    from + later.min(YEAR)
}
