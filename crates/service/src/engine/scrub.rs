//! Periodic checks: files are read again even if the file system reports no change, and products compared with their
//! manifests.

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use rusqlite::Connection;
use serde_json::json;
use tokio::time::sleep;

use super::{
    core::{Core, runs},
    damage::{Damage, Seen, check_run, note_check},
    retry::milliseconds,
    settle::hashes,
    workers::{Workers, words},
};
use crate::{
    contents::Pace,
    database::{
        About, Stored, append,
        files::{FileRow, FileState, file, oldest_checked, put_file},
        jobs_in,
        runs::{DueRun, due_run},
        scrubs::ScrubPass,
    },
    recover::is_own,
    state::JobState,
    worker::protocol::What,
};
use areograph_config::ServiceConfig;
use areograph_store::files::file_name;

/// Files read in one step.
const STEP: u32 = 16;
/// Longest time for a step.
const LIMIT: Duration = Duration::from_mins(30);
/// Time after which a check of products begins no further run.
const PASS_MAX: Duration = Duration::from_hours(1);
/// Time between two looks whether sites still run.
const PAUSE: Duration = Duration::from_secs(1);
const SECONDS_PER_DAY: f64 = 86_400.0;

/// Reads a few files again, those read longest ago. A file with changed content settles again.
///
/// # Errors
/// The database cannot be written.
pub async fn scrub_files<W: Workers>(core: &Arc<Core<W>>) -> Stored<()> {
    let Some(before_ms) = before_ms(core) else {
        return Ok(());
    };
    let old = core
        .shared
        .read(|connection| oldest_checked(connection, before_ms, STEP))?;
    if old.is_empty() {
        return Ok(());
    }
    let what = What::Hash {
        files: old.iter().map(|file| file.path.clone().into()).collect(),
        rehash: true,
    };
    let ended = core.ask("scrub", what, LIMIT).await;
    let Some(read) = hashes(&ended).filter(|read| read.len() == old.len()) else {
        tracing::warn!("files could not be read again: {}", words(&ended));
        return Ok(());
    };
    let now_ms = core.now_ms();
    core.shared.write(|transaction| {
        for (old, read) in old.iter().zip(&read) {
            // A poll may have detected the change meanwhile.
            let Some(now) = file(transaction, &old.path)?.filter(|now| now == old) else {
                continue;
            };
            let same = read.blake3 == old.blake3;
            let checked = FileRow {
                checked_ms: Some(now_ms),
                state: if same {
                    FileState::Ready
                } else {
                    FileState::Settling
                },
                changed_ms: if same { now.changed_ms } else { now_ms },
                ..now
            };
            if !same {
                let name = file_name(Path::new(&old.path));
                let text = format!(
                    "`{name}` has different content, although the file system reports no change"
                );
                tracing::warn!("{text}");
                append(
                    transaction,
                    now_ms,
                    "file",
                    About::default(),
                    &json!({ "path": name, "text": text }),
                )?;
            }
            put_file(transaction, &checked)?;
        }
        Ok(())
    })
}

/// Compares the products of one current run, the one read longest ago, with their manifest; damaged ones are made
/// again. While a site runs, nothing is read.
///
/// # Errors
/// The database cannot be written.
pub async fn scrub_products<W: Workers>(core: &Arc<Core<W>>) -> Stored<()> {
    let Some(before_ms) = before_ms(core).filter(|_| products_are_there(core)) else {
        return Ok(());
    };
    let (busy, due) = core.shared.read(|connection| {
        Ok((
            is_at_work(connection)?,
            due_run(connection, before_ms, true)?,
        ))
    })?;
    if let Some(run) = due.filter(|_| !busy) {
        scrub_run(core, &run, Seen::default()).await?;
    }
    Ok(())
}

/// After a night: compares the products of all runs, those read longest ago first, with their manifests. While a site
/// runs, no further run begins, nor an hour after the start of the check; the next night continues. A folder of a
/// different service is reported here, once a night.
///
/// # Errors
/// The database cannot be written.
pub async fn scrub_runs<W: Workers>(core: &Arc<Core<W>>) -> Stored<()> {
    let Some(before_ms) = before_ms(core) else {
        return Ok(());
    };
    if !products_are_there(core) {
        tracing::warn!(
            "{} is not the products folder of this service: the product check is omitted",
            core.shared.config().outputs.products.display()
        );
        return Ok(());
    }
    let begun = Instant::now();
    let mut pass = ScrubPass::default();
    let mut seen = Seen::default();
    loop {
        let (busy, due) = core.shared.read(|connection| {
            Ok((
                is_at_work(connection)?,
                due_run(connection, before_ms, false)?,
            ))
        })?;
        let Some(run) = due else {
            pass.complete = true;
            break;
        };
        if core.shared.ending.is_cancelled() || begun.elapsed() > PASS_MAX {
            break;
        }
        if busy {
            sleep(PAUSE).await;
            continue;
        }
        let Some(scrubbed) = scrub_run(core, &run, seen).await? else {
            break;
        };
        seen = scrubbed.seen;
        pass.runs += i64::from(scrubbed.existed);
        pass.damaged_runs += i64::from(scrubbed.existed && scrubbed.damaged > 0);
        pass.bytes += i64::try_from(scrubbed.bytes).unwrap_or(i64::MAX);
    }
    pass.ended_ms = core.now_ms();
    if pass.damaged_runs > 0 || !pass.complete {
        tracing::warn!("{}", pass.words());
    } else {
        tracing::info!("{}", pass.words());
    }
    core.shared.write(|transaction| pass.note(transaction))
}

/// Result of reading the products of a run.
struct Scrubbed {
    /// Whether the run was not removed meanwhile.
    existed: bool,
    damaged: i64,
    bytes: u64,
    seen: Seen,
}

/// Reads the products of a run that were not `seen` in this check; `None` if the service ends.
async fn scrub_run<W: Workers>(
    core: &Arc<Core<W>>,
    run: &DueRun,
    mut seen: Seen,
) -> Stored<Option<Scrubbed>> {
    let config = core.shared.config();
    let folder = runs(&config.outputs.products, &run.site).join(&run.id);
    let (shared, manifest) = (Arc::clone(&core.shared), run.manifest_blake3.clone());
    let mut pace = Pace::new(config.changes.scrub_mib_per_s);
    let read = tokio::task::spawn_blocking(move || {
        let stops = || shared.ending.is_cancelled();
        let step = |bytes| pace.step(bytes, stops);
        let check = check_run(&shared.contents, &folder, &manifest, &mut seen, step);
        (check, pace.bytes(), seen, folder)
    });
    let (check, bytes, seen, folder) = match read.await {
        Ok((Some(check), bytes, seen, folder)) => (check, bytes, seen, folder),
        Ok((None, ..)) => return Ok(None),
        Err(panicked) => {
            tracing::error!("{panicked}");
            return Ok(None);
        }
    };
    if !folder.is_dir() {
        // A run that is being removed is recorded as such a moment later.
        sleep(PAUSE).await;
    }
    let now_ms = core.now_ms();
    let damage = Damage {
        site: &run.site,
        run: &run.id,
        products: check.damaged,
        what: &check.what,
    };
    let existed = core
        .shared
        .write(|transaction| note_check(transaction, &config, now_ms, &damage))?;
    Ok(Some(Scrubbed {
        existed,
        damaged: check.damaged,
        bytes,
        seen,
    }))
}

/// Whether the folder of products is the one of this service: without its disk, nothing is damaged.
fn products_are_there<W: Workers>(core: &Core<W>) -> bool {
    let config = core.shared.config();
    core.shared
        .read(|connection| is_own(connection, &config.outputs.products))
        .unwrap_or(false)
}

fn is_at_work(connection: &Connection) -> Stored<bool> {
    let states = [JobState::Starting, JobState::Running, JobState::Cancelling];
    for state in states {
        if !jobs_in(connection, state)?.is_empty() {
            return Ok(true);
        }
    }
    Ok(false)
}

fn before_ms<W: Workers>(core: &Core<W>) -> Option<i64> {
    due_before_ms(&core.shared.config(), core.now_ms())
}

/// Contents last read before this instant are due to be read again; `None` if reading is never due.
#[must_use]
pub fn due_before_ms(config: &ServiceConfig, now_ms: i64) -> Option<i64> {
    let days = config.changes.scrub_days;
    (days > 0.0).then(|| now_ms.saturating_sub(milliseconds(days * SECONDS_PER_DAY)))
}
