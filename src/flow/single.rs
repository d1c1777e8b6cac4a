//! A flow of one stage: from files to the output of the stage, and from this output to products in a separate folder.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use super::{
    PUBLISH,
    publish::{keep, standing},
};
use crate::{
    error::{Locate, Result},
    files::{HashedFile, InputFiles, file_name},
    products::Product,
    stage::{Inputs, Output, Provenance, Stage},
    stages::judge::Verdict,
    store::{
        cache::StageCache,
        lock::SiteLock,
        manifest::{Complaints, ConfigurationEntry, Manifest, StageEntry},
        publish::{CACHE, entries, note_failure, publish, read_manifest, staging},
    },
};

/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// Outcome of such a flow.
#[derive(Debug)]
pub struct SingleOutcome {
    /// Folder of the products.
    pub folder: PathBuf,
    /// The manifest of the products.
    pub manifest: Manifest,
    /// Whether the products already existed.
    pub unchanged: bool,
}

/// Configuration of a flow of one stage.
pub(super) struct Single<'a> {
    /// Identifier, and name of the folder.
    pub(super) name: &'a str,
    /// The configuration file, its hash, keys and values.
    pub(super) file: &'a Path,
    pub(super) blake3: &'a str,
    pub(super) keys: &'a BTreeMap<String, String>,
    /// Raised when the layout of products changes.
    pub(super) method: u32,
    /// `<out>/<name>`.
    pub(super) folder: PathBuf,
    /// Run even if the output is stored.
    pub(super) force: bool,
}

/// The part of a manifest that depends on an output.
pub(super) struct ManifestEntry<'a> {
    pub(super) verdict: &'a Verdict,
    pub(super) counts: Vec<(&'static str, u64)>,
    pub(super) figures: Vec<(&'static str, f64)>,
    /// Texts and number of complaints.
    pub(super) complaints: (&'a [String], u64),
}

impl Single<'_> {
    /// Runs the stage that `stage` makes of the hashed `files`, and publishes the results of `write` and `tell` from
    /// its output, if an input has changed since the last run.
    ///
    /// # Errors
    /// Files that cannot be read, refusals of the stage, write errors; earlier products then remain.
    pub(super) fn run<T>(
        &self,
        files: &[PathBuf],
        made: impl FnOnce(&[HashedFile], &StageCache, &AtomicBool) -> Result<Made<T>>,
        write: impl FnOnce(&Path, &T) -> Result<Vec<Product>>,
        tell: impl Fn(&T) -> ManifestEntry<'_>,
    ) -> Result<SingleOutcome> {
        let ran = self.ran(files, made, write, tell).in_site(self.name);
        if self.folder.is_dir() {
            let failure = ran.as_ref().err().map(ToString::to_string);
            note_failure(&self.folder, failure.as_deref());
        }
        let (manifest, unchanged) = ran?;
        Ok(SingleOutcome {
            folder: self.folder.clone(),
            manifest,
            unchanged,
        })
    }

    fn ran<T>(
        &self,
        files: &[PathBuf],
        made: impl FnOnce(&[HashedFile], &StageCache, &AtomicBool) -> Result<Made<T>>,
        write: impl FnOnce(&Path, &T) -> Result<Vec<Product>>,
        tell: impl Fn(&T) -> ManifestEntry<'_>,
    ) -> Result<(Manifest, bool)> {
        let stop = AtomicBool::new(false);
        let known = InputFiles::default();
        let hashed = known.hash_all(files, &stop)?;
        let _lock = SiteLock::take(&self.folder)?;
        let cache = StageCache::new(&self.folder.join(CACHE), self.force);
        let made = made(&hashed, &cache, &stop)?;
        known.verify_all()?;
        let inputs = self.publish_inputs(&made);
        match standing(&self.folder, &cache, &inputs) {
            Ok(manifest) => return Ok((manifest, true)),
            Err(reason) => tracing::info!(stage = PUBLISH, %reason, "running"),
        }
        let manifest = self
            .publish(&made, &inputs, write, tell)
            .in_stage(PUBLISH)?;
        keep(&cache, inputs, &manifest).in_stage(PUBLISH)?;
        Ok((manifest, false))
    }

    /// The configuration as written, and the output.
    fn publish_inputs<T>(&self, made: &Made<T>) -> Inputs {
        let mut inputs = Inputs::new(self.method);
        for (key, value) in self.keys {
            inputs.setting(key, value);
        }
        inputs.setting("(file name)", &file_name(self.file));
        let provenance: Option<&Provenance> = made.output.provenance();
        inputs.output(made.stage, provenance.map(|of| &*of.blake3));
        inputs.fingerprint_of(made.stage, provenance.map(|of| &*of.fingerprint));
        inputs
    }

    fn publish<T>(
        &self,
        made: &Made<T>,
        inputs: &Inputs,
        write: impl FnOnce(&Path, &T) -> Result<Vec<Product>>,
        tell: impl Fn(&T) -> ManifestEntry<'_>,
    ) -> Result<Manifest> {
        let staging = staging(&self.folder)?;
        let value = made.output.value()?;
        let files: Vec<(PathBuf, u64)> = write(&staging, value)?
            .into_iter()
            .map(|product| (product.path, product.rows))
            .collect();
        let manifest = Manifest {
            products: entries(&staging, &files)?,
            stages: stages(made, inputs),
            ..self.manifest(tell(value))
        };
        publish(&self.folder, &staging, &manifest)?;
        tracing::info!(
            stage = PUBLISH,
            products = manifest.products.len(),
            "published"
        );
        Ok(read_manifest(&self.folder).unwrap_or(manifest))
    }

    /// The manifest without products and stages.
    fn manifest(&self, entry: ManifestEntry<'_>) -> Manifest {
        let named = |(name, count): (&str, u64)| (name.to_owned(), count);
        let (texts, count) = entry.complaints;
        Manifest {
            tool: "areograph".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            site: self.name.to_owned(),
            verdict: entry.verdict.clone(),
            configuration: ConfigurationEntry {
                file_name: file_name(self.file),
                blake3: self.blake3.to_owned(),
                keys: self.keys.clone(),
            },
            biases: Vec::new(),
            kernels: Vec::new(),
            kernel_choice: Vec::new(),
            stages: Vec::new(),
            products: Vec::new(),
            counts: entry.counts.into_iter().map(named).collect(),
            figures: entry
                .figures
                .into_iter()
                .map(|(name, figure)| (name.to_owned(), figure))
                .collect(),
            rejected: BTreeMap::new(),
            complaints: Complaints {
                count,
                texts: texts.iter().take(COMPLAINTS_QUOTED).cloned().collect(),
            },
            notes: Vec::new(),
            finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
        }
    }
}

/// An output and the name of its stage.
pub(super) struct Made<T> {
    stage: &'static str,
    output: Output<T>,
}

/// The output of a stage, stored or computed now.
pub(super) fn made<S: Stage>(
    stage: &S,
    cache: &StageCache,
    stop: &AtomicBool,
) -> Result<Made<S::Output>> {
    let inputs = stage.inputs();
    let output = match cache.load(S::NAME, &inputs) {
        Ok(output) => output,
        Err(reason) => {
            tracing::info!(stage = S::NAME, %reason, "running");
            let value = stage.run(stop).in_stage(S::NAME)?;
            cache.store(S::NAME, inputs, value)?
        }
    };
    Ok(Made {
        stage: S::NAME,
        output,
    })
}

fn stages<T>(made: &Made<T>, inputs: &Inputs) -> Vec<StageEntry> {
    let entry = |name: &str, fingerprint: String| StageEntry {
        name: name.to_owned(),
        fingerprint,
    };
    let of_output = made
        .output
        .provenance()
        .map(|of| entry(made.stage, of.fingerprint.clone()));
    of_output
        .into_iter()
        .chain([entry(PUBLISH, inputs.fingerprint())])
        .collect()
}
