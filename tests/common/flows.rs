//! Runs of flows from a test, with nothing but a folder.

use std::{path::Path, sync::atomic::AtomicBool};

use areograph::{
    error::Error,
    flow::{Observer, PUBLISH, RunOptions, RunOutcome, RunPlan, Task, plan_task, run_task},
    store::hashes::HashCache,
};

/// Runs to the products in `out`.
pub(crate) fn run_into(task: Task<'_>, out: &Path, force: bool) -> Result<RunOutcome, Error> {
    let (stop, hashes) = (AtomicBool::new(false), HashCache::in_folder(out, false));
    let options = RunOptions {
        force,
        ..options(out, &(), &stop, &hashes)
    };
    run_task(task, &options)
}

/// Runs to the products in `out` with an observer, which may set `stop`.
pub(crate) fn run_observed(
    task: Task<'_>,
    out: &Path,
    observer: &dyn Observer,
    stop: &AtomicBool,
) -> Result<RunOutcome, Error> {
    let hashes = HashCache::in_folder(out, false);
    run_task(task, &options(out, observer, stop, &hashes))
}

/// Stages that a run into `out` would run, with the reasons.
pub(crate) fn would_run(task: Task<'_>, out: &Path) -> Vec<(String, String)> {
    let hashes = HashCache::in_folder(out, false);
    let stop = AtomicBool::new(false);
    let RunPlan { stages, .. } = plan_task(task, &options(out, &(), &stop, &hashes)).unwrap();
    let run = stages.into_iter().filter(|stage| stage.reason.runs());
    run.map(|stage| (stage.stage, stage.reason.to_string()))
        .collect()
}

/// Stages that a run ran.
pub(crate) fn ran(outcome: &RunOutcome) -> Vec<&str> {
    let stages = outcome.stages.iter().filter(|stage| stage.reason.runs());
    stages.map(|stage| &*stage.stage).collect()
}

fn options<'a>(
    out: &Path,
    observer: &'a dyn Observer,
    stop: &'a AtomicBool,
    hashes: &'a HashCache,
) -> RunOptions<'a> {
    RunOptions {
        out: out.to_owned(),
        until: PUBLISH,
        force: false,
        stop,
        hashes,
        roots: &[],
        observer,
    }
}
