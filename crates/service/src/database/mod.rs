//! The database of the service: one writer, some readers, one file.

pub mod alerts;
pub mod attempts;
mod causes;
mod events;
pub mod facts;
pub mod files;
mod jobs;
mod layout;
pub mod losses;
pub mod nights;
pub mod runs;
pub mod scrubs;
pub mod service;
pub mod shown;
pub mod sites;
pub mod waits;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use rusqlite::{Connection, OpenFlags, Row, Transaction, TransactionBehavior};
use serde_json::Value;

use crate::private::{create_file, create_folder};
use areograph_base::error::{Cause, IoError, Locate as _, Result};
use layout::{VERSION, layout_of, migrate};

pub use causes::{CauseKind, CauseRow, add_cause, causes};
pub use events::{About, Event, EventFilter, append, events_after, events_before, newest_event};
pub use jobs::{
    Enqueued, Job, JobFilter, JobRequest, Moved, Priority, WrongTransition, active_job, advance,
    due_waiting, enqueue, give_back, job, jobs, jobs_in, next_queued, pending_job, request_cancel,
};
pub(crate) use layout::free_name;

/// Name of the database in the state folder.
pub const DATABASE: &str = "areograph.db";
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
    #[error("the database of the service failed: {}", plain(.0))]
    #[cause(Io: "check the disk and the permissions of the state folder")]
    Sqlite(#[source] rusqlite::Error),
    /// Another program holds a lock.
    #[error("another program has locked the database")]
    #[cause(Io: "close the program that uses the database, and try again")]
    Locked,
    /// There is no database.
    #[error("the state folder contains no database")]
    #[cause(Configuration: "start the service once to create it")]
    Missing,
    /// Something that is not a file has its name.
    #[error("not a regular file; expected the database of the service")]
    #[cause(Input: "run `areograph service rebuild`, which moves this entry aside and creates a database from the products")]
    NotAFile,
    /// A database without the tables or the layout of the service.
    #[error("not a database of the service: {0}")]
    #[cause(like = Damaged)]
    Foreign(String),
    /// The file is damaged.
    #[error("the database is damaged: {0}")]
    #[cause(Input: "restore the newest copy from the folder `copies`, or rebuild the database from the products with \
        `areograph service rebuild`")]
    Damaged(String),
    /// The disk of the products is absent.
    #[error("the database records {0} runs, but the folder of the products contains none of them")]
    #[cause(Input: "mount the disk of the products, or restore them; to start without them, run `areograph service rebuild`")]
    NoProducts(i64),
    /// A newer areograph wrote it.
    #[error("the database has layout {found}; this areograph supports layouts up to {VERSION}")]
    #[cause(Input: "start the newer areograph, or restore a copy of the database with an earlier layout")]
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
        use rusqlite::ErrorCode::{DatabaseBusy, DatabaseCorrupt, DatabaseLocked, NotADatabase};
        match error.sqlite_error_code() {
            Some(DatabaseCorrupt | NotADatabase) => Self::Damaged(plain(&error)),
            Some(DatabaseBusy | DatabaseLocked) => Self::Locked,
            _ => Self::Sqlite(error),
        }
    }
}

/// The message without the statement that failed.
fn plain(error: &rusqlite::Error) -> String {
    match error {
        rusqlite::Error::SqlInputError { msg, .. } => msg.clone(),
        other => other.to_string(),
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
        create_folder(folder)
            .map_err(IoError::on("create the folder"))
            .in_file(folder)?;
        let path = folder.join(DATABASE);
        if fs::symlink_metadata(&path).is_ok() && !path.is_file() {
            return Err(DatabaseError::NotAFile).in_file(path);
        }
        // Its log gets the same mode.
        create_file(&path)
            .map_err(IoError::on("create"))
            .in_file(&path)?;
        let mut writer = connect(&path, OpenFlags::default()).in_file(&path)?;
        sound(&writer).in_file(&path)?;
        migrate(&mut writer, folder).in_file(&path)?;
        Ok(Self {
            path,
            writer: Mutex::new(writer),
            readers: Mutex::new(Vec::new()),
        })
    }

    /// Opens a database that must exist.
    ///
    /// # Errors
    /// As [`Self::open`]; there is none.
    pub fn open_existing(folder: &Path) -> Result<Self> {
        let path = folder.join(DATABASE);
        if fs::symlink_metadata(&path).is_err() {
            return Err(DatabaseError::Missing).in_file(path);
        }
        Self::open(folder)
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

/// Layout of an existing database.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// The present one.
    Present(i64),
    /// A former one, which the next start migrates.
    Former(i64),
}

/// An existing database as a service would find it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// Its layout.
    pub layout: Layout,
    /// The service to which it belongs, if it states this.
    pub identity: Option<String>,
    /// Paths of the known folders of inputs.
    pub roots: Vec<String>,
    /// Number of recorded runs.
    pub runs: i64,
}

/// Looks at the database in `folder` and changes nothing; `None` without a database.
///
/// # Errors
/// Those for which a service refuses the database.
pub fn look_at(folder: &Path) -> Result<Option<Seen>> {
    let path = folder.join(DATABASE);
    match fs::symlink_metadata(&path) {
        Err(_) => return Ok(None),
        Ok(_) if !path.is_file() => return Err(DatabaseError::NotAFile).in_file(path),
        Ok(found) if found.len() == 0 => return Ok(None),
        Ok(_) => {}
    }
    let connection = connect(&path, OpenFlags::SQLITE_OPEN_READ_ONLY).in_file(&path)?;
    let look = || {
        sound(&connection)?;
        let layout = match layout_of(&connection)? {
            None => return Ok(None),
            Some(VERSION) => Layout::Present(VERSION),
            Some(former) => Layout::Former(former),
        };
        let identity = facts::fact(&connection, facts::IDENTITY)?;
        let known = files::roots(&connection)?;
        Ok::<_, DatabaseError>(Some(Seen {
            layout,
            identity,
            roots: known.into_iter().map(|root| root.path).collect(),
            runs: runs::count(&connection)?,
        }))
    };
    look().in_file(&path)
}

fn sound(connection: &Connection) -> Stored<()> {
    let found = connection
        .query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0))
        .map_err(|error| match DatabaseError::from(error) {
            DatabaseError::Sqlite(error) => DatabaseError::Damaged(plain(&error)),
            other => other,
        })?;
    if found == "ok" {
        return Ok(());
    }
    Err(DatabaseError::Damaged(found))
}

/// The copy is private; it contains hashes of tokens.
fn copy(connection: &Connection, path: &Path) -> Stored<()> {
    // SQLite copies into an empty file. It reports one that cannot be created.
    let is_new = create_file(path).unwrap_or(false);
    let text = path.to_string_lossy();
    let copied = connection.execute("VACUUM INTO ?1", [&*text]);
    if copied.is_err() && is_new {
        let _ = fs::remove_file(path);
    }
    copied?;
    Ok(())
}

/// A column of JSON; invalid JSON stays text.
fn document(row: &Row<'_>, column: &str) -> rusqlite::Result<Value> {
    let text: Option<String> = row.get(column)?;
    Ok(text.map_or(Value::Null, |text| {
        serde_json::from_str(&text).unwrap_or(Value::String(text))
    }))
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
        assert!(refused.contains("has layout 5"), "{refused}");
        let mut bytes = fs::read(&path).unwrap();
        bytes[4096..8192].fill(0xff);
        #[allow(clippy::disallowed_methods, reason = "a damaged file for a test")]
        fs::write(&path, bytes).unwrap();
        let refused = Database::open(folder.path()).unwrap_err();
        assert_eq!(refused.kind(), Kind::Input);
        assert!(refused.to_string().contains("is damaged"), "{refused}");
    }

    #[test]
    fn what_is_no_database_of_the_service_is_refused_without_sql_and_left_alone() {
        let refused = |prepare: &dyn Fn(&Path)| {
            let folder = tempfile::tempdir().unwrap();
            prepare(&folder.path().join(DATABASE));
            let refused = Database::open(folder.path()).unwrap_err();
            let text = refused.to_string();
            assert!(
                !text.contains("CREATE") && !text.contains("SELECT"),
                "{text}"
            );
            (refused.kind(), text)
        };
        let with = |sql: &'static str| {
            move |path: &Path| Connection::open(path).unwrap().execute_batch(sql).unwrap()
        };
        for prepare in [
            with("CREATE TABLE a (b)"),
            with("CREATE TABLE a (b); PRAGMA user_version = 2"),
        ] {
            let (kind, text) = refused(&prepare);
            assert_eq!(kind, Kind::Input, "{text}");
            assert!(text.contains("not a database of the service"), "{text}");
            assert!(text.contains("areograph service rebuild"), "{text}");
        }
        let (kind, text) = refused(&|path| {
            drop(Database::open(path.parent().unwrap()).unwrap());
            with("PRAGMA user_version = 0")(path);
        });
        assert_eq!(kind, Kind::Input, "{text}");
        assert!(text.contains("its layout is 0; expected 1 to 4"), "{text}");
        let (kind, text) = refused(&|path| fs::create_dir(path).unwrap());
        assert_eq!(kind, Kind::Input, "{text}");
        assert!(text.contains("not a regular file"), "{text}");
        let folder = tempfile::tempdir().unwrap();
        let missing = Database::open_existing(folder.path()).unwrap_err();
        assert_eq!(missing.kind(), Kind::Configuration);
        assert!(!folder.path().join(DATABASE).exists());
    }

    #[test]
    fn the_database_and_its_copies_are_private() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state");
        let database = Database::open(&state).unwrap();
        let copy = folder.path().join("copy.db");
        database.copy_to(&copy).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(&state), 0o700);
        for file in [
            &state.join(DATABASE),
            &state.join("areograph.db-wal"),
            &copy,
        ] {
            assert_eq!(mode(file), 0o600, "{}", file.display());
        }
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
