//! Files of an archive as tasks for other processes, whose results are stored outputs.
//!
//! Each file has a stored output of its own, which appears when it is complete. Processes that check the same file write the
//! same output, and a process that is killed leaves the outputs of the files that it has finished.

use std::{
    collections::BTreeMap,
    fmt::Debug,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use serde::{Deserialize, Serialize};

use super::{Archive, ArchiveRequest, Files};
use crate::{
    altimetry::MolaClock,
    error::{Cause, Locate as _, Result, Stopped},
    files::Identity,
    spice::KernelSet,
    stages::check_archive::{ArchiveSource, FileRanges},
    store::{cache::StageCache, hashes::HashCache, publish::CACHE},
    watch::Watch,
};

/// A file, as the command that distributes the check found it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArchiveFile {
    /// Its path, as the command names it.
    pub path: PathBuf,
    /// Its identity in the file system. Computers number the device of a shared file system differently.
    pub identity: Identity,
}

/// Processes that check files and store the results as [`ArchiveTask::run`] does.
pub trait ArchiveWorkers: Debug {
    /// Number of times that files without a result are given to them.
    fn attempts(&self) -> u32;

    /// Has files checked, and returns when no process works on them any more.
    ///
    /// * `attempt` – from 1
    /// * `done` – called when a process has stated that it has stored results
    ///
    /// # Errors
    /// The processes cannot be started or observed; interruption. A failure of a file or a process is none.
    fn check(
        &self,
        attempt: u32,
        files: &[ArchiveFile],
        stop: &AtomicBool,
        done: &dyn Fn(),
    ) -> Result<()>;

    /// Called after the last attempt with the number of files without a result.
    fn ended(&self, left: usize);
}

/// Some files of an archive as a task for another process: its input file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArchiveTask {
    /// Folder to which paths are relative.
    pub folder: PathBuf,
    /// The metakernel.
    pub kernels: PathBuf,
    /// The clock of MOLA.
    pub clock: MolaClock,
    /// Folder of the products, whose lock the command holds.
    pub out: PathBuf,
    /// The files.
    pub files: Vec<ArchiveFile>,
    /// Threads.
    pub threads: u16,
}

/// A file that differs from the file of the command that distributes the check.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "the file is not the one that the command found: it was replaced or changed, or this computer has another one"
)]
#[cause(Input: "give all computers the same archive, in a shared folder")]
struct OtherFile;

impl ArchiveTask {
    /// Checks the files without a stored result, and stores the results; returns the number of files that have one. Failures
    /// of files are reported in the log.
    ///
    /// The current folder is [`Self::folder`].
    ///
    /// # Errors
    /// Kernels that cannot be read or have changed; results that cannot be stored; interruption.
    pub fn run(&self, stop: &AtomicBool) -> Result<usize> {
        let request = ArchiveRequest {
            paths: &[],
            kernels: &self.kernels,
            clock: self.clock.clone(),
            allow_uncovered: false,
            workers: None,
        };
        let hashes = HashCache::in_folder(&self.out, false);
        let inputs_read = hashes.files();
        let kernels = KernelSet::from_metakernel_of(&inputs_read, &self.kernels)?;
        let archive = Archive::of(&request, &kernels)?;
        let cache = StageCache::new(&self.out.join(CACHE), false);
        let (mut sources, mut todo) = (BTreeMap::new(), BTreeMap::new());
        let mut stored = 0;
        for (number, file) in self.files.iter().enumerate() {
            Stopped::check(stop)?;
            // Results are stored for the identity that the command stated.
            let (stored_as, inputs) = archive.stored_as(&file.path, &file.identity);
            if cache
                .load_of_others::<FileRanges>(&stored_as, &inputs)
                .is_some()
            {
                stored += 1;
                continue;
            }
            match opened(&file.path, &file.identity) {
                Ok(identity) => {
                    sources.insert(number, identity);
                    todo.insert(number, (stored_as, inputs));
                }
                Err(failure) => tracing::error!("{failure}"),
            }
        }
        let paths: Vec<PathBuf> = self.files.iter().map(|file| file.path.clone()).collect();
        let files = Files {
            paths: &paths,
            sources: &sources,
            todo: &todo,
        };
        if !todo.is_empty() {
            let results = archive.check_here(&files, &inputs_read, &cache, Watch::from(stop))?;
            for failure in results.values().filter_map(|result| result.as_ref().err()) {
                tracing::error!("{failure}");
            }
            stored += results.values().filter(|result| result.is_ok()).count();
        }
        hashes.keep(&inputs_read);
        Ok(stored)
    }
}

/// The identity of a file on this computer, if it is the file of the command.
fn opened(path: &Path, stated: &Identity) -> Result<Identity> {
    let identity = ArchiveSource::open(path)?.identity();
    if identity.is_same_file(stated) {
        return Ok(identity);
    }
    Err(OtherFile).in_file(path)
}
