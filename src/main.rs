//! The `areograph` program: arguments to library calls, failures to exit codes.

use std::process::ExitCode;

fn main() -> ExitCode {
    areograph::cli::main()
}
