//! Files that a command may replace: those that areograph itself wrote as files of this kind, recognised by their
//! content.
//!
//! A file contains a mark if its format has a place for one. Other files, such as text tables, are listed with their
//! hashes in [`LIST`] beside them.

use std::{
    ffi::OsStr,
    fs::{self, File, OpenOptions},
    io::{self, Read as _, Seek as _, SeekFrom, Write as _},
    path::{Path, PathBuf},
};

use super::outputs::require_replaceable;
use crate::manifest::MANIFEST;
use areograph_base::error::{Cause, IoError, Locate, Result};

/// List of written files, in their folder.
const LIST: &str = ".areograph";
/// Its first line; one line of hash and name for each file follows.
const LIST_HEAD: &str =
    "Files that areograph wrote into this folder, with their BLAKE3: it replaces no others.\n";
/// Bytes that identify the kind of a foreign file.
const KIND_BYTES: u64 = 512;
/// A mark of this number of bytes is recognised if one of them is damaged.
const DAMAGED_MARK_MIN: usize = 8;

/// Mark by which files of one kind are recognised.
#[derive(Debug, Clone, Copy)]
pub struct Mark {
    /// The name of such a file in messages: "a page that areograph wrote".
    pub what: &'static str,
    /// Place of the mark.
    pub at: MarkAt,
}

/// Place of the mark of a file.
#[derive(Debug, Clone, Copy)]
pub enum MarkAt {
    /// These bytes begin the file; one of them may be damaged, or the file may end within them.
    Start(&'static [u8]),
    /// This text is among the first bytes, whose number is given.
    Head(&'static str, u64),
    /// This text is among the last bytes, whose number is given.
    Tail(&'static str, u64),
    /// The content is recognised by a reader of the format.
    Content(fn(&Path) -> bool),
    /// The file is in the list of its folder.
    List,
}

/// A file that a command must not replace.
#[derive(Debug, thiserror::Error, Cause)]
#[error("is {found}; expected a new path, or {expected}")]
#[cause(Configuration: "name a different file, or remove this file first if you no longer need it")]
struct Foreign {
    found: String,
    expected: &'static str,
}

/// Ensures that `path` is free, an empty file, or a file with this mark that is not a product.
///
/// # Errors
/// Any other entry, of kind configuration; a file that cannot be read.
pub fn require_own(path: &Path, mark: &Mark) -> Result<()> {
    require_replaceable(path)?;
    let Ok(metadata) = fs::symlink_metadata(path) else {
        return Ok(());
    };
    if metadata.len() == 0 {
        return Ok(());
    }
    let is_own = !is_product(path)
        && mark
            .is_of(path)
            .map_err(IoError::on("read"))
            .in_file(path)?;
    if is_own {
        return Ok(());
    }
    let found = what_is(path, metadata.len());
    let expected = mark.what;
    Err(Foreign { found, expected }).in_file(path)
}

impl Mark {
    fn is_of(&self, path: &Path) -> io::Result<bool> {
        match self.at {
            MarkAt::Start(mark) => Ok(begins(&first_bytes(path, mark.len() as u64)?, mark)),
            MarkAt::Head(mark, bytes) => Ok(contains(&first_bytes(path, bytes)?, mark)),
            MarkAt::Tail(mark, bytes) => Ok(contains(&last_bytes(path, bytes)?, mark)),
            MarkAt::Content(is_own) => Ok(is_own(path)),
            MarkAt::List => {
                let list = fs::read_to_string(list_of(path)).unwrap_or_default();
                let line = line_of(&File::open(path)?, path)?;
                Ok(list.starts_with(LIST_HEAD) && list.lines().any(|listed| listed == line))
            }
        }
    }
}

fn begins(found: &[u8], mark: &[u8]) -> bool {
    let damaged = found.iter().zip(mark).filter(|(a, b)| a != b).count();
    found == mark || (found.len() >= DAMAGED_MARK_MIN && damaged <= 1)
}

fn contains(bytes: &[u8], mark: &str) -> bool {
    let mut windows = bytes.windows(mark.len());
    windows.any(|window| window == mark.as_bytes())
}

fn first_bytes(path: &Path, bytes: u64) -> io::Result<Vec<u8>> {
    let mut found = Vec::new();
    File::open(path)?.take(bytes).read_to_end(&mut found)?;
    Ok(found)
}

fn last_bytes(path: &Path, bytes: u64) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let size = file.metadata()?.len();
    file.seek(SeekFrom::Start(size.saturating_sub(bytes)))?;
    let mut found = Vec::new();
    file.take(bytes).read_to_end(&mut found)?;
    Ok(found)
}

/// Whether a manifest above the file lists it.
fn is_product(path: &Path) -> bool {
    let Ok(whole) = path.canonicalize() else {
        return false;
    };
    whole.ancestors().skip(1).any(|folder| {
        let manifest = fs::read(folder.join(MANIFEST)).ok();
        let manifest: Option<serde_json::Value> =
            manifest.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let is_own = |manifest: &serde_json::Value| manifest["tool"] == "areograph";
        let Some(manifest) = manifest.filter(is_own) else {
            return false;
        };
        let below = whole.strip_prefix(folder).unwrap_or(&whole);
        let mut products = manifest["products"].as_array().into_iter().flatten();
        products.any(|product| product["path"].as_str().map(Path::new) == Some(below))
    })
}

/// Names the kind of a file by its first bytes.
fn what_is(path: &Path, bytes: u64) -> String {
    let start = first_bytes(path, KIND_BYTES).unwrap_or_default();
    let kinds: [(&[u8], &str); 11] = [
        (b"KPL/MK", "a SPICE metakernel"),
        (b"KPL/", "a SPICE text kernel"),
        (b"DAF/", "a binary SPICE kernel"),
        (b"areograph pedr index", "an index of PEDR files"),
        (b"SQLite format 3", "an SQLite database"),
        (b"PAR1", "a Parquet file"),
        (b"\x89PNG", "a PNG picture"),
        (b"II*\0", "a TIFF picture"),
        (b"MM\0*", "a TIFF picture"),
        (b"CCSD3ZF", "a file with a PDS label"),
        (b"PDS_VERSION_ID", "a file with a PDS label"),
    ];
    let known = kinds.iter().find(|(mark, _)| start.starts_with(mark));
    known.map_or_else(
        || format!("a file of {bytes} bytes that this command did not write"),
        |(_, kind)| format!("{kind} that this command did not write"),
    )
}

fn list_of(path: &Path) -> PathBuf {
    path.with_file_name(LIST)
}

/// The line of a file in the list.
fn line_of(file: &File, path: &Path) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file)?;
    let name = path.file_name().unwrap_or(OsStr::new(""));
    // Escaped: a name may hold a line break.
    let name = name.to_string_lossy();
    Ok(format!(
        "{}  {}",
        hasher.finalize().to_hex(),
        name.escape_debug()
    ))
}

/// Lists the content `file`, which is about to receive the name `path`.
///
/// # Errors
/// Another program wrote the list, or it cannot be written.
pub(super) fn enlist(file: &File, path: &Path) -> Result<()> {
    const KIND: Mark = Mark {
        what: "a list that areograph wrote",
        at: MarkAt::Start(LIST_HEAD.as_bytes()),
    };
    let list = list_of(path);
    require_own(&list, &KIND)?;
    let earlier = fs::read_to_string(&list).unwrap_or_default();
    let line = line_of(file, path)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    if earlier.lines().any(|listed| listed == line) {
        return Ok(());
    }
    let head = if earlier.is_empty() { LIST_HEAD } else { "" };
    // A killed command may leave a line without its end.
    let gap = if earlier.is_empty() || earlier.ends_with('\n') {
        ""
    } else {
        "\n"
    };
    OpenOptions::new()
        .append(true)
        .create(true)
        .open(&list)
        .and_then(|mut open| open.write_all(format!("{gap}{head}{line}\n").as_bytes()))
        .map_err(IoError::on("write"))
        .in_file(&list)
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "files of a test")]
mod tests {
    use areograph_base::error::Kind;

    use super::*;
    use crate::files::StagedFile;

    const PAGE: Mark = Mark {
        what: "a page",
        at: MarkAt::Tail("Made by areograph", 40),
    };
    const TABLE: Mark = Mark {
        what: "a table",
        at: MarkAt::List,
    };

    fn write(path: &Path, mark: Mark, text: &str) -> Result<()> {
        let staged = StagedFile::replacing(path, mark)?;
        staged.writer()?.write_all(text.as_bytes()).unwrap();
        staged.finish()
    }

    #[test]
    fn a_marked_file_is_replaced_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        for text in ["one Made by areograph 1", "two Made by areograph 2"] {
            write(&path, PAGE, text).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        fs::write(
            &path,
            "KPL/MK Made by areograph, then more than forty bytes of text",
        )
        .unwrap();
        let refused = write(&path, PAGE, "Made by areograph").unwrap_err();
        assert_eq!(refused.kind(), Kind::Configuration);
        assert!(refused.to_string().contains("is a SPICE metakernel"));
        assert!(fs::read_to_string(&path).unwrap().starts_with("KPL/MK"));
        fs::write(&path, "").unwrap();
        write(&path, PAGE, "Made by areograph").unwrap();
    }

    #[test]
    fn a_listed_file_is_replaced_until_another_program_changes_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tab");
        for text in ["1 2", "3 4", "1 2"] {
            write(&path, TABLE, text).unwrap();
        }
        let list = folder.path().join(LIST);
        assert_eq!(fs::read_to_string(&list).unwrap().lines().count(), 3);
        fs::write(&path, "5 6").unwrap();
        assert!(write(&path, TABLE, "1 2").is_err());
        fs::write(&path, "3 4").unwrap();
        write(&path, TABLE, "7 8").unwrap();
        // A list of another program is not continued.
        fs::write(&list, "mine").unwrap();
        assert!(write(&folder.path().join("b.tab"), TABLE, "1").is_err());
        assert_eq!(fs::read_to_string(&list).unwrap(), "mine");
    }

    #[test]
    fn a_mark_with_one_damaged_byte_is_recognised() {
        let mark = b"areograph hashes 1\n";
        assert!(begins(b"areograph hashes 1\n", mark));
        assert!(begins(b"areogrbph hashes 1\n", mark));
        assert!(begins(b"areograph ", mark));
        assert!(!begins(b"areobrbph hashes 1\n", mark));
        assert!(!begins(b"areo", mark));
    }
}
