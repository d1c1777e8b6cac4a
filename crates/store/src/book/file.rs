//! A book in a file: its layout, the outputs one after the other, then the table of contents and its length.
//!
//! Outputs are read one by one, when they are used. The layout of the outputs is that of this version of areograph.

use std::{
    any::{Any, type_name},
    collections::BTreeMap,
    fmt::Display,
    fs::File,
    io::{BufWriter, Read as _, Seek as _, SeekFrom, Write},
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{Book, Entered, Entry};
use crate::{
    hashed::{HASHED_AT_ONCE, Hashed},
    stage::{Output, Round},
};
use areograph_base::{
    error::{Cause, Error, IoError, Locate as _, Result},
    stored::whole,
};

/// Bytes of the length of the table of contents.
const TAIL_BYTES: u64 = 8;

/// A file that is not a book, or an output that cannot be written or read.
#[derive(Debug, thiserror::Error, Cause)]
enum BookError {
    #[error("these are not outputs of this version of areograph: {0}")]
    #[cause(Input: "run the site again with this version")]
    Unreadable(String),
    #[error("outputs of an opened file were rewritten before they were read: {0}")]
    #[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
    Unread(String),
    #[error("{name} cannot be stored: {source}")]
    #[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
    Unstorable {
        name: &'static str,
        source: postcard::Error,
    },
}

/// An entry of the table of contents.
#[derive(Serialize, Deserialize)]
struct Line {
    name: String,
    round: Round,
    labels: Vec<String>,
    /// Where the outputs end; the first begins where the entry before ends.
    ends: Vec<u64>,
}

/// The outputs of an entry in a file.
#[derive(Debug, Clone)]
pub(super) struct Written {
    file: Arc<(PathBuf, File)>,
    start: u64,
    ends: Vec<u64>,
}

impl Written {
    /// The output with this index.
    pub(super) fn read<T: DeserializeOwned>(&self, part: usize) -> Result<T> {
        let start = part
            .checked_sub(1)
            .map_or(self.start, |before| self.ends[before]);
        let (path, file) = &*self.file;
        let bytes = bytes_of(file, start, self.ends[part]).in_file(path)?;
        postcard::from_bytes(&bytes)
            .map_err(|error| unreadable(&error))
            .in_file(path)
    }
}

impl Book {
    /// Writes all outputs to `to`, and returns the BLAKE3 of what was written.
    ///
    /// * `layout` – names the types of the outputs and their layout; a file is opened by the same name only
    ///
    /// # Errors
    /// Errors of `to`; an output that is not known or cannot be stored.
    pub fn write(&self, layout: &str, to: impl Write) -> Result<blake3::Hash> {
        // Numbers are encoded one by one, and hashed in pieces.
        let mut to = BufWriter::with_capacity(HASHED_AT_ONCE, Hashed::new(to));
        let written = self.write_all(layout, &mut to);
        let flushed = to.flush();
        if let Some(refusal) = to.get_mut().refusal.take() {
            return Err(IoError::on("write")(refusal).into());
        }
        written?;
        flushed.map_err(IoError::on("write"))?;
        Ok(to.get_ref().hash())
    }

    fn write_all(&self, layout: &str, to: &mut BufWriter<Hashed<impl Write>>) -> Result<()> {
        to.write_all(head(layout).as_bytes())
            .map_err(IoError::on("write"))?;
        let mut lines = Vec::new();
        for ((name, round), entry) in &self.entries {
            // An entry of an opened file has no type before it is used.
            let unread = || BookError::Unread(name.clone());
            let known = entry.outputs.get().zip(entry.write);
            let (outputs, write) = known.ok_or_else(unread)?;
            let mut ends = Vec::new();
            while write(&**outputs, ends.len(), to)?.is_some() {
                ends.push(to.get_ref().bytes + to.buffer().len() as u64);
            }
            lines.push(Line {
                name: name.clone(),
                round: *round,
                labels: entry.labels.clone(),
                ends,
            });
        }
        let start = to.get_ref().bytes + to.buffer().len() as u64;
        encode(&lines, "the table of contents", to)?;
        let end = to.get_ref().bytes + to.buffer().len() as u64;
        to.write_all(&(end - start).to_le_bytes())
            .map_err(IoError::on("write"))?;
        Ok(())
    }

    /// Opens the book in the file `path`; its outputs are read when they are used.
    ///
    /// # Errors
    /// A file of kind input that was not written with this `layout`; an error of the disk.
    pub fn open(path: &Path, layout: &str) -> Result<Self> {
        let file = File::open(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        let head = head(layout);
        let start = head.len() as u64;
        if bytes_of(&file, 0, start).in_file(path)? != head.as_bytes() {
            return Err(unreadable(&"its first line differs from the expected line")).in_file(path);
        }
        let lines = contents(&file, start).in_file(path)?;
        let file = Arc::new((path.to_owned(), file));
        let (mut entries, mut start) = (BTreeMap::new(), start);
        for line in lines {
            let written = Written {
                file: Arc::clone(&file),
                start,
                ends: line.ends,
            };
            start = written.ends.last().copied().unwrap_or(start);
            let entry = Entry {
                labels: line.labels,
                outputs: OnceLock::new(),
                written: Some(written),
                write: None,
                lighten: None,
            };
            entries.insert((line.name, line.round), entry);
        }
        Ok(Self {
            entries,
            opened: Some(path.to_owned()),
        })
    }

    /// The error for an output that an opened file does not have.
    pub(super) fn is_without(path: &Path, name: &str) -> Error {
        unreadable(&format!("there is no {name}")).in_file(path)
    }
}

/// The first line of a file.
fn head(layout: &str) -> String {
    format!("areograph outputs, {layout}\n")
}

/// The table of contents; outputs begin at `first`.
fn contents(file: &File, first: u64) -> Result<Vec<Line>> {
    let bytes = file.metadata().map_err(IoError::on("read"))?.len();
    let short = || unreadable(&"its table of contents is invalid");
    let end = bytes.checked_sub(TAIL_BYTES).ok_or_else(short)?;
    let tail = bytes_of(file, end, bytes)?;
    let length = tail.try_into().map_or(u64::MAX, u64::from_le_bytes);
    let start = end.checked_sub(length).ok_or_else(short)?;
    let lines: Vec<Line> =
        postcard::from_bytes(&bytes_of(file, start, end)?).map_err(|error| unreadable(&error))?;
    let ends = lines.iter().flat_map(|line| &line.ends);
    let is_sorted = ends.clone().is_sorted()
        && ends.clone().min().is_none_or(|end| *end >= first)
        && ends.max().is_none_or(|end| *end <= start);
    let is_whole = lines
        .iter()
        .all(|line| line.labels.len() == line.ends.len());
    if is_sorted && is_whole {
        return Ok(lines);
    }
    Err(unreadable(&"its table of contents is invalid"))
}

/// The bytes from `start` to `end`.
fn bytes_of(mut file: &File, start: u64, end: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(start))
        .and_then(|_| file.take(end - start).read_to_end(&mut bytes))
        .map_err(IoError::on("read"))?;
    Ok(bytes)
}

fn unreadable(reason: &dyn Display) -> Error {
    BookError::Unreadable(reason.to_string()).into()
}

/// See [`super::WritePart`].
pub(super) fn write_part<T: Entered>(
    outputs: &dyn Any,
    part: usize,
    to: &mut dyn Write,
) -> Result<Option<()>> {
    let outputs: Option<&Vec<Output<T>>> = outputs.downcast_ref();
    let Some(output) = outputs.and_then(|outputs| outputs.get(part)) else {
        return Ok(None);
    };
    encode(output.value()?, type_name::<T>(), to).map(Some)
}

fn encode(
    value: &impl Serialize,
    name: &'static str,
    to: &mut (impl Write + ?Sized),
) -> Result<()> {
    whole(|| postcard::to_io(value, to))
        .map(|_| ())
        .map_err(|source| BookError::Unstorable { name, source }.into())
}
