//! The threads that check loads.

use std::{
    collections::BTreeMap,
    sync::{Arc, mpsc::Receiver},
};

use crate::{
    error::Result,
    files::InputFiles,
    stage::Inputs,
    stages::check_archive::{ArchiveRules, ArchiveSource, FileCheck, FileRanges, Load},
    store::cache::StageCache,
};

/// Progress of a check.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ArchiveProgress {
    /// Files that are done, those whose result was stored included.
    pub files_done: usize,
    /// Number of these whose result was stored.
    pub files_stored: usize,
    /// All files.
    pub files: usize,
    /// Bytes of files that were checked now.
    pub bytes_done: u64,
    /// Bytes of files that are still to be checked.
    pub bytes_left: u64,
    /// Shots that were checked now.
    pub shots: u64,
}

/// A part of a file on its way to the threads that check it.
pub(super) struct Part {
    /// Index of the file.
    pub(super) file: usize,
    /// Its size.
    pub(super) bytes: u64,
    /// The part, or the reason why it is missing; then no further part follows.
    pub(super) loaded: Result<(Arc<ArchiveSource>, Load)>,
}

/// Input of the checking threads.
pub(super) struct Checker<'a> {
    pub(super) rules: ArchiveRules<'a>,
    /// The kernels: results obtained with other kernels are not stored.
    pub(super) kernels: &'a InputFiles,
    pub(super) cache: &'a StageCache,
    /// Name under which the result of each file is stored, and its inputs.
    pub(super) todo: &'a BTreeMap<usize, (String, Inputs)>,
    pub(super) progress: &'a (dyn Fn(&ArchiveProgress) + Sync),
}

/// By file: its results, or its failure.
pub(super) type Results = BTreeMap<usize, Result<FileRanges>>;

impl Checker<'_> {
    /// Checks incoming parts, and stores the result of every file.
    pub(super) fn run(&self, parts: Receiver<Part>, start: ArchiveProgress) -> Result<Results> {
        let mut progress = start;
        let mut results = Results::new();
        let mut open: Option<(usize, FileCheck<'_>)> = None;
        for part in parts {
            let under_way = open.take().filter(|(file, _)| *file == part.file);
            let checked = part.loaded.and_then(|(source, load)| {
                let begin = || (part.file, FileCheck::new(source, self.rules));
                let (_, mut check) = under_way.unwrap_or_else(begin);
                let found = check.add(&load)?;
                if found.is_none() {
                    open = Some((part.file, check));
                }
                Ok(found)
            });
            let result = match checked {
                Ok(None) => continue,
                Ok(Some(found)) => Ok(self.store(part.file, found)?),
                Err(failure) => Err(failure),
            };
            progress.files_done += 1;
            progress.bytes_done += part.bytes;
            progress.bytes_left = progress.bytes_left.saturating_sub(part.bytes);
            progress.shots += result.as_ref().map_or(0, |found| found.shots);
            results.insert(part.file, result);
            (self.progress)(&progress);
        }
        Ok(results)
    }

    fn store(&self, file: usize, found: FileRanges) -> Result<FileRanges> {
        self.kernels.verify_all()?;
        if let Some((label, inputs)) = self.todo.get(&file) {
            self.cache.store(label, inputs.clone(), found.clone())?;
        }
        Ok(found)
    }
}
