//! The `areograph` program: arguments to library calls, failures to exit codes.

fn main() {}
