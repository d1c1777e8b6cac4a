//! Folders of inputs and the files below them.

use std::{collections::BTreeMap, path::Path};

use super::{DatabaseError, Stored};
use areograph_store::files::Identity;
use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};

/// Reliability of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileState {
    /// It changed, and its folder has not been quiet for long enough.
    Settling,
    /// Its content is known.
    Ready,
    /// It cannot be used.
    Bad,
    /// It was removed.
    Gone,
}

impl FileState {
    const ALL: [Self; 4] = [Self::Settling, Self::Ready, Self::Bad, Self::Gone];

    /// Its name in the database.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Settling => "settling",
            Self::Ready => "ready",
            Self::Bad => "bad",
            Self::Gone => "gone",
        }
    }
}

/// A file below a folder of inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileRow {
    /// Its path.
    pub path: String,
    /// Its identity when it was last listed.
    pub identity: Identity,
    /// BLAKE3 of the content that was last read.
    pub blake3: Option<String>,
    /// Time at which it was first seen, milliseconds of UTC since 1970.
    pub first_seen_ms: i64,
    /// Time at which a change was last detected.
    pub changed_ms: i64,
    /// Time at which its content was last read.
    pub checked_ms: Option<i64>,
    /// Its reliability.
    pub state: FileState,
    /// The reason.
    pub detail: String,
    /// The round of comparisons that found this content.
    pub round: i64,
}

/// Kinds of folders of inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RootKind {
    /// Site files.
    Sites,
    /// Kernels.
    Kernels,
    /// PEDR files, labels, tie points.
    Data,
}

impl RootKind {
    /// Its name in the database.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sites => "sites",
            Self::Kernels => "kernels",
            Self::Data => "data",
        }
    }
}

/// Whether the files below a folder can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RootState {
    /// They can be used.
    Available,
    /// Some of them changed recently.
    Settling,
    /// The folder is missing, or differs too much from its former state.
    Unavailable,
}

impl RootState {
    const ALL: [Self; 3] = [Self::Available, Self::Settling, Self::Unavailable];

    /// Its name in the database.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Available => "available",
            Self::Settling => "settling",
            Self::Unavailable => "unavailable",
        }
    }
}

/// A folder of inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RootRow {
    /// Its path.
    pub path: String,
    /// Kind of its files.
    pub kind: RootKind,
    /// Number of files when it was last available.
    pub files: i64,
    /// Whether they can be used.
    pub state: RootState,
    /// Start, milliseconds of UTC since 1970.
    pub since_ms: i64,
    /// The reason.
    pub detail: String,
}

/// Files known below `folder`, by path.
///
/// # Errors
/// SQLite errors.
pub fn files_below(connection: &Connection, folder: &str) -> Stored<BTreeMap<String, FileRow>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM file_version WHERE path > ?1 || '/' AND path < ?1 || '0' ORDER BY path",
    )?;
    let found = query.query_map([folder], file_row)?;
    let named = found.map(|row| row.map(|row| (row.path.clone(), row)));
    Ok(named.collect::<Result<_, _>>()?)
}

/// A file by its path.
///
/// # Errors
/// SQLite errors.
pub fn file(connection: &Connection, path: &str) -> Stored<Option<FileRow>> {
    let mut query = connection.prepare_cached("SELECT * FROM file_version WHERE path = ?1")?;
    Ok(query.query_row([path], file_row).optional()?)
}

/// Ready files whose content was found after a round, with the round of each.
///
/// # Errors
/// SQLite errors.
pub fn files_since(connection: &Connection, round: i64) -> Stored<Vec<(String, i64)>> {
    let mut query = connection.prepare_cached(
        "SELECT path, round FROM file_version WHERE round > ?1 AND state = 'ready' ORDER BY path",
    )?;
    let found = query.query_map([round], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Ready files that were read longest ago, before `before_ms`.
///
/// # Errors
/// SQLite errors.
pub fn oldest_checked(connection: &Connection, before_ms: i64, limit: u32) -> Stored<Vec<FileRow>> {
    let mut query = connection.prepare_cached(
        "SELECT * FROM file_version WHERE state = 'ready' AND checked_ms < ?1 ORDER BY checked_ms, path LIMIT ?2",
    )?;
    let found = query.query_map(params![before_ms, limit], file_row)?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Records a file.
///
/// # Errors
/// SQLite errors.
pub fn put_file(transaction: &Transaction<'_>, file: &FileRow) -> Stored<()> {
    let mut put = transaction.prepare_cached(
        "INSERT OR REPLACE INTO file_version
         (path, device, inode, size, mtime_ns, ctime_ns, blake3, first_seen_ms, changed_ms, checked_ms, state, detail, round)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)",
    )?;
    let identity = &file.identity;
    put.execute(params![
        file.path,
        identity.device.cast_signed(),
        identity.inode.cast_signed(),
        identity.bytes.cast_signed(),
        nanoseconds(identity.modified),
        nanoseconds(identity.changed),
        file.blake3,
        file.first_seen_ms,
        file.changed_ms,
        file.checked_ms,
        file.state.name(),
        file.detail,
        file.round,
    ])?;
    Ok(())
}

/// All folders of inputs.
///
/// # Errors
/// SQLite errors.
pub fn roots(connection: &Connection) -> Stored<Vec<RootRow>> {
    let mut query = connection.prepare_cached("SELECT * FROM root ORDER BY path")?;
    let found = query.query_map([], |row| {
        let kind: String = row.get("kind")?;
        let state: String = row.get("state")?;
        Ok(RootRow {
            path: row.get("path")?,
            kind: match &*kind {
                "sites" => RootKind::Sites,
                "kernels" => RootKind::Kernels,
                _ => RootKind::Data,
            },
            files: row.get("files")?,
            state: named(&RootState::ALL, RootState::name, &state),
            since_ms: row.get("since_ms")?,
            detail: row.get("detail")?,
        })
    })?;
    Ok(found.collect::<Result<_, _>>()?)
}

/// Whether a folder of inputs changed recently.
///
/// # Errors
/// SQLite errors.
pub fn any_settling(connection: &Connection) -> Stored<bool> {
    let all = roots(connection)?;
    Ok(all.iter().any(|root| root.state == RootState::Settling))
}

/// Records a folder of inputs.
///
/// # Errors
/// SQLite errors.
pub fn put_root(transaction: &Transaction<'_>, root: &RootRow) -> Stored<()> {
    transaction.execute(
        "INSERT OR REPLACE INTO root (path, kind, files, state, since_ms, detail) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
        params![
            root.path, root.kind.name(), root.files, root.state.name(), root.since_ms, root.detail
        ],
    )?;
    Ok(())
}

/// Removes the folders that are no longer configured, and the files below them.
///
/// # Errors
/// SQLite errors.
pub fn keep_roots(transaction: &Transaction<'_>, configured: &[String]) -> Stored<()> {
    for root in roots(transaction)? {
        if configured.contains(&root.path) {
            continue;
        }
        transaction.execute("DELETE FROM root WHERE path = ?1", [&root.path])?;
        let below = files_below(transaction, &root.path)?;
        let elsewhere = |path: &str| configured.iter().any(|root| is_below(path, root));
        for path in below.keys().filter(|path| !elsewhere(path)) {
            transaction.execute("DELETE FROM file_version WHERE path = ?1", [path])?;
        }
    }
    Ok(())
}

/// Whether `path` lies below `folder`.
#[must_use]
pub fn is_below(path: &str, folder: &str) -> bool {
    Path::new(path) != Path::new(folder) && Path::new(path).starts_with(folder)
}

/// Records the coverage of a kernel, by its content.
///
/// # Errors
/// SQLite errors.
pub fn put_coverage(
    transaction: &Transaction<'_>,
    blake3: &str,
    coverage: &serde_json::Value,
) -> Stored<()> {
    transaction.execute(
        "INSERT OR REPLACE INTO kernel_coverage (blake3, coverage) VALUES (?1, ?2)",
        params![blake3, coverage.to_string()],
    )?;
    Ok(())
}

/// Whether the coverage of a kernel with this content is known.
///
/// # Errors
/// SQLite errors.
pub fn knows_coverage(connection: &Connection, blake3: &str) -> Stored<bool> {
    let mut query = connection.prepare_cached("SELECT 1 FROM kernel_coverage WHERE blake3 = ?1")?;
    Ok(query.exists([blake3])?)
}

fn file_row(row: &Row<'_>) -> rusqlite::Result<FileRow> {
    let state: String = row.get("state")?;
    Ok(FileRow {
        path: row.get("path")?,
        identity: Identity {
            device: row.get::<_, i64>("device")?.cast_unsigned(),
            inode: row.get::<_, i64>("inode")?.cast_unsigned(),
            bytes: row.get::<_, i64>("size")?.cast_unsigned(),
            modified: parts(row.get("mtime_ns")?),
            changed: parts(row.get("ctime_ns")?),
        },
        blake3: row.get("blake3")?,
        first_seen_ms: row.get("first_seen_ms")?,
        changed_ms: row.get("changed_ms")?,
        checked_ms: row.get("checked_ms")?,
        state: named(&FileState::ALL, FileState::name, &state),
        detail: row.get("detail")?,
        round: row.get("round")?,
    })
}

const NS_PER_S: i64 = 1_000_000_000;

/// Seconds and nanoseconds since 1970 as nanoseconds, which fit for 292 years.
fn nanoseconds([seconds, nanoseconds]: [i64; 2]) -> i64 {
    seconds.saturating_mul(NS_PER_S).saturating_add(nanoseconds)
}

fn parts(nanoseconds: i64) -> [i64; 2] {
    [
        nanoseconds.div_euclid(NS_PER_S),
        nanoseconds.rem_euclid(NS_PER_S),
    ]
}

/// The tables admit no other names.
fn named<T: Copy>(all: &[T], name: impl Fn(T) -> &'static str, text: &str) -> T {
    let found = all.iter().copied().find(|one| name(*one) == text);
    found.unwrap_or(all[0])
}

/// A path as the database holds it.
///
/// # Errors
/// The path is not UTF-8.
pub fn path_text(path: &Path) -> Stored<&str> {
    path.to_str()
        .ok_or_else(|| DatabaseError::Path(path.to_owned()))
}
