//! Runs: publications of attempts.

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde_json::Value;

use super::Stored;

/// A run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRow {
    /// Its identifier.
    pub id: String,
    /// Its site.
    pub site: String,
    /// Its job.
    pub job: i64,
    /// The attempt that published it.
    pub attempt: i64,
    /// Version of areograph.
    pub version: String,
    /// BLAKE3 of its manifest.
    pub manifest_blake3: String,
    /// Whether the products are valid.
    pub valid: bool,
    /// The verdict in a word.
    pub verdict: String,
    /// Reasons why the products are not valid: sentences.
    pub reasons: Value,
    /// Causes of the run: sentences.
    pub because: Value,
    /// Stages that ran, with their reasons.
    pub stages: Value,
    /// Counts of the manifest.
    pub counts: Value,
    /// Figures of the manifest.
    pub figures: Value,
    /// Name, role and hash of every kernel.
    pub kernels: Value,
    /// The previous current run.
    pub predecessor: Option<String>,
    /// Time at which it was published, milliseconds of UTC since 1970.
    pub published_ms: i64,
    /// Whether it is kept permanently.
    pub pinned: bool,
    /// Time at which its products were removed.
    pub removed_ms: Option<i64>,
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
pub fn put_run(transaction: &Transaction<'_>, run: &RunRow) -> Stored<()> {
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
            run.published_ms,
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
pub fn run(connection: &Connection, id: &str) -> Stored<Option<RunRow>> {
    let mut query = connection.prepare_cached("SELECT * FROM run WHERE id = ?1")?;
    Ok(query.query_row([id], run_row).optional()?)
}

/// Runs of a site whose products exist, the newest first.
///
/// # Errors
/// SQLite errors.
pub fn kept_runs(connection: &Connection, site: &str) -> Stored<Vec<RunRow>> {
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
pub fn uncompared_runs(connection: &Connection) -> Stored<Vec<RunRow>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM run WHERE moved IS NULL AND valid AND removed_ms IS NULL AND predecessor IS NOT NULL ORDER BY id",
    )?;
    let found = query.query_map([], run_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

fn run_row(row: &Row<'_>) -> rusqlite::Result<RunRow> {
    let json = |column: &str| {
        let text: String = row.get(column)?;
        Ok::<_, rusqlite::Error>(serde_json::from_str(&text).unwrap_or_default())
    };
    Ok(RunRow {
        id: row.get("id")?,
        site: row.get("site")?,
        job: row.get("job")?,
        attempt: row.get("attempt")?,
        version: row.get("version")?,
        manifest_blake3: row.get("manifest_blake3")?,
        valid: row.get("valid")?,
        verdict: row.get("verdict")?,
        reasons: json("reasons")?,
        because: json("because")?,
        stages: json("stages")?,
        counts: json("counts")?,
        figures: json("figures")?,
        kernels: json("kernels")?,
        predecessor: row.get("predecessor")?,
        published_ms: row.get("published_ms")?,
        pinned: row.get("pinned")?,
        removed_ms: row.get("removed_ms")?,
    })
}
