//! Layouts of the tables: a database of a former one is copied and migrated.

use std::{
    fs,
    path::{Path, PathBuf},
};

use rusqlite::Connection;

use super::{DatabaseError, Stored, copy};

/// Layout of the tables; a change raises it and adds a step to [`migrate`].
pub(super) const VERSION: i64 = 4;
/// Tables by which a database of the service is recognized.
const OWN_TABLES: &str = "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name IN ('service', 'run', 'site', 'token')";
/// Step from layout 1: time of the last reading of the products of a run, and number of them that do not match its
/// manifest.
const CHECKED_RUNS: &str = "ALTER TABLE run ADD COLUMN checked_ms INTEGER;
    ALTER TABLE run ADD COLUMN damaged INTEGER NOT NULL DEFAULT 0;";
/// Step from layout 2: body of a site, which its next plan states.
const BODIES: &str = "ALTER TABLE site ADD COLUMN body TEXT NOT NULL DEFAULT 'mars';";
/// Step from layout 3: whether Slurm runs an attempt, which is unknown for earlier ones.
const CLUSTERS: &str = "ALTER TABLE attempt ADD COLUMN on_cluster INTEGER;";
const SCHEMA: &str = include_str!("schema.sql");

/// A free path in `folder` for a file that is moved aside or copied: `stem.db`, `stem_2.db` and so on.
pub(crate) fn free_name(folder: &Path, stem: &str) -> PathBuf {
    let is_free = |path: &PathBuf| fs::symlink_metadata(path).is_err();
    let first = folder.join(format!("{stem}.db"));
    let others = (2_u64..).map(|number| folder.join(format!("{stem}_{number}.db")));
    let mut paths = std::iter::once(first.clone()).chain(others);
    paths.find(is_free).unwrap_or(first)
}

/// The layout of a database; `None` for an empty one.
///
/// # Errors
/// It is newer, or of another program; SQLite errors.
pub(super) fn layout_of(connection: &Connection) -> Stored<Option<i64>> {
    let found: i64 = connection.query_row("PRAGMA user_version", [], |row| row.get(0))?;
    if found > VERSION {
        return Err(DatabaseError::Newer { found });
    }
    let count = |sql| connection.query_row(sql, [], |row| row.get::<_, i64>(0));
    let is_empty = count("SELECT count(*) FROM sqlite_schema")? == 0;
    if found < 1 && !is_empty {
        return Err(DatabaseError::Foreign(format!(
            "its layout is {found}; expected 1 to {VERSION}"
        )));
    }
    if found >= 1 && count(OWN_TABLES)? < 4 {
        let why = "its tables belong to another program".to_owned();
        return Err(DatabaseError::Foreign(why));
    }
    Ok((!is_empty).then_some(found))
}

/// Gives the database in `folder` the present layout, after a copy of a former one.
///
/// # Errors
/// Those of [`layout_of`]; SQLite errors.
pub(super) fn migrate(connection: &mut Connection, folder: &Path) -> Stored<()> {
    let found = layout_of(connection)?;
    if found == Some(VERSION) {
        return Ok(());
    }
    if found.is_some() {
        copy(
            connection,
            &free_name(folder, &format!("before-layout-{VERSION}")),
        )?;
    }
    let transaction = connection.transaction()?;
    match found {
        None => transaction.execute_batch(SCHEMA)?,
        Some(layout) => {
            let steps = [CHECKED_RUNS, BODIES, CLUSTERS].into_iter().zip(1..);
            for (step, _) in steps.filter(|(_, from)| *from >= layout) {
                transaction.execute_batch(step)?;
            }
        }
    }
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::{DATABASE, Database};

    #[test]
    fn a_database_of_layout_1_gets_the_present_one_after_a_copy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(DATABASE);
        drop(Database::open(folder.path()).unwrap());
        let former = "ALTER TABLE run DROP COLUMN checked_ms; ALTER TABLE run DROP COLUMN damaged; ALTER TABLE site DROP COLUMN body; ALTER TABLE attempt DROP COLUMN on_cluster;
            INSERT INTO fact VALUES ('a', 'b'); PRAGMA user_version = 1";
        Connection::open(&path)
            .unwrap()
            .execute_batch(former)
            .unwrap();
        // The copy of an earlier migration, after a return to the former layout.
        let copies =
            ["before-layout-4.db", "before-layout-4_2.db"].map(|name| folder.path().join(name));
        #[allow(clippy::disallowed_methods, reason = "an earlier copy for a test")]
        fs::write(&copies[0], "earlier").unwrap();
        let database = Database::open(folder.path()).unwrap();
        let found = database.read(|connection| {
            connection.prepare("SELECT checked_ms, damaged FROM run")?;
            connection.prepare("SELECT body FROM site")?;
            connection.prepare("SELECT on_cluster FROM attempt")?;
            let sql = "SELECT value FROM fact WHERE name = 'a'";
            Ok(connection.query_row(sql, [], |row| row.get::<_, String>(0))?)
        });
        assert_eq!(found.unwrap(), "b");
        assert_eq!(fs::read(&copies[0]).unwrap(), b"earlier");
        let copy = Connection::open(&copies[1]).unwrap();
        let layout = copy.query_row("PRAGMA user_version", [], |row| row.get::<_, i64>(0));
        assert_eq!(layout.unwrap(), 1);
    }

    #[test]
    fn a_site_of_layout_2_has_a_body() {
        let folder = tempfile::tempdir().unwrap();
        drop(Database::open(folder.path()).unwrap());
        let former =
            "ALTER TABLE site DROP COLUMN body; ALTER TABLE attempt DROP COLUMN on_cluster;
            INSERT INTO site (name, file, config_blake3, enabled) VALUES ('a', 'a.toml', '', 1);
            PRAGMA user_version = 2";
        let path = folder.path().join(DATABASE);
        Connection::open(&path)
            .unwrap()
            .execute_batch(former)
            .unwrap();
        let database = Database::open(folder.path()).unwrap();
        let found = database.read(|connection| {
            connection.prepare("SELECT checked_ms, damaged FROM run")?;
            let sql = "SELECT body FROM site WHERE name = 'a'";
            Ok(connection.query_row(sql, [], |row| row.get::<_, String>(0))?)
        });
        assert_eq!(found.unwrap(), "mars");
        assert!(folder.path().join("before-layout-4.db").is_file());
    }
}
