//! Sites of a campaign as array tasks of Slurm.
//!
//! Some sites are one task: a task file names their site files, and the task writes a result file, which is renamed into place
//! when it is complete. This file alone states that a task is done: `squeue` may list a task of a lost node for minutes, and
//! Slurm may run a task twice. The lock of each site keeps two tasks from working on it at the same time. Tasks that left the
//! queue without a result are submitted again, with twice the memory.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use crate::{
    cli::{progress::Progress, stop::Signals},
    config::{ExecutorConfig, absolute},
    error::{Cause, Error, IoError, Kind, Locate as _, Result, Stopped},
    flow::{Campaign, Costs, SiteEnd, SiteTask},
    store::atomic,
    watch::Count,
};

/// Folder of task and result files below that of the products.
const TASKS: &str = ".campaign-tasks";
/// File with the identifier of the submitted job.
const JOB: &str = "job";
/// Submissions of a task.
const ATTEMPTS: u32 = 3;
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
    #[cause(Io: "install Slurm on this machine, or set executor.kind = \"local\"")]
    NoProgram {
        program: &'static str,
        source: std::io::Error,
    },
    #[error("{program} failed: {text}")]
    #[cause(Io: "check the cluster and executor.options; run again: finished sites are kept")]
    Refused { program: &'static str, text: String },
    #[error("sbatch answered {0:?}; expected the identifier of a job")]
    #[cause(Io: "remove options that change the answer of sbatch from executor.options")]
    NoJob(String),
    #[error("the cluster has not answered for {} minutes: {text}", SILENT.as_secs() / 60)]
    #[cause(Io: "check the controller of the cluster; run again: finished sites are kept")]
    Silent { text: String },
    #[error("{ATTEMPTS} tasks with this site ended without a result; see the logs in {}", .0.display())]
    #[cause(Io: "raise executor.memory_mb or executor.minutes, or lower executor.sites_per_task")]
    NoResult(PathBuf),
}

/// Runs the sites as tasks; they are returned in their order.
///
/// # Errors
/// Site files that cannot be written; a cluster that refuses the job or does not answer; interruption, after which the job is
/// cancelled.
pub(super) fn run_sites(campaign: &Campaign, sites: &[usize], out: &Path) -> Result<Vec<SiteEnd>> {
    let signals = Signals::heard()?;
    let cluster = Cluster {
        settings: &campaign.config.executor,
        name: &campaign.config.campaign,
        folder: absolute(out)?.join(TASKS),
        out: absolute(out)?,
        minutes: minutes(campaign, Costs::read(out)),
    };
    cluster.begin()?;
    let mut files: BTreeMap<&str, PathBuf> = BTreeMap::new();
    let mut ended: BTreeMap<String, SiteEnd> = BTreeMap::new();
    for site in sites.iter().map(|number| &campaign.sites[*number]) {
        match campaign.write_site_file(site, &cluster.out) {
            Ok(path) => {
                files.insert(&site.id, path);
            }
            Err(failure) => {
                ended.insert(site.id.clone(), SiteEnd::failed(&site.id, &failure));
            }
        }
    }
    let progress = Progress::of_work(cluster.name);
    for attempt in 1..=ATTEMPTS {
        let left = files.iter().filter(|(id, _)| !ended.contains_key(**id));
        let left: Vec<PathBuf> = left.map(|(_, path)| path.clone()).collect();
        for chunk in left.chunks(cluster.settings.sites_per_task as usize * ARRAY_MAX) {
            let tasks = cluster.write_tasks(attempt, chunk)?;
            let job = cluster.submit(attempt, &tasks)?;
            let already = ended.len();
            let results = Cluster::wait(&job, &tasks, signals.stop(), |done| {
                progress.count(
                    "run",
                    Count {
                        done: (already + done) as u64,
                        all: sites.len() as u64,
                        of: "sites",
                    },
                );
            });
            if let Err(failure) = results {
                cluster.cancel(&job);
                return Err(failure);
            }
            ended.extend(results?.into_iter().map(|of| (of.site.clone(), of)));
        }
    }
    for id in files.into_keys() {
        if !ended.contains_key(id) {
            let failure = Error::from(SlurmError::NoResult(cluster.folder.clone())).in_site(id);
            ended.insert(id.to_owned(), SiteEnd::failed(id, &failure));
        }
    }
    // Logs of failed tasks remain.
    if ended.values().all(|of| of.failure().is_none()) {
        cluster.clear()?;
        // A file of somebody else keeps it.
        let _ = fs::remove_dir(&cluster.folder);
    }
    Ok(ended.into_values().collect())
}

/// Time limit of a task, by the costs of processed sites.
fn minutes(campaign: &Campaign, costs: Option<Costs>) -> u32 {
    const AT_LEAST: u32 = 10;
    const UNKNOWN: u32 = 60;
    const MARGIN: f64 = 10.0;
    let settings = &campaign.config.executor;
    let measured = costs.map(|costs| {
        let images = campaign.sites.iter().map(|site| site.images.len());
        let images = images.max().unwrap_or(1) as f64 * f64::from(settings.sites_per_task);
        let minutes = MARGIN * costs.seconds / costs.images as f64 * images / 60.0;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a bounded time"
        )]
        let minutes = minutes.ceil().min(100_000.0) as u32;
        minutes.max(AT_LEAST)
    });
    settings.minutes.or(measured).unwrap_or(UNKNOWN)
}

/// The cluster, as one campaign uses it.
struct Cluster<'a> {
    settings: &'a ExecutorConfig,
    name: &'a str,
    /// Folder of task and result files.
    folder: PathBuf,
    /// Folder of the products.
    out: PathBuf,
    minutes: u32,
}

impl Cluster<'_> {
    /// Cancels the job of an earlier command that was killed, and empties the folder of tasks.
    fn begin(&self) -> Result<()> {
        if let Ok(job) = fs::read_to_string(self.folder.join(JOB)) {
            self.cancel(job.trim());
        }
        self.clear()?;
        fs::create_dir_all(&self.folder)
            .map_err(IoError::on("create the folder"))
            .in_file(&self.folder)?;
        Ok(())
    }

    /// Removes the files of tasks; others remain.
    fn clear(&self) -> Result<()> {
        let is_own = |name: &str| {
            let (numbers, ending) = name.split_once('.').unwrap_or((name, ""));
            let is_number =
                |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
            name == JOB
                || ["json", "result.json", "log"].contains(&ending)
                    && numbers
                        .split_once('-')
                        .is_some_and(|(attempt, task)| is_number(attempt) && is_number(task))
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

    /// Writes the task files of some sites, `<attempt>-<number>.json`.
    fn write_tasks(&self, attempt: u32, site_files: &[PathBuf]) -> Result<Vec<SiteTask>> {
        let chunks = site_files.chunks(self.settings.sites_per_task as usize);
        let tasks = chunks.enumerate().map(|(number, chunk)| {
            let name = |ending: &str| self.folder.join(format!("{attempt}-{number}.{ending}"));
            let task = SiteTask {
                site_files: chunk.to_vec(),
                out: self.out.clone(),
                result: name("result.json"),
            };
            let path = name("json");
            let text = serde_json::to_vec(&task).map_err(|error| IoError {
                action: "write",
                source: error.into(),
            });
            atomic::write(&path, &text.in_file(&path)?)?;
            Ok(task)
        });
        tasks.collect()
    }

    /// Submits an array of tasks and returns its identifier.
    fn submit(&self, attempt: u32, tasks: &[SiteTask]) -> Result<String> {
        let program = std::env::current_exe().map_err(IoError::on("find the program"))?;
        let limit = self.settings.tasks_max;
        let limit = limit.map_or_else(String::new, |most| format!("%{most}"));
        let memory_mb = u64::from(self.settings.memory_mb) << (attempt - 1);
        let folder = self.folder.display();
        let mut sbatch = Command::new("sbatch");
        sbatch
            .arg("--parsable")
            .arg(format!("--job-name={}", self.job_name()))
            .arg(format!("--array=0-{}{limit}", tasks.len() - 1))
            .arg(format!("--mem={memory_mb}M"))
            .arg(format!("--time={}", self.minutes))
            .arg(format!("--output={folder}/{attempt}-%a.log"))
            .args(&self.settings.options)
            .arg(format!(
                "--wrap=exec {} campaign-task {}\"$SLURM_ARRAY_TASK_ID\".json",
                quoted(&program),
                quoted(&self.folder.join(format!("{attempt}-"))),
            ));
        let answer = answer_of("sbatch", &mut sbatch)?;
        let job = answer.trim().split(';').next().unwrap_or_default();
        if job.is_empty() || !job.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(SlurmError::NoJob(answer).into());
        }
        atomic::write(&self.folder.join(JOB), job.as_bytes())?;
        Ok(job.to_owned())
    }

    /// Waits until every task has a result or has left the queue, and returns the results; sites that were interrupted have
    /// none.
    fn wait(
        job: &str,
        tasks: &[SiteTask],
        stop: &AtomicBool,
        tell: impl Fn(usize),
    ) -> Result<Vec<SiteEnd>> {
        let mut results: BTreeMap<usize, Vec<SiteEnd>> = BTreeMap::new();
        let mut gone_since: BTreeMap<usize, Instant> = BTreeMap::new();
        let mut answered = Instant::now();
        loop {
            if stop.load(Ordering::Relaxed) {
                return Err(Stopped.into());
            }
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
            for (number, task) in tasks.iter().enumerate() {
                if !results.contains_key(&number)
                    && let Some(result) = result_of(task)
                {
                    results.insert(number, result);
                }
            }
            tell(results.values().map(Vec::len).sum());
            let is_lost = |number: usize| {
                let left = gone_since.get(&number);
                left.is_some_and(|since| since.elapsed() > SETTLED)
            };
            if (0..tasks.len()).all(|number| results.contains_key(&number) || is_lost(number)) {
                let interrupted = Kind::Interrupted.exit_code();
                let results = results.into_values().flatten();
                return Ok(results
                    .filter(|of| of.failure() != Some(interrupted))
                    .collect());
            }
            if let Some(queued) = queued {
                for number in 0..tasks.len() {
                    if queued.contains(&number) {
                        gone_since.remove(&number);
                    } else {
                        gone_since.entry(number).or_insert_with(Instant::now);
                    }
                }
            }
            thread::sleep(POLL);
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

    /// Cancels a job, and waits until its tasks have left the queue; a cluster that does not answer is left alone, since the
    /// locks of the sites remain.
    fn cancel(&self, job: &str) {
        // The number of a job alone may be that of somebody else, on another cluster or after a restart.
        let mut scancel = Command::new("scancel");
        scancel.arg(format!("--name={}", self.job_name())).arg(job);
        let is_number = !job.is_empty() && job.bytes().all(|byte| byte.is_ascii_digit());
        if !is_number || answer_of("scancel", &mut scancel).is_err() {
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

/// The result of a task; `None` if there is none, or if it does not contain exactly its sites.
fn result_of(task: &SiteTask) -> Option<Vec<SiteEnd>> {
    let bytes = fs::read(&task.result).ok()?;
    let result: Vec<SiteEnd> = serde_json::from_slice(&bytes).ok()?;
    let sites = task.site_files.iter().map(|path| path.file_stem());
    let sites = sites.map(|stem| stem.unwrap_or_default().to_string_lossy());
    let is_whole = result.len() == task.site_files.len()
        && result.iter().zip(sites).all(|(of, site)| of.site == site);
    is_whole.then_some(result)
}

/// Standard output of a program of Slurm.
fn answer_of(program: &'static str, command: &mut Command) -> Result<String> {
    let output = command
        .output()
        .map_err(|source| SlurmError::NoProgram { program, source })?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Err(SlurmError::Refused { program, text }.into());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A path as one word of a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.to_string_lossy().replace('\'', "'\\''"))
}
