//! Causes of jobs.

use rusqlite::{Connection, Transaction, params};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Stored;

/// Kinds of causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// A kernel changed.
    KernelChanged,
    /// A PEDR file, label or tie point file changed.
    DataChanged,
    /// The site file changed.
    ConfigChanged,
    /// The version of areograph changed.
    ToolChanged,
    /// The site is new.
    First,
    /// The night's comparison.
    Scheduled,
    /// A person requested it.
    Requested,
    /// An earlier job ended without products.
    RetryOf,
    /// A product does not match its manifest.
    ProductDamaged,
}

impl CauseKind {
    /// Its name in the database and in the interface.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::KernelChanged => "kernel_changed",
            Self::DataChanged => "data_changed",
            Self::ConfigChanged => "config_changed",
            Self::ToolChanged => "tool_changed",
            Self::First => "first",
            Self::Scheduled => "scheduled",
            Self::Requested => "asked",
            Self::RetryOf => "retry_of",
            Self::ProductDamaged => "product_damaged",
        }
    }
}

/// A cause of a job.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct CauseRow {
    /// Its kind, one of the names of [`CauseKind`].
    pub kind: String,
    /// The file that changed.
    pub path: Option<String>,
    /// BLAKE3 of its content before.
    pub old_blake3: Option<String>,
    /// BLAKE3 of its content now.
    pub new_blake3: Option<String>,
    /// As text.
    pub detail: String,
    /// When, milliseconds of UTC since 1970.
    pub at_ms: i64,
}

impl CauseRow {
    /// A cause without a file.
    #[must_use]
    pub fn plain(kind: CauseKind, detail: &str, at_ms: i64) -> Self {
        Self {
            kind: kind.name().to_owned(),
            path: None,
            old_blake3: None,
            new_blake3: None,
            detail: detail.to_owned(),
            at_ms,
        }
    }
}

/// Adds a cause to a job, unless the same file with the same content is already recorded.
///
/// # Errors
/// SQLite errors.
pub fn add_cause(transaction: &Transaction<'_>, job: i64, cause: &CauseRow) -> Stored<()> {
    transaction.execute(
        "INSERT INTO cause (job, kind, path, old_blake3, new_blake3, detail, at_ms)
         SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7
         WHERE NOT EXISTS (SELECT 1 FROM cause WHERE job = ?1 AND kind = ?2 AND path IS ?3 AND new_blake3 IS ?5 AND detail = ?6)",
        params![
            job, cause.kind, cause.path, cause.old_blake3, cause.new_blake3, cause.detail, cause.at_ms
        ],
    )?;
    Ok(())
}

/// The causes of a job, in order of arrival.
///
/// # Errors
/// SQLite errors.
pub fn causes(connection: &Connection, job: i64) -> Stored<Vec<CauseRow>> {
    let mut query =
        connection.prepare_cached("SELECT * FROM cause WHERE job = ?1 ORDER BY rowid")?;
    let found = query.query_map([job], |row| {
        Ok(CauseRow {
            kind: row.get("kind")?,
            path: row.get("path")?,
            old_blake3: row.get("old_blake3")?,
            new_blake3: row.get("new_blake3")?,
            detail: row.get("detail")?,
            at_ms: row.get("at_ms")?,
        })
    })?;
    Ok(found.collect::<Result<_, _>>()?)
}
