//! Stage outputs on disk, each with its inputs.
//!
//! Outputs are in `<site>/.cache` (postcard) and are not read back from products: products serve external tools and
//! are rounded where their formats are. Large ones are hashed when the file system reports a change, and read when a
//! stage uses them.

mod streamed;

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{BufWriter, ErrorKind, Read, Seek, SeekFrom, Write as _},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use tempfile::spooled_tempfile_in;

use super::atomic;
use crate::{
    files::InputFiles,
    hashed::{HASHED_AT_ONCE, Hashed},
    stage::{Inputs, Output, Provenance, Reason},
};
use areograph_base::{
    error::{Cause, IoError, Locate, Result},
    stored::whole,
};

/// Largest output that is read at once, bytes: a larger one is read on demand.
const READ_AT_ONCE: u64 = 1 << 16;
/// Bytes of an output that are held in memory before they are written.
const HELD_BYTES: usize = 1 << 20;
/// Largest output that is read into memory before its value is made, bytes; the bytes of a larger one are read as its value needs them.
const IN_MEMORY: u64 = 1 << 24;
/// Bytes of a file that usually contain its header.
const HEAD_BYTES: u64 = 1 << 16;

/// Outputs of a site's stages, in `<out>/<site>/.cache`.
#[derive(Debug)]
pub struct StageCache {
    folder: PathBuf,
    forced: bool,
    /// Stored outputs and products, by hash.
    own: InputFiles,
    /// Whether large outputs are read on demand.
    on_demand: bool,
    /// Whether one of these could not be read.
    lost: Arc<AtomicBool>,
}

/// Header of a stage output in its file, both in postcard: outputs are large, so they are not copied.
#[derive(Serialize, Deserialize)]
struct Head {
    inputs: Inputs,
    blake3: String,
    payload_bytes: u64,
}

/// A stage output that cannot be stored.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the output of {stage} cannot be stored: {source}")]
#[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
struct Unstorable {
    stage: String,
    source: postcard::Error,
}

impl StageCache {
    /// The cache in `folder`; when `forced`, no stored output is used.
    #[must_use]
    pub fn new(folder: &Path, forced: bool) -> Self {
        Self {
            folder: folder.to_owned(),
            forced,
            own: InputFiles::default(),
            on_demand: false,
            lost: Arc::default(),
        }
    }

    /// The cache with the hashes of stored outputs and products from earlier runs, to which hashes of this run are
    /// added; large outputs are read on demand.
    #[must_use]
    pub fn knowing(self, own: InputFiles) -> Self {
        Self {
            own,
            on_demand: true,
            ..self
        }
    }

    /// Whether an output that was to be read on demand could not be read. Later results are not reliable.
    #[must_use]
    pub fn has_lost_output(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    /// Hashes of stored outputs and products.
    #[must_use]
    pub const fn own(&self) -> &InputFiles {
        &self.own
    }

    /// The stored output of the stage with this label for these inputs, or why the stage has to run.
    ///
    /// # Errors
    /// The reason, never [`Reason::Unchanged`].
    pub fn load<T: DeserializeOwned>(
        &self,
        label: &str,
        inputs: &Inputs,
    ) -> std::result::Result<Output<T>, Reason> {
        if self.forced {
            return Err(Reason::Forced);
        }
        let path = self.path(label);
        let mut file = File::open(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => Reason::First,
            _ => Reason::Damaged,
        })?;
        let (head, start) = read_head(&mut file).ok_or(Reason::Damaged)?;
        let changes = inputs.changed_since(&head.inputs);
        if !changes.is_empty() {
            return Err(Reason::Changed(changes));
        }
        let bytes = file.metadata().map_err(|_| Reason::Damaged)?.len();
        if bytes.checked_sub(start) != Some(head.payload_bytes) {
            return Err(Reason::Damaged);
        }
        let provenance = Provenance {
            blake3: head.blake3,
            fingerprint: inputs.fingerprint(),
        };
        let label = label.to_owned();
        if !self.on_demand || head.payload_bytes <= READ_AT_ONCE {
            let value = read_output(&path, &provenance.blake3).ok_or(Reason::Damaged)?;
            return Ok(Output::known(label, value, provenance));
        }
        let hashed = self.own.hash_from(&path, start);
        if hashed.is_ok_and(|file| file.blake3 == provenance.blake3) {
            let output = Output::stored(label, path, read_output, &self.lost, provenance);
            return Ok(output);
        }
        Err(Reason::Damaged)
    }

    /// Stores the output of the stage with this label, with its inputs.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn store<T: Serialize + DeserializeOwned>(
        &self,
        label: &str,
        inputs: Inputs,
        value: T,
    ) -> Result<Output<T>> {
        let unstorable = |source| Unstorable {
            stage: label.to_owned(),
            source,
        };
        let path = self.path(label);
        // A folder that cannot be made is reported when the file is.
        let _ = fs::create_dir_all(&self.folder);
        // The head contains the hash, and is written first.
        let mut payload = spooled_tempfile_in(HELD_BYTES, &self.folder);
        let mut writer = BufWriter::with_capacity(HASHED_AT_ONCE, Hashed::new(&mut payload));
        let stored = whole(|| postcard::to_io(&value, &mut writer)).map(drop);
        let flushed = writer.flush();
        if let Some(refusal) = writer.get_mut().refusal.take() {
            return Err(IoError::on("write beside")(refusal)).in_file(&path);
        }
        stored.map_err(unstorable)?;
        flushed
            .map_err(IoError::on("write beside"))
            .in_file(&path)?;
        let (blake3, payload_bytes) = (writer.get_ref().hash(), writer.get_ref().bytes);
        drop(writer);
        // A field that is skipped when written cannot be read back, and the stage would run again every time.
        debug_assert!(
            can_be_read::<T>(&mut payload),
            "the output of {label} cannot be read back"
        );
        let provenance = Provenance {
            blake3: blake3.to_hex().to_string(),
            fingerprint: inputs.fingerprint(),
        };
        let head = Head {
            inputs,
            blake3: provenance.blake3.clone(),
            payload_bytes,
        };
        let head = postcard::to_stdvec(&head).map_err(unstorable)?;
        payload
            .rewind()
            .map_err(IoError::on("write beside"))
            .in_file(&path)?;
        atomic::write_unflushed(&path, &head, &mut payload).in_file(&path)?;
        self.own.forget(&path);
        Ok(Output::known(label.to_owned(), value, provenance))
    }

    /// The output for these inputs that another process has stored meanwhile, also when `forced`.
    #[must_use]
    pub fn load_of_others<T: DeserializeOwned>(&self, label: &str, inputs: &Inputs) -> Option<T> {
        let (head, value) = read_intact(&self.path(label))?;
        inputs
            .changed_since(&head.inputs)
            .is_empty()
            .then_some(value)
    }

    /// Discards the output of `stage`, so that it runs again.
    pub fn forget(&self, stage: &str) {
        // A missing file is already discarded.
        let _ = fs::remove_file(self.path(stage));
    }

    /// Discards all stages but these, such as stages of an image that is no longer configured.
    pub fn keep_only<'s>(&self, stages: impl IntoIterator<Item = &'s str>) {
        let kept: BTreeSet<PathBuf> = stages.into_iter().map(|stage| self.path(stage)).collect();
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        for path in entries.map(|entry| entry.path()) {
            if !kept.contains(&path) && is_stage_output(&path) {
                // A file that cannot be removed only occupies space.
                let _ = fs::remove_file(path);
            }
        }
    }

    fn path(&self, stage: &str) -> PathBuf {
        path_in(&self.folder, stage)
    }
}

fn path_in(folder: &Path, stage: &str) -> PathBuf {
    folder.join(stage.replace('/', "+"))
}

/// Whether the file begins like a stored output; areograph does not remove files of other programs.
fn is_stage_output(path: &Path) -> bool {
    let head = File::open(path)
        .ok()
        .and_then(|mut file| read_head(&mut file));
    head.is_some_and(|(head, _)| head.blake3.len() == 64)
}

/// The header at the start of the file and its size in bytes.
fn read_head(file: &mut File) -> Option<(Head, u64)> {
    let mut bytes = Vec::new();
    loop {
        let wanted = (bytes.len() as u64).max(HEAD_BYTES);
        let more = Read::by_ref(file).take(wanted);
        let read = { more }.read_to_end(&mut bytes).ok()?;
        match postcard::take_from_bytes::<Head>(&bytes) {
            Ok((head, rest)) => return Some((head, (bytes.len() - rest.len()) as u64)),
            Err(postcard::Error::DeserializeUnexpectedEnd) if read > 0 => {}
            Err(_) => return None,
        }
    }
}

/// The output in the file `path` if its hash is `blake3`.
fn read_output<T: DeserializeOwned>(path: &Path, blake3: &str) -> Option<T> {
    let (head, value) = read_intact(path)?;
    (head.blake3 == blake3).then_some(value)
}

/// The output of the stage with this label in the cache `folder`, whatever its inputs were.
pub(super) fn stored<T: DeserializeOwned>(folder: &Path, label: &str) -> Option<T> {
    read_intact(&path_in(folder, label)).map(|(_, value)| value)
}

/// Header and output in the file `path`, if the output has the hash that its header states.
fn read_intact<T: DeserializeOwned>(path: &Path) -> Option<(Head, T)> {
    read_intact_within(IN_MEMORY, path)
}

fn read_intact_within<T: DeserializeOwned>(in_memory: u64, path: &Path) -> Option<(Head, T)> {
    let mut file = File::open(path).ok()?;
    let (head, start) = read_head(&mut file)?;
    if head.payload_bytes > in_memory {
        file.seek(SeekFrom::Start(start)).ok()?;
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(&mut file).ok()?;
        let is_intact = *hasher.finalize().to_hex() == *head.blake3;
        file.seek(SeekFrom::Start(start)).ok()?;
        let value = is_intact.then(|| streamed::read(file))?;
        // A type that borrows its bytes needs all of them.
        if let Some(value) = value {
            return Some((head, value));
        }
    }
    let bytes = fs::read(path).ok()?;
    let (head, payload): (Head, &[u8]) = postcard::take_from_bytes(&bytes).ok()?;
    let intact = *blake3::hash(payload).to_hex() == *head.blake3;
    let value = intact.then(|| read(payload))??;
    Some((head, value))
}

/// Whether the file contains exactly the stored form of an output.
fn can_be_read<T: DeserializeOwned>(payload: &mut (impl Read + Seek)) -> bool {
    let streamed = payload.rewind().ok();
    if streamed
        .and_then(|()| streamed::read::<T>(&mut *payload))
        .is_some()
    {
        return true;
    }
    let mut bytes = Vec::new();
    let all = payload
        .rewind()
        .and_then(|()| payload.read_to_end(&mut bytes));
    all.is_ok() && read::<T>(&bytes).is_some()
}

/// An output, if these bytes are exactly its stored form.
fn read<T: DeserializeOwned>(payload: &[u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(payload).ok()?;
    rest.is_empty().then_some(value)
}

#[cfg(test)]
mod tests;
