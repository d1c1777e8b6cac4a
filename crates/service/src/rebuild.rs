//! A new database from the products on the disk, at the request of a person.

use std::{fs, path::Path};

use super::{
    database::{DATABASE, Database, free_name, losses::Loss},
    record::Rebuilt,
    recover::make_again,
};
use areograph_base::error::{IoError, Locate as _, Result};

/// Moves the database in `state` aside and creates a new one, with the runs of every site below `products`. Jobs,
/// events and tokens are lost; the next poll that finds the files of sites enables them.
///
/// # Errors
/// A disk error.
pub fn rebuild(state: &Path, products: &Path, now_ms: i64) -> Result<Rebuilt> {
    // First: without the products, as when their disk is not mounted, the database stays.
    fs::read_dir(products)
        .map_err(IoError::on("list"))
        .in_file(products)?;
    let aside = free_name(state, &format!("before-rebuild-{now_ms}"));
    for ending in ["", "-wal", "-shm"] {
        let path = state.join(format!("{DATABASE}{ending}"));
        if fs::symlink_metadata(&path).is_ok() {
            let mut to = aside.clone().into_os_string();
            to.push(ending);
            fs::rename(&path, to)
                .map_err(IoError::on("move aside"))
                .in_file(&path)?;
        }
    }
    let database = Database::open(state)?;
    let report = |loss: Loss| database.write(|transaction| loss.note(transaction));
    let found = make_again(&database, products, || now_ms, || false, report)?;
    Ok(found.unwrap_or_default())
}
