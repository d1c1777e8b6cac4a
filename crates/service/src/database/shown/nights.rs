//! Lists of nights.

use rusqlite::{Connection, params};

use crate::database::{
    Stored,
    nights::{Night, night_row},
};

/// At most `limit` nights, the newest first, with numbers below `before`.
///
/// # Errors
/// SQLite errors.
pub fn nights(connection: &Connection, before: Option<i64>, limit: u32) -> Stored<Vec<Night>> {
    let mut query =
        connection.prepare_cached("SELECT * FROM night WHERE id < ?1 ORDER BY id DESC LIMIT ?2")?;
    let found = query.query_map(params![before.unwrap_or(i64::MAX), limit], night_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}
