//! `areograph man`.

use std::path::PathBuf;

use clap::{Args, CommandFactory};

use super::Cli;
use crate::error::{IoError, Locate, Result};

/// Writes the manual pages, one for each command, in the format of `man`.
///
/// Example: `areograph man ~/.local/share/man/man1`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folder of the pages; it must exist.
    directory: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    clap_mangen::generate_to(Cli::command(), &arguments.directory)
        .map_err(IoError::on("write the manual pages"))
        .in_file(&arguments.directory)
}
