//! Folders of runs: the products of one publication, never changed again.
//!
//! `<runs>/<run>` contains hard links of the products, their manifest, and `run.json`, which identifies the attempt;
//! the manifest's own bytes depend on neither. A folder without a manifest is not a run.

use std::{
    collections::BTreeSet,
    fs::{self, File, Permissions},
    io::ErrorKind,
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use areograph_base::error::{IoError, Locate, Result};
use areograph_store::{
    atomic, lock::SiteLock, manifest::Manifest, publish::MANIFEST, published::still_published,
};

/// File that identifies the attempt that made a run.
pub const RUN_RECORD: &str = "run.json";
/// Suffix of incomplete runs.
const PARTIAL: &str = ".partial";
/// Mode of run folders, which become writable again before removal.
const READ_ONLY: u32 = 0o555;
const WRITABLE: u32 = 0o755;

/// The attempt that made a run: the content of [`RUN_RECORD`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunRecord {
    /// The run, the name of its folder.
    pub run: String,
    /// The job.
    pub job: i64,
    /// Its attempt.
    pub attempt: i64,
    /// BLAKE3 of the manifest.
    pub manifest_blake3: String,
}

/// The record of a run's folder, if it is one.
#[must_use]
pub fn read_record(run_folder: &Path) -> Option<RunRecord> {
    let record = serde_json::from_slice(&fs::read(run_folder.join(RUN_RECORD)).ok()?).ok()?;
    run_folder.join(MANIFEST).is_file().then_some(record)
}

/// The newest run in a folder of runs, by name.
#[must_use]
pub fn newest(runs: &Path) -> Option<PathBuf> {
    let entries = fs::read_dir(runs).ok()?.flatten().map(|entry| entry.path());
    entries
        .filter(|path| !is_partial(path) && read_record(path).is_some())
        .max()
}

/// Removes a complete or incomplete run.
///
/// # Errors
/// A disk error.
pub fn remove(run_folder: &Path) -> Result<()> {
    make(run_folder, WRITABLE)?;
    fs::remove_dir_all(run_folder)
        .map_err(IoError::on("remove the folder"))
        .in_file(run_folder)
}

/// Keeps the products that `manifest` lists, published in `site_folder`, as `<runs>/<run>`.
///
/// Returns the BLAKE3 of the manifest, and whether there is a new run: not if the newest contains this manifest.
///
/// # Errors
/// Another run is active in the site's folder, or has published; a disk error. No run with this name exists then.
pub fn keep(
    site_folder: &Path,
    manifest: &Manifest,
    runs: &Path,
    made_by: &RunRecord,
) -> Result<(String, bool)> {
    let _lock = SiteLock::take(site_folder)?;
    still_published(site_folder, manifest)?;
    let path = site_folder.join(MANIFEST);
    let bytes = fs::read(&path).map_err(IoError::on("read")).in_file(path)?;
    let blake3 = blake3::hash(&bytes).to_hex().to_string();
    let kept = newest(runs).and_then(|run| fs::read(run.join(MANIFEST)).ok());
    if kept.as_ref() == Some(&bytes) {
        return Ok((blake3, false));
    }
    fs::create_dir_all(runs)
        .map_err(IoError::on("create the folder"))
        .in_file(runs)?;
    remove_partial(runs)?;
    let partial = runs.join(format!("{}{PARTIAL}", made_by.run));
    for product in &manifest.products {
        link(
            &site_folder.join(&product.path),
            &partial.join(&product.path),
        )?;
    }
    let record = RunRecord {
        manifest_blake3: blake3.clone(),
        ..made_by.clone()
    };
    let mut record = serde_json::to_vec(&record).unwrap_or_default();
    record.push(b'\n');
    atomic::write(&partial.join(RUN_RECORD), &record)?;
    atomic::write(&partial.join(MANIFEST), &bytes)?;
    make(&partial, READ_ONLY)?;
    let folder = runs.join(&made_by.run);
    fs::rename(&partial, &folder)
        .map_err(IoError::on("rename into place"))
        .in_file(folder)?;
    atomic::sync_folder(runs);
    Ok((blake3, true))
}

/// Takes the name of a run that does not exist, so that a worker on a node that was lost, and may still work, cannot publish it
/// after its attempt has ended. A run that exists remains.
///
/// # Errors
/// A disk error.
pub fn bar(run_folder: &Path) -> Result<()> {
    if let Some(runs) = run_folder.parent() {
        fs::create_dir_all(runs)
            .map_err(IoError::on("create the folder"))
            .in_file(runs)?;
    }
    // A folder cannot be renamed to the name of a file.
    match File::create_new(run_folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => {
            Err(IoError::on("create")(error)).in_file(run_folder)
        }
        _ => Ok(()),
    }
}

/// Removes remainders of attempts that were killed; the site's lock is held.
fn remove_partial(runs: &Path) -> Result<()> {
    let entries = fs::read_dir(runs).into_iter().flatten().flatten();
    let mut partial = entries
        .map(|entry| entry.path())
        .filter(|path| is_partial(path));
    partial.try_for_each(|path| remove(&path))
}

fn is_partial(path: &Path) -> bool {
    path.as_os_str()
        .as_encoded_bytes()
        .ends_with(PARTIAL.as_bytes())
}

/// A hard link of a product, or a copy on another file system.
fn link(product: &Path, to: &Path) -> Result<()> {
    let folder = to.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .map_err(IoError::on("create the folder"))
        .in_file(folder)?;
    if fs::hard_link(product, to).is_ok() {
        return Ok(());
    }
    fs::copy(product, to)
        .map_err(IoError::on("copy"))
        .in_file(product)?;
    atomic::sync_file(to)
}

/// Sets the mode of a folder and all folders below it, flushed; parents last.
fn make(folder: &Path, mode: u32) -> Result<()> {
    let set = |folder: &Path| {
        File::open(folder)
            .and_then(|open| {
                open.set_permissions(Permissions::from_mode(mode))?;
                open.sync_all()
            })
            .map_err(IoError::on("set permissions of"))
            .in_file(folder)
    };
    if mode == WRITABLE {
        set(folder)?;
    }
    let entries = fs::read_dir(folder)
        .map_err(IoError::on("list"))
        .in_file(folder)?;
    let folders: BTreeSet<PathBuf> = entries
        .flatten()
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()))
        .map(|entry| entry.path())
        .collect();
    folders.iter().try_for_each(|folder| make(folder, mode))?;
    set(folder)
}
