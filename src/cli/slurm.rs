//! Array tasks of Slurm.
//!
//! A task file states the work of a task, and the task writes a result file, which is renamed into place when it is complete.
//! This file alone states that a task is done: `squeue` may list a task of a lost node for minutes, and Slurm may run a task
//! twice. Tasks that left the queue without a result are lost; the caller submits their work again, with twice the memory.

use std::{
    cell::Cell,
    collections::{BTreeMap, BTreeSet},
    fs,
    os::unix::process::CommandExt as _,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use serde::{Serialize, de::DeserializeOwned};

use crate::{
    cli::stop::Signals,
    error::{Cause, IoError, Locate as _, Result, Stopped},
    store::atomic,
};

/// Submissions of work.
pub(super) const ATTEMPTS: u32 = 3;
/// Folder of task and result files below that of the products.
const TASKS: &str = ".tasks";
/// File with the identifier of the submitted job.
const JOB: &str = "job";
/// Ending of a result file; its name begins as that of the task file.
const RESULT: &str = "result.json";
/// Interval between questions about the queue.
const POLL: Duration = Duration::from_secs(2);
/// A task has left the queue for this time before its result counts as lost: a result file on a shared file system may appear
/// later than the end of its task.
const SETTLED: Duration = Duration::from_secs(10);
/// The controller of the cluster may not answer for this time.
const SILENT: Duration = Duration::from_mins(30);
/// Largest index of an array that clusters accept by default is 1000.
const ARRAY_MAX: usize = 1_000;

/// Faults of the cluster.
#[derive(Debug, thiserror::Error, Cause)]
enum SlurmError {
    #[error("cannot start {program}: {source}")]
    #[cause(Io: "install Slurm on this machine, or choose the executor \"local\"")]
    NoProgram {
        program: &'static str,
        source: std::io::Error,
    },
    #[error("{program} failed: {text}")]
    #[cause(Io: "check the cluster and the options of the executor; run again: finished work is kept")]
    Refused { program: &'static str, text: String },
    #[error("sbatch answered {0:?}; expected the identifier of a job")]
    #[cause(Io: "remove options that change the answer of sbatch from the options of the executor")]
    NoJob(String),
    #[error("the cluster has not answered for {} minutes: {text}", SILENT.as_secs() / 60)]
    #[cause(Io: "check the controller of the cluster; run again: finished work is kept")]
    Silent { text: String },
}

/// A task file that this version did not write.
#[derive(Debug, thiserror::Error, Cause)]
#[error("this file is not a task that areograph wrote: {0}")]
#[cause(Configuration: "task files are written by commands that submit tasks, such as `areograph campaign`")]
struct NoTask(serde_json::Error);

/// Resources of a task.
#[derive(Debug, Clone, Copy)]
pub(super) struct Resources<'a> {
    /// Largest number of tasks that run at the same time; `None` leaves it to the cluster.
    pub(super) tasks_max: Option<u32>,
    /// Memory of a task at the first attempt, megabytes.
    pub(super) memory_mb: u32,
    /// Time limit of a task.
    pub(super) minutes: u32,
    /// CPUs of a task; `None` leaves it to the cluster.
    pub(super) threads: Option<u16>,
    /// Further options of sbatch.
    pub(super) options: &'a [String],
}

/// The cluster, as one command uses it.
#[derive(Debug)]
pub(super) struct Cluster<'a> {
    /// The end of the name of its jobs.
    name: &'a str,
    /// Hidden command that carries out a task file.
    command: &'static str,
    /// Folder of task and result files.
    folder: PathBuf,
    resources: Resources<'a>,
    /// Arrays submitted so far: the names of their files differ.
    submitted: Cell<u32>,
    /// Whether it refused work that was submitted again: it gets no more.
    refused: Cell<bool>,
}

impl<'a> Cluster<'a> {
    /// Cancels the job of an earlier command that was killed, and empties the folder of tasks.
    ///
    /// * `out` – absolute path of the folder of the products, which the caller has locked
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(super) fn begin(
        name: &'a str,
        command: &'static str,
        out: &Path,
        resources: Resources<'a>,
    ) -> Result<Self> {
        let cluster = Self {
            name,
            command,
            folder: out.join(TASKS),
            resources,
            submitted: Cell::new(0),
            refused: Cell::new(false),
        };
        if let Ok(job) = fs::read_to_string(cluster.folder.join(JOB)) {
            cluster.cancel(job.trim());
        }
        cluster.clear()?;
        fs::create_dir_all(&cluster.folder)
            .map_err(IoError::on("create the folder"))
            .in_file(&cluster.folder)?;
        Ok(cluster)
    }

    /// Folder of task files, results and logs.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Removes the folder of tasks.
    ///
    /// # Errors
    /// A file cannot be removed.
    pub(super) fn end(&self) -> Result<()> {
        self.clear()?;
        // A file of somebody else keeps it.
        let _ = fs::remove_dir(&self.folder);
        Ok(())
    }

    /// Submits tasks and waits for them; returns the results by the number of their task. Lost tasks have none. From the second
    /// attempt on, tasks that the cluster refuses have none either, as when no node has twice the memory; nothing is submitted then.
    ///
    /// * `attempt` – from 1: each doubles the memory
    /// * `read` – the result of a task from the content of its file; `None` for the result of another task
    /// * `heard` – receives the results so far
    ///
    /// # Errors
    /// A cluster that refuses the job at the first attempt or does not answer; interruption. The job is then cancelled.
    pub(super) fn attempt<T: Serialize, R>(
        &self,
        attempt: u32,
        tasks: &[T],
        stop: &AtomicBool,
        read: impl Fn(&T, &[u8]) -> Option<R>,
        heard: impl Fn(&BTreeMap<usize, R>),
    ) -> Result<BTreeMap<usize, R>> {
        let mut results = BTreeMap::new();
        for (array, tasks) in tasks.chunks(ARRAY_MAX).enumerate() {
            if self.refused.get() {
                break;
            }
            let files = self.write(tasks)?;
            let job = match self.submit(attempt, tasks.len()) {
                Ok(job) => job,
                Err(failure) if attempt > 1 => {
                    Stopped::check(stop)?;
                    tracing::warn!("tasks that were lost cannot be submitted again: {failure}");
                    self.refused.set(true);
                    break;
                }
                Err(failure) => return Err(failure),
            };
            let waited = Self::wait(&job, tasks.len(), stop, |number| {
                let place = array * ARRAY_MAX + number;
                if !results.contains_key(&place)
                    && let Ok(bytes) = fs::read(&files[number])
                    && let Some(result) = read(&tasks[number], &bytes)
                {
                    results.insert(place, result);
                    heard(&results);
                }
                results.contains_key(&place)
            });
            if let Err(failure) = waited {
                self.cancel(&job);
                return Err(failure);
            }
        }
        Ok(results)
    }

    /// Removes the files of tasks; others remain.
    fn clear(&self) -> Result<()> {
        let is_own = |name: &str| {
            let (numbers, ending) = name.split_once('.').unwrap_or((name, ""));
            let is_number =
                |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
            name == JOB
                || ["json", RESULT, "log"].contains(&ending)
                    && numbers
                        .split_once('-')
                        .is_some_and(|(array, task)| is_number(array) && is_number(task))
        };
        let Ok(entries) = fs::read_dir(&self.folder) else {
            return Ok(());
        };
        for entry in entries.flatten() {
            if entry.file_name().to_str().is_some_and(is_own) {
                let path = entry.path();
                fs::remove_file(&path)
                    .map_err(IoError::on("remove"))
                    .in_file(&path)?;
            }
        }
        Ok(())
    }

    /// The name of its jobs.
    fn job_name(&self) -> String {
        format!("areograph-{}", self.name)
    }

    /// Writes the files of the tasks of the next array, `<array>-<number>.json`; returns the paths of their results.
    fn write<T: Serialize>(&self, tasks: &[T]) -> Result<Vec<PathBuf>> {
        let array = self.submitted.get() + 1;
        self.submitted.set(array);
        let tasks = tasks.iter().enumerate().map(|(number, task)| {
            let path = self.folder.join(format!("{array}-{number}.json"));
            let text = serde_json::to_vec(task).map_err(|error| IoError {
                action: "write",
                source: error.into(),
            });
            atomic::write(&path, &text.in_file(&path)?)?;
            Ok(path.with_extension(RESULT))
        });
        tasks.collect()
    }

    /// Submits the tasks that were written last, as an array, and returns its identifier.
    fn submit(&self, attempt: u32, tasks: usize) -> Result<String> {
        let program = std::env::current_exe().map_err(IoError::on("find the program"))?;
        let of = &self.resources;
        let limit = of.tasks_max;
        let limit = limit.map_or_else(String::new, |most| format!("%{most}"));
        let memory_mb = u64::from(of.memory_mb) << (attempt - 1);
        let (folder, array) = (self.folder.display(), self.submitted.get());
        let threads = of.threads;
        let mut sbatch = Command::new("sbatch");
        // A signal of the terminal does not reach it: the job must not exist without its number here.
        sbatch.process_group(0);
        // The last of equal options counts: the user's are first.
        sbatch
            .args(of.options)
            .arg("--parsable")
            .arg(format!("--job-name={}", self.job_name()))
            .arg(format!("--array=0-{}{limit}", tasks - 1))
            .arg(format!("--mem={memory_mb}M"))
            .arg(format!("--time={}", of.minutes))
            .args(threads.map(|threads| format!("--cpus-per-task={threads}")))
            .arg(format!("--output={folder}/{array}-%a.log"))
            .arg(format!(
                "--wrap=exec {} {} {}\"$SLURM_ARRAY_TASK_ID\".json",
                quoted(&program),
                self.command,
                quoted(&self.folder.join(format!("{array}-"))),
            ));
        let answer = answer_of("sbatch", &mut sbatch)?;
        let job = answer.trim().split(';').next().unwrap_or_default();
        if !is_job(job) {
            return Err(SlurmError::NoJob(answer).into());
        }
        if let Err(failure) = atomic::write(&self.folder.join(JOB), job.as_bytes()) {
            self.cancel(job);
            return Err(failure);
        }
        Ok(job.to_owned())
    }

    /// Waits until every task has a result or has left the queue.
    ///
    /// * `has_result` – looks for the result of a task
    fn wait(
        job: &str,
        tasks: usize,
        stop: &AtomicBool,
        mut has_result: impl FnMut(usize) -> bool,
    ) -> Result<()> {
        let mut gone_since: BTreeMap<usize, Instant> = BTreeMap::new();
        let mut answered = Instant::now();
        loop {
            Stopped::check(stop)?;
            let queued = match Self::queued(job) {
                Ok(queued) => {
                    answered = Instant::now();
                    Some(queued)
                }
                Err(failure) if answered.elapsed() > SILENT => {
                    let text = failure.to_string();
                    return Err(SlurmError::Silent { text }.into());
                }
                Err(_) => None,
            };
            // Read after the question: a task that had left the queue had written its result before.
            let unfinished: Vec<usize> = (0..tasks).filter(|task| !has_result(*task)).collect();
            let is_lost = |task: &usize| {
                let left = gone_since.get(task);
                left.is_some_and(|since| since.elapsed() > SETTLED)
            };
            if unfinished.iter().all(is_lost) {
                return Ok(());
            }
            if let Some(queued) = queued {
                for task in unfinished {
                    if queued.contains(&task) {
                        gone_since.remove(&task);
                    } else {
                        gone_since.entry(task).or_insert_with(Instant::now);
                    }
                }
            }
            pause(stop);
        }
    }

    /// The tasks of a job that are in the queue, waiting or running.
    ///
    /// After a failure of its controller, Slurm may start a task that is running already, and then holds the task until
    /// somebody releases it: held tasks are released.
    fn queued(job: &str) -> Result<BTreeSet<usize>> {
        let mut squeue = Command::new("squeue");
        squeue.args(["--noheader", "--array", "--format=%K %r", "--me"]);
        squeue.arg(format!("--jobs={job}"));
        let answer = match answer_of("squeue", &mut squeue) {
            Ok(answer) => answer,
            // Slurm forgets a job some minutes after its end.
            Err(failure) if failure.to_string().contains("Invalid job id") => String::new(),
            Err(failure) => return Err(failure),
        };
        let mut queued = BTreeSet::new();
        for line in answer.lines() {
            let (number, reason) = line.trim().split_once(' ').unwrap_or((line.trim(), ""));
            let Ok(task) = number.parse() else { continue };
            queued.insert(task);
            if reason.to_ascii_lowercase().contains("held") {
                let mut release = Command::new("scontrol");
                release.args(["release", &format!("{job}_{task}")]);
                // The next question tries again.
                let _ = answer_of("scontrol", &mut release);
            }
        }
        Ok(queued)
    }

    /// Cancels a job, and waits until its tasks have left the queue. A cluster that does not answer is left alone: tasks that
    /// still run do not disturb later ones.
    fn cancel(&self, job: &str) {
        // The number of a job alone may be that of somebody else, on another cluster or after a restart.
        let mut scancel = Command::new("scancel");
        scancel.arg("--me");
        scancel.arg(format!("--name={}", self.job_name())).arg(job);
        if !is_job(job) || answer_of("scancel", &mut scancel).is_err() {
            return;
        }
        let begun = Instant::now();
        while begun.elapsed() < 6 * SETTLED
            && Self::queued(job).is_ok_and(|queued| !queued.is_empty())
        {
            thread::sleep(POLL);
        }
    }
}

/// Carries out a task file, in the process of the task, and writes the result file.
///
/// # Errors
/// A file that is not a task file; those of the work; a result that cannot be written.
pub(super) fn carry_out<T: DeserializeOwned, R: Serialize>(
    file: &Path,
    work: impl FnOnce(T, &AtomicBool) -> Result<R>,
) -> Result<()> {
    let bytes = fs::read(file).map_err(IoError::on("read")).in_file(file)?;
    let task: T = serde_json::from_slice(&bytes)
        .map_err(NoTask)
        .in_file(file)?;
    let signals = Signals::heard()?;
    let result = work(task, signals.stop())?;
    let path = file.with_extension(RESULT);
    let text = serde_json::to_vec(&result).map_err(|error| IoError {
        action: "write",
        source: error.into(),
    });
    atomic::write(&path, &text.in_file(&path)?)
}

/// Sleeps until the next question, or until the command is stopped.
fn pause(stop: &AtomicBool) {
    const STEP: Duration = Duration::from_millis(100);
    let begun = Instant::now();
    while begun.elapsed() < POLL && !stop.load(Ordering::Relaxed) {
        thread::sleep(STEP);
    }
}

fn is_job(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Standard output of a program of Slurm.
fn answer_of(program: &'static str, command: &mut Command) -> Result<String> {
    let output = command
        .output()
        .map_err(|source| SlurmError::NoProgram { program, source })?;
    if !output.status.success() {
        let text = match String::from_utf8_lossy(&output.stderr).trim() {
            "" => output.status.to_string(),
            text => text.to_owned(),
        };
        return Err(SlurmError::Refused { program, text }.into());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A path as one word of a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.to_string_lossy().replace('\'', "'\\''"))
}
