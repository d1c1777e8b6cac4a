//! Where the files of an archive are checked.

use std::{
    cell::OnceCell,
    env,
    num::NonZeroU16,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::AtomicBool,
};

use clap::{Args, ValueEnum};

use crate::{
    altimetry::MolaClock,
    cli::{
        finish,
        pool::limit_threads,
        slurm::{ATTEMPTS, Cluster, Resources, carry_out},
    },
    config::absolute,
    error::{IoError, Locate as _, Result},
    flow::{ArchiveFile, ArchiveTask, ArchiveWorkers},
    service::words::counted,
};

/// The command of a task, and the end of the name of its job.
const COMMAND: &str = "archive-task";
const JOB: &str = "archive";
const BYTES_PER_MB: u64 = 1_000_000;
/// Heading of these options.
const HEADING: &str = "Options of the executor";

/// Executor of the check; the options have the names of the keys of a campaign's table `executor`.
#[derive(Debug, Args)]
pub(super) struct ExecutorArguments {
    /// Where the files are checked.
    #[arg(long, value_enum, default_value_t = Executor::Local, help_heading = HEADING)]
    executor: Executor,
    /// Size of the files of a task, megabytes.
    #[arg(long, value_name = "MB", default_value_t = 1_000, requires = "executor", help_heading = HEADING,
        value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    mb_per_task: u32,
    /// Largest number of tasks that run at the same time; by default, the cluster decides.
    #[arg(long, value_name = "TASKS", requires = "executor", help_heading = HEADING,
        value_parser = clap::value_parser!(u32).range(1..=100_000))]
    tasks_max: Option<u32>,
    /// Memory of a task; doubled whenever a task ends without a result.
    #[arg(long, value_name = "MB", default_value_t = 1_000, requires = "executor", help_heading = HEADING,
        value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    memory_mb: u32,
    /// Time limit of a task.
    #[arg(long, value_name = "MINUTES", default_value_t = 60, requires = "executor", help_heading = HEADING,
        value_parser = clap::value_parser!(u32).range(1..=100_000))]
    minutes: u32,
    /// Further option of sbatch, such as --executor-option=--partition=planetary; may be repeated.
    #[arg(long = "executor-option", value_name = "OPTION", allow_hyphen_values = true, requires = "executor",
        help_heading = HEADING)]
    options: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Executor {
    /// On this machine.
    Local,
    /// As array tasks, submitted with sbatch; the nodes share archive, kernels and --out.
    Slurm,
}

/// Some files of an archive as array tasks.
#[derive(Debug)]
pub(super) struct SlurmTasks<'a> {
    executor: &'a ExecutorArguments,
    kernels: &'a Path,
    clock: MolaClock,
    /// Folder to which paths are relative.
    folder: PathBuf,
    /// Absolute.
    out: PathBuf,
    threads: u16,
    /// From the first attempt on.
    cluster: OnceCell<Cluster<'a>>,
}

impl ExecutorArguments {
    /// The tasks of a check on a cluster; `None` on this machine.
    ///
    /// * `threads` – of a task; by default, one
    ///
    /// # Errors
    /// The current folder cannot be found.
    pub(super) fn tasks<'a>(
        &'a self,
        kernels: &'a Path,
        clock: &MolaClock,
        out: &Path,
        threads: Option<NonZeroU16>,
    ) -> Result<Option<SlurmTasks<'a>>> {
        if self.executor == Executor::Local {
            return Ok(None);
        }
        Ok(Some(SlurmTasks {
            executor: self,
            kernels,
            clock: clock.clone(),
            folder: env::current_dir().map_err(IoError::on("find the current folder"))?,
            out: absolute(out)?,
            threads: threads.map_or(1, NonZeroU16::get),
            cluster: OnceCell::new(),
        }))
    }
}

impl<'a> SlurmTasks<'a> {
    fn cluster(&self) -> Result<&Cluster<'a>> {
        if let Some(cluster) = self.cluster.get() {
            return Ok(cluster);
        }
        let resources = Resources {
            tasks_max: self.executor.tasks_max,
            memory_mb: self.executor.memory_mb,
            minutes: self.executor.minutes,
            threads: Some(self.threads),
            options: &self.executor.options,
        };
        let cluster = Cluster::begin(JOB, COMMAND, &self.out, resources)?;
        Ok(self.cluster.get_or_init(|| cluster))
    }
}

impl ArchiveWorkers for SlurmTasks<'_> {
    fn attempts(&self) -> u32 {
        ATTEMPTS
    }

    fn check(
        &self,
        attempt: u32,
        files: &[ArchiveFile],
        stop: &AtomicBool,
        done: &dyn Fn(),
    ) -> Result<()> {
        let bytes: Vec<u64> = files.iter().map(|file| file.identity.bytes).collect();
        let limit = u64::from(self.executor.mb_per_task) * BYTES_PER_MB;
        let mut rest = files;
        let tasks = parts(&bytes, limit).into_iter().map(|count| {
            let (files, later) = rest.split_at(count);
            rest = later;
            ArchiveTask {
                folder: self.folder.clone(),
                kernels: self.kernels.to_owned(),
                clock: self.clock.clone(),
                out: self.out.clone(),
                files: files.to_vec(),
                threads: self.threads,
            }
        });
        let tasks: Vec<ArchiveTask> = tasks.collect();
        let read = |_: &ArchiveTask, bytes: &[u8]| serde_json::from_slice::<usize>(bytes).ok();
        self.cluster()?
            .attempt(attempt, &tasks, stop, read, |_| done())?;
        Ok(())
    }

    fn ended(&self, left: usize) {
        let Some(cluster) = self.cluster.get() else {
            return;
        };
        if left > 0 {
            tracing::warn!(
                "{} without a result from the cluster: this machine checks what it can; the logs of the tasks are in {}",
                counted(left, "file"),
                cluster.folder().display()
            );
        } else if let Err(failure) = cluster.end() {
            tracing::warn!("files of tasks remain: {failure}");
        }
    }
}

/// Numbers of successive files of each task: tasks of about equal size, at most `limit` unless a file is larger.
fn parts(bytes: &[u64], limit: u64) -> Vec<usize> {
    let all: u64 = bytes.iter().sum();
    let mut tasks = all.div_ceil(limit).max(1);
    loop {
        let parts = equal_parts(bytes, tasks);
        let mut rest = bytes;
        let fits = parts.iter().all(|count| {
            let (part, later) = rest.split_at(*count);
            rest = later;
            part.len() == 1 || part.iter().sum::<u64>() <= limit
        });
        if fits {
            return parts;
        }
        tasks += (tasks / 16).max(1);
    }
}

/// Numbers of successive files of each of some parts of equal size; a file belongs to the part that contains its middle.
fn equal_parts(bytes: &[u64], tasks: u64) -> Vec<usize> {
    let doubled: u128 = 2 * bytes.iter().copied().map(u128::from).sum::<u128>().max(1);
    let (mut parts, mut last, mut before) = (Vec::new(), None, 0);
    for bytes in bytes.iter().copied().map(u128::from) {
        let part = (2 * before + bytes) * u128::from(tasks) / doubled;
        match parts.last_mut() {
            Some(count) if last == Some(part) => *count += 1,
            _ => parts.push(1),
        }
        (last, before) = (Some(part), before + bytes);
    }
    parts
}

/// Checks the files of a task file, stores their results and writes its result file.
#[derive(Debug, Args)]
pub(in crate::cli) struct TaskArguments {
    /// Task file.
    #[arg(value_name = "TASK.json")]
    file: PathBuf,
}

pub(in crate::cli) fn run_task(arguments: &TaskArguments) -> ExitCode {
    finish(carry_out(&arguments.file, |task: ArchiveTask, stop| {
        env::set_current_dir(&task.folder)
            .map_err(IoError::on("enter the folder"))
            .in_file(&task.folder)?;
        limit_threads(Some(task.threads));
        task.run(stop)
    }))
}

#[cfg(test)]
mod tests {
    use super::parts;

    #[test]
    fn tasks_have_about_the_same_size_and_every_file_one_task() {
        assert_eq!(parts(&[], 100), [0_usize; 0]);
        assert_eq!(parts(&[10; 10], 100), [10]);
        assert_eq!(parts(&[10; 11], 100), [5, 6]);
        assert_eq!(parts(&[326; 61], 5_000), [12, 12, 13, 12, 12]);
        assert_eq!(parts(&[500, 10, 10, 500], 100), [1, 2, 1]);
        assert_eq!(parts(&[0, 0, 0], 1), [3]);
        // Files of the mission: 15 to 40 MB.
        let bytes: Vec<u64> = (0..700).map(|n| 15 + (n * 7_919) % 26).collect();
        let counts = parts(&bytes, 1_000);
        assert_eq!(counts.iter().sum::<usize>(), bytes.len());
        let mut rest = &bytes[..];
        for count in counts {
            let (part, later) = rest.split_at(count);
            rest = later;
            let size: u64 = part.iter().sum();
            assert!(size <= 1_000, "{size}");
        }
    }
}
