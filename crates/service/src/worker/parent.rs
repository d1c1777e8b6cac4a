//! The service's side of one worker process: it is started, fed with its task, listened to, ended in time and waited for.

use std::{future::pending, path::Path, process::ExitStatus, time::Duration};

use rustix::process::Signal;
use tokio::{
    io::{AsyncWriteExt as _, BufReader},
    process::{ChildStderr, ChildStdin, ChildStdout},
    sync::watch,
    task::JoinHandle,
    time::{Instant, sleep_until, timeout},
};

use super::{
    fork::fork,
    lines::{Garbled, LineReader},
    log,
    process::{ProcessIdentity, signal_group},
    protocol::{Answer, Cancel, CancelWhy, Failure, Line, PROTOCOL, Task},
};

/// How long the service's side waits for a process, whatever its task is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// How long a worker may take to say hello.
    pub hello: Duration,
    /// When a worker that was asked to stop gets a signal to do so, and when it is ended; both since it was asked.
    pub patience: [Duration; 2],
    /// How long the pipes of a worker that has ended may stay open.
    pub drain: Duration,
}

impl Times {
    /// Those of the service.
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

/// How long a worker may take, and how much it may say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkerLimits {
    /// Longest time for the task.
    pub deadline_s: f64,
    /// Longest time without a sign of life.
    pub silence_s: f64,
    /// Longest log, kibibytes.
    pub log_max_kib: u32,
    /// How long it is waited for.
    pub times: Times,
}

/// What is heard of a worker while it lives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard<'a> {
    /// First: which process it is.
    Started(&'a ProcessIdentity),
    /// A line, whole; no pieces.
    Line(&'a Line),
}

/// How a worker came to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum How {
    /// By itself, with this code.
    Exited(i32),
    /// By a signal that the service did not send.
    Signalled(i32),
    /// Ended: no sign of life for too long.
    Silent,
    /// Ended: the task took too long.
    DeadlinePassed,
    /// Ended: the caller wanted it.
    Cancelled,
    /// Ended, or gone by itself: it never said hello.
    NoHello,
    /// Ended: it is of this version, which is not the service's.
    ForeignVersion(String),
    /// Ended: it said something that no worker says.
    Garbled(String),
    /// It could not be started, for this reason.
    NotStarted(String),
}

/// What came of a worker.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// How it came to its end; an answer counts, however that was.
    pub how: How,
    /// Its last line.
    pub answer: Option<Result<Answer, Failure>>,
    /// Most memory that it told of, kibibytes.
    pub rss_peak_kib: u64,
}

/// Has `task` done by a process of its own, and waits for its end.
///
/// * `program` – areograph
/// * `log` – a new file for what the worker writes to standard error; its folder is there
/// * `cancel` – a reason asks the worker to stop; it is ended by force when it does not
/// * `heard` – told at once what is heard of the worker
///
/// Returns when the process has ended. One that sleeps uninterruptibly in the kernel cannot be ended; then that takes as
/// long as it does.
pub async fn work(
    program: &Path,
    task: &Task,
    limits: &WorkerLimits,
    log: &Path,
    mut cancel: watch::Receiver<Option<CancelWhy>>,
    mut heard: impl FnMut(Heard<'_>) + Send,
) -> Ended {
    let mut worker = match Worker::start(program, limits, log).await {
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
    // A worker that reads no task says no hello.
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
                worker.say(&Cancel { cancel: why }).await;
                worker.end(How::Cancelled, Instant::now());
            }
            () = sleep_until(next) => worker.wake().await,
            status = &mut worker.exit => break status.ok().flatten(),
        }
    };
    worker.finish(status, &mut heard).await
}

/// The reason once there is one.
async fn asked(cancel: &mut watch::Receiver<Option<CancelWhy>>) -> CancelWhy {
    match cancel.wait_for(Option::is_some).await.map(|why| *why) {
        Ok(Some(why)) => why,
        // Nobody is left who could ask.
        _ => pending().await,
    }
}

/// A worker at work.
struct Worker {
    pid: u32,
    process: Option<ProcessIdentity>,
    times: Times,
    input: Option<ChildStdin>,
    lines: LineReader<BufReader<ChildStdout>>,
    /// Whether its standard output is open, and makes sense.
    speaks: bool,
    log: JoinHandle<std::io::Result<()>>,
    exit: JoinHandle<Option<ExitStatus>>,
    hello: bool,
    hello_by: Instant,
    silence: Duration,
    heard_at: Instant,
    deadline: Instant,
    ending: Option<Ending>,
    answer: Option<Result<Answer, Failure>>,
    rss_peak_kib: u64,
}

/// Why a worker is being ended, and since when.
struct Ending {
    how: How,
    since: Instant,
    /// Signals that were sent.
    sent: usize,
}

impl Worker {
    async fn start(program: &Path, limits: &WorkerLimits, log: &Path) -> std::io::Result<Self> {
        let mut child = fork(program).await?;
        let pid = child.id();
        let (input, output, errors) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take());
        // Before somebody waits for it, its number is its own.
        let process = ProcessIdentity::of(pid);
        let exit = tokio::task::spawn_blocking(move || child.wait().ok());
        let output = output.ok_or(std::io::ErrorKind::BrokenPipe)?;
        let errors = errors.ok_or(std::io::ErrorKind::BrokenPipe)?;
        let errors = ChildStderr::from_std(errors)?;
        let (log, max_kib) = (log.to_owned(), limits.log_max_kib);
        let now = Instant::now();
        let after = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        Ok(Self {
            pid,
            process,
            times: limits.times,
            input: input.map(ChildStdin::from_std).transpose()?,
            lines: LineReader::new(BufReader::new(ChildStdout::from_std(output)?)),
            speaks: true,
            log: tokio::spawn(async move { log::copy(errors, &log, max_kib).await }),
            exit,
            hello: false,
            hello_by: now + limits.times.hello,
            silence: after(limits.silence_s),
            heard_at: now,
            deadline: far(now, after(limits.deadline_s)),
            ending: None,
            answer: None,
            rss_peak_kib: 0,
        })
    }

    /// Writes a line to the worker; whether it reads it, its own lines will tell.
    async fn say(&mut self, what: &impl serde::Serialize) {
        let Some(input) = &mut self.input else { return };
        let Ok(mut line) = serde_json::to_vec(what) else {
            return;
        };
        line.push(b'\n');
        // A worker that hangs does not read: its pipe must not hold the service.
        let _ = timeout(self.times.drain, input.write_all(&line)).await;
    }

    fn take(&mut self, line: &Line) {
        self.heard_at = Instant::now();
        match line {
            Line::Hello { v, version, .. } => {
                self.hello = true;
                if *v != PROTOCOL || version != env!("CARGO_PKG_VERSION") {
                    self.end_at_once(How::ForeignVersion(version.clone()));
                }
            }
            _ if !self.hello => {
                let garbled = "its first line is not a hello".to_owned();
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

    /// The same without waiting for the worker to stop by itself.
    fn end_at_once(&mut self, how: How) {
        let now = Instant::now();
        self.end(how, now.checked_sub(self.times.patience[0]).unwrap_or(now));
    }

    /// When there is something to do, whatever is heard.
    fn next_instant(&self) -> Instant {
        if let Some(ending) = &self.ending {
            let patience = self.times.patience.get(ending.sent).copied();
            return far(ending.since, patience.unwrap_or(Duration::MAX));
        }
        let silent = far(self.heard_at, self.silence);
        let next = silent.min(self.deadline);
        if self.hello {
            next
        } else {
            next.min(self.hello_by)
        }
    }

    /// Does what is due at this instant.
    async fn wake(&mut self) {
        let now = Instant::now();
        if let Some(ending) = &mut self.ending {
            if now < far(ending.since, self.times.patience[ending.sent.min(1)]) {
                return;
            }
            let signal = [Signal::TERM, Signal::KILL][ending.sent.min(1)];
            signal_group(self.pid, signal);
            ending.sent += 1;
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
        }
    }

    /// The worker is gone: what it still said, and what came of it.
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
        match timeout(drain, &mut self.log).await {
            Ok(Ok(Ok(()))) => {}
            // The pipe is still open somewhere, or the disk is full: what is written of the log stays.
            Err(_) => self.log.abort(),
            Ok(failed) => tracing::warn!("the log of a worker was not kept: {failed:?}"),
        }
        // Whatever the worker may have started goes with it.
        signal_group(self.pid, Signal::KILL);
        let answered = matches!(self.answer, Some(Ok(_)));
        let how = match self.ending {
            Some(ending) if !answered => ending.how,
            _ if !self.hello => How::NoHello,
            _ => exited(status),
        };
        Ended {
            how,
            answer: self.answer,
            rss_peak_kib: self.rss_peak_kib,
        }
    }
}

fn exited(status: Option<ExitStatus>) -> How {
    use std::os::unix::process::ExitStatusExt as _;
    let code = status.and_then(|status| status.code()).map(How::Exited);
    let signal = status.and_then(|status| status.signal());
    code.or(signal.map(How::Signalled))
        .unwrap_or(How::Exited(-1))
}

/// An instant so much later, or as late as there is one worth waiting for.
fn far(from: Instant, later: Duration) -> Instant {
    const YEAR: Duration = Duration::from_hours(366 * 24);
    from + later.min(YEAR)
}
