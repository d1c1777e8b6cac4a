//! Hashes files.

use std::path::{Path, PathBuf};

use super::Worker;
use crate::{
    error::{Result, Stopped},
    files::InputFiles,
    service::worker::protocol::Hashed,
    store::hashes::HashCache,
};

/// Files that are read between two checks of the stop flag.
const PART: usize = 16;

impl Worker {
    /// Hashes the files that are not known, or with `rehash` all of them; unreadable files are reported as such.
    pub(super) fn hash(&self, files: &[PathBuf], rehash: bool) -> Result<Vec<Hashed>> {
        let cache = HashCache::new(&self.task.hashes_file, rehash);
        let run = cache.files().within(&self.roots);
        let mut hashed = Vec::with_capacity(files.len());
        for part in files.chunks(PART) {
            Stopped::check(&self.stop)?;
            hashed.extend(part.iter().map(|path| hash(&run, path)));
        }
        cache.keep(&run);
        Ok(hashed)
    }
}

fn hash(run: &InputFiles, path: &Path) -> Hashed {
    let (blake3, problem) = match run.hash(path) {
        Ok(file) => (Some(file.blake3), None),
        Err(failure) => (None, Some(failure.cause.to_string())),
    };
    Hashed {
        path: path.to_owned(),
        blake3,
        problem,
    }
}
