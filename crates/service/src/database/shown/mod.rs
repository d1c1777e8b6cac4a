//! Data for pages and the interface for programs: rows of the tables, read only, in lists of bounded length.

mod inputs;
mod nights;
mod runs;
mod sites;
mod status;
mod work;

use rusqlite::Row;
use serde_json::Value;

pub use inputs::{KernelFile, RootFolder, kernel_by_hash, kernels, roots, used_by};
pub use nights::{Night, night, nights};
pub use runs::{Run, pin_run, run, runs_of_job, runs_of_night, runs_of_site};
pub use sites::{Site, count_sites, current_runs, site, site_file, sites};
pub use status::{DamagedRun, DataStatus, DatabaseLoss, ProductStatus, Scrub, data_status};
pub use work::{Attempt, Totals, attempts, jobs_of_night, last_complete_night_ms, totals};

/// A column of JSON; invalid JSON stays text.
fn document(row: &Row<'_>, column: &str) -> rusqlite::Result<Value> {
    let text: Option<String> = row.get(column)?;
    Ok(text.map_or(Value::Null, |text| {
        serde_json::from_str(&text).unwrap_or(Value::String(text))
    }))
}
