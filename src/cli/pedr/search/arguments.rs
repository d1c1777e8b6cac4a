//! What `areograph pedr search` is asked for.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};

use crate::{
    altimetry::ShotFilter,
    cli::{pedr::filter::FilterArguments, windows::WindowArguments},
    error::{Cause, Kind, Result},
    products::ShotsFormat,
    spice::{KernelSet, Session},
    time::{Et, Interval},
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
pub(in crate::cli::pedr) struct Arguments {
    /// PEDR files, and folders with .b files in and below them.
    #[arg(required = true, value_name = "PATH")]
    pub(super) paths: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) windows: WindowArguments,
    /// Time tags, both included: TDB seconds past J2000, or UTC with --leap-seconds; either end may be left out.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    pub(super) time: Option<String>,
    /// Leap seconds (LSK, such as naif0012.tls), for times in UTC.
    #[arg(long, value_name = "FILE")]
    pub(super) leap_seconds: Option<PathBuf>,
    #[command(flatten)]
    pub(super) shots: FilterArguments,
    /// Complain of every bad record of the files, not only of those near the windows.
    #[arg(long)]
    pub(super) check_all: bool,
    /// How shots are written; without it, by the ending of --out, or only counted.
    #[arg(long, value_enum)]
    pub(super) format: Option<Format>,
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

/// What is wrong with the command line.
#[derive(Debug, thiserror::Error)]
pub(super) enum Usage {
    #[error("{0:?} is no interval of time")]
    Time(String),
    #[error("{0}; expected an ending .parquet, .csv or .geojson")]
    Ending(String),
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
        }
        .to_owned()
    }
}

impl Arguments {
    /// None only counts.
    pub(super) fn format(&self) -> Result<Option<ShotsFormat>> {
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
