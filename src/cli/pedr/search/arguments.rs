//! Arguments of `areograph pedr search`.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, ValueEnum};

use crate::{
    altimetry::ShotFilter,
    cli::{pedr::filter::FilterArguments, windows::WindowArguments},
    error::{Cause, Error, Result},
    files::require_apart,
    products::RowsFormat,
    spice::{KernelSet, Session},
    time::{Et, Interval},
};

/// Finds the shots of an archive that lie in windows, each by its own position in IAU 2000.
///
/// Rows are in time order, each with its PEDR file and record; times are the tags of the files. The file also states the
/// request and the completeness of the answer (key `areograph_search` of Parquet and GeoJSON; for CSV in a .json file
/// beside it). The exit code is not 0 if a file could not be searched, or if rows are not in time order.
///
/// Example: areograph pedr search archive --box 137.0,138.0,-5.5,-4.0 --out gale.parquet
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[command(group = ArgGroup::new("where").required(true).multiple(true).args(["box", "polygons", "windows"]))]
pub(in crate::cli::pedr) struct Arguments {
    /// PEDR files, and folders with .b files in and below them; or tables of the Orbital Data Explorer's PEDR query.
    #[arg(required = true, value_name = "PATH")]
    pub(super) paths: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) windows: WindowArguments,
    /// Interval of time tags, both ends included: TDB seconds past J2000, or UTC with --leap-seconds; either end may be left out.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    pub(super) time: Option<String>,
    /// Leap seconds (LSK, such as naif0012.tls), for times in UTC.
    #[arg(long, value_name = "FILE")]
    pub(super) leap_seconds: Option<PathBuf>,
    #[command(flatten)]
    pub(super) shots: FilterArguments,
    /// Report every invalid record of the files, not only those near the windows.
    #[arg(long)]
    pub(super) check_all: bool,
    /// Format of the shots; by default from the extension of --out; without --out shots are only counted.
    #[arg(long, value_enum)]
    pub(super) format: Option<Format>,
    /// Print JSON: the request, the answer with its completeness, and every file.
    #[arg(long)]
    pub(super) json: bool,
    /// File to write.
    #[arg(long, value_name = "FILE", required_if_eq_any = [("format", "parquet"), ("format", "csv"), ("format", "geojson")])]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Parquet,
    Csv,
    Geojson,
    Count,
}

impl Format {
    /// The format of files with this extension, if supported.
    fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_ascii_lowercase();
        match ending.to_str()? {
            "parquet" => Some(Self::Parquet),
            "csv" => Some(Self::Csv),
            "geojson" | "json" => Some(Self::Geojson),
            _ => None,
        }
    }
}

/// Errors of the command line.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
pub(super) enum Usage {
    #[error("{0:?} is not a time interval")]
    #[cause(
        "write A..B in seconds past J2000 (-25000000..-24990000), or in UTC \
         (1999-03-16T00:00:00..1999-03-17T00:00:00) with --leap-seconds"
    )]
    Time(String),
    #[error("{0}; expected the extension .parquet, .csv or .geojson")]
    #[cause("give --format, or name the file with one of these extensions")]
    Ending(String),
    #[error("{out}: the extension does not match --format {format}")]
    #[cause("omit --format, or name the file with the extension of this format")]
    OtherEnding { out: String, format: String },
    #[error("{0}: --format count only counts shots and writes no file")]
    #[cause("omit --out to print counts, or omit --format to write shots")]
    Count(String),
    #[error("{0:?} is not a file; expected the values of a filter in one list")]
    #[cause("separate values by commas (--classes 0,1), or repeat the filter for each value")]
    Value(String),
}

impl Arguments {
    /// `None` only counts shots.
    pub(super) fn format(&self) -> Result<Option<RowsFormat>> {
        let out = self.out.as_deref();
        let named = || out.unwrap_or(Path::new("")).display().to_string();
        let format = match (self.format, out, out.and_then(Format::of_ending)) {
            (Some(Format::Count), Some(_), _) => return Err(Usage::Count(named()).into()),
            (Some(format), Some(_), Some(of_ending)) if format != of_ending => {
                let format = format.to_possible_value();
                let format = format.map(|value| value.get_name().to_owned());
                let (out, format) = (named(), format.unwrap_or_default());
                return Err(Usage::OtherEnding { out, format }.into());
            }
            (Some(format), _, _) | (None, Some(_), Some(format)) => format,
            (None, Some(_), None) => return Err(Usage::Ending(named()).into()),
            (None, None, _) => Format::Count,
        };
        Ok(match format {
            Format::Parquet => Some(RowsFormat::Parquet),
            Format::Csv => Some(RowsFormat::Csv),
            Format::Geojson => Some(RowsFormat::GeoJson),
            Format::Count => None,
        })
    }

    /// # Errors
    /// A filter value outside its list, which would be searched as a file.
    pub(super) fn check_paths(&self) -> Result<()> {
        let is_value = |path: &&PathBuf| {
            let number = path.to_str().and_then(|text| text.parse::<i64>().ok());
            number.is_some() && !path.exists()
        };
        match self.paths.iter().find(is_value) {
            Some(path) => Err(Usage::Value(path.display().to_string()).into()),
            None => Ok(()),
        }
    }

    /// Ensures that no input is overwritten.
    ///
    /// # Errors
    /// An output is one of these files, or a file of windows or leap seconds.
    pub(super) fn require_apart(&self, read: &[&Path], failures: &[Error]) -> Result<()> {
        // The request is stored in a file beside the CSV.
        let beside = self.out.as_ref().map(|out| {
            let mut name = out.clone().into_os_string();
            name.push(".json");
            PathBuf::from(name)
        });
        let is_csv = self.format()? == Some(RowsFormat::Csv);
        let outputs = self.out.iter().chain(beside.iter().filter(|_| is_csv));
        let unread = failures
            .iter()
            .filter_map(|failure| failure.file.as_deref());
        let asked = self.windows.files();
        let asked = asked.chain(self.leap_seconds.as_deref());
        require_apart(
            outputs.map(PathBuf::as_path),
            read.iter().copied().chain(unread).chain(asked),
        )
    }

    pub(super) fn filter(&self) -> ShotFilter {
        self.shots.filter()
    }

    pub(super) fn time(&self) -> Result<Option<Interval>> {
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
