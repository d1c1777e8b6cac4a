//! Runs: publications, their causes and changes.

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::document;
use crate::{database::Stored, instant::Instant};

/// A run.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Run {
    /// Its identifier.
    pub id: String,
    /// Its site.
    pub site: String,
    /// The job of the run.
    pub job: i64,
    /// The attempt of that job.
    pub attempt: i64,
    /// Version of areograph.
    pub version: String,
    /// BLAKE3 of its manifest.
    pub manifest_blake3: String,
    /// Whether its products are valid; only then can they become current.
    pub valid: bool,
    /// The verdict in a word.
    pub verdict: String,
    /// Why its products are not valid.
    pub reasons: Value,
    /// Causes of the run.
    pub because: Value,
    /// Stages that ran or were kept, each with its reason.
    pub stages: Value,
    /// Counts, by name.
    pub counts: Value,
    /// The largest figures of the site, by name, in the unit that ends the name.
    pub figures: Value,
    /// Kernels in load order with role and BLAKE3.
    pub kernels: Value,
    /// The previous current run.
    pub predecessor: Option<String>,
    /// Changes since the predecessor: headline, sentences, whether a limit was exceeded.
    pub moved: Value,
    /// When it was published.
    pub published_utc: Instant,
    /// Whether it is kept permanently.
    pub pinned: bool,
    /// When its products were removed because of their age.
    pub removed_utc: Option<Instant>,
    /// When all its products were last compared with the manifest.
    pub checked_utc: Option<Instant>,
    /// Products that do not match the manifest, as far as known; they are withheld.
    pub damaged: i64,
}

/// A run by its identifier.
///
/// # Errors
/// SQLite errors.
pub fn run(connection: &Connection, id: &str) -> Stored<Option<Run>> {
    let mut query = connection.prepare_cached("SELECT * FROM run WHERE id = ?1")?;
    Ok(query.query_row([id], read).optional()?)
}

/// At most `limit` runs of a site, the newest first, published before the run `before` where one is named.
///
/// # Errors
/// SQLite errors.
pub fn runs_of_site(
    connection: &Connection,
    site: &str,
    before: Option<&str>,
    limit: u32,
) -> Stored<Vec<Run>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM run WHERE site = ?1
         AND (?2 IS NULL OR (published_ms, id) < (SELECT published_ms, id FROM run WHERE id = ?2))
         ORDER BY published_ms DESC, id DESC LIMIT ?3",
    )?;
    let found = query.query_map(params![site, before, limit], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// At most `limit` runs that jobs of a night published.
///
/// # Errors
/// SQLite errors.
pub fn runs_of_night(connection: &Connection, night: i64, limit: u32) -> Stored<Vec<Run>> {
    let mut query = connection.prepare_cached(
        "SELECT run.* FROM job JOIN run ON run.job = job.id WHERE job.night = ?1 ORDER BY run.site LIMIT ?2",
    )?;
    let found = query.query_map(params![night, limit], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// At most `limit` runs that a job published.
///
/// # Errors
/// SQLite errors.
pub fn runs_of_job(connection: &Connection, job: i64, limit: u32) -> Stored<Vec<Run>> {
    let mut query = connection
        .prepare_cached("SELECT * FROM run WHERE job = ?1 ORDER BY attempt DESC LIMIT ?2")?;
    let found = query.query_map(params![job, limit], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Keeps a run permanently, or releases it. Returns whether the run exists.
///
/// # Errors
/// SQLite errors.
pub fn pin_run(transaction: &Transaction<'_>, id: &str, pinned: bool) -> Stored<bool> {
    let change = "UPDATE run SET pinned = ?2 WHERE id = ?1";
    Ok(transaction.execute(change, params![id, pinned])? > 0)
}

fn read(row: &Row<'_>) -> rusqlite::Result<Run> {
    Ok(Run {
        id: row.get("id")?,
        site: row.get("site")?,
        job: row.get("job")?,
        attempt: row.get("attempt")?,
        version: row.get("version")?,
        manifest_blake3: row.get("manifest_blake3")?,
        valid: row.get("valid")?,
        verdict: row.get("verdict")?,
        reasons: document(row, "reasons")?,
        because: document(row, "because")?,
        stages: document(row, "stages")?,
        counts: document(row, "counts")?,
        figures: document(row, "figures")?,
        kernels: document(row, "kernels")?,
        predecessor: row.get("predecessor")?,
        moved: document(row, "moved")?,
        published_utc: row.get("published_ms")?,
        pinned: row.get("pinned")?,
        removed_utc: row.get("removed_ms")?,
        checked_utc: row.get("checked_ms")?,
        damaged: row.get("damaged")?,
    })
}
