//! A new database from the products on the disk.

use std::{fs, path::Path};

use serde_json::json;

use super::{
    database::{
        DATABASE, Database, Stored,
        runs::{put_current, put_run},
        sites::{disable_site, put_site},
    },
    engine::{
        adopt::after_job,
        runs::{Published, current, finished_ms, read_run, row, tidy},
    },
};
use areograph_base::error::{IoError, Locate as _, Result};

/// The runs found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rebuilt {
    /// Sites with runs.
    pub sites: usize,
    /// Their runs.
    pub runs: usize,
}

/// Moves the database in `state` aside and creates a new one, with the runs of every site below `products`. Jobs,
/// events and tokens are lost; the next sweep that finds the files of sites enables them.
///
/// # Errors
/// A disk error.
pub fn rebuild(state: &Path, products: &Path, now_ms: i64) -> Result<Rebuilt> {
    for ending in ["", "-wal", "-shm"] {
        let path = state.join(format!("{DATABASE}{ending}"));
        if path.exists() {
            let aside = state.join(format!("before-rebuild-{now_ms}.db{ending}"));
            fs::rename(&path, &aside)
                .map_err(IoError::on("move aside"))
                .in_file(&path)?;
        }
    }
    let database = Database::open(state)?;
    let mut rebuilt = Rebuilt::default();
    let folders = fs::read_dir(products)
        .map_err(IoError::on("list"))
        .in_file(products)?;
    let mut folders: Vec<_> = folders.flatten().map(|entry| entry.path()).collect();
    folders.sort();
    for folder in folders.iter().filter(|folder| folder.join("runs").is_dir()) {
        let mut published = Vec::new();
        for path in tidy(folder)? {
            match read_run(&path) {
                Ok(run) => published.push(run),
                Err(failure) => tracing::warn!("a run is left out: {failure}"),
            }
        }
        rebuilt.runs += published.len();
        rebuilt.sites += usize::from(!published.is_empty());
        note(&database, folder, &published, now_ms).in_file(folder)?;
    }
    Ok(rebuilt)
}

fn note(database: &Database, folder: &Path, published: &[Published], now_ms: i64) -> Stored<()> {
    let because = json!(["found on the disk when the database was rebuilt"]);
    database.write(|transaction| {
        let mut before = None;
        for run in published {
            let site = &run.manifest.site;
            let at_ms = finished_ms(&run.manifest).unwrap_or(now_ms);
            let row = row(run, because.clone(), json!([]), before.clone(), at_ms);
            put_run(transaction, &row)?;
            after_job(transaction, row.job)?;
            put_site(transaction, site, "")?;
            if current(folder).as_ref() == Some(&row.id) {
                put_current(transaction, site, &row.id, at_ms)?;
            }
            disable_site(transaction, site)?;
            before = row.valid.then_some(row.id).or(before);
        }
        Ok(())
    })
}
