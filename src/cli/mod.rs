//! The command line: one file per command, no geometry.

mod calibrate;
mod campaign;
mod check;
mod compare_readings;
mod completions;
mod estimate_boresight;
mod export;
mod fetch;
mod files;
mod image;
mod init;
mod kernels;
mod man;
mod nightly;
mod numbers;
mod open;
mod output;
mod panicked;
mod pedr;
mod plan;
mod pool;
mod progress;
mod report;
mod run;
mod scene;
mod serve;
mod service;
mod single;
mod slurm;
mod stop;
mod triangulate;
mod windows;
mod worker;

use std::{
    ffi::OsString,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{ArgAction, Parser, Subcommand, ValueEnum};
use tracing::level_filters::LevelFilter;

use crate::{
    column::lost_values,
    config::{Document, SiteConfig, check_sites},
    error::{Cause, Error, Locate as _},
    fetch::remote::read_stand_ins,
};

/// Mars Global Surveyor data preparation: SPICE kernels, MOLA shots and MOC images to validated products.
///
/// Exit codes: 0 done, 1 bug in areograph, 2 usage or configuration, 3 input data missing or invalid, 4 kernel coverage,
/// 5 products written but invalid, or moved beyond a limit, 6 input/output, 130 interrupted.
#[derive(Debug, Parser)]
#[command(
    name = "areograph",
    version,
    arg_required_else_help = true,
    after_help = "Example: areograph run sites/gusev.toml --out products"
)]
struct Cli {
    /// Print results and errors, but no progress and no warnings.
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = GENERAL)]
    quiet: bool,
    /// Print the log; given twice, in detail.
    #[arg(short, long, global = true, action = ArgAction::Count, help_heading = GENERAL)]
    verbose: u8,
    /// Print the log in this form.
    #[arg(
        long,
        global = true,
        value_name = "FORM",
        conflicts_with = "quiet",
        help_heading = GENERAL
    )]
    log: Option<LogForm>,
    #[command(subcommand)]
    command: Command,
}

/// Heading of options that every command has.
const GENERAL: &str = "Options of all commands";

/// How the log is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LogForm {
    /// Lines of text.
    Text,
    /// One JSON object per line.
    Json,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Arguments),
    Fetch(fetch::Arguments),
    Run(run::Arguments),
    Check(check::Arguments),
    Plan(plan::Arguments),
    /// Inspects kernels: load order, gaps in coverage, differences between alternative sets.
    #[command(after_help = "Example: areograph kernels coverage kernels/nav.tm")]
    Kernels(kernels::Arguments),
    /// Inspects images of the camera, and finds them in the mission's index.
    #[command(after_help = "Example: areograph image info M0100115.imq")]
    Image(image::Arguments),
    /// Inspects PEDR files, and searches archives of them.
    #[command(after_help = "Example: areograph pedr info ap10001l.b")]
    Pedr(pedr::Arguments),
    Report(report::Arguments),
    CompareReadings(compare_readings::Arguments),
    EstimateBoresight(estimate_boresight::Arguments),
    Export(export::Arguments),
    Triangulate(triangulate::Arguments),
    Calibrate(calibrate::Arguments),
    Campaign(campaign::Arguments),
    Scene(scene::Arguments),
    Serve(serve::Arguments),
    Nightly(nightly::Arguments),
    /// Maintains a service: its configuration, copies of its database, its tokens.
    #[command(after_help = "Example: areograph service token list areograph.toml")]
    Service(service::Arguments),
    Completions(completions::Arguments),
    Man(man::Arguments),
    #[command(hide = true)]
    Worker(worker::Arguments),
    #[command(hide = true)]
    CampaignTask(campaign::TaskArguments),
    #[command(hide = true)]
    ArchiveTask(pedr::TaskArguments),
}

/// Parses the command line, runs the command and reports failures on standard error.
#[must_use]
pub fn main() -> ExitCode {
    main_of(std::env::args_os())
}

/// Like [`main`], with these arguments; the first is the name of the program.
///
/// An invalid command line ends the process.
#[must_use]
pub fn main_of(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> ExitCode {
    let cli = Cli::parse_from(arguments);
    log(&cli);
    read_stand_ins();
    let code = catch_unwind(AssertUnwindSafe(|| run(cli.command)));
    let code = code.unwrap_or_else(|panic| match lost_values(&*panic) {
        Some(lost) => report(&lost),
        None => resume_unwind(panic),
    });
    // A success with incomplete output is a failure.
    match output::complete() {
        Err(lost) if code == ExitCode::SUCCESS => report(&lost.into()),
        _ => code,
    }
}

/// Starts the log.
fn log(cli: &Cli) {
    // The log is the only account of an unattended command.
    let unattended = match &cli.command {
        Command::Worker(_)
        | Command::CampaignTask(_)
        | Command::ArchiveTask(_)
        | Command::Nightly(_) => true,
        Command::Serve(arguments) => arguments.init.is_none(),
        _ => false,
    };
    let level = match (unattended, cli.verbose, cli.log.is_some()) {
        _ if cli.quiet => LevelFilter::ERROR,
        (false, 0, false) => LevelFilter::WARN,
        (false, 0, true) | (false, 1, _) | (true, 0, _) => LevelFilter::INFO,
        _ => LevelFilter::DEBUG,
    };
    let log = tracing_subscriber::fmt()
        .with_writer(progress::Log)
        .with_max_level(level)
        .with_target(false);
    let as_json = match &cli.command {
        // Its log is read by the service.
        Command::Worker(_) => true,
        _ => false,
    } || cli.log == Some(LogForm::Json);
    if as_json {
        log.json().flatten_event(true).init();
    } else if level == LevelFilter::WARN {
        // Warnings of a command that a person runs.
        log.without_time().with_ansi(false).init();
    } else {
        let terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
        let colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        log.with_ansi(terminal && colour).init();
    }
}

fn run(command: Command) -> ExitCode {
    match command {
        Command::Init(arguments) => finish(init::run(&arguments)),
        Command::Fetch(arguments) => finish(fetch::run(&arguments)),
        Command::Run(arguments) => run::run(&arguments),
        Command::Check(arguments) => finish(check::run(&arguments)),
        Command::Plan(arguments) => finish(plan::run(&arguments)),
        Command::Kernels(arguments) => finish(kernels::run(&arguments)),
        Command::Image(arguments) => finish(image::run(&arguments)),
        Command::Pedr(arguments) => pedr::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::CompareReadings(arguments) => finish(compare_readings::run(&arguments)),
        Command::EstimateBoresight(arguments) => finish(estimate_boresight::run(&arguments)),
        Command::Export(arguments) => finish(export::run(&arguments)),
        Command::Triangulate(arguments) => triangulate::run(&arguments),
        Command::Calibrate(arguments) => calibrate::run(&arguments),
        Command::Campaign(arguments) => campaign::run(&arguments),
        Command::Scene(arguments) => finish(scene::run(&arguments)),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Nightly(arguments) => nightly::run(&arguments),
        Command::Service(arguments) => finish(service::run(&arguments)),
        Command::Completions(arguments) => {
            completions::run(&arguments);
            ExitCode::SUCCESS
        }
        Command::Man(arguments) => finish(man::run(&arguments)),
        Command::Worker(arguments) => worker::run(&arguments),
        Command::CampaignTask(arguments) => campaign::run_task(&arguments),
        Command::ArchiveTask(arguments) => pedr::run_task(&arguments),
    }
}

/// Success, or one failure reported.
fn finish(result: Result<(), Error>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report(&failure),
    }
}

/// Prints a failure and returns its exit code.
fn report(failure: &Error) -> ExitCode {
    output::error(failure);
    ExitCode::from(failure.kind().exit_code())
}

/// Loads a configuration; its warnings go to the log.
fn load<T: Document>(path: &Path) -> Result<T, Error> {
    let loaded = T::load(path)?;
    for warning in loaded.warnings {
        tracing::warn!("{warning}");
    }
    Ok(loaded.config)
}

/// A file of another flow.
#[derive(Debug, thiserror::Error, Cause)]
#[error("describes a {what}; expected a site")]
#[cause(Configuration: "use `areograph {command}`")]
struct NoSite {
    what: &'static str,
    command: &'static str,
}

/// Refuses files of other flows by their kind; loading reports all other faults.
fn site_file(path: &Path) -> Result<(), Error> {
    for (what, command) in [
        ("net", "triangulate"),
        ("calibration", "calibrate"),
        ("campaign", "campaign"),
    ] {
        if plan::has_key(path, what) && !plan::has_key(path, "site") {
            return Err(NoSite { what, command }).in_file(path);
        }
    }
    Ok(())
}

/// Loads site files, also of folders and globs; every problem of every file is reported before the first failure is
/// returned.
fn load_sites(paths: &[PathBuf]) -> Result<Vec<SiteConfig>, Error> {
    let mut sites = Vec::with_capacity(paths.len());
    let mut first_failure = None;
    for path in files::expand(paths, &files::CONFIGURATIONS)? {
        match site_file(&path).and_then(|()| load(&path)) {
            Ok(site) => sites.push(site),
            Err(failure) => {
                if let Some(earlier) = first_failure.replace(failure) {
                    output::error(&earlier);
                }
            }
        }
    }
    if let Some(failure) = first_failure {
        return Err(failure);
    }
    check_sites(&sites)?;
    Ok(sites)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::Cli;

    /// Commands and groups of them that have no example in their help.
    fn without_example(command: &mut clap::Command, named: &str, found: &mut Vec<String>) {
        let help = command.render_long_help().to_string();
        if !help.contains("Example") {
            found.push(named.to_owned());
        }
        let hidden = ["worker", "campaign-task", "archive-task", "help"];
        let own = |command: &&mut clap::Command| !hidden.contains(&command.get_name());
        for command in command.get_subcommands_mut().filter(own) {
            let named = format!("{named} {}", command.get_name());
            without_example(command, &named, found);
        }
    }

    #[test]
    fn every_help_has_an_example() {
        let mut found = Vec::new();
        without_example(&mut Cli::command(), "areograph", &mut found);
        assert!(found.is_empty(), "{found:?}");
    }
}
