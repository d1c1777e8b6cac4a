//! The log of changes and their authors.

use rusqlite::{Transaction, params};

use super::database::Stored;

/// A change requested by a caller.
#[derive(Debug, Clone, Copy)]
pub struct Change<'a> {
    /// Identifier of the token.
    pub who: &'a str,
    /// The requested action, as in `cancel`.
    pub action: &'a str,
    /// The target, as in `job 7`.
    pub target: &'a str,
    /// Remote address of the request.
    pub remote: &'a str,
}

/// Records a change in the same transaction as the change itself.
///
/// # Errors
/// SQLite errors.
pub fn note_change(transaction: &Transaction<'_>, now_ms: i64, change: Change<'_>) -> Stored<()> {
    let Change {
        who,
        action,
        target,
        remote,
    } = change;
    transaction.execute(
        "INSERT INTO audit (at_ms, who, action, target, remote) VALUES (?1, ?2, ?3, ?4, ?5)",
        params![now_ms, who, action, target, remote],
    )?;
    Ok(())
}
