//! Folders and files of inputs.

use rusqlite::{Connection, OptionalExtension as _, Row, params};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::{
    database::{Stored, document},
    instant::Instant,
};

/// A folder of inputs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct RootFolder {
    /// Its path.
    pub path: String,
    /// `sites`, `kernels` or `data`.
    pub kind: String,
    /// Files below it.
    pub files: i64,
    /// `available`, `settling` or `unavailable`.
    pub state: String,
    /// Start of that state.
    pub since_utc: Instant,
    /// The reason, as text.
    pub detail: String,
}

/// A file in a folder of kernels.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelFile {
    /// Its number: later files have larger ones.
    pub number: i64,
    /// Its path.
    pub path: String,
    /// Size.
    pub bytes: i64,
    /// BLAKE3 of its content, once it has been read.
    pub blake3: Option<String>,
    /// `settling`, `ready`, `bad` or `gone`.
    pub state: String,
    /// The reason, as text.
    pub detail: String,
    /// When it was first seen.
    pub first_seen_utc: Instant,
    /// When it last changed.
    pub changed_utc: Instant,
    /// Its coverage: arrays `position` and `attitude` of intervals, seconds of ephemeris time past J2000.
    pub coverage: Value,
}

/// All folders of inputs.
///
/// # Errors
/// SQLite errors.
pub fn roots(connection: &Connection) -> Stored<Vec<RootFolder>> {
    let mut query = connection.prepare_cached("SELECT * FROM root ORDER BY kind, path")?;
    let found = query.query_map([], |row| {
        Ok(RootFolder {
            path: row.get("path")?,
            kind: row.get("kind")?,
            files: row.get("files")?,
            state: row.get("state")?,
            since_utc: row.get("since_ms")?,
            detail: row.get("detail")?,
        })
    })?;
    Ok(found.collect::<Result<_, _>>()?)
}

const KERNELS: &str = "
    SELECT f.*, f.rowid AS number, k.coverage FROM file_version f LEFT JOIN kernel_coverage k ON k.blake3 = f.blake3
    WHERE EXISTS (SELECT 1 FROM root r WHERE r.kind = 'kernels' AND substr(f.path, 1, length(r.path) + 1) = r.path || '/')";

/// At most `limit` files below the folders of kernels with numbers above `after`.
///
/// # Errors
/// SQLite errors.
pub fn kernels(connection: &Connection, after: i64, limit: u32) -> Stored<Vec<KernelFile>> {
    let mut query = connection.prepare_cached(&format!(
        "{KERNELS} AND f.rowid > ?1 ORDER BY f.rowid LIMIT ?2"
    ))?;
    let found = query.query_map(params![after, limit], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// The kernel with this content; of several the first by path.
///
/// # Errors
/// SQLite errors.
pub fn kernel_by_hash(connection: &Connection, blake3: &str) -> Stored<Option<KernelFile>> {
    let mut query = connection.prepare_cached(&format!(
        "{KERNELS} AND f.blake3 = ?1 ORDER BY f.path LIMIT 1"
    ))?;
    Ok(query.query_row([blake3], read).optional()?)
}

/// At most `limit` sites that read a file.
///
/// # Errors
/// SQLite errors.
pub fn used_by(connection: &Connection, path: &str, limit: u32) -> Stored<Vec<String>> {
    let mut query = connection
        .prepare_cached("SELECT site FROM site_input WHERE path = ?1 ORDER BY site LIMIT ?2")?;
    let found = query.query_map(params![path, limit], |row| row.get(0))?;
    Ok(found.collect::<Result<_, _>>()?)
}

fn read(row: &Row<'_>) -> rusqlite::Result<KernelFile> {
    Ok(KernelFile {
        number: row.get("number")?,
        path: row.get("path")?,
        bytes: row.get("size")?,
        blake3: row.get("blake3")?,
        state: row.get("state")?,
        detail: row.get("detail")?,
        first_seen_utc: row.get("first_seen_ms")?,
        changed_utc: row.get("changed_ms")?,
        coverage: document(row, "coverage")?,
    })
}
