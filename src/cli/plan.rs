//! `areograph plan`.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use clap::Args;
use tracing::level_filters::LevelFilter;

use super::{files, load, load_sites, output};
use crate::{
    config::{CalibrationConfig, NetConfig},
    error::Error,
    flow::{RunOptions, StageReason, Task, check_out, plan_answer, plan_task},
    stage::Reason,
    store::hashes::HashCache,
};

/// States how many stages would run, and why; with -v for each stage.
///
/// Examples:
///   areograph plan sites/gusev.toml --out products
///   areograph plan sites/*.toml --out products --json
///   areograph plan hrsc/calibration.toml net/net.toml --out products
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Site, net and calibration files (TOML), folders or globs of them.
    #[arg(required = true, value_name = "FILE.toml")]
    files: Vec<PathBuf>,
    /// Folder of the products.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Read all input files, stored outputs and products again, even if unchanged.
    #[arg(long)]
    rehash: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Causes that the sentence of a plan states.
const CAUSES_MAX: usize = 5;

/// Files by the flow that they describe.
#[derive(Default)]
struct Files {
    sites: Vec<PathBuf>,
    nets: Vec<NetConfig>,
    calibrations: Vec<CalibrationConfig>,
}

impl Files {
    /// Recognises each file by the key that gives it its name; all others are site files.
    fn of(paths: &[PathBuf]) -> Result<Self, Error> {
        let mut files = Self::default();
        for path in paths {
            if has_key(path, "net") {
                files.nets.push(load(path)?);
            } else if has_key(path, "calibration") {
                files.calibrations.push(load(path)?);
            } else {
                files.sites.push(path.clone());
            }
        }
        Ok(files)
    }
}

/// Whether a file has this key outside of tables; loading reports a file that cannot be read.
pub(super) fn has_key(path: &Path, key: &str) -> bool {
    let text = fs::read_to_string(path).unwrap_or_default();
    let table: Result<toml::Table, _> = text.parse();
    table.is_ok_and(|table| table.contains_key(key))
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let files = Files::of(&files::expand(&arguments.files, &files::CONFIGURATIONS)?)?;
    let sites = load_sites(&files.sites)?;
    check_out(&arguments.out, &sites)?;
    let (never, hashes) = (
        AtomicBool::new(false),
        HashCache::in_folder(&arguments.out, arguments.rehash),
    );
    let options = RunOptions::of(&arguments.out, &never, &hashes);
    let tasks = sites.iter().map(Task::Site);
    let tasks = tasks.chain(files.nets.iter().map(Task::Net));
    let tasks = tasks.chain(files.calibrations.iter().map(Task::Calibration));
    print(&tasks.collect::<Vec<_>>(), &options, arguments.json)
}

/// How many stages would run, and the causes: reasons that are not changes of other outputs.
fn sentence(stages: &[StageReason]) -> String {
    let run: Vec<&Reason> = stages
        .iter()
        .map(|stage| &stage.reason)
        .filter(|reason| reason.runs())
        .collect();
    if run.is_empty() {
        return format!(
            "nothing changed; a run would keep all {} stages",
            stages.len()
        );
    }
    let mut causes: Vec<String> = Vec::new();
    for reason in &run {
        let stated = match reason {
            Reason::Changed(inputs) => inputs.clone(),
            other => vec![other.to_string()],
        };
        let is_cause =
            |cause: &String| !cause.starts_with("output of ") && !cause.starts_with("inputs of ");
        for cause in stated.into_iter().filter(is_cause) {
            if !causes.contains(&cause) {
                causes.push(cause);
            }
        }
    }
    let more = causes.len().saturating_sub(CAUSES_MAX);
    causes.truncate(CAUSES_MAX);
    if more > 0 {
        causes.push(format!("{more} more causes (-v)"));
    }
    let (run, all) = (run.len(), stages.len());
    let noun = if all == 1 { "stage" } else { "stages" };
    let causes = causes.join(", ");
    let colon = if causes.is_empty() { "" } else { ": " };
    format!("{run} of {all} {noun} would run{colon}{causes}")
}

/// Prints the plan of every task.
pub(super) fn print(
    tasks: &[Task<'_>],
    options: &RunOptions<'_>,
    as_json: bool,
) -> Result<(), Error> {
    let mut answers = Vec::new();
    for task in tasks {
        let plan = plan_task(*task, options)?;
        if as_json {
            answers.push(plan_answer(*task, &plan));
            continue;
        }
        output::line(format_args!("{}: {}", task.name(), sentence(&plan.stages)));
        if LevelFilter::current() < LevelFilter::INFO {
            continue;
        }
        for planned in plan.stages {
            let word = if planned.reason.runs() {
                "run "
            } else {
                "keep"
            };
            output::line(format_args!(
                "  {word}  {:32} {}",
                planned.stage, planned.reason
            ));
        }
    }
    if as_json {
        output::json(&answers.into());
    }
    Ok(())
}
