//! `areograph completions`.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, output};

/// Prints the completion script of a shell.
///
/// Example: `areograph completions bash > ~/.local/share/bash-completion/completions/areograph`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The shell.
    shell: Shell,
}

pub(super) fn run(arguments: &Arguments) {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut Cli::command(),
        "areograph",
        &mut script,
    );
    output::text(&script);
}
