//! `areograph triangulate`.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;

use super::{
    report,
    single::{Request, answer},
};
use crate::{
    config::{LoadedNet, load_net},
    flow::run_net,
};

/// Triangulates a net of rectified pictures in the plane: four unknowns per picture, no kernels.
///
/// Products go to `<out>/<net>`. Blunders and gross errors of controls are detected and reported.
///
/// Example: `areograph scene net --plane && areograph triangulate net/net.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Net file (TOML); config/nets/example.toml documents every key.
    #[arg(value_name = "NET.toml")]
    net: PathBuf,
    /// Output folder; the net is written to a subfolder.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Triangulate again, even if stored results are up to date.
    #[arg(long)]
    force: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the net and reports the outcome.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let loaded = match load_net(&arguments.net) {
        Ok(loaded) => loaded,
        Err(failure) => return report(&failure),
    };
    let LoadedNet { net, warnings } = loaded;
    for warning in warnings {
        tracing::warn!("{warning}");
    }
    let request = Request {
        what: "net",
        name: &net.net,
        json: arguments.json,
    };
    let ran = run_net(&net, &arguments.out, arguments.force);
    answer(&request, ran, |count| {
        format!(
            "{} pictures, {} points, {} blunders, {} controls left out of {}",
            count("pictures"),
            count("points"),
            count("blunders"),
            count("rejected_controls"),
            count("controls"),
        )
    })
}
