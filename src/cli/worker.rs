//! `areograph worker`: one task of the service.

use std::process::ExitCode;

use clap::Args;

use crate::worker;

/// Performs one task of the service, which communicates over standard input and output.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The process of the service; the worker ends if its parent is a different process.
    #[arg(long, value_name = "PID")]
    parent: Option<u32>,
    /// Longest time without a line of the service, after which a worker on another computer ends.
    #[arg(long, value_name = "SECONDS")]
    lease_s: Option<f64>,
}

pub(super) fn run(arguments: &Arguments) -> ExitCode {
    worker::main(arguments.parent, arguments.lease_s)
}
