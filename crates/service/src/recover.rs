//! A lost database is recognized by the products, which are marked with the service that made them, and made again from
//! the runs on the disk. The database of another service is refused.

use std::{fs, io::ErrorKind, path::Path};

use rusqlite::Connection;
use serde_json::Value;

use super::{
    database::{Database, DatabaseError, Stored, facts, losses::Loss},
    engine::alerts::{Alert, tell},
    record::{has_runs, record_all},
    shared::Shared,
    tokens::random_hex,
};
use areograph_base::error::{IoError, Locate as _, Result};
use areograph_config::AlertKind;
use areograph_store::atomic;

/// File in the folder of products that identifies the service.
const OWNER: &str = ".areograph-service";
/// Bytes of the identity of a service.
const ID_BYTES: usize = 16;

/// Ensures that the database belongs to the service that made the products, and marks both. A new database beside
/// products of an earlier one is recorded as lost: [`recover`] makes it again.
///
/// # Errors
/// The database belongs to another service; a disk error.
pub fn examine(database: &Database, products: &Path) -> Result<()> {
    let marked = owner(products)?;
    let state = database.path();
    let (known, is_lost, is_used) = database
        .read(|connection| {
            Ok((
                facts::fact(connection, facts::IDENTITY)?,
                facts::fact(connection, facts::RECOVERING)?.is_some(),
                is_used(connection)?,
            ))
        })
        .in_file(state)?;
    let is_lost = match (&known, &marked) {
        (Some(known), Some(marked)) if known != marked => return Err(foreign()).in_file(state),
        (None, Some(_)) if is_used => return Err(foreign()).in_file(state),
        (Some(_), _) => is_lost,
        // Written before databases and products were marked.
        (None, None) if is_used => false,
        (None, marked) => marked.is_some() || has_runs(products)?,
    };
    let is_known = known.is_some();
    let id = match known.or_else(|| marked.clone()) {
        Some(id) => id,
        None => random_hex::<ID_BYTES>().in_file(state)?,
    };
    if !is_known {
        database
            .write(|transaction| {
                facts::note(transaction, facts::IDENTITY, &id)?;
                if is_lost {
                    facts::note(transaction, facts::RECOVERING, "yes")?;
                }
                Ok(())
            })
            .in_file(state)?;
    }
    // Last: a mark without its database would be taken for a loss.
    if marked.is_none() {
        atomic::write(&products.join(OWNER), format!("{id}\n").as_bytes())?;
    }
    Ok(())
}

fn foreign() -> DatabaseError {
    let why = "it belongs to another service than the products";
    DatabaseError::Foreign(why.to_owned())
}

/// The service that made the products; an incomplete mark counts as none.
fn owner(products: &Path) -> Result<Option<String>> {
    let path = products.join(OWNER);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        read => read.map_err(IoError::on("read")).in_file(&path)?,
    };
    let id = text.trim();
    let is_id = id.len() == 2 * ID_BYTES && id.bytes().all(|byte| byte.is_ascii_hexdigit());
    Ok(is_id.then(|| id.to_owned()))
}

/// Whether the folder of products is marked as that of the service with this database, or the database has no mark.
///
/// # Errors
/// SQLite errors.
pub fn is_own(connection: &Connection, products: &Path) -> Stored<bool> {
    let known = facts::fact(connection, facts::IDENTITY)?;
    Ok(known.is_none_or(|known| owner(products).is_ok_and(|marked| marked == Some(known))))
}

fn is_used(connection: &Connection) -> Stored<bool> {
    let rows = "SELECT EXISTS (SELECT 1 FROM site) OR EXISTS (SELECT 1 FROM run) OR EXISTS (SELECT 1 FROM job)";
    Ok(connection.query_row(rows, [], |row| row.get(0))?)
}

/// Whether the database was lost and has not been made again.
///
/// # Errors
/// SQLite errors.
pub fn is_lost(connection: &Connection) -> Stored<bool> {
    Ok(facts::fact(connection, facts::RECOVERING)?.is_some())
}

/// Makes a lost database again from the runs on the disk, and reports the loss. A service that is to end stops this;
/// the next one continues.
///
/// # Errors
/// A disk error.
pub fn recover(shared: &Shared) -> Result<()> {
    let config = shared.config();
    let (state, products) = (&config.outputs.state, &config.outputs.products);
    if !shared.read(is_lost).in_file(state)? {
        return Ok(());
    }
    shared.set_recovering(true);
    tracing::warn!("the database was lost: it is made again from the products");
    let stops = || {
        shared.note_progress();
        shared.ending.is_cancelled()
    };
    let Some(found) = record_all(shared.database(), products, shared.now_ms(), stops)? else {
        return Ok(());
    };
    let now_ms = shared.now_ms();
    let loss = found.as_loss(now_ms);
    let text = loss.words();
    shared
        .write(|transaction| {
            loss.note(transaction)?;
            facts::remove(transaction, facts::RECOVERING)?;
            let alert = Alert {
                kind: AlertKind::DatabaseLost,
                site: None,
                run: None,
                text: &text,
            };
            tell(transaction, &config, now_ms, &alert, &Value::Null)
        })
        .in_file(state)?;
    shared.set_recovering(false);
    Ok(())
}

/// Marks a database that was made at the request of a person.
///
/// # Errors
/// A disk error.
pub fn mark(database: &Database, products: &Path, loss: Loss) -> Result<()> {
    let id = match owner(products)? {
        Some(id) => id,
        None => random_hex::<ID_BYTES>().in_file(database.path())?,
    };
    database
        .write(|transaction| {
            facts::note(transaction, facts::IDENTITY, &id)?;
            loss.note(transaction)
        })
        .in_file(database.path())?;
    atomic::write(&products.join(OWNER), format!("{id}\n").as_bytes())
}
