//! Sites, and the files that each reads.

use std::collections::BTreeMap;

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};

use super::Stored;
use areograph_base::body::Body;

/// The round of a site that requires a plan because another program made its products.
pub const OTHER_PROGRAM: i64 = -1;

/// State of a site.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteRow {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// BLAKE3 of its keys in the last plan, empty before.
    pub config_blake3: String,
    /// Whether its file exists.
    pub enabled: bool,
    /// The reason for which it cannot be run.
    pub problem: Option<String>,
    /// The current run.
    pub current_run: Option<String>,
    /// Time at which all its inputs were last compared, milliseconds of UTC since 1970.
    pub checked_ms: Option<i64>,
    /// Time from which the products have not corresponded to the inputs.
    pub stale_since_ms: Option<i64>,
    /// The reason.
    pub stale_because: Option<String>,
    /// The round of that comparison; 0 or [`OTHER_PROGRAM`]: a plan is required.
    pub round: i64,
}

impl SiteRow {
    /// Whether a plan is required.
    #[must_use]
    pub fn needs_plan(&self) -> bool {
        self.round <= 0
    }
}

/// All sites, by name.
///
/// # Errors
/// SQLite errors.
pub fn sites(connection: &Connection) -> Stored<Vec<SiteRow>> {
    let mut query = connection.prepare_cached("SELECT * FROM site ORDER BY name")?;
    let found = query.query_map([], site_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// A site by its name.
///
/// # Errors
/// SQLite errors.
pub fn site(connection: &Connection, name: &str) -> Stored<Option<SiteRow>> {
    let mut query = connection.prepare_cached("SELECT * FROM site WHERE name = ?1")?;
    Ok(query.query_row([name], site_row).optional()?)
}

/// Records the file of a site; a disabled site is planned again.
///
/// # Errors
/// SQLite errors.
pub fn put_site(transaction: &Transaction<'_>, name: &str, file: &str) -> Stored<()> {
    transaction.execute(
        "INSERT INTO site (name, file, config_blake3, enabled) VALUES (?1, ?2, '', 1)
         ON CONFLICT (name) DO UPDATE SET file = ?2, enabled = 1, round = CASE WHEN enabled AND file = ?2 THEN round ELSE 0 END
         WHERE file <> ?2 OR NOT enabled",
        params![name, file],
    )?;
    Ok(())
}

/// Records that a site has no file.
///
/// # Errors
/// SQLite errors.
pub fn disable_site(transaction: &Transaction<'_>, name: &str) -> Stored<()> {
    let note = "the site file was removed";
    transaction.execute(
        "UPDATE site SET enabled = 0, last_note = ?2, stale_since_ms = NULL, stale_because = NULL WHERE name = ?1",
        params![name, note],
    )?;
    Ok(())
}

/// Records that a site has runs, and that its file has not been read.
///
/// # Errors
/// SQLite errors.
pub fn put_unread(transaction: &Transaction<'_>, name: &str) -> Stored<()> {
    let note = "runs of the site were found on the disk; the site file has not been read yet";
    transaction.execute(
        "UPDATE site SET enabled = 0, last_note = ?2 WHERE name = ?1",
        params![name, note],
    )?;
    Ok(())
}

/// The result of a comparison or plan of a site.
#[derive(Debug, Clone, Default)]
pub struct Checked<'a> {
    /// The round of the comparison.
    pub round: i64,
    /// Time, milliseconds of UTC since 1970.
    pub at_ms: i64,
    /// BLAKE3 of its keys, if it was planned.
    pub config_blake3: Option<&'a str>,
    /// Extent of its windows, degrees, if it was planned.
    pub bounds_deg: Option<[f64; 4]>,
    /// Its body, if it was planned.
    pub body: Option<Body>,
    /// The reason for which it cannot be planned.
    pub problem: Option<&'a str>,
    /// As text.
    pub note: &'a str,
}

/// Records the result for a site.
///
/// # Errors
/// SQLite errors.
pub fn put_checked(transaction: &Transaction<'_>, name: &str, checked: &Checked<'_>) -> Stored<()> {
    let bounds = checked.bounds_deg;
    let bound = |index: usize| bounds.map(|bounds| bounds[index]);
    transaction.execute(
        "UPDATE site SET round = ?2, checked_ms = ?3, config_blake3 = coalesce(?4, config_blake3), problem = ?5, last_note = ?6,
         west_deg = coalesce(?7, west_deg), south_deg = coalesce(?8, south_deg),
         east_deg = coalesce(?9, east_deg), north_deg = coalesce(?10, north_deg), body = coalesce(?11, body) WHERE name = ?1",
        params![
            name,
            checked.round,
            checked.at_ms,
            checked.config_blake3,
            checked.problem,
            checked.note,
            bound(0),
            bound(1),
            bound(2),
            bound(3),
            checked.body.map(Body::word),
        ],
    )?;
    Ok(())
}

/// Records that every site requires a plan: with `round` 0, or [`OTHER_PROGRAM`].
///
/// # Errors
/// SQLite errors.
pub fn require_plans(transaction: &Transaction<'_>, round: i64) -> Stored<()> {
    transaction.execute("UPDATE site SET round = ?1", [round])?;
    Ok(())
}

/// Records that sites were compared and need no plan.
///
/// # Errors
/// SQLite errors.
pub fn put_unchanged(
    transaction: &Transaction<'_>,
    names: &[&str],
    round: i64,
    at_ms: i64,
) -> Stored<()> {
    let mut put = transaction.prepare_cached(
        "UPDATE site SET round = ?2, checked_ms = ?3 WHERE name = ?1 AND enabled AND round > 0",
    )?;
    for name in names {
        put.execute(params![name, round, at_ms])?;
    }
    Ok(())
}

/// Records the time from which, and the reason why, a site's products do not match its inputs; the first instant is kept.
///
/// # Errors
/// SQLite errors.
pub fn put_stale(
    transaction: &Transaction<'_>,
    name: &str,
    since_ms: i64,
    because: &str,
) -> Stored<()> {
    transaction.execute(
        "UPDATE site SET stale_since_ms = coalesce(stale_since_ms, ?2), stale_because = ?3
         WHERE name = ?1 AND (stale_because IS NOT ?3 OR stale_since_ms IS NULL)",
        params![name, since_ms, because],
    )?;
    Ok(())
}

/// Records that a site's products match its inputs.
///
/// # Errors
/// SQLite errors.
pub fn put_fresh(transaction: &Transaction<'_>, name: &str) -> Stored<()> {
    transaction.execute(
        "UPDATE site SET stale_since_ms = NULL, stale_because = NULL, problem = NULL WHERE name = ?1",
        [name],
    )?;
    Ok(())
}

/// A file that a site reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SiteInput {
    /// Its path.
    pub path: String,
    /// `site`, `kernel` or `data`.
    pub role: String,
    /// BLAKE3 of the content in the last plan; `None` for a file that did not exist.
    pub blake3: Option<String>,
}

/// Files that one site reads.
///
/// # Errors
/// SQLite errors.
pub fn inputs_of(connection: &Connection, site: &str) -> Stored<Vec<SiteInput>> {
    let mut query =
        connection.prepare_cached("SELECT * FROM site_input WHERE site = ?1 ORDER BY path")?;
    let found = query.query_map([site], input_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Records which files a site reads.
///
/// # Errors
/// SQLite errors.
pub fn put_inputs(transaction: &Transaction<'_>, site: &str, inputs: &[SiteInput]) -> Stored<()> {
    transaction.execute("DELETE FROM site_input WHERE site = ?1", [site])?;
    let mut put = transaction.prepare_cached(
        "INSERT OR REPLACE INTO site_input (site, path, role, blake3) VALUES (?1, ?2, ?3, ?4)",
    )?;
    for input in inputs {
        put.execute(params![site, input.path, input.role, input.blake3])?;
    }
    Ok(())
}

/// Sites with files that were removed or whose content differs from that in their plan, with these files.
///
/// # Errors
/// SQLite errors.
pub fn changed_inputs(connection: &Connection) -> Stored<BTreeMap<String, Vec<String>>> {
    let mut query = connection.prepare_cached(
        "SELECT i.site, i.path FROM file_version f JOIN site_input i ON i.path = f.path
         WHERE CASE f.state WHEN 'ready' THEN f.blake3 IS NOT i.blake3 WHEN 'gone' THEN i.blake3 IS NOT NULL ELSE 0 END
         ORDER BY i.site, i.path",
    )?;
    let mut rows = query.query([])?;
    let mut changed: BTreeMap<String, Vec<String>> = BTreeMap::new();
    while let Some(row) = rows.next()? {
        changed.entry(row.get(0)?).or_default().push(row.get(1)?);
    }
    Ok(changed)
}

fn input_row(row: &Row<'_>) -> rusqlite::Result<SiteInput> {
    Ok(SiteInput {
        path: row.get("path")?,
        role: row.get("role")?,
        blake3: row.get("blake3")?,
    })
}

fn site_row(row: &Row<'_>) -> rusqlite::Result<SiteRow> {
    Ok(SiteRow {
        name: row.get("name")?,
        file: row.get("file")?,
        config_blake3: row.get("config_blake3")?,
        enabled: row.get("enabled")?,
        problem: row.get("problem")?,
        current_run: row.get("current_run")?,
        checked_ms: row.get("checked_ms")?,
        stale_since_ms: row.get("stale_since_ms")?,
        stale_because: row.get("stale_because")?,
        round: row.get("round")?,
    })
}
