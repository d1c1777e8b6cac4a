//! Retention: newest runs, one a week, pinned ones, the current one and its predecessor; newest events, logs and
//! copies.

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    time::{Duration, SystemTime},
};

use super::{
    core::{COPIES, Core, LOGS, runs},
    diffs::page,
    retry::milliseconds,
    runs::current,
    workers::Workers,
};
use crate::{
    clock::utc_text,
    database::{
        Stored, newest_event,
        runs::{Run, kept_runs, put_removed},
        sites::sites,
    },
    worker::run_folder::remove,
};
use areograph_config::RetentionConfig;

const DAY_MS: i64 = 86_400_000;
const WEEK_MS: i64 = 7 * DAY_MS;
/// Runs removed in one step.
const STEP: usize = 8;
/// Notifications, and jobs without a run, are kept as long as logs.
const SECONDS_PER_DAY: f64 = 86_400.0;

/// Runs of a site that need not be kept; `runs` are all existing ones, the newest first.
#[must_use]
pub fn superfluous<'a>(
    runs: &'a [Run],
    current: Option<&str>,
    config: &RetentionConfig,
    now_ms: i64,
) -> Vec<&'a str> {
    let predecessor = runs
        .iter()
        .find(|run| Some(&*run.id) == current)
        .and_then(|run| run.predecessor.as_deref());
    let newest = usize::try_from(config.runs).unwrap_or(usize::MAX);
    let mut weeks = BTreeSet::new();
    let mut superfluous = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        let week = now_ms.saturating_sub(run.published_utc.0) / WEEK_MS;
        // The newest run of each week comes first.
        let of_its_week = week < i64::from(config.weeks) && run.valid && weeks.insert(week);
        let kept = place < newest
            || of_its_week
            || run.pinned
            || Some(&*run.id) == current
            || Some(&*run.id) == predecessor;
        if !kept {
            superfluous.push(&*run.id);
        }
    }
    superfluous
}

/// Removes a few runs that need not be kept. Returns whether there are more.
///
/// # Errors
/// The database cannot be written.
pub fn remove_runs<W: Workers>(core: &Core<W>) -> Stored<bool> {
    let config = core.shared.config();
    let mut left = STEP;
    for site in core.shared.read(sites)? {
        let kept = core
            .shared
            .read(|connection| kept_runs(connection, &site.name))?;
        let products = &config.outputs.products;
        let linked = current(&super::core::site_folder(products, &site.name));
        let linked = linked.or(site.current_run);
        let now_ms = core.now_ms();
        for run in superfluous(&kept, linked.as_deref(), &config.retention, now_ms) {
            if left == 0 {
                return Ok(true);
            }
            left -= 1;
            remove_run(&runs(products, &site.name), run);
            let _ = fs::remove_file(page(products, &site.name, run));
            core.shared
                .write(|transaction| put_removed(transaction, run, now_ms))?;
            tracing::info!(site = site.name, run, "removed");
        }
    }
    Ok(false)
}

/// It is renamed first, so that an incomplete run is never taken for a run.
fn remove_run(folder: &Path, run: &str) {
    let leaving = folder.join(format!("{run}.partial"));
    let removed = fs::rename(folder.join(run), &leaving).is_err() || remove(&leaving).is_ok();
    if !removed {
        // The next start removes the remainder.
        tracing::warn!("{} could not be removed", leaving.display());
    }
}

/// Removes old events, notifications, requests, jobs and figures of removed runs, and writes the log of the database back.
///
/// # Errors
/// The database cannot be written.
pub fn trim<W: Workers>(core: &Core<W>) -> Stored<()> {
    let config = core.shared.config();
    let now_ms = core.now_ms();
    let logs_ms = milliseconds(config.retention.logs_days * SECONDS_PER_DAY);
    let before_ms = now_ms.saturating_sub(logs_ms);
    let history_ms = milliseconds(config.retention.history_days * SECONDS_PER_DAY);
    core.shared.write(|transaction| {
        transaction.execute(
            "DELETE FROM run WHERE removed_ms IS NOT NULL AND published_ms < ?1",
            [now_ms.saturating_sub(history_ms)],
        )?;
        let oldest = newest_event(transaction)? - i64::from(config.retention.events);
        transaction.execute("DELETE FROM event WHERE seq <= ?1", [oldest])?;
        for old in [
            "DELETE FROM outbox WHERE created_ms < ?1",
            "DELETE FROM audit WHERE at_ms < ?1",
            "DELETE FROM job WHERE ended_ms < ?1 AND id NOT IN (SELECT job FROM run WHERE removed_ms IS NULL)",
        ] {
            transaction.execute(old, [before_ms])?;
        }
        transaction.execute("DELETE FROM idempotency WHERE at_ms < ?1", [now_ms - DAY_MS])?;
        Ok(())
    })?;
    core.shared.database().checkpoint()?;
    let age = Duration::try_from_secs_f64(config.retention.logs_days * SECONDS_PER_DAY);
    if let Some(before) = age.ok().and_then(|age| SystemTime::now().checked_sub(age)) {
        remove_logs(core, before)?;
    }
    Ok(())
}

/// Removes logs of deleted attempts, and old logs without runs.
fn remove_logs<W: Workers>(core: &Core<W>, before: SystemTime) -> Stored<()> {
    let kept: BTreeSet<String> = core.shared.read(|connection| {
        let mut query = connection.prepare(
            "SELECT job || '-' || attempt || '.jsonl' FROM run WHERE removed_ms IS NULL",
        )?;
        let names = query.query_map([], |row| row.get(0))?;
        Ok(names.collect::<Result<_, _>>()?)
    })?;
    let folder = core.shared.config().outputs.state.join(LOGS);
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let modified = entry.metadata().and_then(|found| found.modified());
        if !kept.contains(&name) && modified.is_ok_and(|modified| modified < before) {
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}

/// Copies the database, and keeps the newest copies.
///
/// # Errors
/// The database cannot be copied.
pub fn copy_database<W: Workers>(core: &Core<W>) -> Stored<()> {
    let config = core.shared.config();
    let copies = usize::try_from(config.retention.copies).unwrap_or(usize::MAX);
    if copies == 0 {
        return Ok(());
    }
    let folder = config.outputs.state.join(COPIES);
    let stamp = utc_text(core.now_ms()).replace([':', '.'], "-");
    let path = folder.join(format!("areograph-{stamp}.db"));
    let partial = path.with_extension("partial");
    let _ = fs::remove_file(&partial);
    core.shared.database().copy_to(&partial)?;
    let _ = fs::rename(&partial, &path);
    let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries.map(|entry| entry.path()).collect();
    found.retain(|path| path.extension().is_some_and(|ending| ending == "db"));
    found.sort();
    for old in found.iter().rev().skip(copies) {
        let _ = fs::remove_file(old);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instant::Instant;

    fn run(day: i64, pinned: bool) -> Run {
        Run {
            id: format!("day{day}"),
            site: "gusev".to_owned(),
            job: day,
            attempt: 1,
            valid: true,
            verdict: "valid".to_owned(),
            predecessor: (day > 0).then(|| format!("day{}", day - 1)),
            published_utc: Instant(day * DAY_MS),
            pinned,
            ..Run::default()
        }
    }

    #[test]
    fn newest_weekly_pinned_and_current_runs_stay() {
        let runs: Vec<Run> = (0..100).rev().map(|day| run(day, day == 41)).collect();
        let config = RetentionConfig {
            runs: 3,
            weeks: 4,
            events: 1000,
            logs_days: 1.0,
            history_days: 1.0,
            copies: 1,
        };
        let gone = superfluous(&runs, Some("day20"), &config, 100 * DAY_MS);
        let kept: Vec<&str> = runs
            .iter()
            .map(|run| &*run.id)
            .filter(|id| !gone.contains(id))
            .collect();
        // Weeks end 7, 14 and 21 days before day 100; the newest of this week is among the newest.
        assert_eq!(
            kept,
            [
                "day99", "day98", "day97", "day93", "day86", "day79", "day41", "day20", "day19"
            ]
        );
        assert!(superfluous(&runs[..3], None, &config, 100 * DAY_MS).is_empty());
    }
}
