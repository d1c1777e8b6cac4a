//! Named values.

use rusqlite::{Connection, OptionalExtension as _, Transaction, params};

use super::Stored;

/// Number of the newest round of comparisons.
pub const ROUND: &str = "round";
/// Version of areograph of the last writer.
pub const TOOL_VERSION: &str = "version";
/// Cron fields and zone of the last intended instant.
pub const SCHEDULE: &str = "schedule";
/// The last instant at which a night was intended, milliseconds of UTC since 1970.
pub const INTENDED_MS: &str = "intended_ms";

/// Identity of the service, also in the folder of its products.
pub const IDENTITY: &str = "identity";
/// Present while the runs on the disk are not yet recorded in a new database.
pub const RECOVERING: &str = "recovering";
/// Time of reconstruction of the database from the products, milliseconds of UTC since 1970; and the sites and runs
/// found.
pub const RECOVERED_MS: &str = "recovered_ms";
/// See [`RECOVERED_MS`].
pub const RECOVERED_SITES: &str = "recovered_sites";
/// See [`RECOVERED_MS`].
pub const RECOVERED_RUNS: &str = "recovered_runs";

/// A value.
///
/// # Errors
/// SQLite errors.
pub fn fact(connection: &Connection, name: &str) -> Stored<Option<String>> {
    let mut query = connection.prepare_cached("SELECT value FROM fact WHERE name = ?1")?;
    Ok(query.query_row([name], |row| row.get(0)).optional()?)
}

/// A whole number.
///
/// # Errors
/// SQLite errors.
pub fn number(connection: &Connection, name: &str) -> Stored<Option<i64>> {
    Ok(fact(connection, name)?.and_then(|text| text.parse().ok()))
}

/// Records a value.
///
/// # Errors
/// SQLite errors.
pub fn note(transaction: &Transaction<'_>, name: &str, value: &str) -> Stored<()> {
    transaction.execute(
        "INSERT INTO fact (name, value) VALUES (?1, ?2) ON CONFLICT (name) DO UPDATE SET value = ?2",
        params![name, value],
    )?;
    Ok(())
}

/// Removes a value.
///
/// # Errors
/// SQLite errors.
pub fn remove(transaction: &Transaction<'_>, name: &str) -> Stored<()> {
    transaction.execute("DELETE FROM fact WHERE name = ?1", [name])?;
    Ok(())
}
