//! `areograph pedr qa`.

use std::{
    io::{IsTerminal as _, Write as _},
    path::PathBuf,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use clap::Args;
use serde_json::json;

use super::tables;
use crate::{
    altimetry::{BiasScope, MolaClock, TagSign},
    cli::{output, progress::duration, stop::Signals},
    config::usual_altimeter,
    error::{Cause, Error},
    flow::{ArchiveOutcome, ArchiveProgress, ArchiveRequest, check_archive},
};

/// Interval of progress lines without a terminal.
const TOLD_EVERY: Duration = Duration::from_secs(10);

/// Checks every shot of an archive against kernels: measured range minus distance, profile by profile.
///
/// Products go to --out: a row of statistics for every profile, shots of the worst ones, a page. A profile is the part of one
/// revolution in one file. A check that was interrupted or killed resumes where it stopped, with the same result. The exit code
/// is 5 if a profile exceeds a limit, a file could not be checked, or kernels do not cover a profile (--allow-uncovered).
///
/// Example: `areograph scene demo --days 5 && areograph pedr qa demo/pedr --kernels demo/kernels/archive.tm --out qa`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folders of PEDR files, searched below as well, and single files.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Metakernel: leap seconds, clock, and the orbit of the spacecraft.
    #[arg(long, value_name = "KERNELS.tm")]
    kernels: PathBuf,
    /// Folder of the products.
    #[arg(long, default_value = "qa")]
    out: PathBuf,
    /// Delay of the time tags; 0 leaves them unchanged. The default is the bias of MOLA's clock.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = usual_altimeter().clock_bias_s)]
    clock_bias_s: f64,
    /// Threads; the default is one for every processor.
    #[arg(long)]
    threads: Option<std::num::NonZeroU16>,
    /// Do not report the archive as invalid if the kernels have no position for some of its shots.
    #[arg(long)]
    allow_uncovered: bool,
    /// Check every file again, even if stored results are up to date.
    #[arg(long)]
    force: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// An implausible clock bias.
#[derive(Debug, thiserror::Error, Cause)]
#[error("--clock-bias-s is {0}; expected -10 to 10")]
#[cause(Configuration: "give the seconds by which time tags are late, 0.117 for MOLA")]
struct ClockBias(f64);

/// Profiles that exceed limits, or that could not be checked.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "the archive contradicts these kernels, or was checked only in part; the products were written"
)]
#[cause(Validation: "read the report: it lists the reasons first and then the worst profiles")]
struct Invalid;

impl Arguments {
    fn clock(&self) -> Result<MolaClock, ClockBias> {
        let bias_s = self.clock_bias_s;
        if !(-10.0..=10.0).contains(&bias_s) {
            return Err(ClockBias(bias_s));
        }
        let usual = usual_altimeter();
        let is_usual = (bias_s - usual.clock_bias_s).abs() <= 0.0;
        Ok(MolaClock {
            bias_s: bias_s.abs(),
            sign: if bias_s < 0.0 {
                TagSign::Early
            } else {
                TagSign::Late
            },
            scope: BiasScope::SpkLookup,
            source: if is_usual {
                usual.clock_source.clone()
            } else {
                "as given on the command line".to_owned()
            },
        })
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    if let Some(threads) = arguments.threads {
        // The only failure is an existing pool, which keeps its size.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads.get()))
            .build_global();
    }
    tables::refuse(&arguments.paths)?;
    let signals = Signals::heard()?;
    let telling = Telling::new();
    let request = ArchiveRequest {
        paths: &arguments.paths,
        kernels: &arguments.kernels,
        out: &arguments.out,
        clock: arguments.clock()?,
        force: arguments.force,
        allow_uncovered: arguments.allow_uncovered,
        stop: signals.stop(),
    };
    let outcome = check_archive(&request, &|progress| telling.tell(progress));
    telling.end();
    print(arguments, &outcome?)
}

fn print(arguments: &Arguments, outcome: &ArchiveOutcome) -> Result<(), Error> {
    let manifest = &outcome.manifest;
    let page = arguments.out.join("report/index.html");
    if arguments.json {
        output::json(&json!({
            "folder": arguments.out,
            "page": page,
            "unchanged": outcome.unchanged,
            "verdict": manifest.verdict,
            "counts": manifest.counts,
            "figures": manifest.figures,
        }));
    } else {
        let count = |name: &str| manifest.counts.get(name).copied().unwrap_or(0);
        output::line(format_args!(
            "{}{}: {} shots in {} profiles of {} files, {} profiles beyond limits, {} not covered by the kernels; {}",
            manifest.verdict.word(),
            if outcome.unchanged {
                ", nothing changed"
            } else {
                ""
            },
            count("shots"),
            count("profiles"),
            count("files"),
            count("profiles_beyond_limits"),
            count("profiles_not_covered"),
            page.display(),
        ));
        for reason in &manifest.verdict.reasons {
            output::line(format_args!("  invalid: {reason}"));
        }
        for remark in &manifest.verdict.remarks {
            output::line(format_args!("  remark: {remark}"));
        }
    }
    outcome.failures.iter().for_each(output::error);
    if manifest.verdict.valid {
        Ok(())
    } else {
        Err(Invalid.into())
    }
}

/// Reports progress on standard error: a line that is overwritten on a terminal, else a line at intervals.
struct Telling {
    begun: Instant,
    is_terminal: bool,
    told: Mutex<Option<Instant>>,
}

impl Telling {
    fn new() -> Self {
        Self {
            begun: Instant::now(),
            is_terminal: std::io::stderr().is_terminal(),
            told: Mutex::new(None),
        }
    }

    fn tell(&self, progress: &ArchiveProgress) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = told.is_none_or(|at| at.elapsed() >= TOLD_EVERY);
        let is_last = progress.files_done == progress.files;
        if !self.is_terminal && !is_due && !is_last {
            return;
        }
        *told = Some(Instant::now());
        let line = words(progress, self.begun.elapsed());
        let mut out = std::io::stderr().lock();
        // A closed standard error is not a failure.
        let _ = if self.is_terminal {
            write!(out, "\r\x1b[K{line}").and_then(|()| out.flush())
        } else {
            writeln!(out, "{line}")
        };
    }

    /// Ends the line on a terminal.
    fn end(&self) {
        let told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_terminal && told.is_some() {
            let _ = writeln!(std::io::stderr());
        }
    }
}

/// Progress of a check after the time `taken`, with the estimated time left.
fn words(progress: &ArchiveProgress, taken: Duration) -> String {
    let taken_s = taken.as_secs_f64();
    let done = format!("{} of {} files", progress.files_done, progress.files);
    let stored = match progress.files_stored {
        0 => String::new(),
        stored => format!(" ({stored} from before)"),
    };
    if progress.bytes_done == 0 {
        return format!("pedr qa: {done}{stored}");
    }
    let left_s = taken_s * progress.bytes_left as f64 / progress.bytes_done as f64;
    format!(
        "pedr qa: {done}{stored}, {:.1} million shots, {:.1} million a second, {} left",
        progress.shots as f64 / 1e6,
        progress.shots as f64 / 1e6 / taken_s,
        duration(left_s),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_says_how_far_it_is_and_how_long_it_takes() {
        let progress = ArchiveProgress {
            files_done: 3,
            files_stored: 1,
            files: 9,
            bytes_done: 2_000,
            bytes_left: 6_000,
            shots: 5_000_000,
        };
        assert_eq!(
            words(&progress, Duration::from_secs(2)),
            "pedr qa: 3 of 9 files (1 from before), 5.0 million shots, 2.5 million a second, 6 s left"
        );
    }
}
