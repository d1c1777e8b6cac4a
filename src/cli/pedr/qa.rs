//! `areograph pedr qa`.

mod executor;

use std::{path::PathBuf, process::ExitCode};

use clap::Args;

use self::executor::ExecutorArguments;
pub(in crate::cli) use self::executor::{TaskArguments, run_task};
use crate::{
    altimetry::MolaClock,
    cli::{
        files::exist,
        report,
        single::{self, RunArguments},
    },
    config::usual_altimeter,
    error::Cause,
    flow::{ArchiveRequest, ArchiveWorkers, Task, refuse_tables},
};

/// Checks every shot of an archive against kernels: measured range minus distance, profile by profile.
///
/// Products go to --out: a row of statistics for every profile, shots of the worst ones, a page. A profile is the part of one
/// revolution in one file. A check that was interrupted or killed resumes where it stopped, with the same result. The exit code
/// is 5 if a profile exceeds a limit, a file could not be checked, or kernels do not cover a profile (unless --allow-uncovered).
///
/// With --executor slurm, tasks of a cluster check the files, and this command publishes the same products.
///
/// Example: `areograph scene archive demo --days 5 && areograph pedr qa demo/pedr --kernels demo/kernels/archive.tm --out qa`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// PEDR files, and folders with .b files in and below them.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Metakernel: leap seconds, clock, and the orbit of the spacecraft.
    #[arg(long, value_name = "KERNELS.tm")]
    kernels: PathBuf,
    /// Folder of the products.
    #[arg(long, default_value = "qa")]
    out: PathBuf,
    /// Delay of the time tags; 0 leaves them unchanged. The default is the bias of MOLA's clock.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = usual_altimeter().clock_bias_s)]
    clock_bias_s: f64,
    /// Threads; the default is one per core, and one for each task of Slurm.
    #[arg(long)]
    threads: Option<std::num::NonZeroU16>,
    /// Do not report the archive as invalid if the kernels contain no position for some of its shots.
    #[arg(long)]
    allow_uncovered: bool,
    #[command(flatten)]
    executor: ExecutorArguments,
    #[command(flatten)]
    run: RunArguments,
}

/// An implausible clock bias.
#[derive(Debug, thiserror::Error, Cause)]
#[error("--clock-bias-s is {0}; expected -10 to 10")]
#[cause(Configuration: "give the delay of the time tags in seconds, 0.117 for MOLA")]
struct ClockBias(f64);

impl Arguments {
    fn clock(&self) -> Result<MolaClock, ClockBias> {
        let bias_s = self.clock_bias_s;
        if !(bias_s.abs() <= MolaClock::BIAS_MAX_S) {
            return Err(ClockBias(bias_s));
        }
        let usual = usual_altimeter();
        let is_usual = (bias_s - usual.clock_bias_s).abs() <= 0.0;
        let source = if is_usual {
            usual.clock_source.clone()
        } else {
            "as given on the command line".to_owned()
        };
        Ok(MolaClock::late_by(bias_s, source))
    }
}

/// Checks the archive and reports the outcome.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    if let Some(threads) = arguments.threads {
        // The only failure is an existing pool, which keeps its size.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads.get()))
            .build_global();
    }
    let prepared = exist(&arguments.paths)
        .and_then(|()| refuse_tables(&arguments.paths))
        .and_then(|()| {
            let (clock, out) = (arguments.clock()?, &arguments.out);
            let executor = &arguments.executor;
            let tasks = executor.tasks(&arguments.kernels, &clock, out, arguments.threads)?;
            Ok((clock, tasks))
        });
    let (clock, tasks) = match prepared {
        Ok(prepared) => prepared,
        Err(failure) => return report(&failure),
    };
    let request = ArchiveRequest {
        paths: &arguments.paths,
        kernels: &arguments.kernels,
        clock,
        allow_uncovered: arguments.allow_uncovered,
        workers: tasks.as_ref().map(|tasks| tasks as &dyn ArchiveWorkers),
    };
    let task = Task::Archive(&request);
    single::run(task, task.name(), &arguments.out, &arguments.run, |count| {
        format!(
            "{} shots in {} profiles of {} files, {} profiles beyond limits, {} not covered by the kernels",
            count("shots"),
            count("profiles"),
            count("files"),
            count("profiles_beyond_limits"),
            count("profiles_not_covered"),
        )
    })
}
