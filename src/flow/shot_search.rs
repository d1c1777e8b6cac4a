//! A search of an archive for shots: the shots, and a statement of the request and of the completeness of the answer.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use serde_json::{Value, json};

use super::shot_tables::{
    described, instant_of_table, leap_second_clock, passes, state_nadir_by_range, tables_among,
};
use crate::{
    altimetry::ShotFilter,
    config::WindowConfig,
    error::{Cause, Error, Result},
    files::file_name,
    footprints::{AsRead, Footprints, SourceFile},
    geom::window::Region,
    pds::{
        archive::{
            Found, FoundInTables, Judged, Opened, Query, Seen, Sink, Source, WindowLists, search,
            search_tables,
        },
        shot_table::OffNadirPass,
    },
    time::{Et, Interval},
};

/// Rows that are not in time order, or that an earlier file contains as well.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "{rows} rows are not in time order, the first in record {record}, after a shot of {before}"
)]
#[cause(Input: "if both files contain the same orbits, name only one of them: otherwise the answer contains their \
    shots twice")]
struct NotInOrder {
    rows: u64,
    record: u32,
    before: String,
}

/// Complaints that are kept with their text; all are counted.
pub const COMPLAINTS_MAX: usize = 20;

/// Shots to find.
#[derive(Debug, Clone, Copy)]
pub struct ShotRequest<'a> {
    /// PEDR files and folders of them, or tables of the Orbital Data Explorer.
    pub paths: &'a [PathBuf],
    /// Windows, each shot by its own position.
    pub windows: &'a [WindowConfig],
    /// Shots to keep; without a filter all with a return.
    pub filter: Option<&'a ShotFilter>,
    /// Interval of time tags.
    pub time: Option<Interval>,
    /// Records that are checked.
    pub judged: Judged,
    /// Leap seconds, which let the two times of the rows of tables be compared.
    pub leap_seconds: Option<&'a Path>,
}

/// Receives the shots of a search, in order.
pub trait ShotSink {
    /// Receives shots with their windows.
    ///
    /// # Errors
    /// An error that ends the search.
    fn take(&mut self, shots: Footprints<AsRead>, windows: &WindowLists) -> Result<()>;
}

/// A search whose files are known.
pub struct ShotSearch<'a> {
    request: ShotRequest<'a>,
    query: Query<'a>,
    files: Vec<SourceFile>,
    /// The files for readers of the answer.
    described: Vec<Value>,
    archive: Archive,
    failures: Vec<Error>,
}

/// What is searched.
enum Archive {
    Files(Vec<Source>),
    /// Tables are read when they are opened.
    Tables(Box<FoundInTables>),
}

/// An answer: its statement, and what keeps it from being complete.
#[derive(Debug)]
pub struct ShotAnswer {
    /// Request and completeness, as JSON.
    pub statement: Value,
    /// Complaints about records.
    pub complaints: u64,
    /// Files that could not be searched, and rows that are not in order of time; empty if the answer meets the request.
    pub failures: Vec<Error>,
}

impl<'a> ShotSearch<'a> {
    /// Opens the files.
    ///
    /// # Errors
    /// No files; tables among PEDR files; leap seconds that cannot be read; [`Stopped`](crate::error::Stopped).
    pub fn open(request: ShotRequest<'a>, stop: &AtomicBool) -> Result<Self> {
        let regions = request.windows.iter();
        let regions = regions.map(|window| Region::new(&window.shape)).collect();
        let query = match request.filter {
            Some(filter) => Query::new(regions, filter, request.judged),
            None => Query::unfiltered(regions, request.judged),
        };
        let query = query.within(request.time);
        if !tables_among(request.paths)? {
            let Opened { sources, failures } = Opened::all(request.paths)?;
            return Ok(Self {
                request,
                query,
                files: sources.iter().map(Source::file).collect(),
                described: sources.iter().map(described_file).collect(),
                archive: Archive::Files(sources),
                failures,
            });
        }
        let clock = leap_second_clock(request.leap_seconds)?;
        let utc = |text: &str| instant_of_table(clock.as_ref(), text);
        let utc = clock.as_ref().map(|_| &utc as _);
        let mut found = search_tables(request.paths, &query, utc, stop)?;
        Ok(Self {
            request,
            query,
            files: found
                .tables
                .iter()
                .map(|table| table.file.clone())
                .collect(),
            described: found.tables.iter().map(described).collect(),
            failures: std::mem::take(&mut found.failures),
            archive: Archive::Tables(Box::new(found)),
        })
    }

    /// The files to which shots refer by index.
    #[must_use]
    pub fn files(&self) -> &[SourceFile] {
        &self.files
    }

    /// The files that are read.
    #[must_use]
    pub fn paths(&self) -> Vec<&Path> {
        match &self.archive {
            Archive::Files(sources) => sources.iter().map(Source::path).collect(),
            Archive::Tables(_) => self.request.paths.iter().map(PathBuf::as_path).collect(),
        }
    }

    /// Files that cannot be searched.
    #[must_use]
    pub fn failures(&self) -> &[Error] {
        &self.failures
    }

    /// Passes the shots to `sink`.
    ///
    /// # Errors
    /// An error of `sink`; [`Stopped`](crate::error::Stopped).
    pub fn run(self, stop: &AtomicBool, sink: &mut dyn ShotSink) -> Result<ShotAnswer> {
        let mut answering = Answering {
            answer: Answer {
                files: self.files,
                counts: vec![0; self.request.windows.len()],
                failures: self.failures,
                ..Answer::default()
            },
            sink,
        };
        match self.archive {
            Archive::Files(sources) => search(&sources, &self.query, stop, &mut answering)?,
            Archive::Tables(found) => {
                answering.answer.repeated = Some(found.repeated);
                answering.answer.passes_off_nadir = found.passes_off_nadir;
                answering.found(0, found.found)?;
            }
        }
        let answer = answering.answer;
        Ok(ShotAnswer {
            statement: answer.statement(&self.request, &self.described),
            complaints: answer.complaint_counts.values().sum(),
            failures: answer.all_failures(),
        })
    }
}

/// A PEDR file in the answer.
fn described_file(source: &Source) -> Value {
    json!({
        "file": file_name(source.path()),
        "records": source.records(),
        "datum": source.datum(),
    })
}

/// Results and failures.
#[derive(Default)]
struct Answer {
    files: Vec<SourceFile>,
    /// Rows of tables that repeat others; `None` in a search of PEDR files.
    repeated: Option<u64>,
    /// Passes of tables off nadir.
    passes_off_nadir: Vec<OffNadirPass>,
    rows: u64,
    /// Shots of each window.
    counts: Vec<u64>,
    failures: Vec<Error>,
    complaints: Vec<String>,
    complaint_counts: BTreeMap<String, u64>,
    /// Records whose shots are left out because of a complaint; some may lie in a window.
    records_left_out: u64,
    rejected: BTreeMap<String, u64>,
    frames_read: u64,
    shots_read: u64,
    seen: Seen,
    /// File and time tag of the latest row so far.
    latest: Option<(usize, f64)>,
    disorder: Option<(NotInOrder, PathBuf)>,
}

/// An answer while shots arrive.
struct Answering<'a> {
    answer: Answer,
    sink: &'a mut dyn ShotSink,
}

impl Answer {
    /// The request, and the completeness of the answer.
    fn statement(&self, request: &ShotRequest<'_>, described: &[Value]) -> Value {
        let windows: Vec<Value> = request
            .windows
            .iter()
            .zip(&self.counts)
            .map(|(window, shots)| json!({"id": window.id, "shape": window.shape, "shots": shots}))
            .collect();
        let mut statement = json!({
            "complete": self.failures.is_empty() && self.records_left_out == 0,
            "records_left_out": self.records_left_out,
            "in_order_of_time": self.disorder.is_none(),
            "rows": self.rows,
            "windows": windows,
            "filter": request.filter,
            "all_records_judged": request.judged == Judged::All,
            "failures": self.failures.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "complaints": self.complaint_counts,
            "first_complaints": self.complaints,
            "rejected": self.rejected,
            "frames_read": self.frames_read,
            "shots_read": self.shots_read,
            "files": described,
            "areograph": env!("CARGO_PKG_VERSION"),
        });
        if let Some(repeated) = self.repeated {
            statement["repeated_rows"] = json!(repeated);
            state_nadir_by_range(&mut statement);
            statement["passes_off_nadir"] = passes(&self.passes_off_nadir);
        }
        if let Some(time) = request.time {
            let finite = |et: Et| et.seconds().is_finite().then(|| et.seconds());
            let ends = [
                ("et_start_s", finite(time.start)),
                ("et_stop_s", finite(time.stop)),
            ];
            for (name, end) in ends {
                if let Some(end) = end {
                    statement[name] = json!(end);
                }
            }
        }
        statement
    }

    /// The failures of an answer that does not meet the request.
    fn all_failures(self) -> Vec<Error> {
        let disorder = self.disorder.into_iter();
        let disorder = disorder.map(|(disorder, path)| Error::from(disorder).in_file(path));
        self.failures.into_iter().chain(disorder).collect()
    }

    /// Counts the shots and complaints of a stretch of file `file`.
    fn count(&mut self, file: usize, found: &Found) {
        for complaint in &found.complaints {
            self.records_left_out += u64::from(complaint.leaves_out());
            if self.complaints.len() < COMPLAINTS_MAX {
                self.complaints.push(complaint.to_string());
            }
        }
        for (reason, count) in &found.complaint_counts {
            let reason = json!(reason).as_str().unwrap_or_default().to_owned();
            *self.complaint_counts.entry(reason).or_default() += count;
        }
        for (reason, count) in &found.rejected {
            *self.rejected.entry(reason.to_string()).or_default() += count;
        }
        self.frames_read += found.frames_read;
        self.shots_read += found.shots_read;
        self.rows += found.footprints.len() as u64;
        for row in 0..found.footprints.len() {
            for window in found.windows.of(row) {
                self.counts[*window as usize] += 1;
            }
        }
        self.follow(file, &found.footprints);
    }

    /// Detects rows that precede an earlier row in time, or that an earlier file contains as well.
    fn follow(&mut self, file: usize, footprints: &Footprints<AsRead>) {
        for (record, tag_s) in footprints.record.iter().zip(&footprints.et_tag_s) {
            let holder = self.seen.take(file, tag_s);
            let later = self.latest.filter(|(_, latest_s)| tag_s < *latest_s);
            if let Some(before) = holder.or(later.map(|(before, _)| before)) {
                let name = |file: usize| self.files[file].name.clone();
                let (disorder, _) = self.disorder.get_or_insert_with(|| {
                    let disorder = NotInOrder {
                        rows: 0,
                        record,
                        before: name(before),
                    };
                    (disorder, PathBuf::from(name(file)))
                });
                disorder.rows += 1;
            }
            if later.is_none() {
                self.latest = Some((file, tag_s));
            }
        }
    }
}

impl Sink for Answering<'_> {
    fn found(&mut self, file: usize, found: Found) -> Result<()> {
        self.answer.count(file, &found);
        self.sink.take(found.footprints, &found.windows)
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        self.answer.failures.push(failure);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_testing::shot_cases::{CASES, Case, source};

    fn is_in_order(case: &Case) -> bool {
        let tags_s: Vec<f64> = (0..case.files.len())
            .flat_map(|file| case.tags_s(file))
            .collect();
        tags_s.is_sorted()
    }

    #[test]
    fn rows_that_stand_in_two_files_are_noticed() {
        for case in CASES {
            let files = 0..case.files.len();
            let mut answer = Answer {
                files: files.clone().map(source).collect(),
                ..Answer::default()
            };
            for file in files {
                answer.follow(file, &case.footprints(file));
            }
            let noticed = answer.disorder;
            let is_expected = case.shared.is_some() || !is_in_order(case);
            assert_eq!(noticed.is_some(), is_expected, "{}", case.name);
            if let (Some((disorder, path)), Some([other, file]), true) = (
                noticed,
                case.shared,
                is_in_order(case) || case.files.len() == 2,
            ) {
                assert_eq!(path, PathBuf::from(source(file).name), "{}", case.name);
                assert_eq!(disorder.before, source(other).name, "{}", case.name);
            }
        }
    }
}
