//! The running service, for other readers of the database.

use rusqlite::{Transaction, params};

use super::Stored;
use crate::worker::process::ProcessIdentity;

/// Records the start of the service.
///
/// # Errors
/// SQLite errors.
pub fn put_service(
    transaction: &Transaction<'_>,
    process: &ProcessIdentity,
    address: &str,
    now_ms: i64,
) -> Stored<()> {
    transaction.execute(
        "INSERT OR REPLACE INTO service (id, pid, boot_id, address, version, started_ms, beat_ms) VALUES (1, ?1, ?2, ?3, ?4, ?5, ?5)",
        params![process.pid, process.boot_id, address, env!("CARGO_PKG_VERSION"), now_ms],
    )?;
    Ok(())
}

/// Records a heartbeat of the service.
///
/// # Errors
/// SQLite errors.
pub fn beat(transaction: &Transaction<'_>, now_ms: i64) -> Stored<()> {
    transaction.execute("UPDATE service SET beat_ms = ?1", [now_ms])?;
    Ok(())
}
