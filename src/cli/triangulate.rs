//! `areograph triangulate`.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;

use super::{
    load, report,
    single::{self, RunArguments},
};
use crate::{config::NetConfig, flow::Task};

/// Triangulates a net of rectified pictures in the plane: four unknowns per picture, no kernels.
///
/// Products go to `<out>/<net>`. Blunders and gross errors of controls are detected and reported.
///
/// Example: `areograph scene net net && areograph triangulate net/net.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Net file (TOML); config/nets/example.toml documents every key.
    #[arg(value_name = "NET.toml")]
    net: PathBuf,
    /// Output folder; the net is written to a subfolder.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    run: RunArguments,
}

/// Runs the net and reports the outcome.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let net: NetConfig = match load(&arguments.net) {
        Ok(net) => net,
        Err(failure) => return report(&failure),
    };
    let (task, name) = (Task::Net(&net), &net.net);
    single::run(task, name, &arguments.out, &arguments.run, |count| {
        format!(
            "{} pictures, {} points, {} blunders, {} of {} controls rejected",
            count("pictures"),
            count("points"),
            count("blunders"),
            count("rejected_controls"),
            count("controls"),
        )
    })
}
