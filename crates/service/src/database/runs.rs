//! Runs: publications of attempts.

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::{Stored, document};
use crate::instant::Instant;

/// A run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
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

/// Whether a run of the site has this manifest, by its BLAKE3.
///
/// # Errors
/// SQLite errors.
pub fn is_run(connection: &Connection, site: &str, manifest_blake3: &str) -> Stored<bool> {
    let mut query = connection.prepare_cached(
        "SELECT EXISTS (SELECT 1 FROM run WHERE site = ?1 AND manifest_blake3 = ?2)",
    )?;
    Ok(query.query_row([site, manifest_blake3], |row| row.get(0))?)
}

/// Records a run; a known one is unchanged.
///
/// # Errors
/// SQLite errors.
pub fn put_run(transaction: &Transaction<'_>, run: &Run) -> Stored<()> {
    transaction.execute(
        "INSERT OR IGNORE INTO run
         (id, site, job, attempt, version, manifest_blake3, valid, verdict, reasons, because, stages, counts, figures, kernels,
          predecessor, published_ms, pinned)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17)",
        params![
            run.id,
            run.site,
            run.job,
            run.attempt,
            run.version,
            run.manifest_blake3,
            run.valid,
            run.verdict,
            run.reasons.to_string(),
            run.because.to_string(),
            run.stages.to_string(),
            run.counts.to_string(),
            run.figures.to_string(),
            run.kernels.to_string(),
            run.predecessor,
            run.published_utc,
            run.pinned,
        ],
    )?;
    Ok(())
}

/// Reserves the job numbers of runs on the disk, so that they are not reused.
///
/// # Errors
/// SQLite errors.
pub fn reserve_job(transaction: &Transaction<'_>, job: i64) -> Stored<()> {
    transaction.execute(
        "INSERT INTO sqlite_sequence (name, seq) SELECT 'job', 0 WHERE NOT EXISTS (SELECT 1 FROM sqlite_sequence WHERE name = 'job')",
        [],
    )?;
    transaction.execute(
        "UPDATE sqlite_sequence SET seq = max(seq, ?1) WHERE name = 'job'",
        [job],
    )?;
    Ok(())
}

/// Records the current run of a site.
///
/// # Errors
/// SQLite errors.
pub fn put_current(
    transaction: &Transaction<'_>,
    site: &str,
    run: &str,
    since_ms: i64,
) -> Stored<()> {
    transaction.execute(
        "UPDATE site SET current_run = ?2, current_since_ms = ?3 WHERE name = ?1 AND current_run IS NOT ?2",
        params![site, run, since_ms],
    )?;
    Ok(())
}

/// Records the result of the comparison with the predecessor.
///
/// # Errors
/// SQLite errors.
pub fn put_moved(transaction: &Transaction<'_>, run: &str, moved: &Value) -> Stored<()> {
    transaction.execute(
        "UPDATE run SET moved = ?2 WHERE id = ?1",
        params![run, moved.to_string()],
    )?;
    Ok(())
}

/// Records that the products of a run were removed.
///
/// # Errors
/// SQLite errors.
pub fn put_removed(transaction: &Transaction<'_>, run: &str, now_ms: i64) -> Stored<()> {
    transaction.execute(
        "UPDATE run SET removed_ms = ?2 WHERE id = ?1",
        params![run, now_ms],
    )?;
    Ok(())
}

/// Records when all products of a run were last read.
///
/// # Errors
/// SQLite errors.
pub fn put_checked(transaction: &Transaction<'_>, run: &str, now_ms: i64) -> Stored<()> {
    transaction.execute(
        "UPDATE run SET checked_ms = ?2 WHERE id = ?1",
        params![run, now_ms],
    )?;
    Ok(())
}

/// Records the number of products of a run that do not match its manifest.
///
/// # Errors
/// SQLite errors.
pub fn put_damaged(transaction: &Transaction<'_>, run: &str, products: i64) -> Stored<()> {
    transaction.execute(
        "UPDATE run SET damaged = ?2 WHERE id = ?1",
        params![run, products],
    )?;
    Ok(())
}

/// Whether the products of a run are kept.
///
/// # Errors
/// SQLite errors.
pub fn is_kept(connection: &Connection, run: &str) -> Stored<bool> {
    let mut query =
        connection.prepare_cached("SELECT 1 FROM run WHERE id = ?1 AND removed_ms IS NULL")?;
    Ok(query.exists([run])?)
}

/// Number of products of a run that do not match its manifest, as far as known.
///
/// # Errors
/// SQLite errors.
pub fn damaged_products(connection: &Connection, run: &str) -> Stored<i64> {
    let mut query = connection.prepare_cached("SELECT damaged FROM run WHERE id = ?1")?;
    let found = query.query_row([run], |row| row.get(0)).optional()?;
    Ok(found.unwrap_or(0))
}

/// A run whose products are to be read again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DueRun {
    /// Its identifier.
    pub id: String,
    /// Its site.
    pub site: String,
    /// BLAKE3 of its manifest.
    pub manifest_blake3: String,
}

/// The run whose products were read longest ago, before `before_ms`; with `current` only among current runs of sites
/// with a file.
///
/// # Errors
/// SQLite errors.
pub fn due_run(connection: &Connection, before_ms: i64, current: bool) -> Stored<Option<DueRun>> {
    let mut query = connection.prepare_cached(
        "SELECT id, site, manifest_blake3 FROM run WHERE removed_ms IS NULL AND coalesce(checked_ms, 0) < ?1
         AND (NOT ?2 OR id IN (SELECT current_run FROM site WHERE enabled))
         ORDER BY coalesce(checked_ms, 0), id LIMIT 1",
    )?;
    let found = query.query_row(params![before_ms, current], |row| {
        Ok(DueRun {
            id: row.get(0)?,
            site: row.get(1)?,
            manifest_blake3: row.get(2)?,
        })
    });
    Ok(found.optional()?)
}

/// A run by its identifier.
///
/// # Errors
/// SQLite errors.
pub fn run(connection: &Connection, id: &str) -> Stored<Option<Run>> {
    let mut query = connection.prepare_cached("SELECT * FROM run WHERE id = ?1")?;
    Ok(query.query_row([id], run_row).optional()?)
}

/// Runs of a site whose products exist, the newest first.
///
/// # Errors
/// SQLite errors.
pub fn kept_runs(connection: &Connection, site: &str) -> Stored<Vec<Run>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM run WHERE site = ?1 AND removed_ms IS NULL ORDER BY published_ms DESC, id DESC",
    )?;
    let found = query.query_map([site], run_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Runs with a predecessor to which they have not been compared.
///
/// # Errors
/// SQLite errors.
pub fn uncompared_runs(connection: &Connection) -> Stored<Vec<Run>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM run WHERE moved IS NULL AND valid AND removed_ms IS NULL AND predecessor IS NOT NULL ORDER BY id",
    )?;
    let found = query.query_map([], run_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

pub(super) fn run_row(row: &Row<'_>) -> rusqlite::Result<Run> {
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

/// Number of runs.
///
/// # Errors
/// SQLite errors.
pub fn count(connection: &Connection) -> Stored<i64> {
    Ok(connection.query_row("SELECT count(*) FROM run", [], |row| row.get(0))?)
}
