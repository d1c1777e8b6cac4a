//! `areograph campaign-task`: sites of a campaign on a node of a cluster.

use std::{
    fs,
    path::PathBuf,
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

use clap::Args;

use crate::{
    cli::{report, stop::Signals},
    error::{Cause, IoError, Locate as _, Result},
    flow::{End, RunOptions, SiteEnd, SiteTask, run_site_file},
    store::{atomic, hashes::HashCache},
};

/// Time between attempts on a site on which another process is working.
const BUSY: Duration = Duration::from_secs(2);

/// Runs the sites of a task file and writes its result file.
#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    /// Task file.
    #[arg(value_name = "TASK.json")]
    file: PathBuf,
}

/// A task file that this version did not write.
#[derive(Debug, thiserror::Error, Cause)]
#[error("this file is not a task of a campaign: {0}")]
#[cause(Configuration: "task files are written by `areograph campaign`")]
struct NoTask(serde_json::Error);

pub(in crate::cli) fn run(arguments: &Arguments) -> ExitCode {
    match ran(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report(&failure),
    }
}

fn ran(arguments: &Arguments) -> Result<()> {
    let file = &arguments.file;
    let bytes = fs::read(file).map_err(IoError::on("read")).in_file(file)?;
    let task: SiteTask = serde_json::from_slice(&bytes)
        .map_err(NoTask)
        .in_file(file)?;
    let signals = Signals::heard()?;
    let hashes = HashCache::in_folder(&task.out, false);
    let options = RunOptions::of(&task.out, signals.stop(), &hashes);
    let sites = task
        .site_files
        .iter()
        .map(|path| when_free(path, &options, signals.stop()));
    let ended: Vec<SiteEnd> = sites.collect();
    let text = serde_json::to_vec(&ended)
        .map_err(NoTask)
        .in_file(&task.result)?;
    atomic::write(&task.result, &text)
}

/// Runs a site; while another process works on it, for example an earlier attempt on a node that had been lost, waits.
fn when_free(path: &std::path::Path, options: &RunOptions<'_>, stop: &AtomicBool) -> SiteEnd {
    loop {
        let ended = run_site_file(path, options);
        let is_busy = matches!(ended.end, End::Failed { is_busy: true, .. });
        if !is_busy || stop.load(Ordering::Relaxed) {
            return ended;
        }
        thread::sleep(BUSY);
    }
}
