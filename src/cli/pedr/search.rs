//! `areograph pedr search`.

use std::{collections::BTreeMap, path::PathBuf, sync::atomic::AtomicBool};

use clap::{ArgGroup, Args, ValueEnum};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::cli::output;
use crate::{
    altimetry::{BiasScope, DatumChoice, MolaClock, ShotFilter, TagSign},
    config::{WindowConfig, load_windows, window_of_box, window_of_polygon},
    error::{Cause, Error, Kind, Result},
    files::file_name,
    footprints::{AsRead, Footprints, SourceFile},
    frames::{MarsDatum, MarsIau2000},
    geom::window::Region,
    pds::archive::{
        Found, Index, Indexes, Judged, Listing, Query, Sink, Source, WindowLists, search,
    },
    products::{FoundShots, ShotsFile, ShotsFormat},
    spice::{KernelSet, Session},
    stages::convert_datum::convert_datum,
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};

/// Finds the shots of an archive that lie in windows, each by its own position in IAU 2000.
///
/// Rows come in the order of time, each with its PEDR file and record; times are the tags of the files. What was asked for
/// and how complete the answer is stands in the file (key `areograph_search` of Parquet and GeoJSON; beside CSV in a file
/// .json). The exit code is not 0 when a file could not be searched, or rows are not in order of time.
///
/// Example: areograph pedr search archive --box 137.0,138.0,-5.5,-4.0 --out gale.parquet
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[command(group = ArgGroup::new("where").required(true).multiple(true).args(["boxes", "polygons", "windows"]))]
pub(super) struct Arguments {
    /// PEDR files, and folders with .b files in and below them.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// West, east, south and north edge, degrees: east longitude (-180 to 360, west above east crosses 0 or 180) and
    /// areocentric latitude.
    #[arg(long = "box", value_name = "W,E,S,N", value_parser = numbers, allow_hyphen_values = true)]
    boxes: Vec<[f64; 4]>,
    /// GeoJSON polygons.
    #[arg(long = "polygon", value_name = "FILE")]
    polygons: Vec<PathBuf>,
    /// TOML file with up to 10,000 tables `windows` as in a site file.
    #[arg(long, value_name = "FILE")]
    windows: Option<PathBuf>,
    /// Time tags, both included: TDB seconds past J2000, or UTC with --leap-seconds; either end may be left out.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    time: Option<String>,
    /// Leap seconds (LSK, such as naif0012.tls), for times in UTC.
    #[arg(long, value_name = "FILE")]
    leap_seconds: Option<PathBuf>,
    /// Classification codes to keep: 1 ground, 0 cloud or noise.
    #[arg(long, value_delimiter = ',', default_values_t = [1], allow_hyphen_values = true)]
    classes: Vec<i16>,
    /// Trigger channels to keep.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2, 3, 4])]
    channels: Vec<u8>,
    /// Attitude flags to keep.
    #[arg(long, value_delimiter = ',', default_values_t = [0, 1])]
    attitude_flags: Vec<u16>,
    /// Largest off-nadir angle of the laser, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 90.0)]
    off_nadir_max_deg: f64,
    /// Complain of every bad record of the files, not only of those near the windows.
    #[arg(long)]
    check_all: bool,
    /// How shots are written; without it, by the ending of --out, or only counted.
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// File to write.
    #[arg(long, value_name = "FILE", required_if_eq_any = [("format", "parquet"), ("format", "csv"), ("format", "geojson")])]
    out: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Parquet,
    Csv,
    Geojson,
    Count,
}

/// What is wrong with the command line.
#[derive(Debug, thiserror::Error)]
enum Usage {
    #[error("{0:?} is no interval of time")]
    Time(String),
    #[error("{0}; expected an ending .parquet, .csv or .geojson")]
    Ending(String),
    #[error("{0} PEDR files; expected 1 to 65535")]
    Files(usize),
}

impl Cause for Usage {
    fn kind(&self) -> Kind {
        Kind::Configuration
    }

    fn advice(&self) -> String {
        match self {
            Self::Time(_) => {
                "write A..B with seconds past J2000 (-25000000..-24990000), or with UTC (1999-03-16T00:00:00..1999-03-17T00:00:00) and --leap-seconds"
            }
            Self::Ending(_) => "say --format, or give the file another ending",
            Self::Files(_) => "name PEDR files (AP#####v.B), or folders that hold them",
        }
        .to_owned()
    }
}

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
/// Nobody stops a search but by killing it, which leaves nothing behind under the name of the answer.
static RUN_ON: AtomicBool = AtomicBool::new(false);

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let format = arguments.format()?;
    let windows = arguments.windows()?;
    let time = arguments.time()?;
    let mut answer = Answer {
        window_ids: windows.iter().map(|window| window.id.clone()).collect(),
        ..Answer::default()
    };
    let sources = answer.sources(&arguments.paths)?;
    answer.files = sources.iter().map(source_file).collect();
    answer.counts = vec![0; windows.len()];
    if let (Some(format), Some(out)) = (format, &arguments.out) {
        answer.file = Some(ShotsFile::create(out, format)?);
    }
    let filter = arguments.filter();
    let regions = windows.iter().map(|window| Region::new(&window.shape));
    let judged = if arguments.check_all {
        Judged::All
    } else {
        Judged::Near
    };
    let query = Query::new(regions.collect(), &filter, judged).within(time);
    search(&sources, &query, &RUN_ON, &mut answer)?;
    let told = answer.tell(arguments, &windows, &sources, time);
    if let Some(file) = answer.file.take() {
        file.finish(&told)?;
    }
    output::json(&told);
    answer.end()
}

impl Arguments {
    /// None only counts.
    fn format(&self) -> Result<Option<ShotsFormat>> {
        let of_ending = |out: &PathBuf| {
            let ending = out.extension().unwrap_or_default().to_ascii_lowercase();
            match ending.to_str() {
                Some("parquet") => Ok(Format::Parquet),
                Some("csv") => Ok(Format::Csv),
                Some("geojson" | "json") => Ok(Format::Geojson),
                _ => Err(Usage::Ending(out.display().to_string())),
            }
        };
        let format = match (self.format, &self.out) {
            (Some(format), _) => format,
            (None, Some(out)) => of_ending(out)?,
            (None, None) => Format::Count,
        };
        Ok(match format {
            Format::Parquet => Some(ShotsFormat::Parquet),
            Format::Csv => Some(ShotsFormat::Csv),
            Format::Geojson => Some(ShotsFormat::GeoJson),
            Format::Count => None,
        })
    }

    fn windows(&self) -> Result<Vec<WindowConfig>> {
        let mut windows = Vec::new();
        for (number, edges) in (1..).zip(&self.boxes) {
            windows.push(window_of_box(&format!("box{number}"), *edges)?);
        }
        for path in &self.polygons {
            windows.push(window_of_polygon(path)?);
        }
        if let Some(path) = &self.windows {
            windows.extend(load_windows(path)?);
        }
        Ok(windows)
    }

    fn filter(&self) -> ShotFilter {
        ShotFilter {
            classes: self.classes.clone(),
            channels: self.channels.clone(),
            attitude_flags: self.attitude_flags.clone(),
            off_nadir_max_rad: self.off_nadir_max_deg * RADIANS_PER_DEGREE,
        }
    }

    fn time(&self) -> Result<Option<Interval>> {
        let Some(text) = &self.time else {
            return Ok(None);
        };
        let wrong = || Usage::Time(text.clone());
        let (start, stop) = text.split_once("..").ok_or_else(wrong)?;
        let clock = self.leap_seconds.as_ref().map(|kernel| {
            let kernels = KernelSet::from_files(std::slice::from_ref(kernel))?;
            Session::open(&kernels)
        });
        let clock = clock.transpose()?;
        let instant = |text: &str, open_end: f64| -> Result<Et> {
            match (text, text.parse::<f64>(), &clock) {
                ("", _, _) => Ok(Et::from_seconds(open_end)),
                (_, Ok(seconds), _) if seconds.is_finite() => Ok(Et::from_seconds(seconds)),
                (_, _, Some(clock)) => Ok(clock.utc_to_et(text)?),
                _ => Err(wrong().into()),
            }
        };
        let interval = Interval::new(
            instant(start.trim(), f64::NEG_INFINITY)?,
            instant(stop.trim(), f64::INFINITY)?,
        );
        if interval.start > interval.stop {
            return Err(wrong().into());
        }
        Ok(Some(interval))
    }
}

fn numbers(text: &str) -> std::result::Result<[f64; 4], String> {
    let numbers: std::result::Result<Vec<f64>, _> = text
        .split(',')
        .map(|number| number.trim().parse())
        .collect();
    let numbers = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| "expected four numbers: west,east,south,north".to_owned())
}

fn source_file(source: &Source) -> SourceFile {
    SourceFile {
        name: file_name(source.path()),
        version: source.version(),
        datum: source.datum(),
        blake3: String::new(),
    }
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
    rejected: BTreeMap<String, u64>,
    frames_read: u64,
    shots_read: u64,
    /// File, record and time tag of the last row.
    last: Option<(u16, f64)>,
    disorder: Option<(NotInOrder, PathBuf)>,
}

impl Answer {
    /// The files in the order of their first records; those that cannot be searched are failures.
    fn sources(&mut self, paths: &[PathBuf]) -> Result<Vec<Source>> {
        let mut files = Vec::new();
        for path in paths {
            if path.is_dir() {
                let listing = Listing::below(path);
                self.failures.extend(listing.failures);
                files.extend(listing.paths);
            } else {
                files.push(path.clone());
            }
        }
        if files.is_empty() || files.len() > usize::from(u16::MAX) {
            return Err(Usage::Files(files.len()).into());
        }
        let indexes = Indexes::beside(&files, Index::read);
        let opened: Vec<Result<Source>> = files
            .par_iter()
            .map(|path| Source::open(path, DatumChoice::Auto, &indexes))
            .collect();
        let mut sources = Vec::with_capacity(opened.len());
        for source in opened {
            match source {
                Ok(source) => sources.push(source),
                Err(failure) => self.failures.push(failure),
            }
        }
        sources.sort_by(|a, b| a.first_s().total_cmp(&b.first_s()));
        Ok(sources)
    }

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
            "complete": self.failures.is_empty(),
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

    fn write(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        let footprints = in_iau2000(footprints, &self.files);
        file.write(&FoundShots {
            footprints: &footprints,
            windows,
            window_ids: &self.window_ids,
        })
    }
}

/// The shots in IAU 2000, turned at their time tags.
fn in_iau2000(mut footprints: Footprints<AsRead>, files: &[SourceFile]) -> Footprints<MarsIau2000> {
    footprints.files = files.to_vec();
    let is_iau2000 = |file: &u16| files[usize::from(*file)].datum == MarsDatum::Iau2000;
    if footprints.file.iter().all(is_iau2000) {
        return footprints.declare();
    }
    let at_tags = MolaClock {
        bias_s: 0.0,
        sign: TagSign::Late,
        scope: BiasScope::None,
        source: String::new(),
    };
    convert_datum(footprints, &at_tags).footprints
}

impl Sink for Answer {
    fn found(&mut self, _file: usize, found: Found) -> Result<()> {
        for complaint in &found.complaints {
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
        self.write(found.footprints, &found.windows)
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        self.failures.push(failure);
        Ok(())
    }
}
