//! The products of a flow that ends in one result: those of a net, a calibration, a match.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use super::{
    PUBLISH,
    driver::{Ledger, MadeFrom, Publication},
};
use crate::{
    error::Result,
    files::file_name,
    products::Product,
    stage::{Inputs, Output},
    stages::judge::Verdict,
    store::{
        manifest::{Complaints, ConfigurationEntry, Manifest, StageEntry},
        publish::{entries, publish, read_manifest, staging},
    },
};

/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// Publication of a result.
pub(super) struct ResultPublication<'a, T, W> {
    pub(super) written: Written<'a>,
    pub(super) result: &'a Output<T>,
    /// Whether further stages may follow that are not known before the result is.
    pub(super) has_further_stages: bool,
    /// Writes the products.
    pub(super) write: W,
    /// The part of the manifest that depends on the result.
    pub(super) entry: fn(&T) -> ManifestEntry<'_>,
}

/// Configuration of such a flow, as written.
pub(super) struct Written<'a> {
    /// Identifier.
    pub(super) name: &'a str,
    /// The configuration file, its hash, keys and values.
    pub(super) file: &'a Path,
    pub(super) blake3: &'a str,
    pub(super) keys: &'a BTreeMap<String, String>,
    /// Raised when the layout of products changes.
    pub(super) method: u32,
}

/// The part of a manifest that depends on a result.
pub(super) struct ManifestEntry<'a> {
    pub(super) verdict: &'a Verdict,
    pub(super) counts: Vec<(&'static str, u64)>,
    pub(super) figures: Vec<(&'static str, f64)>,
    /// Texts and number of complaints.
    pub(super) complaints: (&'a [String], u64),
}

impl<T, W: Fn(&Path, &T) -> Result<Vec<Product>>> Publication for ResultPublication<'_, T, W> {
    /// The configuration as written, and the outputs of all stages.
    fn inputs(&self, _folder: &Path, ledger: &Ledger) -> Inputs {
        let mut inputs = Inputs::new(self.written.method);
        for (key, value) in self.written.keys {
            inputs.setting(key, value);
        }
        inputs.setting("(file name)", &file_name(self.written.file));
        for (label, provenance) in ledger {
            let provenance = provenance.as_ref();
            inputs.output(label, provenance.map(|of| &*of.blake3));
            inputs.fingerprint_of(label, provenance.map(|of| &*of.fingerprint));
        }
        if self.has_further_stages {
            for prefix in ["output of ", "inputs of "] {
                inputs.not_known_yet("further stages", prefix);
            }
        }
        inputs
    }

    fn verdict(&self) -> Result<Verdict> {
        Ok((self.entry)(self.result.value()?).verdict.clone())
    }

    fn publish(&self, from: &MadeFrom<'_>) -> Result<Manifest> {
        let value = self.result.value()?;
        let staging = staging(from.folder)?;
        let files: Vec<(PathBuf, u64)> = (self.write)(&staging, value)?
            .into_iter()
            .map(|product| (product.path, product.rows))
            .collect();
        let manifest = Manifest {
            products: entries(&staging, &files)?,
            stages: stages(from),
            ..self.written.manifest(&(self.entry)(value))
        };
        publish(from.folder, &staging, &manifest)?;
        tracing::info!(
            stage = PUBLISH,
            products = manifest.products.len(),
            "published"
        );
        Ok(read_manifest(from.folder).unwrap_or(manifest))
    }
}

impl Written<'_> {
    /// The manifest without products and stages.
    fn manifest(&self, entry: &ManifestEntry<'_>) -> Manifest {
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
            counts: named(&entry.counts),
            figures: named(&entry.figures),
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

fn named<T: Copy>(of: &[(&str, T)]) -> BTreeMap<String, T> {
    let named = of.iter().map(|(name, value)| ((*name).to_owned(), *value));
    named.collect()
}

fn stages(from: &MadeFrom<'_>) -> Vec<StageEntry> {
    let entry = |name: &str, fingerprint: &str| StageEntry {
        name: name.to_owned(),
        fingerprint: fingerprint.to_owned(),
    };
    let ledger = from.ledger.iter().filter_map(|(label, provenance)| {
        let provenance = provenance.as_ref()?;
        Some(entry(label, &provenance.fingerprint))
    });
    ledger
        .chain([entry(PUBLISH, &from.inputs.fingerprint())])
        .collect()
}
