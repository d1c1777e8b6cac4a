//! Stage outputs on disk, each with its inputs.
//!
//! Outputs are in `<site>/.cache` (postcard) and are not read back from products: products serve external tools and
//! are rounded where their formats are.

use std::{
    collections::BTreeSet,
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::atomic;
use crate::stage::{Inputs, Output, Provenance, Reason};
use areograph_base::{
    error::{Cause, Locate, Result},
    stored::whole,
};

/// Outputs of a site's stages, in `<out>/<site>/.cache`.
#[derive(Debug)]
pub struct StageCache {
    folder: PathBuf,
    forced: bool,
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
        }
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
        let bytes = fs::read(self.path(label)).map_err(|error| match error.kind() {
            ErrorKind::NotFound => Reason::First,
            _ => Reason::Damaged,
        })?;
        let (stored, payload): (Head, &[u8]) =
            postcard::take_from_bytes(&bytes).map_err(|_| Reason::Damaged)?;
        let changes = inputs.changed_since(&stored.inputs);
        if !changes.is_empty() {
            return Err(Reason::Changed(changes));
        }
        let is_whole =
            u64::try_from(payload.len()).is_ok_and(|bytes| bytes == stored.payload_bytes);
        if !is_whole || *blake3::hash(payload).to_hex() != *stored.blake3 {
            return Err(Reason::Damaged);
        }
        let value = read(payload).ok_or(Reason::Damaged)?;
        let provenance = Provenance {
            blake3: stored.blake3,
            fingerprint: inputs.fingerprint(),
        };
        Ok(Output::known(label.to_owned(), value, provenance))
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
        let payload = whole(|| postcard::to_stdvec(&value)).map_err(unstorable)?;
        // A field that is skipped when written cannot be read back, and the stage would run again every time.
        debug_assert!(
            read::<T>(&payload).is_some(),
            "the output of {label} cannot be read back"
        );
        let provenance = Provenance {
            blake3: blake3::hash(&payload).to_hex().to_string(),
            fingerprint: inputs.fingerprint(),
        };
        let head = Head {
            inputs,
            blake3: provenance.blake3.clone(),
            payload_bytes: payload.len() as u64,
        };
        let head = postcard::to_stdvec(&head).map_err(unstorable)?;
        let path = self.path(label);
        atomic::write_parts(&path, &[&head, &payload]).in_file(path)?;
        Ok(Output::known(label.to_owned(), value, provenance))
    }

    /// Discards the output of `stage`, so that it runs again.
    pub fn forget(&self, stage: &str) {
        // A missing file is already discarded.
        let _ = fs::remove_file(self.path(stage));
    }

    /// Discards all stages but these, such as those of an image that is no longer configured.
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
        self.folder.join(stage.replace('/', "+"))
    }
}

/// Whether the file begins like a stored output; files of other programs are not those of areograph to remove.
fn is_stage_output(path: &Path) -> bool {
    let bytes = fs::read(path).unwrap_or_default();
    postcard::take_from_bytes::<Head>(&bytes).is_ok_and(|(head, _)| head.blake3.len() == 64)
}

/// The output of the stage with this label in the cache `folder`, whatever its inputs were.
pub(super) fn stored<T: DeserializeOwned>(folder: &Path, label: &str) -> Option<T> {
    let bytes = fs::read(StageCache::new(folder, false).path(label)).ok()?;
    let (_, payload): (Head, &[u8]) = postcard::take_from_bytes(&bytes).ok()?;
    read(payload)
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
        // What exists and cannot be read.
        fs::create_dir(&path).unwrap();
        assert_eq!(why(&cache, 1), Some(Reason::Damaged));
    }
}
