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
    watch::Watch,
};

/// What is counted.
pub(super) const FILES: &str = "files";

/// A part of a file on its way to the threads that check it.
pub(super) struct Part {
    /// Index of the file.
    pub(super) file: usize,
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
    pub(super) watch: Watch<'a>,
}

/// By file: its results, or its failure.
pub(super) type Results = BTreeMap<usize, Result<FileRanges>>;

impl Checker<'_> {
    /// Checks incoming parts, and stores the result of every file.
    pub(super) fn run(&self, parts: Receiver<Part>) -> Result<Results> {
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
            results.insert(part.file, result);
            self.watch.step(1, FILES);
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
