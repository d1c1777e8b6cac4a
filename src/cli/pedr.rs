//! `areograph pedr`.

mod index;
mod info;
mod qa;
mod search;
#[cfg(feature = "sql")]
mod sql;
mod tab;

use clap::{Args, Subcommand};

use crate::error::Error;

/// Looks into PEDR files.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Info(info::Arguments),
    Tab(tab::Arguments),
    Index(index::Arguments),
    Search(search::Arguments),
    Qa(qa::Arguments),
    #[cfg(feature = "sql")]
    Sql(sql::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    match &arguments.command {
        Command::Info(arguments) => info::run(arguments),
        Command::Tab(arguments) => tab::run(arguments),
        Command::Index(arguments) => index::run(arguments),
        Command::Search(arguments) => search::run(arguments),
        Command::Qa(arguments) => qa::run(arguments),
        #[cfg(feature = "sql")]
        Command::Sql(arguments) => sql::run(arguments),
    }
}
