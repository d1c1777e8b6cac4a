//! Stage outputs on disk, each with the parts it was made from.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{
    atomic,
    fingerprint::{Because, Parts},
};
use crate::error::{Fault, Kind, Place, Result};

/// Outputs of a site's stages, in `<out>/<site>/.cache`.
#[derive(Debug)]
pub struct StageCache {
    folder: PathBuf,
    forced: bool,
}

/// A stage output with its origin; the file is this struct in postcard.
#[derive(Serialize, Deserialize)]
struct Stored {
    parts: Parts,
    blake3: String,
    payload: Vec<u8>,
}

/// A value together with the hash of its stored form.
#[derive(Debug)]
pub struct Output<T> {
    /// The stage's output.
    pub value: T,
    /// BLAKE3 of its stored form, for the parts of later stages.
    pub blake3: String,
    /// Hash over the parts it was made from, for the manifest.
    pub fingerprint: String,
    /// Whether it was made just now.
    pub fresh: bool,
}

/// A stage output that cannot be stored.
#[derive(Debug, thiserror::Error)]
#[error("the output of {stage} cannot be stored: {source}")]
struct Unstorable {
    stage: String,
    source: postcard::Error,
}

impl Fault for Unstorable {
    fn kind(&self) -> Kind {
        Kind::Bug
    }

    fn advice(&self) -> String {
        "this is a fault of areograph; please report it with the configuration".to_owned()
    }
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

    /// The stored output of `stage` for these parts, or why the stage has to run.
    ///
    /// # Errors
    /// The reason, never [`Because::Unchanged`].
    pub fn load<T: DeserializeOwned>(
        &self,
        stage: &str,
        parts: &Parts,
    ) -> std::result::Result<Output<T>, Because> {
        if self.forced {
            return Err(Because::Forced);
        }
        let bytes = fs::read(self.path(stage)).map_err(|_| Because::First)?;
        let stored: Stored = postcard::from_bytes(&bytes).map_err(|_| Because::Damaged)?;
        let changes = parts.changed_since(&stored.parts);
        if !changes.is_empty() {
            return Err(Because::Moved(changes));
        }
        if *blake3::hash(&stored.payload).to_hex() != *stored.blake3 {
            return Err(Because::Damaged);
        }
        let value = postcard::from_bytes(&stored.payload).map_err(|_| Because::Damaged)?;
        Ok(Output {
            value,
            blake3: stored.blake3,
            fingerprint: parts.fingerprint(),
            fresh: false,
        })
    }

    /// The stored output of `stage` for these parts, or what `run` gives, then stored.
    ///
    /// # Errors
    /// Those of `run`, and of writing the output.
    pub fn stage<T: Serialize + DeserializeOwned>(
        &self,
        stage: &str,
        parts: Parts,
        run: impl FnOnce() -> Result<T>,
    ) -> Result<Output<T>> {
        let because = match self.load(stage, &parts) {
            Ok(output) => {
                tracing::info!(stage, "kept: {}", Because::Unchanged);
                return Ok(output);
            }
            Err(because) => because,
        };
        tracing::info!(stage, "running: {because}");
        self.store(stage, parts, run()?)
    }

    /// Stores the output of `stage` with the parts it was made from.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn store<T: Serialize>(&self, stage: &str, parts: Parts, value: T) -> Result<Output<T>> {
        let unstorable = |source| Unstorable {
            stage: stage.to_owned(),
            source,
        };
        let payload = postcard::to_stdvec(&value).map_err(unstorable)?;
        let blake3 = blake3::hash(&payload).to_hex().to_string();
        let fingerprint = parts.fingerprint();
        let stored = Stored {
            parts,
            blake3: blake3.clone(),
            payload,
        };
        let bytes = postcard::to_stdvec(&stored).map_err(unstorable)?;
        let path = self.path(stage);
        atomic::write(&path, &bytes).in_file(path)?;
        Ok(Output {
            value,
            blake3,
            fingerprint,
            fresh: true,
        })
    }

    /// Forgets the output of `stage`, so that it runs again.
    pub fn forget(&self, stage: &str) {
        // Nothing to forget is as good as forgotten.
        let _ = fs::remove_file(self.path(stage));
    }

    /// Forgets all stages but these, such as those of an image that is no longer configured.
    pub fn keep_only<'s>(&self, stages: impl IntoIterator<Item = &'s str>) {
        let kept: BTreeSet<PathBuf> = stages.into_iter().map(|stage| self.path(stage)).collect();
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        for path in entries.map(|entry| entry.path()) {
            if !kept.contains(&path) {
                // What cannot be removed costs room and nothing else: nobody asks for it.
                let _ = fs::remove_file(path);
            }
        }
    }

    fn path(&self, stage: &str) -> PathBuf {
        self.folder.join(stage.replace('/', "+"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_kept_until_a_part_moves_or_the_file_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StageCache::new(folder.path(), false);
        let parts = |value: u32| Parts::new(1).key("windows", &value);
        let run = |value: u32, output: u32| cache.stage("search", parts(value), || Ok(output));
        assert_eq!(run(1, 10).unwrap().value, 10);
        assert_eq!(run(1, 11).unwrap().value, 10);
        assert_eq!(run(2, 12).unwrap().value, 12);
        let why = |cache: &StageCache, value| cache.load::<u32>("search", &parts(value)).err();
        let moved = Because::Moved(vec!["key windows changed".to_owned()]);
        assert_eq!(why(&cache, 3), Some(moved));
        let path = folder.path().join("search");
        let mut bytes = fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        atomic::write(&path, &bytes).unwrap();
        assert_eq!(why(&cache, 2), Some(Because::Damaged));
        assert_eq!(run(2, 13).unwrap().value, 13);
        let forced = StageCache::new(folder.path(), true);
        assert_eq!(why(&forced, 2), Some(Because::Forced));
        cache.forget("search");
        assert_eq!(why(&cache, 2), Some(Because::First));
    }
}
