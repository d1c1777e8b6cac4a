//! Failures as exceptions, and calls that Ctrl-C can stop.

use std::{
    panic::{self, AssertUnwindSafe},
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::Duration,
};

use areograph::{
    column::lost_values,
    error::{Error, Kind, Result},
};
use pyo3::{
    create_exception,
    exceptions::{PyException, PyKeyboardInterrupt},
    prelude::*,
    types::PyType,
};

create_exception!(
    areograph,
    AreographError,
    PyException,
    "A failure; the subclass states its kind."
);
create_exception!(
    areograph,
    InternalError,
    AreographError,
    "A bug in areograph (exit code 1)."
);
create_exception!(
    areograph,
    UsageError,
    AreographError,
    "Wrong arguments or configuration (exit code 2)."
);
create_exception!(
    areograph,
    InputError,
    AreographError,
    "Missing input files, or invalid content (exit code 3)."
);
create_exception!(
    areograph,
    CoverageError,
    AreographError,
    "Kernels do not cover the requested times (exit code 4)."
);
create_exception!(
    areograph,
    InvalidProducts,
    AreographError,
    "The products exist but are invalid (exit code 5)."
);
create_exception!(
    areograph,
    FileAccessError,
    AreographError,
    "A file or folder could not be read or written (exit code 6)."
);

/// Interval at which signals are examined.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// The exception of a failure, with the attributes `exit_code`, `site`, `stage`, `file` and `advice`.
pub(crate) fn exception(py: Python<'_>, failure: &Error) -> PyErr {
    let kind = failure.kind();
    let message = failure.to_string();
    let class: Bound<'_, PyType> = match kind {
        Kind::Interrupted => return PyKeyboardInterrupt::new_err(message),
        Kind::Bug => py.get_type::<InternalError>(),
        Kind::Configuration => py.get_type::<UsageError>(),
        Kind::Input => py.get_type::<InputError>(),
        Kind::Coverage => py.get_type::<CoverageError>(),
        Kind::Validation => py.get_type::<InvalidProducts>(),
        Kind::Io => py.get_type::<FileAccessError>(),
    };
    let exception = PyErr::from_type(class, message);
    let value = exception.value(py);
    let attributes = value
        .setattr("exit_code", kind.exit_code())
        .and_then(|()| value.setattr("site", &failure.site))
        .and_then(|()| value.setattr("stage", &failure.stage))
        .and_then(|()| value.setattr("file", &failure.file))
        .and_then(|()| value.setattr("advice", failure.cause.advice()));
    attributes.err().unwrap_or(exception)
}

/// An exception for wrong arguments.
pub(crate) fn usage(message: impl Into<String>) -> PyErr {
    UsageError::new_err(message.into())
}

/// Runs `work` without the global interpreter lock; it stops early when a signal handler of Python raises an
/// exception.
///
/// # Errors
/// The exception of a failure, or of the signal.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T> + Send,
) -> PyResult<T> {
    let (worked, signal) = py.detach(move || {
        let stop = &AtomicBool::new(false);
        let (working, ended) = mpsc::channel::<()>();
        thread::scope(|scope| {
            let worker = scope.spawn(move || {
                let _working = working;
                work(stop)
            });
            let mut signal = None;
            while ended.recv_timeout(SIGNALS_EVERY) == Err(RecvTimeoutError::Timeout) {
                if signal.is_none() {
                    #[allow(
                        clippy::redundant_closure_for_method_calls,
                        reason = "the method has a lifetime of its own"
                    )]
                    let examined = Python::attach(|py| py.check_signals());
                    signal = examined.err();
                    stop.store(signal.is_some(), Ordering::Relaxed);
                }
            }
            (worker.join(), signal)
        })
    });
    match (worked, signal) {
        (_, Some(signal)) => Err(signal),
        (Ok(result), None) => result.map_err(|failure| exception(py, &failure)),
        (Err(panicked), None) => match lost_values(&*panicked) {
            Some(lost) => Err(exception(py, &lost)),
            None => panic::resume_unwind(panicked),
        },
    }
}

/// As [`interruptible`] for work that is never long.
///
/// # Errors
/// The exception of a failure.
pub(crate) fn detached<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<T> {
    py.detach(|| panic::catch_unwind(AssertUnwindSafe(work)))
        .unwrap_or_else(|panicked| match lost_values(&*panicked) {
            Some(lost) => Err(lost),
            None => panic::resume_unwind(panicked),
        })
        .map_err(|failure| exception(py, &failure))
}
