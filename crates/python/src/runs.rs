//! Sites: plans, checks and runs; and the program itself.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use areograph::{
    config::{Document as _, SiteConfig, built_in_instruments},
    error::Result,
    flow::{
        Extent, RunOptions, Task, check_answer, check_out, check_site, plan_answer, plan_site,
        publish_sites, run_answer, run_site,
    },
    pds::read_label,
    service::start::set_program,
    store::hashes::HashCache,
};
use pyo3::prelude::*;

use super::failures::{detached, interruptible};

/// Runs the program with the arguments of a command line, and returns its exit code.
///
/// * `program` – the file that starts the program again, for the processes of its service
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<String>, program: PathBuf) -> u8 {
    set_program(program);
    let ended = py.detach(|| areograph::cli::main_of(arguments));
    // An exit code does not state its number.
    let is_it = |code: &u8| ExitCode::from(*code) == ended;
    (0..=u8::MAX).find(is_it).unwrap_or(1)
}

/// The identifier of the product that a label describes.
#[pyfunction]
pub(crate) fn product_id(py: Python<'_>, label: PathBuf) -> PyResult<Option<String>> {
    detached(py, || {
        Ok(read_label(&label, built_in_instruments())?.product_id)
    })
}

fn load(site: &Path) -> Result<(SiteConfig, Vec<String>)> {
    let loaded = SiteConfig::load(site)?;
    let warnings = loaded.warnings.iter().map(ToString::to_string).collect();
    Ok((loaded.config, warnings))
}

/// A JSON answer, and warnings on the configuration.
type Answered = (String, Vec<String>);

/// Runs a site; the answer is that of `areograph run --json`.
#[pyfunction]
pub(crate) fn run(py: Python<'_>, site: PathBuf, out: PathBuf, force: bool) -> PyResult<Answered> {
    interruptible(py, |stop| {
        let (config, warnings) = load(&site)?;
        check_out(&out, std::slice::from_ref(&config))?;
        let hashes = HashCache::in_folder(&out, false);
        let options = RunOptions {
            force,
            ..RunOptions::of(&out, stop, &hashes)
        };
        let outcome = run_site(&config, &options)?;
        publish_sites(&out)?;
        Ok((run_answer(&outcome).to_string(), warnings))
    })
}

/// Stages that a run would execute; the answer is that of `areograph plan --json`.
#[pyfunction]
pub(crate) fn plan(py: Python<'_>, site: PathBuf, out: PathBuf) -> PyResult<Answered> {
    interruptible(py, |stop| {
        let (config, warnings) = load(&site)?;
        check_out(&out, std::slice::from_ref(&config))?;
        let hashes = HashCache::in_folder(&out, false);
        let plan = plan_site(&config, &RunOptions::of(&out, stop, &hashes))?;
        Ok((
            plan_answer(Task::Site(&config), &plan).to_string(),
            warnings,
        ))
    })
}

/// Examines a site; the answer is that of `areograph check --json`.
#[pyfunction]
pub(crate) fn check(py: Python<'_>, site: PathBuf, out: PathBuf, full: bool) -> PyResult<Answered> {
    interruptible(py, |stop| {
        let (config, warnings) = load(&site)?;
        let hashes = HashCache::in_folder(&out, false);
        let extent = if full { Extent::Full } else { Extent::Inputs };
        let mut checked = check_site(&config, extent, &RunOptions::of(&out, stop, &hashes));
        let apart = check_out(&out, std::slice::from_ref(&config));
        checked.failures.splice(0..0, apart.err());
        Ok((check_answer(&config.site, &checked).to_string(), warnings))
    })
}
