//! Inputs for which sites wait: files that left their folder or cannot be used, each once for all of its sites.

use std::{collections::BTreeMap, path::Path};

use rusqlite::{Connection, params};
use serde::Serialize;
use utoipa::ToSchema;

use super::{Stored, files::FileState};
use crate::{clock::minute_text, instant::Instant};
use areograph_store::files::file_name;

/// A file that is not usable, and the sites that wait for it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Wait {
    /// Its path.
    pub path: String,
    /// `gone`, `bad`, or the state in which a lost file came back.
    pub state: String,
    /// Since when.
    pub since_utc: Instant,
    /// What was found, and what to do.
    pub text: String,
    /// The sites, by name.
    pub sites: Vec<String>,
}

impl Wait {
    /// Whether the file is no longer in its folder.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.state != FileState::Bad.name()
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        file_name(Path::new(&self.path))
    }
}

/// The start of the text about a lost file, by which it is recognised.
fn loss(path: &str) -> String {
    format!("`{}` disappeared from ", file_name(Path::new(path)))
}

/// The text about the first input of a site that left its folder and that the reason for which the site cannot be
/// planned names, as `is_named` decides from its path.
///
/// # Errors
/// SQLite errors.
pub fn lost_input(
    connection: &Connection,
    site: &str,
    is_named: impl Fn(&str) -> bool,
) -> Stored<Option<String>> {
    let mut query = connection.prepare_cached(
        "SELECT f.path, f.changed_ms FROM site_input i JOIN file_version f ON f.path = i.path
         WHERE i.site = ?1 AND f.state = 'gone' ORDER BY f.path",
    )?;
    let mut rows = query.query(params![site])?;
    while let Some(row) = rows.next()? {
        let path: String = row.get(0)?;
        if is_named(&path) {
            let folder = Path::new(&path).parent().map(file_name);
            return Ok(Some(format!(
                "{}{}/ at {}; restore it, or remove it from the site files that name it",
                loss(&path),
                folder.unwrap_or_default(),
                minute_text(row.get(1)?)
            )));
        }
    }
    Ok(None)
}

/// All files for which sites wait, by path.
///
/// # Errors
/// SQLite errors.
pub fn waits(connection: &Connection) -> Stored<Vec<Wait>> {
    let mut found: BTreeMap<String, Wait> = BTreeMap::new();
    // A file that left its folder is a cause only where the plan failed on it: globs match fewer files. It remains one
    // until the site has been planned with it again.
    let mut query = connection.prepare_cached(
        "SELECT f.path, f.state, f.changed_ms, f.detail, s.name, s.problem FROM site s
         JOIN site_input i ON i.site = s.name JOIN file_version f ON f.path = i.path
         WHERE s.enabled AND s.problem IS NOT NULL AND i.blake3 IS NULL AND f.state <> 'bad'
         UNION ALL
         SELECT f.path, f.state, f.changed_ms, f.detail, s.name, NULL FROM file_version f
         JOIN site_input i ON i.path = f.path JOIN site s ON s.name = i.site
         WHERE s.enabled AND f.state = 'bad' ORDER BY 1, 5",
    )?;
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let (path, state): (String, String) = (row.get(0)?, row.get(1)?);
        let (since, detail): (Instant, String) = (row.get(2)?, row.get(3)?);
        let text = match row.get::<_, Option<String>>(5)? {
            None => format!("`{}` cannot be used: {detail}", file_name(Path::new(&path))),
            Some(problem) if problem.starts_with(&loss(&path)) => problem,
            Some(_) => continue,
        };
        let wait = found.entry(path.clone()).or_insert_with(|| Wait {
            path,
            state,
            since_utc: since,
            text,
            sites: Vec::new(),
        });
        wait.sites.push(row.get(4)?);
    }
    Ok(found.into_values().collect())
}

/// Subjects of alerts about such files that have begun and not ended.
///
/// # Errors
/// SQLite errors.
pub fn alerted_waits(connection: &Connection) -> Stored<Vec<String>> {
    let mut query = connection.prepare_cached(
        "SELECT subject FROM alert_state WHERE substr(subject, 1, length(?1)) = ?1 AND state = 'wrong'",
    )?;
    let found = query.query_map([SUBJECT], |row| row.get(0))?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Start of the subject of such an alert; the path follows.
pub const SUBJECT: &str = "input ";
