//! Files named by the user, opened for a search.

use std::path::PathBuf;

use rayon::prelude::*;

use super::{Index, Indexes, Listing, Source};
use areograph_base::{
    altimetry::DatumChoice,
    error::{Cause, Error, Result},
};

/// A number of files beyond the range of a search.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{0} PEDR files; expected 1 to 65535")]
#[cause(Input: "name PEDR files (AP#####v.B), or folders that contain them")]
struct FileCount(usize);

/// Files of an archive that can be searched, and failures of the others.
#[derive(Debug, Default)]
pub struct Opened {
    /// Files in the order of their first records.
    pub sources: Vec<Source>,
    /// Folders that cannot be listed, files that cannot be opened or contain no valid record.
    pub failures: Vec<Error>,
}

impl Opened {
    /// Opens these files, and those with the ending `.b` in and below these folders, each once, with the indexes beside
    /// them.
    ///
    /// # Errors
    /// No files, with the reason if an entry cannot be read; more than 65,535 files.
    pub fn all(paths: &[PathBuf]) -> Result<Self> {
        let Listing {
            paths: files,
            mut failures,
        } = Listing::of(paths);
        if files.is_empty() && !failures.is_empty() {
            return Err(failures.swap_remove(0));
        }
        let mut opened = Self {
            sources: Vec::new(),
            failures,
        };
        if files.is_empty() || files.len() > usize::from(u16::MAX) {
            return Err(FileCount(files.len()).into());
        }
        let indexes = Indexes::beside(&files, Index::read);
        let sources: Vec<Result<Source>> = files
            .par_iter()
            .map(|path| Source::open(path, DatumChoice::Auto, &indexes))
            .collect();
        for source in sources {
            match source {
                Ok(source) => opened.sources.push(source),
                Err(failure) => opened.failures.push(failure),
            }
        }
        let in_time = |a: &Source, b: &Source| a.first_s().total_cmp(&b.first_s());
        opened.sources.sort_by(in_time);
        Ok(opened)
    }
}
