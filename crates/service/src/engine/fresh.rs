//! Since when, and why, a site's products do not match its inputs. A site with unchanged inputs is fresh, independent
//! of the age of its run.

use std::collections::BTreeMap;

use rusqlite::{Connection, Transaction, params};
use serde_json::Value;

use super::{
    alerts::{Alert, tell_edge, tell_waits},
    hold::not_ready,
    retry::milliseconds,
};
use crate::{
    clock::utc_text,
    database::{
        Stored, causes,
        sites::{SiteRow, put_fresh, put_stale, site, sites},
    },
    state::JobState,
};
use areograph_config::{AlertKind, ServiceConfig};

/// Records for one site, or for all, whether it is fresh.
///
/// # Errors
/// SQLite errors.
pub fn refresh(transaction: &Transaction<'_>, now_ms: i64, only: Option<&str>) -> Stored<()> {
    let sites = match only {
        Some(name) => site(transaction, name)?.into_iter().collect(),
        None => sites(transaction)?,
    };
    let waits = not_ready(transaction)?;
    let newest = newest_jobs(transaction, only)?;
    for site in sites.iter().filter(|site| site.enabled) {
        let stale = match waits.of(&site.name) {
            Some(why) if !site.needs_plan() => Some((now_ms, why)),
            _ => by_job(transaction, site, newest.get(&site.name))?,
        };
        match stale {
            Some((since_ms, because)) => {
                put_stale(transaction, &site.name, since_ms, &because)?;
            }
            None if site.stale_since_ms.is_some() || site.problem.is_some() => {
                put_fresh(transaction, &site.name)?;
            }
            None => {}
        }
    }
    Ok(())
}

/// The newest job of a site: its number, state, outcome and start.
struct Newest {
    id: i64,
    state: JobState,
    outcome: String,
    created_ms: i64,
}

fn newest_jobs(connection: &Connection, only: Option<&str>) -> Stored<BTreeMap<String, Newest>> {
    let mut query = connection.prepare_cached(
        "SELECT s.name, j.id, j.state, j.outcome, j.created_ms FROM site s
         JOIN job j ON j.id = (SELECT max(id) FROM job WHERE site = s.name AND state <> 'superseded')
         WHERE ?1 IS NULL OR s.name = ?1",
    )?;
    let mut rows = query.query(params![only])?;
    let mut newest = BTreeMap::new();
    while let Some(row) = rows.next()? {
        let state: String = row.get(2)?;
        let outcome: Option<String> = row.get(3)?;
        let outcome: Value = outcome
            .and_then(|text| serde_json::from_str(&text).ok())
            .unwrap_or_default();
        let job = Newest {
            id: row.get(1)?,
            state: state.parse().unwrap_or(JobState::Failed),
            outcome: outcome["text"].as_str().unwrap_or_default().to_owned(),
            created_ms: row.get(4)?,
        };
        newest.insert(row.get(0)?, job);
    }
    Ok(newest)
}

fn by_job(
    connection: &Connection,
    site: &SiteRow,
    newest: Option<&Newest>,
) -> Stored<Option<(i64, String)>> {
    let Some(job) = newest else {
        return Ok(None);
    };
    let why = match job.state {
        JobState::Succeeded | JobState::Unchanged | JobState::Superseded => return Ok(None),
        // A cancelled job leaves the products of the preceding run, which were not stale.
        JobState::Cancelled if site.stale_since_ms.is_none() => return Ok(None),
        JobState::Queued | JobState::Starting | JobState::Running | JobState::Cancelling => {
            let causes = causes(connection, job.id)?;
            causes
                .into_iter()
                .next_back()
                .map_or_else(|| job.state.to_string(), |cause| cause.detail)
        }
        state => format!("job {} is {state}: {}", job.id, job.outcome),
    };
    Ok(Some((job.created_ms, why)))
}

/// Hours as milliseconds.
fn hours_ms(hours: f64) -> i64 {
    milliseconds(hours * 3600.0)
}

/// Reports once each file for which sites wait, and each site that has been stale, or was not compared, for too long.
///
/// # Errors
/// SQLite errors.
pub fn tell_stale(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
) -> Stored<()> {
    tell_waits(transaction, config, now_ms)?;
    let freshness = &config.freshness;
    let stale_before_ms = now_ms.saturating_sub(hours_ms(freshness.stale_after_h));
    let unchecked_before_ms = now_ms.saturating_sub(hours_ms(freshness.unchecked_after_h));
    for site in sites(transaction)?.iter().filter(|site| site.enabled) {
        let stale = site
            .stale_since_ms
            .filter(|since_ms| *since_ms < stale_before_ms);
        let unchecked = site
            .checked_ms
            .filter(|checked_ms| *checked_ms < unchecked_before_ms);
        let because = site.stale_because.as_deref().unwrap_or_default();
        let text = match (stale, unchecked) {
            (Some(since_ms), _) => {
                format!("stale since {}: {because}", utc_text(since_ms))
            }
            (None, Some(checked_ms)) => {
                format!("not compared since {}", utc_text(checked_ms))
            }
            (None, None) => String::new(),
        };
        let alert = Alert {
            kind: AlertKind::Stale,
            site: Some(&site.name),
            run: None,
            text: &text,
        };
        let subject = format!("freshness {}", site.name);
        let wrong = !text.is_empty();
        tell_edge(
            transaction,
            config,
            now_ms,
            (&subject, wrong),
            (&alert, None),
        )?;
    }
    Ok(())
}
