//! A run of a net, a calibration, a match or an archive: its options, and the answer as a line or JSON.

use std::{path::Path, process::ExitCode};

use clap::Args;
use serde_json::json;

use super::{output, plan, progress::Progress, report, stop::Signals};
use crate::{
    error::{Kind, Result},
    flow::{Ending, PUBLISH, RunOptions, RunOutcome, Task, run_task},
    store::{hashes::HashCache, manifest::Manifest, publish::read_manifest},
    verdict::{NOT_TESTED, Verdict},
};

/// Options of such a run.
#[derive(Debug, Args)]
pub(super) struct RunArguments {
    /// Stop after this stage; an unknown name lists the stages.
    #[arg(long, value_name = "STAGE", default_value = PUBLISH, hide_default_value = true)]
    until: String,
    #[command(flatten)]
    flags: RunFlags,
}

/// Flags of every run, including that of a site.
#[derive(Debug, Clone, Args)]
#[allow(clippy::struct_excessive_bools, reason = "command-line flags")]
pub(super) struct RunFlags {
    /// Run every stage, even if its stored output is up to date.
    #[arg(long)]
    pub(super) force: bool,
    /// Read all input files, stored outputs and products again, even if unchanged.
    #[arg(long)]
    pub(super) rehash: bool,
    /// State how many stages would run, and why (with -v for each stage), as `areograph plan` does; write no products.
    #[arg(long)]
    pub(super) plan: bool,
    /// Print JSON.
    #[arg(long)]
    pub(super) json: bool,
}

/// Runs a task, or shows its plan, and reports the outcome, with its counts in words.
///
/// * `name` – name in the answer
pub(super) fn run(
    task: Task<'_>,
    name: &str,
    out: &Path,
    arguments: &RunArguments,
    words: impl Fn(&dyn Fn(&str) -> u64) -> String,
) -> ExitCode {
    match ran(task, out, arguments) {
        Ok(Some(outcome)) => answer(task.kind(), name, &outcome, arguments.flags.json, words),
        Ok(None) => ExitCode::SUCCESS,
        Err(failure) => report(&failure),
    }
}

/// The outcome of a run; `None` of a plan, which is printed.
fn ran(task: Task<'_>, out: &Path, arguments: &RunArguments) -> Result<Option<RunOutcome>> {
    let (signals, flags) = (Signals::heard()?, &arguments.flags);
    let hashes = HashCache::in_folder(out, flags.rehash);
    let options = |observer| RunOptions {
        out: out.to_owned(),
        until: &arguments.until,
        force: flags.force,
        stop: signals.stop(),
        hashes: &hashes,
        roots: &[],
        observer,
    };
    if flags.plan {
        plan::print(&[task], &options(&()), flags.json)?;
        return Ok(None);
    }
    run_task(task, &options(&Progress::of(task))).map(Some)
}

/// Prints the outcome of a run.
fn answer(
    kind: &str,
    name: &str,
    outcome: &RunOutcome,
    as_json: bool,
    words: impl Fn(&dyn Fn(&str) -> u64) -> String,
) -> ExitCode {
    outcome.left_out.iter().for_each(output::error);
    let invalid = ExitCode::from(Kind::Validation.exit_code());
    let folder = &outcome.folder;
    let manifest = match &outcome.ending {
        Ending::Published(manifest) | Ending::Unchanged(manifest) => manifest,
        Ending::StoppedAfter(stage) => {
            if as_json {
                let earlier = read_manifest(folder).map(|earlier| earlier.finished_utc);
                output::json(&json!({
                    kind: name,
                    "folder": folder,
                    "stopped_after": stage,
                    "earlier_products_utc": earlier,
                }));
            } else {
                stopped_after(outcome, stage);
            }
            return if outcome.left_out.is_empty() {
                ExitCode::SUCCESS
            } else {
                invalid
            };
        }
    };
    let unchanged = outcome.is_unchanged();
    let page = folder.join("report/index.html");
    if as_json {
        output::json(&json!({
            kind: name,
            "folder": folder,
            "page": page,
            "unchanged": unchanged,
            "verdict": manifest.verdict,
            "counts": manifest.counts,
            "figures": manifest.figures,
        }));
    } else {
        let count = |name: &str| manifest.counts.get(name).copied().unwrap_or(0);
        output::line(format_args!(
            "{name}: {}{}; {}; {}",
            manifest.verdict.word(),
            if unchanged { ", nothing changed" } else { "" },
            words(&count),
            page.display(),
        ));
        tell(manifest);
    }
    if manifest.verdict.valid {
        ExitCode::SUCCESS
    } else {
        invalid
    }
}

/// Reports that a run stopped after the requested stage, and what remains of earlier products.
pub(super) fn stopped_after(outcome: &RunOutcome, stage: &str) {
    let products = read_manifest(&outcome.folder).map_or_else(
        || ", no products".to_owned(),
        |earlier| {
            let (utc, folder) = (earlier.finished_utc, outcome.folder.display());
            format!("; the products of {utc} in {folder} remain unchanged")
        },
    );
    output::line(format_args!(
        "{}: stopped after {stage}{products}",
        outcome.name
    ));
}

/// Reports reasons, remarks, and errors that are not tested.
fn tell(manifest: &Manifest) {
    for reason in &manifest.verdict.reasons {
        output::line(format_args!("  invalid: {reason}"));
    }
    for remark in &manifest.verdict.remarks {
        output::line(format_args!("  remark: {remark}"));
    }
    untested(&manifest.verdict);
}

/// Prints errors that no datum of a valid result can show; of an invalid one the reasons matter.
pub(super) fn untested(verdict: &Verdict) {
    if verdict.valid && !verdict.untested.is_empty() {
        output::line(format_args!("  {NOT_TESTED}"));
        for phrase in &verdict.untested {
            output::line(format_args!("    {phrase}"));
        }
    }
}
