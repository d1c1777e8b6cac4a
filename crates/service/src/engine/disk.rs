//! Disk space: without enough of it no job begins, and a reserve lets the database complete current work.

use std::{
    fs::{self, File},
    io::Write as _,
    path::Path,
};

use rustix::fs::statvfs;

use super::{
    alerts::{Alert, tell_edge},
    core::Core,
    workers::Workers,
};
use crate::database::{DatabaseError, Stored};
use areograph_config::AlertKind;

/// A file that is removed when the disk is full.
const RESERVE: &str = "reserve";
const RESERVE_MIB: u64 = 16;
const MIB: u64 = 1 << 20;

/// Free space below a folder, mebibytes; `None` if the system does not report it.
#[must_use]
pub fn free_mib(folder: &Path) -> Option<u64> {
    let found = statvfs(folder).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize) / MIB)
}

/// Whether there is space for jobs; changes are reported. The reserve is released and restored as space permits.
///
/// # Errors
/// The database cannot be written.
pub fn has_room<W: Workers>(core: &Core<W>) -> Stored<bool> {
    let config = core.shared.config();
    let least_mib = u64::from(config.workers.min_free_mib);
    let (state, products) = (&config.outputs.state, &config.outputs.products);
    let in_state = free_mib(state).unwrap_or(u64::MAX);
    let in_products = free_mib(products).unwrap_or(u64::MAX);
    reserve(state, in_state, least_mib);
    let low = in_state.min(in_products) < least_mib;
    let (folder, left) = if in_state < in_products {
        (state, in_state)
    } else {
        (products, in_products)
    };
    let text = format!(
        "{} has {left} MiB left, less than workers.min_free_mib = {least_mib}: no job starts",
        folder.display()
    );
    let alert = Alert::of_service(AlertKind::DiskLow, &text);
    let now_ms = core.now_ms();
    core.shared.write(|transaction| {
        tell_edge(transaction, &config, now_ms, ("disk", low), (&alert, None))
    })?;
    Ok(!low)
}

/// Keeps the reserve while there is ample space, and releases it when there is hardly any.
pub fn reserve(state: &Path, free_mib: u64, least_mib: u64) {
    let path = state.join(RESERVE);
    if free_mib < RESERVE_MIB {
        give_up_reserve(state);
    } else if !path.exists() && free_mib > least_mib + 4 * RESERVE_MIB {
        let block = vec![0; 1 << 20];
        let filled = File::create(&path).and_then(|mut file| {
            (0..RESERVE_MIB).try_for_each(|_| file.write_all(&block))?;
            file.sync_all()
        });
        if filled.is_err() {
            let _ = fs::remove_file(&path);
        }
    }
}

/// Frees space for the database.
pub fn give_up_reserve(state: &Path) {
    if fs::remove_file(state.join(RESERVE)).is_ok() {
        tracing::warn!(
            "the disk of {} is full: the reserve is released",
            state.display()
        );
    }
}

/// Whether the disk is full for the database.
#[must_use]
pub fn is_full(error: &DatabaseError) -> bool {
    let DatabaseError::Sqlite(rusqlite::Error::SqliteFailure(failure, _)) = error else {
        return false;
    };
    failure.code == rusqlite::ErrorCode::DiskFull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reserve_is_there_while_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let there = || {
            folder
                .path()
                .join(RESERVE)
                .metadata()
                .is_ok_and(|found| found.len() == RESERVE_MIB * MIB)
        };
        reserve(folder.path(), 1000, 1000);
        assert!(!there());
        reserve(folder.path(), 2000, 1000);
        assert!(there());
        reserve(folder.path(), 500, 1000);
        assert!(there());
        reserve(folder.path(), 15, 1000);
        assert!(!there());
        assert!(free_mib(folder.path()).is_some());
    }
}
