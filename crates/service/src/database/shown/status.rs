//! Status of the data of a service: its database and its products.

use rusqlite::Connection;
use serde::Serialize;
use utoipa::ToSchema;

use crate::{
    database::{Stored, losses::Loss, scrubs::ScrubPass},
    instant::Instant,
};

/// Damaged runs in a list.
const DAMAGED: u32 = 100;

/// Status of the data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct DataStatus {
    /// The loss of an earlier database, if there was one.
    pub database_loss: Option<DatabaseLoss>,
    /// The products of all kept runs.
    pub products: ProductStatus,
}

/// An earlier database was lost and rebuilt from the products.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct DatabaseLoss {
    /// When it was rebuilt.
    pub at_utc: Instant,
    /// What was found, and what was lost.
    pub text: String,
}

/// Products compared with their manifests.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ProductStatus {
    /// Runs whose products are kept.
    pub runs: i64,
    /// Runs whose products were not read for longer than `changes.scrub_days`.
    pub runs_due: i64,
    /// Runs with products that do not match the manifest.
    pub runs_damaged: i64,
    /// The check longest ago among kept runs; null if one was never checked.
    pub oldest_check_utc: Option<Instant>,
    /// The last check after a night.
    pub last_scrub: Option<Scrub>,
    /// The newest damaged runs, at most 100.
    pub damaged: Vec<DamagedRun>,
}

/// A check of products after a night.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Scrub {
    /// When it ended.
    pub ended_utc: Instant,
    /// Runs whose products were read.
    pub runs: i64,
    /// Runs with damaged products among them.
    pub damaged_runs: i64,
    /// Bytes read.
    pub bytes: i64,
    /// Whether no run was left for the next night.
    pub complete: bool,
}

/// A run with damaged products.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct DamagedRun {
    /// The run.
    pub run: String,
    /// Its site.
    pub site: String,
    /// Products that do not match the manifest, as far as known.
    pub products: i64,
}

/// Status of the data; runs checked before `before_ms` are due, without it none is.
///
/// # Errors
/// SQLite errors.
pub fn data_status(connection: &Connection, before_ms: Option<i64>) -> Stored<DataStatus> {
    let loss = Loss::last(connection)?.map(|loss| DatabaseLoss {
        at_utc: Instant(loss.at_ms),
        text: loss.words(),
    });
    let counts = "SELECT count(*), count(CASE WHEN coalesce(checked_ms, 0) < ?1 THEN 1 END),
        count(CASE WHEN damaged > 0 THEN 1 END), min(coalesce(checked_ms, 0)) FROM run WHERE removed_ms IS NULL";
    let (runs, runs_due, runs_damaged, oldest_ms) =
        connection.query_row(counts, [before_ms], |row| {
            let oldest_ms: Option<i64> = row.get(3)?;
            Ok((row.get(0)?, row.get(1)?, row.get(2)?, oldest_ms))
        })?;
    let mut query = connection.prepare_cached(
        "SELECT id, site, damaged FROM run WHERE removed_ms IS NULL AND damaged > 0 ORDER BY published_ms DESC, id DESC LIMIT ?1",
    )?;
    let damaged = query.query_map([DAMAGED], |row| {
        Ok(DamagedRun {
            run: row.get(0)?,
            site: row.get(1)?,
            products: row.get(2)?,
        })
    })?;
    let last_scrub = ScrubPass::last(connection)?.map(|pass| Scrub {
        ended_utc: Instant(pass.ended_ms),
        runs: pass.runs,
        damaged_runs: pass.damaged_runs,
        bytes: pass.bytes,
        complete: pass.complete,
    });
    Ok(DataStatus {
        database_loss: loss,
        products: ProductStatus {
            runs,
            runs_due,
            runs_damaged,
            oldest_check_utc: oldest_ms.filter(|at_ms| *at_ms > 0).map(Instant),
            last_scrub,
            damaged: damaged.collect::<Result<_, _>>()?,
        },
    })
}
