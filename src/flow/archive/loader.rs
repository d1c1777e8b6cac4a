//! The thread that loads data for the checking threads: the only one that calls CSPICE.

use std::{
    path::Path,
    sync::{Arc, atomic::AtomicBool, mpsc::SyncSender},
};

use super::checker::Part;
use crate::{
    error::{Result, Stopped},
    files::Identity,
    spice::Session,
    stages::check_archive::{ArchiveRules, ArchiveSource},
};

/// Input of the loading thread.
pub(super) struct Loader<'a> {
    pub(super) rules: ArchiveRules<'a>,
    pub(super) session: &'a Session,
    /// Checked before every load.
    pub(super) stop: &'a AtomicBool,
    /// Destination of the loads.
    pub(super) parts: SyncSender<Part>,
}

impl Loader<'_> {
    /// Loads files one after the other, each with its initial identity.
    pub(super) fn run<'f>(
        self,
        files: impl Iterator<Item = (usize, &'f Path, &'f Identity)>,
    ) -> Result<()> {
        for (file, path, identity) in files {
            if !self.load(file, ArchiveSource::reopen(path, identity))? {
                // The checker has stopped, and reports why.
                return Ok(());
            }
        }
        Ok(())
    }

    /// Loads a file part by part; returns whether the checker still accepts parts.
    fn load(&self, file: usize, source: Result<ArchiveSource>) -> Result<bool> {
        let send = |loaded| self.parts.send(Part { file, loaded }).is_ok();
        let source = match source {
            Ok(source) => Arc::new(source),
            Err(failure) => return Ok(send(Err(failure))),
        };
        for rows in source.loads() {
            Stopped::check(self.stop)?;
            let load = source.load(rows, self.session, &self.rules);
            let is_over = load.is_err();
            if !send(load.map(|load| (Arc::clone(&source), load))) {
                return Ok(false);
            }
            if is_over {
                break;
            }
        }
        Ok(true)
    }
}
