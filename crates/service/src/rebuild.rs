//! A new database from the products on the disk, at the request of a person.

use std::{fs, path::Path};

use super::{
    database::{DATABASE, Database},
    record::{Rebuilt, record_all},
    recover::mark,
};
use areograph_base::error::{IoError, Locate as _, Result};

/// Moves the database in `state` aside and creates a new one, with the runs of every site below `products`. Jobs,
/// events and tokens are lost; the next sweep that finds the files of sites enables them.
///
/// # Errors
/// A disk error.
pub fn rebuild(state: &Path, products: &Path, now_ms: i64) -> Result<Rebuilt> {
    // First: without the products, as when their disk is not mounted, the database stays.
    fs::read_dir(products)
        .map_err(IoError::on("list"))
        .in_file(products)?;
    for ending in ["", "-wal", "-shm"] {
        let path = state.join(format!("{DATABASE}{ending}"));
        if fs::symlink_metadata(&path).is_ok() {
            let aside = state.join(format!("before-rebuild-{now_ms}.db{ending}"));
            fs::rename(&path, &aside)
                .map_err(IoError::on("move aside"))
                .in_file(&path)?;
        }
    }
    let database = Database::open(state)?;
    let found = record_all(&database, products, now_ms, || false)?.unwrap_or_default();
    mark(&database, products, found.as_loss(now_ms))?;
    Ok(found)
}
