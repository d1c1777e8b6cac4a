//! `areograph pedr search`.

mod arguments;

use std::{collections::BTreeMap, path::PathBuf};

use serde_json::{Value, json};

pub(super) use self::arguments::Arguments;
use crate::cli::{output, stop::Signals};
use crate::{
    config::WindowConfig,
    error::{Cause, Error, Kind, Result},
    files::file_name,
    footprints::{AsRead, Footprints, SourceFile},
    geom::window::Region,
    pds::archive::{Found, Judged, Opened, Query, Sink, Source, search},
    products::ShotsFile,
    time::{Et, Interval},
};

/// Rows that are not in the order of time.
#[derive(Debug, thiserror::Error)]
#[error(
    "{rows} rows are not in the order of time, the first in record {record}, after a shot of {before}"
)]
struct NotInOrder {
    rows: u64,
    record: u32,
    before: String,
}

impl Cause for NotInOrder {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "if both files hold the same orbits, name only one of them: their shots stand in the answer twice"
            .to_owned()
    }
}

/// Half the time between two shots, seconds: two rows nearer to each other are one shot of two files.
const SAME_SHOT_S: f64 = 0.05;
/// Complaints that are printed and kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 20;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let format = arguments.format()?;
    let windows = arguments.windows.windows()?;
    let time = arguments.time()?;
    let signals = Signals::heard()?;
    arguments.check_paths()?;
    let Opened { sources, failures } = Opened::all(&arguments.paths)?;
    arguments.require_apart(&sources, &failures)?;
    let mut answer = Answer {
        window_ids: windows.iter().map(|window| window.id.clone()).collect(),
        files: sources.iter().map(Source::file).collect(),
        counts: vec![0; windows.len()],
        failures,
        ..Answer::default()
    };
    if let (Some(format), Some(out)) = (format, &arguments.out) {
        let (sources, window_ids) = (answer.files.clone(), answer.window_ids.clone());
        answer.file = Some(ShotsFile::create(out, format, sources, window_ids)?);
    }
    let filter = arguments.filter();
    let regions = windows.iter().map(|window| Region::new(&window.shape));
    let judged = if arguments.check_all {
        Judged::All
    } else {
        Judged::Near
    };
    let query = Query::new(regions.collect(), &filter, judged).within(time);
    search(&sources, &query, signals.stop(), &mut answer)?;
    let told = answer.tell(arguments, &windows, &sources, time);
    if let Some(file) = answer.file.take() {
        file.finish(&told)?;
    }
    output::json(&told);
    let complaints: u64 = answer.complaint_counts.values().sum();
    if complaints > 0 {
        tracing::warn!(
            "{complaints} complaints: bad records are left out; `complaints` of the answer counts them by reason, \
             `first_complaints` has the first {COMPLAINTS_MAX}"
        );
    }
    answer.end()
}

/// What is found, and what fails.
#[derive(Default)]
struct Answer {
    file: Option<ShotsFile>,
    files: Vec<SourceFile>,
    window_ids: Vec<String>,
    rows: u64,
    /// Shots of each window.
    counts: Vec<u64>,
    failures: Vec<Error>,
    complaints: Vec<String>,
    complaint_counts: BTreeMap<String, u64>,
    /// Records with shots that are left out for a complaint: some may have been in a window.
    records_left_out: u64,
    rejected: BTreeMap<String, u64>,
    frames_read: u64,
    shots_read: u64,
    /// File, record and time tag of the last row.
    last: Option<(u16, f64)>,
    disorder: Option<(NotInOrder, PathBuf)>,
}

impl Answer {
    /// What was asked for, and how complete the answer is.
    fn tell(
        &self,
        arguments: &Arguments,
        windows: &[WindowConfig],
        sources: &[Source],
        time: Option<Interval>,
    ) -> Value {
        let windows: Vec<Value> = windows
            .iter()
            .zip(&self.counts)
            .map(|(window, shots)| json!({"id": window.id, "shape": window.shape, "shots": shots}))
            .collect();
        let files: Vec<Value> = sources
            .iter()
            .map(|source| {
                json!({
                    "file": file_name(source.path()),
                    "records": source.records(),
                    "datum": source.datum(),
                })
            })
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
            "files": files,
            "areograph": env!("CARGO_PKG_VERSION"),
        });
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

    /// The failures of an answer that is not what was asked for.
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

    /// Notices rows that do not follow the ones before in time.
    fn follow(&mut self, footprints: &Footprints<AsRead>) {
        for row in 0..footprints.len() {
            let (file, tag_s) = (footprints.file[row], footprints.et_tag_s[row]);
            if let Some((before, before_s)) = self.last
                && (tag_s < before_s || (file != before && tag_s - before_s < SAME_SHOT_S))
            {
                let name = |file: u16| self.files[usize::from(file)].name.clone();
                let (disorder, _) = self.disorder.get_or_insert_with(|| {
                    let disorder = NotInOrder {
                        rows: 0,
                        record: footprints.record[row],
                        before: name(before),
                    };
                    (disorder, PathBuf::from(name(file)))
                });
                disorder.rows += 1;
            }
            self.last = Some((file, tag_s));
        }
    }
}

impl Sink for Answer {
    fn found(&mut self, _file: usize, found: Found) -> Result<()> {
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
        self.follow(&found.footprints);
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
