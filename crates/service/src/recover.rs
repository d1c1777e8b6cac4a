//! A lost database is recognized by the products, which are marked with the service that made them, and made again from
//! the runs on the disk. The database of another service is refused.

use std::{fs, io::ErrorKind, path::Path};

use rusqlite::Connection;
use serde_json::Value;

use super::{
    database::{Database, DatabaseError, Stored, facts, losses::Loss},
    engine::alerts::{Alert, tell},
    record::{Rebuilt, has_runs, record_all},
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
/// products of an earlier one is recorded as lost: [`recover`] rebuilds it. An empty folder beside a used database is
/// not marked: the disk of the products may not be mounted.
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
    refuse_foreign(known.as_deref(), products).in_file(state)?;
    let is_lost = match (&known, &marked) {
        (None, Some(_)) if is_used => return Err(foreign()).in_file(state),
        (Some(_), _) => is_lost,
        // Written before databases and products were marked.
        (None, None) if is_used => false,
        (None, marked) => marked.is_some() || has_runs(products)?,
    };
    let id = identify(database, known.or(marked), is_lost)?;
    mark(products, &id, is_used)
}

/// Refuses a folder of products without the mark of a service and without a run, where the database records `runs`: the
/// disk of the products may not be mounted, and a service would make them again below the mount point.
pub(crate) fn require_products(runs: i64, products: &Path) -> Result<()> {
    if runs > 0 && owner(products)?.is_none() && !has_runs(products)? {
        return Err(DatabaseError::NoProducts(runs)).in_file(products);
    }
    Ok(())
}

/// Refuses a database of which the identity is not that of the products.
pub(crate) fn refuse_foreign(known: Option<&str>, products: &Path) -> Result<()> {
    match (known, owner(products)?) {
        (Some(known), Some(marked)) if known != marked => Err(foreign().into()),
        _ => Ok(()),
    }
}

fn foreign() -> DatabaseError {
    let why = "its identity does not match the products: it may belong to another service";
    DatabaseError::Foreign(why.to_owned())
}

/// Records the identity of the service, a new one without `known`, and whether the runs on the disk are still to be
/// recorded.
fn identify(database: &Database, known: Option<String>, is_lost: bool) -> Result<String> {
    let state = database.path();
    let id = match known {
        Some(id) => id,
        None => random_hex::<ID_BYTES>().in_file(state)?,
    };
    database
        .write(|transaction| {
            facts::note(transaction, facts::IDENTITY, &id)?;
            if is_lost {
                facts::note(transaction, facts::RECOVERING, "yes")?;
            }
            Ok(())
        })
        .in_file(state)?;
    Ok(id)
}

/// Marks unmarked products with the identity of the service, after its database: a mark without its database would be
/// taken for a loss. An empty folder beside a used database remains unmarked.
fn mark(products: &Path, id: &str, is_used: bool) -> Result<()> {
    if owner(products)?.is_some() || (is_used && !has_runs(products)?) {
        return Ok(());
    }
    atomic::write(&products.join(OWNER), format!("{id}\n").as_bytes())
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

/// Whether the folder of products is marked as belonging to the service with this database, or the database has no
/// mark.
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

/// Whether the database was lost and has not been rebuilt.
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
    tracing::warn!("the database was lost: the service is rebuilding it from the products");
    let stops = || {
        shared.note_progress();
        shared.ending.is_cancelled()
    };
    let now_ms = || shared.now_ms();
    let report = |loss: Loss| {
        let text = loss.words();
        let alert = Alert {
            kind: AlertKind::DatabaseLost,
            site: None,
            run: None,
            text: &text,
        };
        shared.write(|transaction| {
            loss.note(transaction)?;
            tell(transaction, &config, loss.at_ms, &alert, &Value::Null)
        })
    };
    if make_again(shared.database(), products, now_ms, stops, report)?.is_some() {
        shared.set_recovering(false);
    }
    Ok(())
}

/// Makes a database again from the runs on the disk: its identity, and that it is lost, are recorded before any run, so
/// that the next start continues if this is interrupted. `report` records the loss ([`Loss::note`]), which ends it.
/// `None` if `stops` stopped it between two sites.
///
/// # Errors
/// A disk error.
pub fn make_again(
    database: &Database,
    products: &Path,
    now_ms: impl Fn() -> i64,
    stops: impl Fn() -> bool,
    report: impl FnOnce(Loss) -> Stored<()>,
) -> Result<Option<Rebuilt>> {
    let state = database.path();
    let (known, is_used) = database
        .read(|connection| {
            let known = facts::fact(connection, facts::IDENTITY)?;
            Ok((known, is_used(connection)?))
        })
        .in_file(state)?;
    let marked = owner(products)?;
    let id = identify(database, known.or(marked), true)?;
    mark(products, &id, is_used)?;
    let found = record_all(database, products, now_ms(), stops)?;
    if let Some(found) = found {
        report(found.as_loss(now_ms())).in_file(state)?;
    }
    Ok(found)
}
