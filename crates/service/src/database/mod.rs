//! The database of the service: one writer, some readers, one file.

pub mod alerts;
pub mod attempts;
mod causes;
mod events;
pub mod facts;
pub mod files;
mod jobs;
pub mod nights;
pub mod runs;
pub mod service;
pub mod shown;
pub mod sites;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use rusqlite::{Connection, OpenFlags, OptionalExtension as _, Transaction, TransactionBehavior};

use areograph_base::error::{Cause, IoError, Locate as _, Result};

pub use causes::{CauseKind, CauseRow, add_cause, causes};
pub use events::{About, Event, append, events_after, newest_event};
pub use jobs::{
    Ask, Asked, Job, JobFilter, Moved, Priority, WrongTransition, active_job, advance, ask,
    ask_cancel, due_waiting, give_back, job, jobs, jobs_in, next_queued, pending_job,
};

/// Name of the database in the state folder.
pub const DATABASE: &str = "areograph.db";
/// Layout of the tables; a change raises it and adds a step to [`migrate`].
const VERSION: i64 = 1;
const SCHEMA: &str = include_str!("schema.sql");
/// Concurrent read connections; a request beyond them opens its own.
const READERS: usize = 8;

/// The database, open.
#[derive(Debug)]
pub struct Database {
    path: PathBuf,
    writer: Mutex<Connection>,
    readers: Mutex<Vec<Connection>>,
}

/// Errors of the database.
#[derive(Debug, thiserror::Error, Cause)]
pub enum DatabaseError {
    /// An error of SQLite.
    #[error("the database of the service: {0}")]
    #[cause(Io: "check the disk of the state folder; the service tries again")]
    Sqlite(#[source] rusqlite::Error),
    /// The file is damaged.
    #[error("the database is damaged: {0}")]
    #[cause(Input: "put the newest copy from the folder copies in its place, or make a new one from the products: \
        areograph service rebuild")]
    Damaged(String),
    /// A newer areograph wrote it.
    #[error("the database has layout {found}; this areograph supports layouts up to {VERSION}")]
    #[cause(Input: "start the newer areograph, or put back a copy of its layout")]
    Newer {
        /// Its layout.
        found: i64,
    },
    /// A path that the database cannot store.
    #[error("the path {} is not UTF-8", .0.display())]
    #[cause(Input: "give the file another name")]
    Path(PathBuf),
    /// The system has no random numbers.
    #[error("random numbers are not available: {0}")]
    #[cause(Io: "check that the system has a source of random numbers")]
    NoRandom(String),
    /// An invalid transition of a job.
    #[error(transparent)]
    #[cause(Bug: "this is a bug in areograph; please report it with the log")]
    Transition(#[from] WrongTransition),
}

impl From<rusqlite::Error> for DatabaseError {
    fn from(error: rusqlite::Error) -> Self {
        use rusqlite::ErrorCode::{DatabaseCorrupt, NotADatabase};
        match error.sqlite_error_code() {
            Some(DatabaseCorrupt | NotADatabase) => Self::Damaged(error.to_string()),
            _ => Self::Sqlite(error),
        }
    }
}

/// Result of reading or writing.
pub type Stored<T> = std::result::Result<T, DatabaseError>;

impl Database {
    /// Opens the database in `folder`, created if necessary, and migrates it to the current layout after making a copy.
    ///
    /// # Errors
    /// [`DatabaseError`]; [`IoError`].
    pub fn open(folder: &Path) -> Result<Self> {
        fs::create_dir_all(folder)
            .map_err(IoError::on("create the folder"))
            .in_file(folder)?;
        let path = folder.join(DATABASE);
        let mut writer = connect(&path, OpenFlags::default()).in_file(&path)?;
        sound(&writer).in_file(&path)?;
        migrate(&mut writer, folder).in_file(&path)?;
        Ok(Self {
            path,
            writer: Mutex::new(writer),
            readers: Mutex::new(Vec::new()),
        })
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Performs `work` as one transaction, which is on the disk on return.
    ///
    /// # Errors
    /// An error of `work`, in which case nothing is written; or an SQLite error.
    pub fn write<T>(&self, work: impl FnOnce(&Transaction<'_>) -> Stored<T>) -> Stored<T> {
        let mut writer = lock(&self.writer);
        let transaction = writer.transaction_with_behavior(TransactionBehavior::Immediate)?;
        let done = work(&transaction)?;
        transaction.commit()?;
        Ok(done)
    }

    /// Performs `look` on one state of the database.
    ///
    /// # Errors
    /// An error of `look`, or an SQLite error.
    pub fn read<T>(&self, look: impl FnOnce(&Connection) -> Stored<T>) -> Stored<T> {
        let idle = lock(&self.readers).pop();
        let mut reader = match idle {
            Some(reader) => reader,
            None => connect(&self.path, OpenFlags::SQLITE_OPEN_READ_ONLY)?,
        };
        let transaction = reader.transaction()?;
        let seen = look(&transaction);
        drop(transaction);
        let mut readers = lock(&self.readers);
        if readers.len() < READERS {
            readers.push(reader);
        }
        seen
    }

    /// Writes the log back into the database and truncates it; active readers may retain a part.
    ///
    /// # Errors
    /// SQLite errors.
    pub fn checkpoint(&self) -> Stored<()> {
        let writer = lock(&self.writer);
        writer.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))?;
        Ok(())
    }

    /// Copies the database, as of one instant, to `path`, which must not exist.
    ///
    /// # Errors
    /// SQLite errors.
    pub fn copy_to(&self, path: &Path) -> Stored<()> {
        copy(&lock(&self.writer), path)
    }
}

/// Transactions are atomic, so that a panic of another thread leaves no partial state.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn connect(path: &Path, flags: OpenFlags) -> Stored<Connection> {
    let connection = Connection::open_with_flags(path, flags)?;
    connection.busy_timeout(Duration::from_secs(5))?;
    if !flags.contains(OpenFlags::SQLITE_OPEN_READ_ONLY) {
        connection.pragma_update(None, "journal_mode", "WAL")?;
        connection.pragma_update(None, "synchronous", "FULL")?;
        connection.pragma_update(None, "journal_size_limit", 64 << 20)?;
    }
    connection.pragma_update(None, "foreign_keys", true)?;
    connection.pragma_update(None, "trusted_schema", false)?;
    Ok(connection)
}

fn sound(connection: &Connection) -> Stored<()> {
    let found = connection
        .query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0))
        .map_err(|error| DatabaseError::Damaged(error.to_string()))?;
    if found == "ok" {
        return Ok(());
    }
    Err(DatabaseError::Damaged(found))
}

fn migrate(connection: &mut Connection, folder: &Path) -> Stored<()> {
    let found: i64 = connection.query_row("PRAGMA user_version", [], |row| row.get(0))?;
    if found > VERSION {
        return Err(DatabaseError::Newer { found });
    }
    if found == VERSION {
        return Ok(());
    }
    let table = "SELECT name FROM sqlite_schema LIMIT 1";
    let any: Option<String> = connection
        .query_row(table, [], |row| row.get(0))
        .optional()?;
    if any.is_some() {
        copy(
            connection,
            &folder.join(format!("before-layout-{VERSION}.db")),
        )?;
    }
    let transaction = connection.transaction()?;
    if found < 1 {
        transaction.execute_batch(SCHEMA)?;
    }
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()?;
    Ok(())
}

fn copy(connection: &Connection, path: &Path) -> Stored<()> {
    let path = path.to_string_lossy();
    connection.execute("VACUUM INTO ?1", [&*path])?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use areograph_base::error::Kind;

    use super::*;

    #[test]
    fn a_newer_layout_is_refused_and_a_damaged_file_is_told() {
        let folder = tempfile::tempdir().unwrap();
        drop(Database::open(folder.path()).unwrap());
        let path = folder.path().join(DATABASE);
        let connection = Connection::open(&path).unwrap();
        connection
            .pragma_update(None, "user_version", VERSION + 1)
            .unwrap();
        drop(connection);
        let refused = Database::open(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("has layout 2"), "{refused}");
        let mut bytes = fs::read(&path).unwrap();
        bytes[4096..8192].fill(0xff);
        #[allow(clippy::disallowed_methods, reason = "a damaged file for a test")]
        fs::write(&path, bytes).unwrap();
        let refused = Database::open(folder.path()).unwrap_err();
        assert_eq!(refused.kind(), Kind::Input);
        assert!(refused.to_string().contains("is damaged"), "{refused}");
    }

    #[test]
    fn what_fails_in_the_middle_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path()).unwrap();
        let put = "INSERT INTO fact (name, value) VALUES ('a', 'b')";
        let failed = database.write(|transaction| {
            transaction.execute(put, [])?;
            transaction.execute(put, [])?;
            Ok(())
        });
        failed.unwrap_err();
        let count =
            database.read(|connection| {
                Ok(connection
                    .query_row("SELECT count(*) FROM fact", [], |row| row.get::<_, i64>(0))?)
            });
        assert_eq!(count.unwrap(), 0);
    }
}
