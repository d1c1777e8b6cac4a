//! Answers on standard output, failures on standard error.

use std::{
    fmt::Display,
    io::{Error, ErrorKind, Result, Write as _, stderr, stdout},
    sync::OnceLock,
};

use crate::error::IoError;

/// Why some of the answer was lost.
static LOST: OnceLock<Error> = OnceLock::new();

/// Prints a line of the answer. A reader that went away (`| head`) is no failure.
pub(super) fn line(text: impl Display) {
    told(writeln!(stdout().lock(), "{text}"));
}

/// Prints text as it is.
pub(super) fn text(text: &[u8]) {
    told(stdout().lock().write_all(text));
}

/// Prints a failure.
pub(super) fn error(failure: impl Display) {
    // Where failures cannot be told either, the exit code tells them.
    let _ = writeln!(stderr().lock(), "error: {failure}");
}

/// Prints what a user should know of a command that succeeded.
pub(super) fn warning(text: impl Display) {
    // As for failures.
    let _ = writeln!(stderr().lock(), "warning: {text}");
}

/// Prints an answer for scripts.
pub(super) fn json(value: &serde_json::Value) {
    line(format_args!("{value:#}"));
}

/// Gives out what is still held back.
///
/// # Errors
/// Some of the answer was lost.
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
        // The first failure is the one that is told.
        let _ = LOST.set(error);
    }
}
