//! One round of comparisons: folders are listed, settled files read, and the sites planned that a change may affect.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use rusqlite::Transaction;
use serde_json::json;
use tokio::task::JoinSet;

use super::{
    alerts::{Alert, tell_edge},
    core::Core,
    folders::{Folder, folders},
    fresh::refresh,
    hold::{NotReady, hold_and_release, not_ready, wake_blocked},
    listing::read_list,
    plans::{Candidate, plan},
    poll::{Poll, Polled, compare},
    settle::settle,
    sites::{SiteBook, bring_in_line},
    workers::{Workers, words},
};
use crate::{
    database::{
        About, Stored, active_job, append, facts,
        files::{
            FileRow, RootKind, RootRow, RootState, files_below, files_since, keep_roots, put_file,
            put_root, roots,
        },
        nights::put_night_checked,
        pending_job,
        sites::{SiteRow, changed_inputs, put_unchanged, sites},
    },
    engine::retry::milliseconds,
    worker::protocol::{Answer, What},
};
use areograph_config::{AlertKind, ServiceConfig};
use areograph_store::files::Identity;

/// The purpose of a round.
#[derive(Debug, Clone, Copy, Default)]
pub struct Purpose {
    /// Its night: then sites whose products do not match their inputs are planned again.
    pub night: Option<i64>,
}

/// Performs one round.
///
/// # Errors
/// The database cannot be written; the next round starts over.
pub async fn round<W: Workers>(
    core: &Arc<Core<W>>,
    book: &mut SiteBook,
    purpose: Purpose,
) -> Stored<()> {
    let config = core.shared.config();
    let folders = folders(&config.inputs)?;
    let number = begin(core, &folders)?;
    let settled = poll(core, &folders).await?;
    settle(core, settled, number).await?;
    let site_folders: Vec<String> = folders
        .iter()
        .filter(|folder| folder.kind == RootKind::Sites)
        .map(|folder| folder.path.clone())
        .collect();
    let now_ms = core.now_ms();
    let candidates = core.shared.write(|transaction| {
        bring_in_line(transaction, now_ms, book, &site_folders)?;
        let waits = not_ready(transaction)?;
        hold_and_release(transaction, now_ms, &waits)?;
        let compared = candidates(transaction, book, &waits, purpose)?;
        let unchanged: Vec<&str> = compared.unchanged.iter().map(|name| &**name).collect();
        put_unchanged(transaction, &unchanged, number, now_ms)?;
        if let Some(night) = purpose.night {
            let checked = unchanged.len() + compared.candidates.len();
            put_night_checked(transaction, night, checked)?;
        }
        refresh(transaction, now_ms, None)?;
        Ok(compared.candidates)
    })?;
    plan_all(core, candidates, number, purpose, &folders).await;
    Ok(())
}

/// Assigns the number of the round.
fn begin<W: Workers>(core: &Core<W>, folders: &[Folder]) -> Stored<i64> {
    let paths: Vec<String> = folders.iter().map(|folder| folder.path.clone()).collect();
    core.shared.write(|transaction| {
        keep_roots(transaction, &paths)?;
        let number = facts::number(transaction, facts::ROUND)?.unwrap_or(0) + 1;
        facts::note(transaction, facts::ROUND, &number.to_string())?;
        Ok(number)
    })
}

type Listing = Result<BTreeMap<String, Identity>, String>;

/// Lists all folders in parallel, compares them, and returns the files that have settled.
async fn poll<W: Workers>(core: &Arc<Core<W>>, folders: &[Folder]) -> Stored<Vec<FileRow>> {
    let mut lists = JoinSet::new();
    for folder in folders {
        let (core, folder) = (Arc::clone(core), folder.clone());
        lists.spawn(async move {
            let listing = list(&core, &folder).await;
            (folder, listing)
        });
    }
    let mut settled = Vec::new();
    while let Some(listed) = lists.join_next().await {
        match listed {
            // A stopping service has ended its workers, which implies nothing about the folder.
            Ok(_) if core.shared.ending.is_cancelled() => {}
            Ok((folder, listing)) => settled.extend(note_poll(core, &folder, &listing)?),
            Err(panicked) => tracing::error!("listing a folder failed: {panicked}"),
        }
    }
    settled.sort_by(|one: &FileRow, other| one.path.cmp(&other.path));
    settled.dedup_by(|one, other| one.path == other.path);
    Ok(settled)
}

async fn list<W: Workers>(core: &Arc<Core<W>>, folder: &Folder) -> Listing {
    let into = core.scratch();
    let what = What::List {
        roots: vec![folder.path.clone().into()],
        into: into.clone(),
    };
    let limit_s = core.shared.config().changes.sweep_limit_s;
    let limit = Duration::from_secs_f64(limit_s);
    let begun = Instant::now();
    let ended = core
        .ask(&format!("list {}", folder.path), what, limit)
        .await;
    let listing = match &ended.answer {
        Some(Ok(Answer::List { .. })) => read_list(&into, Path::new(&folder.path), folder.kind),
        _ if begun.elapsed() >= limit => {
            Err(format!("the folder could not be listed within {limit_s} s"))
        }
        _ => Err(words(&ended)),
    };
    let _ = std::fs::remove_file(into);
    listing
}

fn note_poll<W: Workers>(
    core: &Core<W>,
    folder: &Folder,
    listing: &Listing,
) -> Stored<Vec<FileRow>> {
    let config = core.shared.config();
    let now_ms = core.now_ms();
    let (root, known) = core.shared.read(|connection| {
        let root = roots(connection)?
            .into_iter()
            .find(|root| root.path == folder.path);
        Ok((root, files_below(connection, &folder.path)?))
    })?;
    let root = root.unwrap_or_else(|| RootRow {
        path: folder.path.clone(),
        kind: folder.kind,
        files: 0,
        state: RootState::Available,
        since_ms: now_ms,
        detail: String::new(),
    });
    let polled = compare(&Poll {
        root: &root,
        known: &known,
        found: listing.as_ref().map_err(|why| &**why),
        now_ms,
        max_loss: config.changes.max_loss,
        quiet_ms: match folder.kind {
            // Small files, which are not copied in pieces.
            RootKind::Sites => 0,
            _ => milliseconds(config.changes.quiet_period_s),
        },
    });
    let Polled {
        root: now,
        changed,
        settled,
    } = polled;
    core.shared.write(|transaction| {
        for file in &changed {
            put_file(transaction, file)?;
        }
        put_root(transaction, &now)?;
        if now.state != root.state {
            let why = if now.detail.is_empty() { "" } else { ": " };
            let state = now.state.name();
            tracing::info!("{} is {state}{why}{}", now.path, now.detail);
            let data = json!({ "path": now.path, "state": now.state.name(), "text": now.detail });
            append(transaction, now_ms, "root", About::default(), &data)?;
            if root.state == RootState::Unavailable {
                wake_blocked(transaction, now_ms, &now.path)?;
            }
        }
        tell_root(transaction, &config, now_ms, &now)
    })?;
    Ok(settled)
}

/// Reports that a folder is unavailable, or available again.
fn tell_root(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    root: &RootRow,
) -> Stored<()> {
    let gone = format!("{} is not available: {}", root.path, root.detail);
    let back = format!("{} is available again", root.path);
    tell_edge(
        transaction,
        config,
        now_ms,
        (
            &format!("root {}", root.path),
            root.state == RootState::Unavailable,
        ),
        (
            &Alert::of_service(AlertKind::RootUnavailable, &gone),
            Some(&Alert::of_service(AlertKind::RootBack, &back)),
        ),
    )
}

/// Result of a comparison of all sites.
struct Compared {
    candidates: Vec<Candidate>,
    unchanged: Vec<String>,
}

/// Sites that a change may affect, and those that it does not. Sites with unusable inputs, or with an active job, are
/// neither.
fn candidates(
    connection: &rusqlite::Connection,
    book: &SiteBook,
    waits: &NotReady,
    purpose: Purpose,
) -> Stored<Compared> {
    let mut changed = changed_inputs(connection)?;
    let all: Vec<SiteRow> = sites(connection)?;
    let planned = all.iter().filter(|site| site.enabled && !site.needs_plan());
    let oldest = planned.map(|site| site.round).min().unwrap_or(i64::MAX);
    let new = files_since(connection, oldest)?;
    let mut compared = Compared {
        candidates: Vec::new(),
        unchanged: Vec::new(),
    };
    for site in all.into_iter().filter(|site| site.enabled) {
        if waits.to_plan(&site.name).is_some() || active_job(connection, &site.name)?.is_some() {
            continue;
        }
        let changed = changed.remove(&site.name).unwrap_or_default();
        let file = book.of(&site.file);
        let reached = |file: &super::sites::SiteFile| {
            new.iter()
                .any(|(path, round)| *round > site.round && file.reaches(path))
        };
        let reached = !site.needs_plan() && file.is_some_and(reached);
        let again = purpose.night.is_some()
            && site.stale_since_ms.is_some()
            && pending_job(connection, &site.name)?.is_none();
        if site.needs_plan() || !changed.is_empty() || reached || again {
            compared.candidates.push(Candidate { site, changed });
        } else {
            compared.unchanged.push(site.name);
        }
    }
    Ok(compared)
}

async fn plan_all<W: Workers>(
    core: &Arc<Core<W>>,
    candidates: Vec<Candidate>,
    round: i64,
    purpose: Purpose,
    folders: &[Folder],
) {
    let places = usize::from(core.shared.config().workers.count);
    let places = Arc::new(tokio::sync::Semaphore::new(places));
    let folders: Arc<[Folder]> = folders.into();
    let mut plans = JoinSet::new();
    for candidate in candidates {
        let (core, places, folders) = (Arc::clone(core), Arc::clone(&places), Arc::clone(&folders));
        plans.spawn(async move {
            let _place = places.acquire_owned().await;
            let name = candidate.site.name.clone();
            if core.shared.ending.is_cancelled() {
                return;
            }
            if let Err(error) = plan(&core, candidate, round, purpose.night, &folders).await {
                tracing::error!(site = name, "the plan could not be recorded: {error}");
            }
            core.shared.wake.notify_one();
        });
    }
    while let Some(done) = plans.join_next().await {
        if let Err(panicked) = done {
            tracing::error!("planning a site failed: {panicked}");
        }
    }
}
