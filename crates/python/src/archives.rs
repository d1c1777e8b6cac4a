//! Files from the archives of the mission.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    error::Result,
    fetch::{Archives, Done, Filling, Standing, plan::PlannedFile},
    flow::Needs,
};
use pyo3::prelude::*;

use super::failures::interruptible;

/// Kind, path, source, size in bytes and MD5, where they are known, state and reason of a file.
type FileRow = (
    String,
    PathBuf,
    String,
    Option<u64>,
    Option<String>,
    String,
    String,
);

/// Plans the files that a site needs, or fetches them: rows by file, and notes.
///
/// * `into` – folder of fetch.json and of copies of the indexes; by default the folder of the site file
/// * `archives` – table of other hosts
#[pyfunction]
pub(crate) fn fetch(
    py: Python<'_>,
    site: PathBuf,
    into: Option<PathBuf>,
    plan_only: bool,
    archives: Option<PathBuf>,
) -> PyResult<(Vec<FileRow>, Vec<String>)> {
    interruptible(py, |stop| {
        let archives = match &archives {
            Some(path) => Archives::with(path)?,
            None => Archives::built_in()?,
        };
        let folder = site.parent().filter(|folder| *folder != Path::new(""));
        let folder = into.as_deref().or(folder).unwrap_or(Path::new("."));
        filled(
            &Filling::of(&archives, folder, stop)?,
            &site,
            plan_only,
            stop,
        )
    })
}

fn filled(
    filling: &Filling<'_>,
    site: &Path,
    plan_only: bool,
    stop: &AtomicBool,
) -> Result<(Vec<FileRow>, Vec<String>)> {
    let mut needs = Needs::default();
    needs.add_site(site)?;
    if !plan_only {
        filling.refresh(Filling::indexes_of(&needs.wish))?;
    }
    let mut plan = filling.plan(&needs.wish)?;
    plan.notes.splice(0..0, needs.notes);
    let notes = plan.notes.iter().chain(&plan.lacks).cloned().collect();
    if plan_only {
        let standing = filling.standing(&plan)?;
        let files = plan.files.iter().zip(standing);
        let rows = files.map(|(file, standing)| row(file, None, state_of(standing)));
        return Ok((rows.collect(), notes));
    }
    let mut rows = Vec::new();
    let mut failure = None;
    for outcome in filling.fetch(&plan, false, &|_| {})? {
        match outcome.result {
            Ok((done, record)) => {
                let found = (record.bytes, record.md5);
                rows.push(row(&outcome.file, Some(found), word(done).to_owned()));
            }
            Err(one) => {
                rows.push(row(&outcome.file, None, format!("failed: {one}")));
                failure.get_or_insert(one);
            }
        }
    }
    // A table that contains failures would be read as an answer when nothing has arrived.
    let arrived = rows.iter().any(|row| !row.5.starts_with("failed"));
    areograph::error::Stopped::check(stop)?;
    match failure {
        Some(failure) if !arrived => Err(failure),
        _ => Ok((rows, notes)),
    }
}

fn row(file: &PlannedFile, found: Option<(u64, String)>, state: String) -> FileRow {
    let (bytes, md5) = found.map_or((file.bytes, file.md5.clone()), |(bytes, md5)| {
        (Some(bytes), Some(md5))
    });
    (
        file.kind.word().to_owned(),
        file.path.clone(),
        file.url.clone(),
        bytes,
        md5,
        state,
        file.why.clone(),
    )
}

const fn word(done: Done) -> &'static str {
    match done {
        Done::Present => "present",
        Done::Adopted => "adopted",
        Done::Fetched { .. } => "fetched",
        Done::Empty => "without rows",
    }
}

fn state_of(standing: Standing) -> String {
    match standing {
        Standing::Present => "present".to_owned(),
        Standing::Unknown => "present, of unknown origin".to_owned(),
        Standing::Other => "present, but a different file".to_owned(),
        Standing::Begun(bytes) => format!("begun, {bytes} bytes"),
        Standing::Missing => "missing".to_owned(),
    }
}
