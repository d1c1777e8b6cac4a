//! `areograph pedr`.

#[cfg(feature = "cluster")]
mod cluster;
mod crossovers;
mod filter;
mod index;
mod info;
mod matching;
mod qa;
mod search;
#[cfg(feature = "sql")]
mod sql;
mod tab;
mod tables;

use std::process::ExitCode;

use clap::{Args, Subcommand};

pub(super) use self::qa::{TaskArguments, run_task};
use super::finish;

/// Inspects PEDR files.
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
    Crossovers(crossovers::Arguments),
    Qa(qa::Arguments),
    Match(matching::Arguments),
    #[cfg(feature = "sql")]
    Sql(sql::Arguments),
    #[cfg(feature = "cluster")]
    Cluster(cluster::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let ran = match &arguments.command {
        Command::Info(arguments) => info::run(arguments),
        Command::Tab(arguments) => tab::run(arguments),
        Command::Index(arguments) => index::run(arguments),
        Command::Search(arguments) => search::run(arguments),
        Command::Crossovers(arguments) => crossovers::run(arguments),
        Command::Qa(arguments) => return qa::run(arguments),
        Command::Match(arguments) => return matching::run(arguments),
        #[cfg(feature = "sql")]
        Command::Sql(arguments) => sql::run(arguments),
        #[cfg(feature = "cluster")]
        Command::Cluster(arguments) => cluster::run(arguments),
    };
    finish(ran)
}
