//! Records the runs on the disk in a new database.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use rusqlite::Transaction;
use serde_json::json;

use super::{
    database::{
        Database, Stored,
        losses::Loss,
        runs::{put_current, put_run, reserve_job},
        sites::{put_site, put_unread},
    },
    engine::runs::{Published, current, finished_ms, identify_run_of, row},
};
use areograph_base::error::{IoError, Locate as _, Result};
use areograph_store::publish::MANIFEST;

/// The runs found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rebuilt {
    /// Sites with runs.
    pub sites: usize,
    /// Their runs.
    pub runs: usize,
}

impl Rebuilt {
    /// The loss of the earlier database.
    #[must_use]
    pub fn as_loss(self, at_ms: i64) -> Loss {
        let count = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);
        Loss {
            at_ms,
            sites: count(self.sites),
            runs: count(self.runs),
        }
    }
}

/// Records the runs of every site below `products`; `None` if `stops` stopped it between two sites. Only their
/// manifests are read: products are compared with them when they are read, and by the scrub. A run of a site other than
/// the folder's is left out.
///
/// # Errors
/// A disk error.
pub fn record_all(
    database: &Database,
    products: &Path,
    now_ms: i64,
    stops: impl Fn() -> bool,
) -> Result<Option<Rebuilt>> {
    record(database, products, now_ms, |_| true, stops)
}

/// Records the runs in the folders of sites for which `wanted` holds.
///
/// # Errors
/// A disk error.
pub fn record(
    database: &Database,
    products: &Path,
    now_ms: i64,
    wanted: impl Fn(&Path) -> bool,
    stops: impl Fn() -> bool,
) -> Result<Option<Rebuilt>> {
    let mut rebuilt = Rebuilt::default();
    for folder in site_folders(products)? {
        if !wanted(&folder) {
            continue;
        }
        let site = folder.file_name().unwrap_or_default().to_string_lossy();
        let mut published = Vec::new();
        for path in runs_in(&folder)? {
            if stops() {
                return Ok(None);
            }
            match identify_run_of(&site, &path) {
                Ok(run) => published.push(run),
                Err(failure) => tracing::warn!("a run is not recorded: {failure}"),
            }
        }
        rebuilt.runs += published.len();
        rebuilt.sites += usize::from(!published.is_empty());
        database
            .write(|transaction| note(transaction, &folder, &published, now_ms))
            .in_file(&folder)?;
    }
    Ok(Some(rebuilt))
}

/// Whether there is a run of any site below `products`.
///
/// # Errors
/// A disk error.
pub fn has_runs(products: &Path) -> Result<bool> {
    for folder in site_folders(products)? {
        if !runs_in(&folder)?.is_empty() {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Folders of sites with runs, by name.
fn site_folders(products: &Path) -> Result<Vec<PathBuf>> {
    let folders = match fs::read_dir(products) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.map_err(IoError::on("list")).in_file(products)?,
    };
    let mut folders: Vec<_> = folders.flatten().map(|entry| entry.path()).collect();
    folders.retain(|folder| folder.join("runs").is_dir());
    folders.sort();
    Ok(folders)
}

/// Folders of published runs of a site, by name. Nothing is removed: the folder may belong to another program.
fn runs_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let folder = folder.join("runs");
    let entries = fs::read_dir(&folder)
        .map_err(IoError::on("list"))
        .in_file(folder)?;
    let mut runs: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    runs.retain(|run| run.join(MANIFEST).is_file() && run.extension().is_none());
    runs.sort();
    Ok(runs)
}

fn note(
    transaction: &Transaction<'_>,
    folder: &Path,
    published: &[Published],
    now_ms: i64,
) -> Stored<()> {
    let because = json!(["found on the disk when the database was rebuilt"]);
    let mut before = None;
    for run in published {
        let site = &run.manifest.site;
        let at_ms = finished_ms(&run.manifest).unwrap_or(now_ms);
        let row = row(run, because.clone(), json!([]), before.clone(), at_ms);
        put_run(transaction, &row)?;
        reserve_job(transaction, row.job)?;
        put_site(transaction, site, "")?;
        if current(folder).as_ref() == Some(&row.id) {
            put_current(transaction, site, &row.id, at_ms)?;
        }
        put_unread(transaction, site)?;
        before = row.valid.then_some(row.id).or(before);
    }
    Ok(())
}
