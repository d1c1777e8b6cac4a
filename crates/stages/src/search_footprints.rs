//! Searches PEDR files for the shots in a site's windows: one pass over every file for all windows.

mod left_out;
mod repeats;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::repeats::require_distinct;
use super::outline_windows::Windows;
use areograph_base::{
    altimetry::DatumChoice,
    error::{Cause, Error, Locate, Result},
    footprints::{AsRead, Footprints, SourceFile},
    watch::Watch,
};
use areograph_config::{PedrConfig, WindowConfig};
use areograph_geom::window::Region;
pub use areograph_pds::archive::ShotRejection;
use areograph_pds::{
    archive::{Copies, Found, Indexes, Judged, Query, Sink, Source, search},
    pedr::{Complaint, Reason},
};
use areograph_store::{
    files::{HashedFile, file_name},
    stage::{InOrder, Input, Inputs, Stage},
    stage_inputs,
};

/// Complaints kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;
const STAGE: &str = "search_footprints";

/// Results of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchResult {
    /// Shots in the windows, ordered by file, record and shot, in the coordinates of their files.
    pub footprints: Footprints<AsRead>,
    /// Complaints about the files, ordered by file and record; at most 1000 are kept.
    pub complaints: Vec<Complaint>,
    /// All complaints by reason.
    pub complaint_counts: BTreeMap<Reason, u64>,
    /// Numbers of rejected shots in the windows, by reason.
    pub rejected: BTreeMap<ShotRejection, u64>,
    /// Records read.
    pub frames_read: u64,
    /// Shots whose own position was tested, in frames near a window.
    pub shots_read: u64,
    /// Interpretation of the files, one sentence for each way, and the copies among them.
    pub notes: Vec<String>,
}

/// More files than footprints can index.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{0} PEDR files; expected at most {max}", max = u16::MAX)]
#[cause(Configuration: "name only the files of the site's orbits in pedr.files")]
struct TooManyFiles(usize);

stage_inputs! {
    /// PEDR files, the filter of their shots, and the windows.
    pub struct SearchFootprints<'a> {
        /// Datum, filter, and the paths of the files.
        pub pedr: &'a PedrConfig,
        /// These files with their hashes.
        pub files: PedrFiles<'a>,
        /// Indexes of their records.
        pub index: KnownPlaces<'a>,
        /// Windows on the ground.
        pub windows: Windows<'a>,
        /// Seconds to add to time tags.
        pub clock_correction_s: &'a f64,
    }
}

/// The PEDR files of a site, in order.
#[derive(Debug)]
pub struct PedrFiles<'a>(pub &'a [HashedFile]);

impl Input for PedrFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        InOrder(self.0).add_to("pedr", inputs);
    }
}

/// Indexes beside the files: they shorten the search without changing its result.
#[derive(Debug)]
pub struct KnownPlaces<'a>(pub &'a Indexes);

impl Input for KnownPlaces<'_> {
    fn add_to(&self, _field: &str, _inputs: &mut Inputs) {}
}

impl Stage for SearchFootprints<'_> {
    const NAME: &'static str = STAGE;
    const METHOD: u32 = 8;
    const CHECKED: bool = true;
    type Output = SearchResult;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<SearchResult> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<SearchResult> {
        let (files, correction_s) = (self.files.0, *self.clock_correction_s);
        search_footprints(
            self.pedr,
            files,
            self.index.0,
            self.windows.value()?,
            correction_s,
            watch,
        )
    }

    fn findings(&self, result: &SearchResult) -> Vec<String> {
        let spoiled = result.rejected.get(&ShotRejection::Spoiled);
        let spoiled = spoiled.copied().unwrap_or_default();
        left_out::findings(&result.complaints, &result.complaint_counts, spoiled)
    }

    fn examine(&self) -> Vec<Result<String>> {
        let files = self.pedr.files.iter();
        files
            .map(|path| examine_file(path, self.pedr.datum))
            .collect()
    }
}

/// A summary of a PEDR file, without a search.
fn examine_file(path: &Path, choice: DatumChoice) -> Result<String> {
    let file = Source::open(path, choice, &Indexes::default())?;
    let complaints = file.label_complaints().iter();
    let complaints = complaints.map(|complaint| format!("; {}", complaint.text));
    Ok(format!(
        "{}: {} frames in {}{}",
        path.display(),
        file.records(),
        file.datum(),
        complaints.collect::<String>()
    ))
}

/// Searches `files`, interpreted as `pedr` configures, for shots in any of `windows`.
///
/// Every shot is judged by its own position, in IAU 2000 at its time tag. `correction_s` is added to tags to give
/// `et_s`. The result depends neither on the number of threads nor on `indexes`. A file with the bytes of an earlier
/// one is not read again; a note states this. `watch` is checked before every piece of a file, and counts records.
///
/// # Errors
/// A file that cannot be opened, holds no valid record, changes while it is read, or whose datum cannot be determined;
/// two files that hold the same shot in a window; [`Stopped`](areograph_base::error::Stopped). Any other fault inside a
/// file is a complaint; its good records are kept.
pub fn search_footprints<'a>(
    pedr: &PedrConfig,
    files: &[HashedFile],
    indexes: &Indexes,
    windows: &[WindowConfig],
    correction_s: f64,
    watch: impl Into<Watch<'a>>,
) -> Result<SearchResult> {
    let watch = watch.into();
    if files.len() > usize::from(u16::MAX) {
        return Err(TooManyFiles(files.len())).in_stage(STAGE);
    }
    let opened: Vec<Result<Source>> = files
        .par_iter()
        .map(|file| {
            watch.check()?;
            Source::open(&file.path, pedr.datum, indexes)
        })
        .collect();
    let mut gathered = Gathered::new(watch);
    let mut sources = Vec::with_capacity(files.len());
    // In the order of the files, so that one and the same of several failures is always reported.
    for (opened, file) in opened.into_iter().zip(files) {
        let source = opened.in_stage(STAGE)?;
        if gathered.enlist(&source, file) {
            sources.push(source);
        }
    }
    let regions = windows.iter().map(|window| Region::new(&window.shape));
    let query = Query::new(regions.collect(), &pedr.filter, Judged::All).corrected(correction_s);
    watch.announce(sources.iter().map(Source::records).sum());
    search(&sources, &query, watch.stop(), &mut gathered).in_stage(STAGE)?;
    let paths: Vec<PathBuf> = files.iter().map(|file| file.path.clone()).collect();
    require_distinct(&gathered.result.footprints, &paths).in_stage(STAGE)?;
    Ok(gathered.finish())
}

/// Results of the search of all files.
struct Gathered<'a> {
    watch: Watch<'a>,
    result: SearchResult,
    files: Vec<SourceFile>,
    /// Files that are searched: others are copies.
    searched: Vec<u16>,
    copies: Copies,
    understood: BTreeMap<String, u32>,
    copy_notes: Vec<String>,
}

impl<'a> Gathered<'a> {
    fn new(watch: Watch<'a>) -> Self {
        Self {
            watch,
            result: SearchResult {
                footprints: Footprints::new(Vec::new()),
                complaints: Vec::new(),
                complaint_counts: BTreeMap::new(),
                rejected: BTreeMap::new(),
                frames_read: 0,
                shots_read: 0,
                notes: Vec::new(),
            },
            files: Vec::new(),
            searched: Vec::new(),
            copies: Copies::default(),
            understood: BTreeMap::new(),
            copy_notes: Vec::new(),
        }
    }
}

impl Gathered<'_> {
    /// Registers the next file; returns whether it is to be searched, not being a copy of an earlier one.
    fn enlist(&mut self, source: &Source, file: &HashedFile) -> bool {
        let index = self.files.len();
        let enlisted = SourceFile {
            name: file_name(&file.path),
            version: source.version(),
            datum: source.datum(),
            blake3: file.blake3.clone(),
            is_table: false,
        };
        let copies = &mut self.copies;
        let original = copies.original_of(index, &enlisted.blake3, enlisted.datum);
        if let Some(original) = original {
            self.copy_notes.push(format!(
                "PEDR file {} ({}) is identical to file {} ({}) and is read once",
                index + 1,
                enlisted.name,
                original + 1,
                self.files[original].name
            ));
        } else {
            *self.understood.entry(understood(source)).or_default() += 1;
            // The number of files was checked.
            self.searched.push(u16::try_from(index).unwrap_or(u16::MAX));
        }
        self.files.push(enlisted);
        original.is_none()
    }

    fn finish(self) -> SearchResult {
        let mut result = self.result;
        result.footprints.files = self.files;
        let notes = self.understood.into_iter().map(|(note, files)| {
            let plural = if files == 1 { "" } else { "s" };
            format!("{files} PEDR file{plural}: {note}")
        });
        result.notes = notes.chain(self.copy_notes).collect();
        result
    }
}

impl Sink for Gathered<'_> {
    fn found(&mut self, file: usize, mut found: Found) -> Result<()> {
        let result = &mut self.result;
        let searched = self.searched[file];
        found.footprints.file = found.footprints.file.changed(|_, _| searched);
        result.footprints.append(found.footprints);
        let room = COMPLAINTS_MAX.saturating_sub(result.complaints.len());
        result
            .complaints
            .extend(found.complaints.into_iter().take(room));
        for (reason, count) in found.complaint_counts {
            *result.complaint_counts.entry(reason).or_default() += count;
        }
        for (reason, count) in found.rejected {
            *result.rejected.entry(reason).or_default() += count;
        }
        result.frames_read += found.frames_read;
        self.watch.step(found.frames_read, "records");
        result.shots_read += found.shots_read;
        Ok(())
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}

/// Interpretation of a file.
fn understood(source: &Source) -> String {
    let software = source.software_version().map_or_else(
        || "unknown, treated as new".to_owned(),
        |version| version.to_string(),
    );
    let letter = source.version();
    let letter = letter.map_or_else(|| "none".to_owned(), |letter| letter.to_string());
    format!(
        "version letter {letter}, datum {}, software version {software}",
        source.datum()
    )
}
