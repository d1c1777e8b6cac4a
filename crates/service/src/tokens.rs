//! Tokens of people and programs: `areo_<id>_<secret>`, of which the database stores only the hash of the secret.

use std::{fmt, str::FromStr};

use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;
use utoipa::ToSchema;

use super::database::{DatabaseError, Stored};

/// Start of every token.
pub const PREFIX: &str = "areo_";
const ID_BYTES: usize = 4;
const SECRET_BYTES: usize = 32;

/// Permissions of a token's bearer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Read.
    Read,
    /// Read, start and cancel jobs, pin runs.
    Operate,
}

impl Role {
    /// Its name in the database and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Operate => "operate",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// An unknown name of a role.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown role {0}; expected read or operate")]
pub struct UnknownRole(String);

impl FromStr for Role {
    type Err = UnknownRole;

    fn from_str(name: &str) -> Result<Self, UnknownRole> {
        let role = [Self::Read, Self::Operate]
            .into_iter()
            .find(|role| role.name() == name);
        role.ok_or_else(|| UnknownRole(name.to_owned()))
    }
}

/// A token, without its secret.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Token {
    /// Its public part.
    pub id: String,
    /// Role of its bearer.
    pub role: Role,
    /// Its purpose.
    pub note: String,
    /// When it was created, milliseconds of UTC since 1970.
    pub created_ms: i64,
    /// When it expires.
    pub expires_ms: Option<i64>,
    /// When it was revoked.
    pub revoked_ms: Option<i64>,
    /// When it was last used, to the minute.
    pub used_ms: Option<i64>,
}

impl Token {
    /// Whether it is still valid.
    #[must_use]
    pub fn is_valid(&self, now_ms: i64) -> bool {
        self.revoked_ms.is_none() && self.expires_ms.is_none_or(|end| now_ms < end)
    }
}

/// Creates a token and returns it with its secret, the only time that it is available.
///
/// # Errors
/// SQLite errors; the system has no random numbers.
pub fn add_token(
    transaction: &Transaction<'_>,
    now_ms: i64,
    role: Role,
    note: &str,
    expires_ms: Option<i64>,
) -> Stored<String> {
    let (id, secret) = (random_hex::<ID_BYTES>()?, random_hex::<SECRET_BYTES>()?);
    transaction.execute(
        "INSERT INTO token (id, sha256, role, note, created_ms, expires_ms) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
        params![id, hash(&secret).as_slice(), role.name(), note, now_ms, expires_ms],
    )?;
    Ok(format!("{PREFIX}{id}_{secret}"))
}

/// All tokens, including expired and revoked ones, oldest first.
///
/// # Errors
/// SQLite errors.
pub fn tokens(connection: &Connection) -> Stored<Vec<Token>> {
    let mut query = connection.prepare_cached("SELECT * FROM token ORDER BY created_ms, id")?;
    let found = query.query_map([], read)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Revokes a token and ends the sessions that it opened. Returns whether the token exists.
///
/// # Errors
/// SQLite errors.
pub fn revoke_token(transaction: &Transaction<'_>, now_ms: i64, id: &str) -> Stored<bool> {
    transaction.execute("DELETE FROM session WHERE token = ?1", [id])?;
    let revoked = transaction.execute(
        "UPDATE token SET revoked_ms = coalesce(revoked_ms, ?2) WHERE id = ?1",
        params![id, now_ms],
    )?;
    Ok(revoked > 0)
}

/// The token with this text, if it is known and still valid. An unknown token takes the same time.
///
/// # Errors
/// SQLite errors.
pub fn find_token(connection: &Connection, now_ms: i64, text: &str) -> Stored<Option<Token>> {
    let (id, secret) = split(text).unwrap_or_default();
    let mut query = connection.prepare_cached("SELECT * FROM token WHERE id = ?1")?;
    let row = |row: &Row<'_>| Ok((read(row)?, row.get::<_, Vec<u8>>("sha256")?));
    let (token, kept) = match query.query_row([id], row).optional()? {
        Some((token, kept)) => (Some(token), kept),
        None => (None, hash("").to_vec()),
    };
    let same = bool::from(hash(secret).as_slice().ct_eq(&kept));
    Ok(token.filter(|token| same && token.is_valid(now_ms)))
}

/// Records that a token was used, at most once a minute.
///
/// # Errors
/// SQLite errors.
pub fn note_use(transaction: &Transaction<'_>, now_ms: i64, id: &str) -> Stored<()> {
    transaction.execute(
        "UPDATE token SET used_ms = ?2 WHERE id = ?1 AND coalesce(used_ms, 0) < ?2 - 60000",
        params![id, now_ms],
    )?;
    Ok(())
}

/// The identifier in a token's text, if it has the form of one.
#[must_use]
pub fn token_name(text: &str) -> Option<&str> {
    split(text).map(|(id, _)| id)
}

/// Identifier and secret of a token's text.
fn split(text: &str) -> Option<(&str, &str)> {
    let (id, secret) = text.strip_prefix(PREFIX)?.split_once('_')?;
    (id.len() == 2 * ID_BYTES && secret.len() == 2 * SECRET_BYTES).then_some((id, secret))
}

/// The secret has 256 random bits: a slow hash would add nothing.
fn hash(secret: &str) -> [u8; 32] {
    Sha256::digest(secret.as_bytes()).into()
}

/// Random bytes in hexadecimal digits.
///
/// # Errors
/// The system has no random numbers.
pub fn random_hex<const BYTES: usize>() -> Stored<String> {
    let mut bytes = [0_u8; BYTES];
    getrandom::fill(&mut bytes).map_err(|error| DatabaseError::NoRandom(error.to_string()))?;
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    Ok(digits
        .filter_map(|digit| char::from_digit(digit.into(), 16))
        .collect())
}

fn read(row: &Row<'_>) -> rusqlite::Result<Token> {
    let role: String = row.get("role")?;
    Ok(Token {
        id: row.get("id")?,
        role: role.parse().unwrap_or(Role::Read),
        note: row.get("note")?,
        created_ms: row.get("created_ms")?,
        expires_ms: row.get("expires_ms")?,
        revoked_ms: row.get("revoked_ms")?,
        used_ms: row.get("used_ms")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::Database;

    const DAY_MS: i64 = 86_400_000;

    #[test]
    fn a_token_opens_until_it_ends_and_no_other_text_does() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path()).unwrap();
        let make = |expires_ms| {
            database
                .write(|transaction| add_token(transaction, 0, Role::Operate, "", expires_ms))
                .unwrap()
        };
        let find = |now_ms, text: &str| {
            database
                .read(|connection| find_token(connection, now_ms, text))
                .unwrap()
        };
        let (text, short) = (make(None), make(Some(DAY_MS)));
        assert_ne!(text, short);
        let token = find(5, &text).unwrap();
        assert_eq!(token.role, Role::Operate);
        assert!(find(DAY_MS - 1, &short).is_some());
        assert!(find(DAY_MS, &short).is_none());
        // One secret under another's identifier, a missing digit, no secret.
        let (id, secret) = split(&text).unwrap();
        let forged = format!("{PREFIX}{}_{secret}", split(&short).unwrap().0);
        let unknown = format!("{PREFIX}00000000_{secret}");
        let empty = format!("{PREFIX}{id}_");
        for other in [&forged, &unknown, &empty, &text[..text.len() - 1], ""] {
            assert_eq!(find(5, other), None, "{other}");
        }
        let stored: i64 = database
            .read(|connection| {
                Ok(connection.query_row(
                    "SELECT count(*) FROM token WHERE instr(sha256, ?1)",
                    [secret],
                    |row| row.get(0),
                )?)
            })
            .unwrap();
        assert_eq!(stored, 0);
        let revoked = database.write(|transaction| revoke_token(transaction, 6, id));
        assert!(revoked.unwrap());
        assert!(find(7, &text).is_none());
        let unknown = database.write(|transaction| revoke_token(transaction, 6, "none"));
        assert!(!unknown.unwrap());
    }
}
