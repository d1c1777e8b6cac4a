//! Periodic checks: files are read again even if the file system reports no change, and products compared with their
//! manifests.

use std::{path::Path, sync::Arc, time::Duration};

use serde_json::json;

use super::{
    core::{Core, runs},
    retry::milliseconds,
    settle::hashes,
    workers::{Workers, words},
};
use crate::{
    database::{
        About, Ask, CauseKind, CauseRow, Priority, Stored, active_job, append, ask, facts,
        files::{FileRow, FileState, file, oldest_checked, put_file},
        sites::sites,
    },
    worker::protocol::What,
};
use areograph_store::files::file_name;
use areograph_store::published::read_published;

/// Files read in one step.
const STEP: u32 = 16;
/// Longest time for a step.
const LIMIT: Duration = Duration::from_mins(30);
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
            // A sweep may have detected the change meanwhile.
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

/// Compares the products of one site, the one checked longest ago, with their manifest; damaged ones are made again.
///
/// # Errors
/// The database cannot be written.
pub async fn scrub_products<W: Workers>(core: &Arc<Core<W>>) -> Stored<()> {
    let Some(before_ms) = before_ms(core) else {
        return Ok(());
    };
    let next = core.shared.read(|connection| {
        let mut next: Option<(i64, String, String)> = None;
        for site in sites(connection)?.into_iter().filter(|site| site.enabled) {
            let checked_ms = facts::number(connection, &fact(&site.name))?.unwrap_or(0);
            let is_next = next
                .as_ref()
                .is_none_or(|(oldest_ms, ..)| checked_ms < *oldest_ms);
            if let Some(run) = site.current_run.filter(|_| is_next) {
                next = Some((checked_ms, site.name, run));
            }
        }
        Ok(next.filter(|(checked_ms, ..)| *checked_ms < before_ms))
    })?;
    let Some((_, site, run)) = next else {
        return Ok(());
    };
    let folder = runs(&core.shared.config().outputs.products, &site).join(&run);
    let read = tokio::task::spawn_blocking(move || read_published(&folder)).await;
    let now_ms = core.now_ms();
    core.shared.write(|transaction| {
        facts::note(transaction, &fact(&site), &now_ms.to_string())?;
        let Ok(Err(failure)) = read else {
            return Ok(());
        };
        if active_job(transaction, &site)?.is_some() {
            return Ok(());
        }
        tracing::warn!(site, "{failure}");
        let text = failure.to_string();
        let text = text.lines().next().unwrap_or_default();
        let cause = CauseRow::plain(CauseKind::ProductDamaged, text, now_ms);
        let asked = Ask {
            site: &site,
            priority: Priority::Changed,
            force: true,
            night: None,
            asked_by: None,
            ready: true,
            causes: &[cause],
        };
        ask(transaction, now_ms, &asked).map(|_| ())
    })
}

fn fact(site: &str) -> String {
    format!("scrubbed {site}")
}

fn before_ms<W: Workers>(core: &Core<W>) -> Option<i64> {
    let days = core.shared.config().changes.scrub_days;
    (days > 0.0).then(|| {
        core.now_ms()
            .saturating_sub(milliseconds(days * SECONDS_PER_DAY))
    })
}
