//! `areograph plan`.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use clap::Args;
use serde_json::json;

use super::{load_sites, output};
use crate::{
    config::SiteConfig,
    error::Error,
    flow::{PUBLISH, RunOptions, StageReason, check_out, plan_site},
    store::hashes::HashCache,
};

/// Lists the stages that would run, with the reasons.
///
/// Examples:
///   areograph plan sites/gusev.toml --out products
///   areograph plan sites/*.toml --out products --json
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Site files (TOML).
    #[arg(required = true, value_name = "SITE.toml")]
    sites: Vec<PathBuf>,
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

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let sites = load_sites(&arguments.sites)?;
    check_out(&arguments.out, &sites)?;
    let options = RunOptions {
        out: arguments.out.clone(),
        until: PUBLISH,
        force: false,
        stop: &AtomicBool::new(false),
        hashes: &HashCache::in_folder(&arguments.out, arguments.rehash),
        roots: &[],
        observer: &(),
    };
    print(&sites, &options, arguments.json)
}

/// Prints the plan of every site.
pub(super) fn print(
    sites: &[SiteConfig],
    options: &RunOptions<'_>,
    as_json: bool,
) -> Result<(), Error> {
    let mut answers = Vec::new();
    for site in sites {
        let stages = plan_site(site, options)?.stages;
        if as_json {
            let stages: Vec<_> = stages.iter().map(stage_json).collect();
            answers.push(json!({ "site": site.site, "stages": stages }));
            continue;
        }
        output::line(format_args!("{}:", site.site));
        for planned in stages {
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

/// A stage with its reason, for the answers of plans and runs.
pub(super) fn stage_json(stage: &StageReason) -> serde_json::Value {
    json!({
        "stage": stage.stage,
        "runs": stage.reason.runs(),
        "because": stage.reason.to_string(),
    })
}
