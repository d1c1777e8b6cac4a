//! Lists of runs.

use rusqlite::{Connection, Transaction, params};

use crate::database::{
    Stored,
    runs::{Run, run_row},
};

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
    let found = query.query_map(params![site, before, limit], run_row)?;
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
    let found = query.query_map(params![night, limit], run_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// At most `limit` runs that a job published.
///
/// # Errors
/// SQLite errors.
pub fn runs_of_job(connection: &Connection, job: i64, limit: u32) -> Stored<Vec<Run>> {
    let mut query = connection
        .prepare_cached("SELECT * FROM run WHERE job = ?1 ORDER BY attempt DESC LIMIT ?2")?;
    let found = query.query_map(params![job, limit], run_row)?;
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
