//! The check of the files without stored results: in other processes as far as requested, the rest in this one.

use std::{cell::RefCell, sync::mpsc::sync_channel, thread};

use super::{
    Archive, Files,
    checker::{Checker, FILES, Results},
    loader::Loader,
    task::{ArchiveFile, ArchiveWorkers},
};
use crate::{
    error::Result, files::InputFiles, stages::check_archive::FileRanges, store::cache::StageCache,
    watch::Watch,
};

impl Archive<'_> {
    /// Checks the files without stored results.
    pub(super) fn check_todo(
        &self,
        files: &Files<'_>,
        kernels: &InputFiles,
        cache: &StageCache,
        watch: Watch<'_>,
    ) -> Result<Results> {
        watch.announce(files.todo.len());
        watch.step(0, FILES);
        let Some(workers) = self.request.workers else {
            return self.check_here(files, kernels, cache, watch);
        };
        let mut results = check_elsewhere(workers, files, cache, watch)?;
        let mut left = files.todo.clone();
        left.retain(|file, _| !results.contains_key(file));
        workers.ended(left.len());
        // This process reports failures of files as without other processes.
        if !left.is_empty() {
            let left = Files {
                todo: &left,
                ..*files
            };
            results.extend(self.check_here(&left, kernels, cache, watch)?);
        }
        Ok(results)
    }

    /// Checks files in this process: this thread loads, while another one distributes the checks to all threads of the pool.
    pub(super) fn check_here(
        &self,
        files: &Files<'_>,
        kernels: &InputFiles,
        cache: &StageCache,
        watch: Watch<'_>,
    ) -> Result<Results> {
        let session = self.view.session()?;
        let todo = files.todo;
        let checker = Checker {
            rules: self.rules(),
            kernels,
            cache,
            todo,
            watch,
        };
        thread::scope(|scope| {
            // The channel has no buffer: at most two loads are in memory.
            let (parts, received) = sync_channel(0);
            let worker = scope.spawn(|| checker.run(received));
            let loader = Loader {
                rules: self.rules(),
                session,
                stop: watch.stop(),
                parts,
            };
            let paths = todo
                .keys()
                .map(|file| (*file, &*files.paths[*file], &files.sources[file]));
            let loaded = loader.run(paths);
            let checked = worker.join();
            loaded?;
            checked.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }
}

/// Has files checked by other processes; a file without a result afterwards has none that can be used. Only the stored result
/// states that a file was checked.
fn check_elsewhere(
    workers: &dyn ArchiveWorkers,
    files: &Files<'_>,
    cache: &StageCache,
    watch: Watch<'_>,
) -> Result<Results> {
    // The stored results of these files are not used, and must not be taken for new ones.
    for (stored_as, _) in files.todo.values() {
        cache.forget(stored_as);
    }
    let results = RefCell::new(Results::new());
    // Only results that are used are counted.
    let take = |left: &[usize]| {
        let mut results = results.borrow_mut();
        let before = results.len();
        for file in left {
            if results.contains_key(file) {
                continue;
            }
            let (stored_as, inputs) = &files.todo[file];
            if let Some(found) = cache.load_of_others::<FileRanges>(stored_as, inputs) {
                results.insert(*file, Ok(found));
            }
        }
        watch.step((results.len() - before) as u64, FILES);
    };
    for attempt in 1..=workers.attempts() {
        let mut left: Vec<usize> = files.todo.keys().copied().collect();
        left.retain(|file| !results.borrow().contains_key(file));
        if left.is_empty() {
            break;
        }
        let listed = left.iter().map(|file| ArchiveFile {
            path: files.paths[*file].clone(),
            identity: files.sources[file],
        });
        let listed: Vec<ArchiveFile> = listed.collect();
        workers.check(attempt, &listed, watch.stop(), &|| take(&left))?;
        take(&left);
    }
    Ok(results.into_inner())
}
