//! Current state of the sites.

use std::collections::BTreeMap;

use rusqlite::{Connection, OptionalExtension as _, Row, params};
use serde::Serialize;
use utoipa::ToSchema;

use areograph_base::body::Body;

use crate::{
    database::{Stored, waits::waits},
    instant::Instant,
    state::JobState,
};

/// Current state of a site.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct Site {
    /// Its name.
    pub name: String,
    /// Whether its site file exists and enables it.
    pub enabled: bool,
    /// The fault of its site file.
    pub problem: Option<String>,
    /// The run whose products are current.
    pub current_run: Option<String>,
    /// Verdict of that run in a word.
    pub verdict: Option<String>,
    /// Time from which that run has been current.
    pub current_since_utc: Option<Instant>,
    /// When its inputs were last compared completely.
    pub checked_utc: Option<Instant>,
    /// Time from which its inputs have been newer than its products.
    pub stale_since_utc: Option<Instant>,
    /// The reason, and the next step.
    pub stale_because: Option<String>,
    /// The result of its last comparison.
    pub note: Option<String>,
    /// Its newest run, which is not current if it is invalid.
    pub newest_run: Option<String>,
    /// Whether the newest run is valid.
    pub newest_valid: Option<bool>,
    /// Verdict of the newest run.
    pub newest_verdict: Option<String>,
    /// Its newest job.
    pub job: Option<i64>,
    /// State of that job.
    pub job_state: Option<JobState>,
    /// The file or folder for which it waits.
    pub waits_for: Option<String>,
    /// Extent of its windows: west, south, east, north, degrees of east longitude and areocentric latitude.
    pub bounds_deg: Option<[f64; 4]>,
    /// The body of its windows.
    #[schema(value_type = String, example = "mars")]
    pub body: Body,
}

const SELECT: &str = "
    SELECT s.*, c.verdict AS verdict, c.published_ms AS current_ms,
      n.id AS newest_run, n.valid AS newest_valid, n.verdict AS newest_verdict, j.id AS job, j.state AS job_state
    FROM site s
    LEFT JOIN run c ON c.id = s.current_run
    LEFT JOIN run n ON n.id = (SELECT id FROM run WHERE site = s.name ORDER BY published_ms DESC LIMIT 1)
    LEFT JOIN job j ON j.id = (SELECT id FROM job WHERE site = s.name ORDER BY id DESC LIMIT 1)";

/// At most `limit` sites after the one named `after`, by name.
///
/// # Errors
/// SQLite errors.
pub fn sites(connection: &Connection, after: &str, limit: u32) -> Stored<Vec<Site>> {
    let mut query = connection.prepare_cached(&format!(
        "{SELECT} WHERE s.name > ?1 ORDER BY s.name LIMIT ?2"
    ))?;
    let found = query.query_map(params![after, limit], read)?;
    let mut sites = found.collect::<Result<Vec<_>, _>>()?;
    put_waits(connection, &mut sites)?;
    Ok(sites)
}

/// States the file or folder for which sites wait.
fn put_waits(connection: &Connection, sites: &mut [Site]) -> Stored<()> {
    let mut known = BTreeMap::new();
    for wait in waits(connection)? {
        for site in &wait.sites {
            known.entry(site.clone()).or_insert_with(|| wait.name());
        }
    }
    let mut query = connection.prepare_cached(
        "SELECT DISTINCT i.site, r.path FROM root r JOIN site_input i ON i.path > r.path || '/' AND i.path < r.path || '0'
         WHERE r.state = 'unavailable'",
    )?;
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        known.insert(row.get(0)?, row.get(1)?);
    }
    for site in sites.iter_mut().filter(|site| site.enabled) {
        site.waits_for = known.remove(&site.name);
    }
    Ok(())
}

/// A site by its name.
///
/// # Errors
/// SQLite errors.
pub fn site(connection: &Connection, name: &str) -> Stored<Option<Site>> {
    let mut query = connection.prepare_cached(&format!("{SELECT} WHERE s.name = ?1"))?;
    let mut found = query.query_row([name], read).optional()?;
    put_waits(connection, found.as_mut_slice())?;
    Ok(found)
}

/// Numbers of sites and of stale sites.
///
/// # Errors
/// SQLite errors.
pub fn count_sites(connection: &Connection) -> Stored<(i64, i64)> {
    let counts = "SELECT count(*), count(stale_since_ms) FROM site WHERE enabled";
    Ok(connection.query_row(counts, [], |row| Ok((row.get(0)?, row.get(1)?)))?)
}

fn read(row: &Row<'_>) -> rusqlite::Result<Site> {
    let state: Option<String> = row.get("job_state")?;
    let side = |column| row.get::<_, Option<f64>>(column);
    let bounds = [
        side("west_deg")?,
        side("south_deg")?,
        side("east_deg")?,
        side("north_deg")?,
    ];
    let bounds_deg = match bounds {
        [Some(west), Some(south), Some(east), Some(north)] => Some([west, south, east, north]),
        _ => None,
    };
    let word: String = row.get("body")?;
    let body = Body::WORDS.into_iter().find(|(of, _)| *of == word);
    let since: Option<Instant> = row.get("current_since_ms")?;
    Ok(Site {
        name: row.get("name")?,
        enabled: row.get("enabled")?,
        problem: row.get("problem")?,
        current_run: row.get("current_run")?,
        verdict: row.get("verdict")?,
        current_since_utc: since.or(row.get("current_ms")?),
        checked_utc: row.get("checked_ms")?,
        stale_since_utc: row.get("stale_since_ms")?,
        stale_because: row.get("stale_because")?,
        note: row.get("last_note")?,
        newest_run: row.get("newest_run")?,
        newest_valid: row.get("newest_valid")?,
        newest_verdict: row.get("newest_verdict")?,
        job: row.get("job")?,
        job_state: state.and_then(|state| state.parse().ok()),
        waits_for: None,
        bounds_deg,
        body: body.map_or_else(Body::default, |(_, body)| body),
    })
}

/// The site file of a site.
///
/// # Errors
/// SQLite errors.
pub fn site_file(connection: &Connection, name: &str) -> Stored<Option<String>> {
    let mut query = connection.prepare_cached("SELECT file FROM site WHERE name = ?1")?;
    Ok(query.query_row([name], |row| row.get(0)).optional()?)
}

/// Sites with their current runs.
///
/// # Errors
/// SQLite errors.
pub fn current_runs(connection: &Connection) -> Stored<Vec<(String, String)>> {
    let mut query = connection.prepare_cached(
        "SELECT name, current_run FROM site WHERE current_run IS NOT NULL ORDER BY name",
    )?;
    let found = query.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(found.collect::<Result<_, _>>()?)
}
