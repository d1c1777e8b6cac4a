//! Work on several sites at the same time.

use std::{
    num::NonZero,
    sync::{Arc, atomic::AtomicBool},
    thread,
};

use tokio::{runtime::Runtime, task::JoinSet};

use super::{panicked::flatten, stop::on_signals};
use crate::error::{IoError, Result};

/// Most pieces of work at a time.
pub(super) const JOBS_MAX: u16 = 64;
/// Sites beyond the number of cores: while some wait for the disk, others compute.
const BEYOND_CORES: u16 = 2;

/// The number of sites at a time that the user gave, or else one that keeps all cores busy.
///
/// * `threads` – worker threads, if the user limits them
pub(super) fn jobs_or_default(given: Option<u16>, threads: Option<u16>) -> u16 {
    let jobs = cores(threads).saturating_add(BEYOND_CORES);
    given.unwrap_or_else(|| jobs.min(JOBS_MAX))
}

/// Cores that the user permits to be used.
pub(super) fn cores(threads: Option<u16>) -> u16 {
    let all = thread::available_parallelism().map_or(1, NonZero::get);
    threads.unwrap_or_else(|| u16::try_from(all).unwrap_or(JOBS_MAX).min(JOBS_MAX))
}

/// Does at most `jobs` pieces of work at a time, begun in their order, and passes the number and result of each to `done`
/// when it ends. Work is created when it begins, so the memory does not depend on the number of pieces.
///
/// * `stop` – set at the first signal; work begun later must end at once
///
/// # Errors
/// No threads.
pub(super) fn in_pool<W, T>(
    jobs: u16,
    stop: &Arc<AtomicBool>,
    work: impl IntoIterator<Item = W>,
    mut done: impl FnMut(usize, Result<T>),
) -> Result<()>
where
    W: FnOnce() -> Result<T> + Send + 'static,
    T: Send + 'static,
{
    let runtime = Runtime::new().map_err(IoError::on("start threads"))?;
    runtime.block_on(async {
        let stop = Arc::clone(stop);
        let told = tokio::spawn(async move { on_signals(&stop).await });
        let mut left = work.into_iter().enumerate();
        let mut running = JoinSet::new();
        loop {
            while running.len() < usize::from(jobs) {
                let Some((number, work)) = left.next() else {
                    break;
                };
                let task = tokio::task::spawn_blocking(work);
                running.spawn(async move { (number, flatten(task.await)) });
            }
            match running.join_next().await {
                Some(Ok((number, result))) => done(number, result),
                // The task above only waits; a panic of the work is a result.
                Some(Err(_)) => {}
                None => break,
            }
        }
        told.abort();
    });
    Ok(())
}

/// Limits the worker threads of all stages; by default, there is one per core.
pub(super) fn limit_threads(threads: Option<u16>) {
    if let Some(threads) = threads {
        // The only failure is an existing pool, which keeps its size.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sites_at_a_time_follow_the_limits_of_the_user() {
        assert_eq!(jobs_or_default(Some(7), Some(1)), 7);
        assert_eq!(jobs_or_default(None, Some(1)), 3);
        assert_eq!(jobs_or_default(None, Some(1024)), JOBS_MAX);
        assert!((3..=JOBS_MAX).contains(&jobs_or_default(None, None)));
    }
}
