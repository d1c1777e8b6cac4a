//! Checks of products after nights.

use rusqlite::{Connection, Transaction};

use super::{Stored, facts};
use crate::words::counted;

/// One check of products.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ScrubPass {
    /// Time at which it ended, milliseconds of UTC since 1970.
    pub ended_ms: i64,
    /// Runs whose products were read.
    pub runs: i64,
    /// Runs with damaged products among them.
    pub damaged_runs: i64,
    /// Bytes read.
    pub bytes: i64,
    /// Whether no run was left to be read.
    pub complete: bool,
}

/// Names of its facts.
const NAMES: [&str; 5] = [
    "scrub_ended_ms",
    "scrub_runs",
    "scrub_damaged_runs",
    "scrub_bytes",
    "scrub_complete",
];

impl ScrubPass {
    /// The last one.
    ///
    /// # Errors
    /// SQLite errors.
    pub fn last(connection: &Connection) -> Stored<Option<Self>> {
        let mut numbers = [0; NAMES.len()];
        for (name, number) in NAMES.iter().zip(&mut numbers) {
            let Some(found) = facts::number(connection, name)? else {
                return Ok(None);
            };
            *number = found;
        }
        let [ended_ms, runs, damaged_runs, bytes, complete] = numbers;
        Ok(Some(Self {
            ended_ms,
            runs,
            damaged_runs,
            bytes,
            complete: complete != 0,
        }))
    }

    /// Records it.
    ///
    /// # Errors
    /// SQLite errors.
    pub fn note(&self, transaction: &Transaction<'_>) -> Stored<()> {
        let numbers = [
            self.ended_ms,
            self.runs,
            self.damaged_runs,
            self.bytes,
            i64::from(self.complete),
        ];
        for (name, number) in NAMES.iter().zip(numbers) {
            facts::note(transaction, name, &number.to_string())?;
        }
        Ok(())
    }

    /// As text.
    #[must_use]
    pub fn words(&self) -> String {
        const MIB: i64 = 1 << 20;
        let left = if self.complete {
            ""
        } else {
            "; the next night reads the remaining runs"
        };
        format!(
            "the check read the products of {} ({} MiB) and found damage in {}{left}",
            counted(self.runs, "run"),
            self.bytes / MIB,
            counted(self.damaged_runs, "run")
        )
    }
}
