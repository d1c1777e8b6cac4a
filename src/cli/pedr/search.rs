//! `areograph pedr search`.

mod arguments;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde_json::{Value, json};

pub(super) use self::arguments::Arguments;
use super::tables;
use crate::cli::{output, stop::Signals};
use crate::{
    config::WindowConfig,
    error::{Cause, Error, Result},
    files::file_name,
    footprints::{AsRead, Footprints, SourceFile},
    geom::window::Region,
    pds::{
        archive::{Found, Judged, Opened, Query, Seen, Sink, Source, search, search_tables},
        shot_table::OffNadirPass,
    },
    products::{RowsFormat, ShotsFile},
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

/// Complaints that are shown and kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 20;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let format = arguments.format()?;
    let windows = arguments.windows.windows()?;
    let time = arguments.time()?;
    let signals = Signals::heard()?;
    arguments.check_paths()?;
    let filter = arguments.filter();
    let regions = windows.iter().map(|window| Region::new(&window.shape));
    let judged = if arguments.check_all {
        Judged::All
    } else {
        Judged::Near
    };
    let query = Query::new(regions.collect(), &filter, judged).within(time);
    let mut answer = Answer {
        window_ids: windows.iter().map(|window| window.id.clone()).collect(),
        counts: vec![0; windows.len()],
        ..Answer::default()
    };
    if tables::tables_among(&arguments.paths)? {
        let read: Vec<&Path> = arguments.paths.iter().map(PathBuf::as_path).collect();
        arguments.require_apart(&read, &[])?;
        let clock = tables::clock(arguments.leap_seconds.as_deref())?;
        let utc = |text: &str| tables::instant(clock.as_ref(), text);
        let utc = clock.as_ref().map(|_| &utc as _);
        let found = search_tables(&arguments.paths, &query, utc, signals.stop())?;
        answer.files = found
            .tables
            .iter()
            .map(|table| table.file.clone())
            .collect();
        answer.told_files = found.tables.iter().map(tables::described).collect();
        answer.failures = found.failures;
        answer.repeated = Some(found.repeated);
        answer.passes_off_nadir = found.passes_off_nadir;
        answer.create(arguments, format)?;
        answer.found(0, found.found)?;
    } else {
        let Opened { sources, failures } = Opened::all(&arguments.paths)?;
        let read: Vec<&Path> = sources.iter().map(Source::path).collect();
        arguments.require_apart(&read, &failures)?;
        answer.files = sources.iter().map(Source::file).collect();
        answer.told_files = sources.iter().map(tell_of).collect();
        answer.failures = failures;
        answer.create(arguments, format)?;
        search(&sources, &query, signals.stop(), &mut answer)?;
    }
    let told = answer.tell(arguments, &windows, time);
    if let Some(file) = answer.file.take() {
        file.finish(&told)?;
    }
    output::json(&told);
    let complaints: u64 = answer.complaint_counts.values().sum();
    if complaints > 0 {
        tracing::warn!(
            "{complaints} complaints: invalid records are skipped; `complaints` of the answer counts them by reason, \
             `first_complaints` lists the first {COMPLAINTS_MAX}"
        );
    }
    answer.end()
}

/// A file in the answer.
fn tell_of(source: &Source) -> Value {
    json!({
        "file": file_name(source.path()),
        "records": source.records(),
        "datum": source.datum(),
    })
}

/// Results and failures.
#[derive(Default)]
struct Answer {
    file: Option<ShotsFile>,
    files: Vec<SourceFile>,
    /// The files for readers of the answer.
    told_files: Vec<Value>,
    /// Rows of tables that repeat others; `None` in a search of PEDR files.
    repeated: Option<u64>,
    /// Passes of tables off nadir.
    passes_off_nadir: Vec<OffNadirPass>,
    window_ids: Vec<String>,
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

impl Answer {
    /// Creates the shot file if one is requested.
    fn create(&mut self, arguments: &Arguments, format: Option<RowsFormat>) -> Result<()> {
        if let (Some(format), Some(out)) = (format, &arguments.out) {
            let (sources, window_ids) = (self.files.clone(), self.window_ids.clone());
            self.file = Some(ShotsFile::create(out, format, sources, window_ids)?);
        }
        Ok(())
    }

    /// The request, and the completeness of the answer.
    fn tell(
        &self,
        arguments: &Arguments,
        windows: &[WindowConfig],
        time: Option<Interval>,
    ) -> Value {
        let windows: Vec<Value> = windows
            .iter()
            .zip(&self.counts)
            .map(|(window, shots)| json!({"id": window.id, "shape": window.shape, "shots": shots}))
            .collect();
        let mut told = json!({
            "complete": self.failures.is_empty() && self.records_left_out == 0,
            "records_left_out": self.records_left_out,
            "in_order_of_time": self.disorder.is_none(),
            "rows": self.rows,
            "windows": windows,
            "filter": arguments.filter(),
            "all_records_judged": arguments.check_all,
            "failures": self.failures.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "complaints": self.complaint_counts,
            "first_complaints": self.complaints,
            "rejected": self.rejected,
            "frames_read": self.frames_read,
            "shots_read": self.shots_read,
            "files": self.told_files,
            "areograph": env!("CARGO_PKG_VERSION"),
        });
        if let Some(repeated) = self.repeated {
            told["repeated_rows"] = json!(repeated);
            tables::state_nadir_by_range(&mut told);
            told["passes_off_nadir"] = tables::passes(&self.passes_off_nadir);
        }
        if let Some(time) = time {
            let finite = |et: Et| et.seconds().is_finite().then(|| et.seconds());
            let ends = [
                ("et_start_s", finite(time.start)),
                ("et_stop_s", finite(time.stop)),
            ];
            for (name, end) in ends {
                if let Some(end) = end {
                    told[name] = json!(end);
                }
            }
        }
        told
    }

    /// The failures of an answer that does not meet the request.
    fn end(self) -> Result<()> {
        let disorder = self.disorder.into_iter();
        let disorder = disorder.map(|(disorder, path)| Error::from(disorder).in_file(path));
        let mut failures = self.failures.into_iter().chain(disorder);
        let Some(first) = failures.next() else {
            return Ok(());
        };
        failures.for_each(output::error);
        Err(first)
    }

    /// Detects rows that precede an earlier row in time, or that an earlier file contains as well.
    fn follow(&mut self, file: usize, footprints: &Footprints<AsRead>) {
        for (record, tag_s) in footprints.record.iter().zip(&footprints.et_tag_s) {
            let holder = self.seen.take(file, *tag_s);
            let later = self.latest.filter(|(_, latest_s)| tag_s < latest_s);
            if let Some(before) = holder.or(later.map(|(before, _)| before)) {
                let name = |file: usize| self.files[file].name.clone();
                let (disorder, _) = self.disorder.get_or_insert_with(|| {
                    let disorder = NotInOrder {
                        rows: 0,
                        record: *record,
                        before: name(before),
                    };
                    (disorder, PathBuf::from(name(file)))
                });
                disorder.rows += 1;
            }
            if later.is_none() {
                self.latest = Some((file, *tag_s));
            }
        }
    }
}

impl Sink for Answer {
    fn found(&mut self, file: usize, found: Found) -> Result<()> {
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
        match &mut self.file {
            Some(file) => file.write(found.footprints, &found.windows),
            None => Ok(()),
        }
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        self.failures.push(failure);
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
