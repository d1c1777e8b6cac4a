//! `areograph image`.

mod extract;
mod info;
mod search;

pub(super) use search::propose;

use clap::{Args, Subcommand};

use crate::error::Error;

/// Inspects images of the camera, and finds them in the mission's index.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Info(info::Arguments),
    Extract(extract::Arguments),
    Search(search::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    match &arguments.command {
        Command::Info(arguments) => info::run(arguments),
        Command::Extract(arguments) => extract::run(arguments),
        Command::Search(arguments) => search::run(arguments),
    }
}
