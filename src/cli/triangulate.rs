//! `areograph triangulate`.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use serde_json::json;

use super::{output, report};
use crate::{
    config::{LoadedNet, load_net},
    error::Kind,
    flow::run_net,
};

/// Triangulates a net of rectified pictures in the plane: four unknowns a picture, no kernels.
///
/// Products go to `<out>/<net>`. Blunders and gross controls are found and told.
///
/// Example: `areograph scene net --plane && areograph triangulate net/net.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Net file (TOML); config/nets/example.toml documents every key.
    #[arg(value_name = "NET.toml")]
    net: PathBuf,
    /// Folder of the products; the net gets a folder of its own in it.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Triangulate again, whatever is stored.
    #[arg(long)]
    force: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the net and prints how it ended.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let loaded = match load_net(&arguments.net) {
        Ok(loaded) => loaded,
        Err(failure) => return report(&failure),
    };
    let LoadedNet { net, warnings } = loaded;
    for warning in warnings {
        tracing::warn!("{warning}");
    }
    let outcome = match run_net(&net, &arguments.out, arguments.force) {
        Ok(outcome) => outcome,
        Err(failure) => return report(&failure),
    };
    let manifest = &outcome.manifest;
    if arguments.json {
        output::json(&json!({
            "net": net.net,
            "folder": outcome.folder,
            "unchanged": outcome.unchanged,
            "verdict": manifest.verdict,
            "counts": manifest.counts,
            "figures": manifest.figures,
        }));
    } else {
        let count = |name: &str| manifest.counts.get(name).copied().unwrap_or(0);
        let unchanged = if outcome.unchanged {
            ", nothing changed"
        } else {
            ""
        };
        output::line(format_args!(
            "{}: {}{unchanged}; {} pictures, {} points, {} blunders, {} controls left out of {}; {}",
            net.net,
            manifest.verdict.word(),
            count("pictures"),
            count("points"),
            count("blunders"),
            count("rejected_controls"),
            count("controls"),
            outcome.folder.join("report/index.html").display(),
        ));
        for reason in &manifest.verdict.reasons {
            output::line(format_args!("  invalid: {reason}"));
        }
        for remark in &manifest.verdict.remarks {
            output::line(format_args!("  remark: {remark}"));
        }
    }
    if manifest.verdict.valid {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(Kind::Validation.exit_code())
    }
}
