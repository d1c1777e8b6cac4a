//! `areograph scene`.

use std::path::PathBuf;

use clap::Args;

use super::output;
use crate::{
    error::Error,
    scene::{SceneOptions, write_scene, write_scene_along},
};

/// Writes a synthetic mission: kernels, PEDR files, labels, site files, and the truth behind them.
///
/// Example: `areograph scene demo && areograph run demo/sites/*.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folder to write; an earlier scene in it is replaced, if nothing was added or changed.
    directory: PathBuf,
    /// Seed of terrain and noise; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Fly these kernels instead of the invented orbit.
    #[arg(long, value_name = "KERNELS.tm")]
    along: Option<PathBuf>,
    /// With --along: labels of images to put into the site file.
    #[arg(long, value_name = "FILE", requires = "along")]
    label: Vec<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let options = SceneOptions {
        seed: arguments.seed,
        ..SceneOptions::default()
    };
    let summary = match &arguments.along {
        None => write_scene(&arguments.directory, &options)?,
        Some(kernels) => {
            write_scene_along(&arguments.directory, kernels, &arguments.label, &options)?
        }
    };
    output::line(summary);
    Ok(())
}
