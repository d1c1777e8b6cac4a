//! Browser sessions: a token exchanged for a random reference, of which the database stores only the hash.

use std::fmt::Write as _;

use rusqlite::{Connection, OptionalExtension as _, Transaction, params};
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

use super::{
    database::{DatabaseError, Stored},
    tokens::Role,
};

/// A session ends after this time without a request.
pub const IDLE_MS: i64 = 3_600_000;
/// Longest duration of a session.
pub const LIFE_MS: i64 = 12 * 3_600_000;
/// Shortest time between two records of a session's use.
const NOTE_MS: i64 = 60_000;

/// A session that is open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Session {
    /// Hash of its reference.
    pub sha256: Vec<u8>,
    /// Its token.
    pub token: String,
    /// The role of that token.
    pub role: Role,
    /// The token in every form of its pages.
    pub form_token: String,
    /// Its last recorded use.
    pub seen_ms: i64,
}

impl Session {
    /// Whether a form came from a page of this session.
    #[must_use]
    pub fn made_form(&self, form_token: &str) -> bool {
        self.form_token
            .as_bytes()
            .ct_eq(form_token.as_bytes())
            .into()
    }

    /// Whether its use should be recorded now.
    #[must_use]
    pub fn note_is_due(&self, now_ms: i64) -> bool {
        now_ms - self.seen_ms > NOTE_MS
    }
}

/// Opens a session and returns its reference, the only time that it is available. Ended sessions are removed.
///
/// # Errors
/// SQLite errors; the system has no random numbers.
pub fn open_session(transaction: &Transaction<'_>, now_ms: i64, token: &str) -> Stored<String> {
    transaction.execute(
        "DELETE FROM session WHERE seen_ms <= ?1 - ?2 OR created_ms <= ?1 - ?3",
        params![now_ms, IDLE_MS, LIFE_MS],
    )?;
    let (reference, form_token) = (random()?, random()?);
    transaction.execute(
        "INSERT INTO session (sha256, token, csrf, created_ms, seen_ms) VALUES (?1, ?2, ?3, ?4, ?4)",
        params![hash(&reference), token, form_token, now_ms],
    )?;
    Ok(reference)
}

/// The session with this reference, if it is open and its token still valid.
///
/// # Errors
/// SQLite errors.
pub fn find_session(
    connection: &Connection,
    now_ms: i64,
    reference: &str,
) -> Stored<Option<Session>> {
    let mut query = connection.prepare_cached(
        "SELECT s.*, t.role FROM session s JOIN token t ON t.id = s.token
         WHERE s.sha256 = ?1 AND s.seen_ms > ?2 - ?3 AND s.created_ms > ?2 - ?4
         AND t.revoked_ms IS NULL AND (t.expires_ms IS NULL OR t.expires_ms > ?2)",
    )?;
    let sha256 = hash(reference);
    let found = query.query_row(params![sha256, now_ms, IDLE_MS, LIFE_MS], |row| {
        let role: String = row.get("role")?;
        Ok(Session {
            sha256: sha256.clone(),
            token: row.get("token")?,
            role: role.parse().unwrap_or(Role::Read),
            form_token: row.get("csrf")?,
            seen_ms: row.get("seen_ms")?,
        })
    });
    Ok(found.optional()?)
}

/// Records that a session was used.
///
/// # Errors
/// SQLite errors.
pub fn note_session(transaction: &Transaction<'_>, now_ms: i64, session: &Session) -> Stored<()> {
    let note = "UPDATE session SET seen_ms = ?2 WHERE sha256 = ?1";
    transaction.execute(note, params![session.sha256, now_ms])?;
    Ok(())
}

/// Ends a session.
///
/// # Errors
/// SQLite errors.
pub fn close_session(transaction: &Transaction<'_>, session: &Session) -> Stored<()> {
    transaction.execute("DELETE FROM session WHERE sha256 = ?1", [&session.sha256])?;
    Ok(())
}

/// Whether a token is still valid and, for a session, whether it is open; for operations that outlast a request.
///
/// # Errors
/// SQLite errors.
pub fn still_open(
    connection: &Connection,
    now_ms: i64,
    token: &str,
    session: Option<&Session>,
) -> Stored<bool> {
    let mut query = connection.prepare_cached(
        "SELECT EXISTS (SELECT 1 FROM token WHERE id = ?1 AND revoked_ms IS NULL AND (expires_ms IS NULL OR expires_ms > ?2))
         AND (?3 IS NULL OR EXISTS (SELECT 1 FROM session WHERE sha256 = ?3 AND created_ms > ?2 - ?4))",
    )?;
    let sha256 = session.map(|session| &session.sha256);
    Ok(query.query_row(params![token, now_ms, sha256, LIFE_MS], |row| row.get(0))?)
}

/// The reference has 256 random bits: the time of a search for its hash reveals nothing.
fn hash(reference: &str) -> Vec<u8> {
    Sha256::digest(reference.as_bytes()).to_vec()
}

fn random() -> Stored<String> {
    let mut bytes = [0_u8; 32];
    getrandom::fill(&mut bytes).map_err(|error| DatabaseError::NoRandom(error.to_string()))?;
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        database::Database,
        tokens::{add_token, revoke_token},
    };

    #[test]
    fn a_session_ends_when_idle_when_old_when_closed_and_with_its_token() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path()).unwrap();
        let text = database
            .write(|transaction| add_token(transaction, 0, Role::Operate, "", None))
            .unwrap();
        let id = text.split('_').nth(1).unwrap();
        let open = || {
            database
                .write(|transaction| open_session(transaction, 0, id))
                .unwrap()
        };
        let find = |now_ms, reference: &str| {
            database
                .read(|connection| find_session(connection, now_ms, reference))
                .unwrap()
        };
        let reference = open();
        let session = find(IDLE_MS - 1, &reference).unwrap();
        assert!(session.made_form(&session.form_token) && !session.made_form(""));
        assert_eq!(find(IDLE_MS, &reference), None);
        for hour in 0..12 {
            let now_ms = hour * 3_000_000;
            let used = find(now_ms, &reference).unwrap();
            database
                .write(|transaction| note_session(transaction, now_ms, &used))
                .unwrap();
        }
        let late = Session {
            seen_ms: 0,
            ..session
        };
        database
            .write(|transaction| note_session(transaction, LIFE_MS - 1, &late))
            .unwrap();
        assert!(find(LIFE_MS - 1, &reference).is_some());
        assert_eq!(find(LIFE_MS, &reference), None);
        let (other, third) = (open(), open());
        let found = find(1, &other).unwrap();
        database
            .write(|transaction| close_session(transaction, &found))
            .unwrap();
        assert_eq!(find(1, &other), None);
        assert!(find(1, &third).is_some());
        database
            .write(|transaction| revoke_token(transaction, 2, id))
            .unwrap();
        assert_eq!(find(3, &third), None);
    }
}
