//! Sites whose inputs are not usable now: their jobs are held, and released when they are.

use std::collections::BTreeMap;

use rusqlite::{Connection, Transaction, params};
use serde_json::json;

use crate::{
    database::{
        Job, Moved, Stored, advance,
        files::{RootKind, RootState, roots},
        jobs_in,
        waits::waits,
    },
    state::JobState,
};
use areograph_store::files::file_name;

/// Reasons for which inputs are not usable now.
#[derive(Debug, Default)]
pub struct NotReady {
    /// For planned sites.
    by_site: BTreeMap<String, String>,
    /// For others, whose inputs are unknown.
    unplanned: Option<String>,
    /// For sites of which a file left its folder.
    lost: BTreeMap<String, String>,
    /// Sites whose inputs are known.
    planned: std::collections::BTreeSet<String>,
}

impl NotReady {
    /// The reason for which the inputs of a site are not usable now; `None` if they are.
    #[must_use]
    pub fn of(&self, site: &str) -> Option<String> {
        self.to_plan(site).or_else(|| self.lost.get(site).cloned())
    }

    /// The reason for which a site cannot even be planned. A lost file is not such a reason: the site may no longer name it.
    #[must_use]
    pub fn to_plan(&self, site: &str) -> Option<String> {
        if self.planned.contains(site) {
            return self.by_site.get(site).cloned();
        }
        self.unplanned.clone()
    }
}

/// Examines all sites.
///
/// # Errors
/// SQLite errors.
pub fn not_ready(connection: &Connection) -> Stored<NotReady> {
    let mut found = NotReady::default();
    let mut query = connection.prepare_cached(
        "SELECT name FROM site WHERE EXISTS (SELECT 1 FROM site_input WHERE site = name)",
    )?;
    for site in query.query_map([], |row| row.get(0))? {
        found.planned.insert(site?);
    }
    for root in roots(connection)? {
        let why = match root.state {
            RootState::Available => continue,
            RootState::Unavailable => format!("{} is not available: {}", root.path, root.detail),
            RootState::Settling => format!("{}: {}", root.path, root.detail),
        };
        if root.kind != RootKind::Sites || root.state == RootState::Unavailable {
            found.unplanned.get_or_insert_with(|| why.clone());
        }
        let mut query = connection.prepare_cached(
            "SELECT DISTINCT site FROM site_input WHERE path > ?1 || '/' AND path < ?1 || '0'",
        )?;
        for site in query.query_map([&root.path], |row| row.get::<_, String>(0))? {
            let site = site?;
            let changed = changed_below(connection, &site, &root.path)?;
            let why = changed.map_or_else(
                || why.clone(),
                |path| format!("`{}` changed; {why}", file_name(path.as_ref())),
            );
            found.by_site.entry(site).or_insert(why);
        }
    }
    for wait in waits(connection)? {
        let known = if wait.is_lost() {
            &mut found.lost
        } else {
            &mut found.by_site
        };
        for site in wait.sites {
            known.entry(site).or_insert_with(|| wait.text.clone());
        }
    }
    Ok(found)
}

/// A settling file that a site reads, if any.
fn changed_below(connection: &Connection, site: &str, root: &str) -> Stored<Option<String>> {
    use rusqlite::OptionalExtension as _;
    let mut query = connection.prepare_cached(
        "SELECT f.path FROM file_version f JOIN site_input i ON i.path = f.path
         WHERE f.state = 'settling' AND i.site = ?1 AND f.path > ?2 || '/' AND f.path < ?2 || '0' ORDER BY f.path LIMIT 1",
    )?;
    Ok(query
        .query_row(params![site, root], |row| row.get(0))
        .optional()?)
}

/// Holds a queued job.
///
/// # Errors
/// SQLite errors.
pub fn hold(transaction: &Transaction<'_>, now_ms: i64, job: &Job, why: &str) -> Stored<()> {
    tracing::debug!(site = job.site, job = job.id, "held: {why}");
    let moved = Moved {
        outcome: Some(json!({ "text": why })),
        ..Moved::default()
    };
    advance(transaction, now_ms, job.id, JobState::Held, &moved)
}

/// Holds queued jobs whose inputs are not usable, and releases those that can proceed.
///
/// # Errors
/// SQLite errors.
pub fn hold_and_release(
    transaction: &Transaction<'_>,
    now_ms: i64,
    waits: &NotReady,
) -> Stored<()> {
    for job in jobs_in(transaction, JobState::Queued)? {
        if let Some(why) = waits.of(&job.site) {
            hold(transaction, now_ms, &job, &why)?;
        }
    }
    for job in jobs_in(transaction, JobState::Held)? {
        if waits.of(&job.site).is_none() {
            tracing::info!(site = job.site, job = job.id, "released");
            advance(
                transaction,
                now_ms,
                job.id,
                JobState::Queued,
                &Moved::default(),
            )?;
        }
    }
    Ok(())
}

/// Queues blocked jobs of sites that read below a folder which is available again: its absence may have caused their
/// failure, and none of their inputs has changed. The same applies to sites whose inputs are unknown.
///
/// # Errors
/// SQLite errors.
pub fn wake_blocked(transaction: &Transaction<'_>, now_ms: i64, root: &str) -> Stored<()> {
    let mut query = transaction.prepare_cached(
        "SELECT NOT EXISTS (SELECT 1 FROM site_input WHERE site = ?1) OR EXISTS (SELECT 1 FROM site_input
         WHERE site = ?1 AND path > ?2 || '/' AND path < ?2 || '0')",
    )?;
    for job in jobs_in(transaction, JobState::Blocked)? {
        if query.query_row(params![job.site, root], |row| row.get(0))? {
            let text = format!("{root} is available again");
            let moved = Moved {
                outcome: Some(json!({ "text": text })),
                not_before_ms: Some(0),
                ..Moved::default()
            };
            advance(transaction, now_ms, job.id, JobState::Queued, &moved)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::{Database, JobRequest, Priority, enqueue, job};

    #[test]
    fn what_failed_while_its_folder_was_away_is_tried_again_when_it_is_back() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path()).unwrap();
        let states = database.write(|transaction| {
            let mut ids = Vec::new();
            for (site, path) in [("eos", "/k/a.bc"), ("gusev", "/other/a.bc"), ("new", "")] {
                transaction.execute(
                    "INSERT INTO site (name, file, config_blake3, enabled) VALUES (?1, '', '', 1)",
                    [site],
                )?;
                if !path.is_empty() {
                    transaction.execute(
                        "INSERT INTO site_input (site, path, role) VALUES (?1, ?2, 'kernel')",
                        [site, path],
                    )?;
                }
                let request = JobRequest {
                    site,
                    priority: Priority::Changed,
                    force: false,
                    night: None,
                    asked_by: None,
                    ready: true,
                    causes: &[],
                };
                let id = enqueue(transaction, 0, &request)?.job;
                for state in [JobState::Starting, JobState::Running, JobState::Blocked] {
                    advance(transaction, 0, id, state, &Moved::default())?;
                }
                ids.push(id);
            }
            wake_blocked(transaction, 1, "/k")?;
            let states = ids
                .into_iter()
                .map(|id| Ok(job(transaction, id)?.unwrap().state));
            states.collect::<Stored<Vec<_>>>()
        });
        let expected = [JobState::Queued, JobState::Blocked, JobState::Queued];
        assert_eq!(states.unwrap(), expected);
    }
}
