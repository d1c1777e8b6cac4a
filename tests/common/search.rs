//! The search, of files that are hashed first as a run does.

use std::sync::atomic::AtomicBool;

use areograph::{
    config::{PedrConfig, WindowConfig},
    error::Result,
    files::InputFiles,
    pds::archive::Indexes,
    stages::search_footprints::{self, SearchResult},
};

/// The shots in the windows, found without an index.
pub(crate) fn search_footprints(
    pedr: &PedrConfig,
    windows: &[WindowConfig],
    correction_s: f64,
    stop: &AtomicBool,
) -> Result<SearchResult> {
    let files = InputFiles::default().hash_all(&pedr.files, &AtomicBool::new(false))?;
    let indexes = Indexes::default();
    search_footprints::search_footprints(pedr, &files, &indexes, windows, correction_s, stop)
}
