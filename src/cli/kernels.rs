//! `areograph kernels`.

mod compare;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde_json::json;

use super::output;
use crate::{
    constants::Spacecraft,
    error::Error,
    spice::{Coverage, KernelSet, Session},
    time::Intervals,
};

/// Inspects kernels.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Lists kernels in load order: role by content, size, hash, and why each is included.
    #[command(after_help = "Example: areograph kernels list kernels/nav.tm")]
    List(Files),
    /// Shows position and attitude coverage of Mars Global Surveyor with its gaps, and the coverage of other spacecraft.
    #[command(after_help = "Example: areograph kernels coverage kernels/nav.tm")]
    Coverage(Files),
    Compare(compare::Arguments),
}

#[derive(Debug, Args)]
struct Files {
    /// One metakernel (.tm), a folder of kernels, or kernels in load order.
    #[arg(required = true, value_name = "KERNEL")]
    files: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    match &arguments.command {
        Command::List(files) => list(files),
        Command::Coverage(files) => coverage(files),
        Command::Compare(arguments) => compare::run(arguments),
    }
}

fn list(files: &Files) -> Result<(), Error> {
    let kernels = KernelSet::named(&files.files)?;
    if files.json {
        output::json(&json!({
            "kernels": kernels.kernels(),
            "explanation": kernels.explanation(),
        }));
        return Ok(());
    }
    for kernel in kernels.kernels() {
        output::line(format_args!(
            "{:5} {:>12} {}  {}",
            kernel.role.to_string(),
            kernel.bytes,
            &kernel.blake3[..16],
            kernel.path.display()
        ));
    }
    for line in kernels.explanation() {
        output::line(format_args!("# {line}"));
    }
    Ok(())
}

fn coverage(files: &Files) -> Result<(), Error> {
    let session = Session::open(&KernelSet::named(&files.files)?)?;
    let coverage = session.coverage()?;
    let others = Spacecraft::all().iter().filter(|one| !one.has_laser());
    let others: Vec<Session> = others.map(|one| session.of(one)).collect();
    let mut found = json!({ "position": coverage.spk, "attitude": coverage.ck });
    if !files.json {
        print_coverage("", &session, coverage)?;
    }
    // For other spacecraft, the available coverage.
    for session in &others {
        let (spacecraft, coverage) = (session.spacecraft(), session.coverage()?);
        if coverage.per_kernel.is_empty() {
            continue;
        }
        found["others"][&*spacecraft.id] =
            json!({ "position": coverage.spk, "attitude": coverage.ck });
        if !files.json {
            print_coverage(&format!(" of {}", spacecraft.name), session, coverage)?;
        }
    }
    if files.json {
        output::json(&found);
    }
    Ok(())
}

fn print_coverage(of: &str, session: &Session, coverage: &Coverage) -> Result<(), Error> {
    for (what, intervals) in [("position", &coverage.spk), ("attitude", &coverage.ck)] {
        output::line(format_args!("{what}{of}:"));
        print_intervals(session, intervals)?;
    }
    Ok(())
}

fn print_intervals(session: &Session, intervals: &Intervals) -> Result<(), Error> {
    if intervals.as_slice().is_empty() {
        output::line("  none");
    }
    let mut earlier: Option<f64> = None;
    for interval in intervals.as_slice() {
        if let Some(stop_s) = earlier {
            let gap_s = interval.start.seconds() - stop_s;
            output::line(format_args!("  -- gap of {gap_s:.3} s"));
        }
        output::line(format_args!(
            "  {} .. {} UTC  ({:.3} s)",
            session.et_to_utc(interval.start)?,
            session.et_to_utc(interval.stop)?,
            interval.duration_s()
        ));
        earlier = Some(interval.stop.seconds());
    }
    Ok(())
}
