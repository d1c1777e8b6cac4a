//! Writing rate of found shots.

use std::{path::Path, time::Instant};

use areograph::{
    error::{Error, Result},
    footprints::SourceFile,
    pds::archive::{Found, Indexes, Judged, Query, Sink, Source, search},
    products::{RowsFormat, ShotsFile},
};
use serde_json::{Value, json};

use super::{Archive, RUN_ON, everywhere};

/// Files of which every shot is written: about 5 million.
const FILES: usize = 6;

/// Pieces of an answer in memory.
#[derive(Default)]
struct Kept(Vec<Found>);

impl Sink for Kept {
    fn found(&mut self, _: usize, found: Found) -> Result<()> {
        self.0.push(found);
        Ok(())
    }

    fn failed(&mut self, _: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}

/// Rows per second by format, for shots in memory.
pub(super) fn rows_per_s(archive: &Archive, folder: &Path) -> Value {
    let sources: Vec<Source> = archive
        .sources(&Indexes::default())
        .into_iter()
        .take(FILES)
        .collect();
    let files: Vec<SourceFile> = sources.iter().map(Source::file).collect();
    let rate = |format: RowsFormat, name: &str| {
        let mut kept = Kept::default();
        let query = Query::unfiltered(vec![everywhere()], Judged::Near);
        search(&sources, &query, &RUN_ON, &mut kept).unwrap();
        let path = folder.join(name);
        let windows = vec!["mars".to_owned()];
        let mut file = ShotsFile::create(&path, format, files.clone(), windows).unwrap();
        let start = Instant::now();
        for found in kept.0 {
            file.write(found.footprints, &found.windows).unwrap();
        }
        let rows = file.finish(&json!({})).unwrap();
        let taken_s = start.elapsed().as_secs_f64();
        std::fs::remove_file(&path).unwrap();
        rows as f64 / taken_s
    };
    json!({
        "parquet": rate(RowsFormat::Parquet, "written.parquet"),
        "csv": rate(RowsFormat::Csv, "written.csv"),
    })
}
