//! Stage outputs on disk, each with its inputs.
//!
//! Outputs are in `<site>/.cache` (postcard) and are not read back from products: products serve external tools and
//! are rounded where their formats are. Large ones are hashed when the file system reports a change, and read when a
//! stage uses them.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{BufWriter, ErrorKind, Read, Seek, Write as _},
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
    let bytes = fs::read(path).ok()?;
    let (head, payload): (Head, &[u8]) = postcard::take_from_bytes(&bytes).ok()?;
    let intact = *blake3::hash(payload).to_hex() == *head.blake3;
    let value = intact.then(|| read(payload))??;
    Some((head, value))
}

/// Whether the file contains exactly the stored form of an output.
fn can_be_read<T: DeserializeOwned>(payload: &mut (impl Read + Seek)) -> bool {
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
mod tests {
    use super::*;

    #[test]
    fn a_field_that_documents_leave_out_comes_back() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Figure {
            #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
            value: Option<f64>,
            unit: String,
        }
        let folder = tempfile::tempdir().unwrap();
        let cache = StageCache::new(folder.path(), false);
        let figure = || Figure {
            value: None,
            unit: "m".to_owned(),
        };
        cache.store("judge", Inputs::new(1), figure()).unwrap();
        let loaded = cache.load::<Figure>("judge", &Inputs::new(1)).unwrap();
        assert_eq!(loaded.value().unwrap(), &figure());
    }

    #[test]
    fn an_output_is_kept_until_an_input_changes_or_the_file_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StageCache::new(folder.path(), false);
        let inputs = |value: u32| {
            let mut inputs = Inputs::new(1);
            inputs.setting("windows", &value);
            inputs
        };
        let why = |cache: &StageCache, value| cache.load::<u32>("search", &inputs(value)).err();
        assert_eq!(why(&cache, 1), Some(Reason::First));
        let stored = cache.store("search", inputs(1), 10_u32).unwrap();
        let loaded = cache.load::<u32>("search", &inputs(1)).unwrap();
        assert_eq!(loaded.value().unwrap(), &10);
        assert_eq!(loaded.provenance(), stored.provenance());
        let changed = Reason::Changed(vec!["key windows changed".to_owned()]);
        assert_eq!(why(&cache, 2), Some(changed));
        let path = folder.path().join("search");
        let mut bytes = fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        atomic::write(&path, &bytes).unwrap();
        assert_eq!(why(&cache, 1), Some(Reason::Damaged));
        let forced = StageCache::new(folder.path(), true);
        assert_eq!(why(&forced, 1), Some(Reason::Forced));
        cache.forget("search");
        assert_eq!(why(&cache, 1), Some(Reason::First));
        // An entry that exists and cannot be read.
        fs::create_dir(&path).unwrap();
        assert_eq!(why(&cache, 1), Some(Reason::Damaged));
    }

    #[test]
    fn a_large_output_is_read_when_it_is_used_and_a_damaged_one_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StageCache::new(folder.path(), false).knowing(InputFiles::default());
        let heights: Vec<u32> = (0..1 << 20).collect();
        let stored = cache
            .store("search", Inputs::new(1), heights.clone())
            .unwrap();
        let load = || cache.load::<Vec<u32>>("search", &Inputs::new(1)).unwrap();
        let loaded = load();
        assert_eq!(loaded.provenance(), stored.provenance());
        assert_eq!(loaded.value().unwrap(), &heights);
        let fewer = load().without_rows(|heights| heights.truncate(3));
        assert_eq!(fewer.value().unwrap(), &[0, 1, 2]);
        // One bit, after the output was examined and before it is used.
        let unread = load();
        let path = folder.path().join("search");
        let mut bytes = fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        atomic::write(&path, &bytes).unwrap();
        assert!(!cache.has_lost_output());
        let lost = unread.value().unwrap_err().to_string();
        assert!(cache.has_lost_output() && unread.get().is_none());
        assert!(
            lost.contains("the stored output of search is damaged"),
            "{lost}"
        );
        // The file remains; whoever reads all outputs at once identifies it.
        let at_once = StageCache::new(folder.path(), false);
        let damaged = at_once.load::<Vec<u32>>("search", &Inputs::new(1));
        assert_eq!(damaged.err(), Some(Reason::Damaged));
    }

    #[test]
    fn an_output_that_a_power_failure_left_incomplete_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let heights: Vec<u32> = (0..1 << 16).collect();
        let cache = StageCache::new(folder.path(), false);
        cache.store("search", Inputs::new(1), heights).unwrap();
        let path = folder.path().join("search");
        let whole = fs::read(&path).unwrap();
        let half = whole.len() / 2;
        let zeros = |kept: usize| [&whole[..kept], &vec![0; whole.len() - kept]].concat();
        let left = [Vec::new(), whole[..half].to_vec(), zeros(half), zeros(0)];
        for bytes in left {
            atomic::write(&path, &bytes).unwrap();
            // Read at once, and on demand.
            let on_demand = StageCache::new(folder.path(), false).knowing(InputFiles::default());
            for cache in [&cache, &on_demand] {
                // Zeros are a header of other inputs: whatever the reason, the stage runs.
                let loaded = cache.load::<Vec<u32>>("search", &Inputs::new(1));
                assert!(loaded.is_err());
            }
            assert_eq!(stored::<Vec<u32>>(folder.path(), "search"), None);
        }
    }

    #[test]
    fn a_large_head_is_read_in_pieces() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StageCache::new(folder.path(), false);
        let mut inputs = Inputs::new(1);
        for image in 0..10_000 {
            inputs.setting(&format!("image {image}"), &image);
        }
        cache.store("publish", inputs.clone(), 7_u32).unwrap();
        assert!(fs::metadata(folder.path().join("publish")).unwrap().len() > 2 * HEAD_BYTES);
        let loaded = cache.load::<u32>("publish", &inputs).unwrap();
        assert_eq!(loaded.value().unwrap(), &7);
    }
}
