//! `areograph check`.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use clap::Args;

use super::{load_sites, output, progress::Progress};
use crate::{
    error::{Error, Kind},
    flow::{Checked, Extent, FoundProducts, RunOptions, check_answer, check_out, check_site},
    store::hashes::HashCache,
};

/// Checks configuration, files and kernel coverage, and reports all errors that would stop a run.
///
/// The verdict is that of the products in --out, if they are up to date. If they are not, --full computes every stage and
/// reports all causes that would make products invalid.
///
/// Examples:
///   areograph check sites/gusev.toml
///   areograph check sites --json
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Site files (TOML), folders or globs of them.
    #[arg(required = true, value_name = "SITE.toml")]
    sites: Vec<PathBuf>,
    /// Compute every stage for the verdict of a run, unless products are up to date; no product is written.
    #[arg(long)]
    full: bool,
    /// Folder of the products of a run, separate from the inputs; unchanged kernels that such a run has read are not read
    /// again.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Read every input file again, even if it did not change.
    #[arg(long)]
    rehash: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let hashes = HashCache::in_folder(&arguments.out, arguments.rehash);
    // A signal ends the command at once: it writes no product.
    let never = AtomicBool::new(false);
    let extent = if arguments.full {
        Extent::Full
    } else {
        Extent::Inputs
    };
    let mut failures = Vec::new();
    let mut answers = Vec::new();
    for site in load_sites(&arguments.sites)? {
        let progress = Progress::of_work(&site.site);
        let options = RunOptions {
            observer: &progress,
            ..RunOptions::of(&arguments.out, &never, &hashes)
        };
        let mut checked = check_site(&site, extent, &options);
        drop(progress);
        let out = check_out(&arguments.out, std::slice::from_ref(&site));
        checked.failures.splice(0..0, out.err());
        if arguments.json {
            answers.push(check_answer(&site.site, &checked));
        } else {
            print(&site.site, &checked);
        }
        failures.extend(checked.failures);
    }
    if arguments.json {
        output::json(&answers.into());
    }
    // The returned failure determines the exit code: a failure outranks an invalid site.
    let failed = failures
        .iter()
        .position(|failure| failure.kind() != Kind::Validation);
    let decides = (!failures.is_empty()).then(|| failures.remove(failed.unwrap_or(0)));
    failures.iter().for_each(output::error);
    decides.map_or(Ok(()), Err)
}

fn print(site: &str, checked: &Checked) {
    let word = if checked.failures.is_empty() {
        "ready"
    } else {
        "NOT READY"
    };
    output::line(format_args!("{site}: {word}"));
    for finding in &checked.findings {
        output::line(format_args!("  {finding}"));
    }
    let Some(verdict) = &checked.verdict else {
        if checked.failures.is_empty() {
            let stale = match checked.products {
                FoundProducts::OutOfDate => {
                    "products are out of date (areograph plan states why); "
                }
                _ => "",
            };
            output::line(format_args!(
                "  {stale}verdict: not computed; --full computes it, as a run does"
            ));
        }
        return;
    };
    let word = verdict.word();
    output::line(if checked.products == FoundProducts::Current {
        format!("  products are up to date; verdict: {word}")
    } else {
        format!("  a run would be {word}")
    });
    for remark in &verdict.remarks {
        output::line(format_args!("  {remark}"));
    }
}
