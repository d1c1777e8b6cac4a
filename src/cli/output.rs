//! Answers on standard output, failures on standard error.

use std::{
    fmt::Display,
    io::{Error, ErrorKind, Result, Write as _, stderr, stdout},
    sync::OnceLock,
};

use crate::error::{IoError, printable};

/// Control characters of answers and messages themselves; others come from paths and files.
const LAYOUT: &str = "\n\t";

/// Reason why part of the output was lost.
static LOST: OnceLock<Error> = OnceLock::new();

/// Prints a line of the output. A closed pipe (`| head`) is not a failure.
pub(super) fn line(text: impl Display) {
    told(writeln!(
        stdout().lock(),
        "{}",
        printable(&text.to_string(), LAYOUT)
    ));
}

/// Prints text unchanged.
pub(super) fn text(text: &[u8]) {
    told(stdout().lock().write_all(text));
}

/// Prints a failure.
pub(super) fn error(failure: impl Display) {
    // If standard error fails too, the exit code still reports the failure.
    let failure = failure.to_string();
    let _ = writeln!(stderr().lock(), "error: {}", printable(&failure, LAYOUT));
}

/// Prints a warning of a command that succeeded.
pub(super) fn warning(text: impl Display) {
    // As for failures.
    let text = text.to_string();
    let _ = writeln!(stderr().lock(), "warning: {}", printable(&text, LAYOUT));
}

/// Prints JSON for scripts.
pub(super) fn json(value: &serde_json::Value) {
    line(format_args!("{value:#}"));
}

/// Flushes the output.
///
/// # Errors
/// Part of the output was lost.
pub(super) fn complete() -> std::result::Result<(), IoError> {
    told(stdout().lock().flush());
    LOST.get().map_or(Ok(()), |error| {
        let error = Error::new(error.kind(), error.to_string());
        Err(IoError::on("write the answer to standard output")(error))
    })
}

fn told(result: Result<()>) {
    if let Err(error) = result
        && error.kind() != ErrorKind::BrokenPipe
    {
        // Only the first failure is reported.
        let _ = LOST.set(error);
    }
}
