//! Answers on standard output, failures on standard error.

use std::{fmt::Display, io::Write};

/// Prints a line of the answer. A reader that went away (`| head`) is no failure.
pub(super) fn line(text: impl Display) {
    let _ = writeln!(std::io::stdout().lock(), "{text}");
}

/// Prints text as it is.
pub(super) fn text(text: &[u8]) {
    let _ = std::io::stdout().lock().write_all(text);
}

/// Prints a failure.
pub(super) fn error(failure: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "error: {failure}");
}

/// Prints an answer for scripts.
pub(super) fn json(value: &serde_json::Value) {
    line(format_args!("{value:#}"));
}
