//! `areograph campaign-task`: sites of a campaign on a node of a cluster.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

use clap::Args;

use crate::{
    cli::{finish, slurm::carry_out},
    flow::{End, RunOptions, SiteEnd, SiteTask, run_site_file},
    store::hashes::HashCache,
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

pub(in crate::cli) fn run(arguments: &Arguments) -> ExitCode {
    finish(carry_out(&arguments.file, |task: SiteTask, stop| {
        let hashes = HashCache::in_folder(&task.out, false);
        let options = RunOptions::of(&task.out, stop, &hashes);
        let sites = task
            .site_files
            .iter()
            .map(|path| when_free(path, &options, stop));
        Ok(sites.collect::<Vec<SiteEnd>>())
    }))
}

/// Runs a site; while another process works on it, for example an earlier attempt on a node that had been lost, waits.
fn when_free(path: &Path, options: &RunOptions<'_>, stop: &AtomicBool) -> SiteEnd {
    loop {
        let ended = run_site_file(path, options);
        let is_busy = matches!(ended.end, End::Failed { is_busy: true, .. });
        if !is_busy || stop.load(Ordering::Relaxed) {
            return ended;
        }
        thread::sleep(BUSY);
    }
}
