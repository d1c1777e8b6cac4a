//! The loss of a database that was made again from the products.

use rusqlite::{Connection, Transaction};

use super::{Stored, facts};
use crate::{clock::utc_text, words::counted};

/// A loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Loss {
    /// Time at which the database was rebuilt, milliseconds of UTC since 1970.
    pub at_ms: i64,
    /// Sites with runs that were found on the disk.
    pub sites: i64,
    /// Their runs.
    pub runs: i64,
}

impl Loss {
    /// The last one.
    ///
    /// # Errors
    /// SQLite errors.
    pub fn last(connection: &Connection) -> Stored<Option<Self>> {
        let Some(at_ms) = facts::number(connection, facts::RECOVERED_MS)? else {
            return Ok(None);
        };
        Ok(Some(Self {
            at_ms,
            sites: facts::number(connection, facts::RECOVERED_SITES)?.unwrap_or(0),
            runs: facts::number(connection, facts::RECOVERED_RUNS)?.unwrap_or(0),
        }))
    }

    /// Records it: the database is no longer lost.
    ///
    /// # Errors
    /// SQLite errors.
    pub fn note(&self, transaction: &Transaction<'_>) -> Stored<()> {
        for (name, number) in [
            (facts::RECOVERED_MS, self.at_ms),
            (facts::RECOVERED_SITES, self.sites),
            (facts::RECOVERED_RUNS, self.runs),
        ] {
            facts::note(transaction, name, &number.to_string())?;
        }
        facts::remove(transaction, facts::RECOVERING)
    }

    /// As text.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "the database was rebuilt from the products on {}: {}, {}. Earlier tokens, sessions, jobs, nights, events, pins and \
             audit records are lost; create new tokens with `areograph service token add`",
            utc_text(self.at_ms),
            counted(self.sites, "site"),
            counted(self.runs, "run"),
        )
    }
}
