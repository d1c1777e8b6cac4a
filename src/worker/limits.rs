//! Resource limits of a worker, and its parent process.

use std::{fs::File, io::Write as _};

use rustix::process::{
    Resource, Rlimit, Signal, getppid, nice, set_parent_process_death_signal, setrlimit,
};

use crate::service::worker::protocol::Task;

/// Niceness of a worker, relative to the service.
const NICENESS: i32 = 10;
/// Out-of-memory score of a worker, of 1000: it is killed before the service.
const OUT_OF_MEMORY_SCORE: &[u8] = b"500";

/// Makes the worker end with its parent; false if that has already ended.
///
/// A worker normally stops at the end of its input; this is for one that hangs.
pub(super) fn end_with(parent: Option<u32>) -> bool {
    let Some(parent) = parent else { return true };
    if let Err(error) = set_parent_process_death_signal(Some(Signal::KILL)) {
        tracing::warn!("the worker may outlive the service: {error}");
    }
    // The parent may have ended before this was set.
    let now = getppid().map(|pid| pid.as_raw_nonzero().get());
    now.and_then(|pid| u32::try_from(pid).ok()) == Some(parent)
}

/// Limits the resources of the worker to the limits of its task. Refusals of the system are reported; the task can be
/// done without the limits.
///
/// # Errors
/// The limit of memory does not admit the threads of the task.
pub(super) fn keep_to(task: &Task) -> Result<(), String> {
    // Limits the data, not the address space: large files are mapped.
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
        tracing::warn!(
            "the worker is not the first process to be killed when memory runs out: {error}"
        );
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(task.threads))
        .build_global()
        .map_err(|error| {
            format!(
                "the {} threads of workers.threads cannot be started within workers.memory_mib = {}: {error}",
                task.threads, task.memory_mib
            )
        })
}
