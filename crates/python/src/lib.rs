//! The native module of the Python package: functions of the program with columns, texts and numbers as arguments.
//!
//! The package in `python/areograph` holds the interface for users; it converts data frames and arrays, and documents
//! units. Long calls release the global interpreter lock and stop on Ctrl-C. A failure raises the exception of its
//! kind.

#![allow(
    clippy::needless_pass_by_value,
    reason = "arguments of functions of Python are values"
)]

mod archives;
mod cameras;
mod columns;
mod failures;
mod kernels;
mod ranges;
mod runs;
mod shots;

/// `areograph._native`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        archives::fetch,
        cameras::Camera,
        columns::Columns,
        failures::{
            AreographError, CoverageError, FileAccessError, InputError, InternalError,
            InvalidProducts, UsageError,
        },
        kernels::{compare_kernels, spacecraft_states, utc_to_et},
        ranges::range_residuals,
        runs::{check, main, plan, product_id, run},
        shots::{search_shots, shot_columns},
    };

    /// Version of the program.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    /// Columns of shots that `range_residuals` takes.
    #[pymodule_export]
    const RANGE_COLUMNS: [&str; 10] = super::ranges::RANGE_COLUMNS;
    /// A pause longer than this starts another profile of the same orbit, seconds.
    #[pymodule_export]
    const PROFILE_PAUSE_S: f64 = areograph::stages::group_profiles::Profile::PAUSE_S;

    /// Stand-ins of files on servers are read as files are.
    #[pymodule_init]
    #[allow(clippy::unnecessary_wraps, reason = "the signature is that of PyO3")]
    fn init(_module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        areograph::fetch::remote::read_stand_ins();
        Ok(())
    }
}
