//! What a worker may take of the machine, and whose child it is.

use std::{fs::File, io::Write as _};

use rustix::process::{
    Resource, Rlimit, Signal, getppid, nice, set_parent_process_death_signal, setrlimit,
};

use crate::service::worker::protocol::Task;

/// How much less urgent than the service a worker is.
const NICENESS: i32 = 10;
/// How much rather than the service a worker is ended when memory runs out, of 1000.
const OUT_OF_MEMORY_SCORE: &[u8] = b"500";

/// Makes the worker end with its parent; false when that is gone already.
///
/// The end of input says the same, and is what a worker stops by; this is for one that hangs.
pub(super) fn end_with(parent: Option<u32>) -> bool {
    let Some(parent) = parent else { return true };
    if let Err(error) = set_parent_process_death_signal(Some(Signal::KILL)) {
        tracing::warn!("the worker may outlive the service: {error}");
    }
    // It may have ended before that was set.
    let now = getppid().map(|pid| pid.as_raw_nonzero().get());
    now.and_then(|pid| u32::try_from(pid).ok()) == Some(parent)
}

/// Keeps the worker to what its task allows. What the system refuses is told, for the task can be done all the same.
pub(super) fn keep_to(task: &Task) {
    // Of the data, not of the address space: large files are mapped.
    let memory = u64::from(task.memory_mib) << 20;
    for (resource, limit, what) in [
        (Resource::Data, memory, "memory"),
        (Resource::Core, 0, "core files"),
    ] {
        let limit = Rlimit {
            current: Some(limit),
            maximum: Some(limit),
        };
        if let Err(error) = setrlimit(resource, limit) {
            tracing::warn!("{what} cannot be limited: {error}");
        }
    }
    if let Err(error) = nice(NICENESS) {
        tracing::warn!("the worker runs at the priority of the service: {error}");
    }
    let score = File::options()
        .write(true)
        .open("/proc/self/oom_score_adj")
        .and_then(|mut file| file.write_all(OUT_OF_MEMORY_SCORE));
    if let Err(error) = score {
        tracing::warn!("the worker is not the first to go when memory runs out: {error}");
    }
    // The only failure is a pool that exists already, and none does.
    let _ = rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(task.threads))
        .build_global();
}
