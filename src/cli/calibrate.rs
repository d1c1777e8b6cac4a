//! `areograph calibrate`.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;

use super::{
    load, report,
    single::{self, RunArguments},
};
use crate::{config::CalibrationConfig, flow::Task};

/// Calibrates the lines of a camera in orbit, first from tie points, then from laser points, some of which are withheld for
/// validation.
///
/// Points are read from tables; with `ties.match` and `[laser]` they are measured in the images, in rounds until convergence. A
/// calibration that was stopped or killed resumes at the first incomplete stage of its round.
///
/// Products go to `<out>/<calibration>`, with calibrated support data (ISD) of every line. Angles that tie points cannot determine
/// are detected and reported.
///
/// Example: `areograph scene calibration hrsc --images && areograph calibrate hrsc/calibration.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Calibration file (TOML); config/calibrations/example.toml documents every key.
    #[arg(value_name = "CALIBRATION.toml")]
    calibration: PathBuf,
    /// Output folder; the calibration is written to a subfolder.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    run: RunArguments,
}

/// Runs the calibration and reports the outcome.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let calibration: CalibrationConfig = match load(&arguments.calibration) {
        Ok(calibration) => calibration,
        Err(failure) => return report(&failure),
    };
    let (task, name) = (Task::Calibration(&calibration), &calibration.calibration);
    single::run(task, name, &arguments.out, &arguments.run, |count| {
        format!(
            "{} lines, {} tie points, {} laser points, {} more withheld, {} rejected",
            count("cameras"),
            count("ties"),
            count("controls"),
            count("held_back_controls"),
            count("left_out"),
        )
    })
}
