//! What a run has stored of its stages: with which inputs, and what was made of them.

use std::{collections::BTreeMap, fs, path::Path};

use areograph::flow::PUBLISH;
use serde_json::Value;

use super::ledger::Row;

/// What stands before an output in its file: inputs by name, BLAKE3 and bytes of the output (`store::cache`).
type Head = (BTreeMap<String, String>, String, u64);

/// A stored output.
pub(crate) struct Stored {
    /// Name of the stage.
    pub(crate) stage: String,
    /// What it ran for: an image, a round.
    part: Option<String>,
    /// Inputs by name.
    pub(crate) inputs: BTreeMap<String, String>,
    output: Vec<u8>,
}

impl Stored {
    fn read(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let (head, output): (Head, &[u8]) = postcard::take_from_bytes(&bytes).unwrap();
        let label = path.file_name().unwrap().to_str().unwrap();
        let (stage, part) = match label.split_once('+') {
            Some((stage, part)) => (stage, Some(part.to_owned())),
            None => (label, None),
        };
        Self {
            stage: stage.to_owned(),
            part,
            inputs: head.0,
            output: output.to_vec(),
        }
    }

    /// Its round: later ones follow from an adjustment or a calibration, and so from what the same stage made before.
    fn round(&self) -> u32 {
        let part = self.part.as_deref().unwrap_or_default();
        let round = part.rsplit('+').next().unwrap_or_default();
        match round.strip_prefix("round-") {
            Some(number) => number.parse().unwrap(),
            None => u32::from(["matching", "adjusted"].contains(&round)),
        }
    }

    /// The number under which it is stored: that of products for what is published of an archive, which has one of its own.
    fn method(&self) -> u32 {
        let layout = self.inputs.get("key (layout)");
        let of_stage = || self.inputs["areograph"].rsplit_once(' ').unwrap().1;
        let number = layout.map_or_else(of_stage, String::as_str);
        number.parse().unwrap()
    }

    /// Of the inputs and of the output.
    fn hashes(&self, folder: &Path, products: &Path) -> [String; 2] {
        let output = blake3::hash(&self.steady_output(folder, products));
        [self.hash_of_inputs(folder), output.to_hex().to_string()]
    }

    /// All inputs but for the number of the method, and for what is of this copy of the files alone.
    fn hash_of_inputs(&self, folder: &Path) -> String {
        let mut hasher = blake3::Hasher::new();
        for (name, value) in &self.inputs {
            let is_of_copy = name.starts_with("key identity");
            if is_of_copy || name == "areograph" || name == "key (layout)" {
                continue;
            }
            let value = value.replace(folder.to_str().unwrap(), "");
            hasher.update(format!("{name}\n{value}\n").as_bytes());
        }
        if self.stage == PUBLISH {
            // Products name the version.
            let (version, _) = self.inputs["areograph"].split_once(',').unwrap();
            hasher.update(version.as_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }

    /// The output without the folder and the time of day; of what is published, in `products`, all files.
    fn steady_output(&self, folder: &Path, products: &Path) -> Vec<u8> {
        let folder = folder.to_str().unwrap();
        if self.stage == PUBLISH {
            let text: String = postcard::from_bytes(&self.output).unwrap();
            let mut manifest: Value = serde_json::from_str(&text).unwrap();
            let mut hashed = hashes_of_products(&manifest["products"], products, folder);
            let manifest = manifest.as_object_mut().unwrap();
            // Fingerprints of stages hold what the inputs hold.
            for name in ["finished_utc", "stages", "products"] {
                manifest.remove(name).unwrap();
            }
            hashed += &serde_json::to_string(manifest).unwrap().replace(folder, "");
            return hashed.into_bytes();
        }
        let found = self.output.windows(folder.len());
        let mut found = found.filter(|window| *window == folder.as_bytes());
        assert!(found.next().is_none(), "{} holds a path", self.stage);
        self.output.clone()
    }
}

/// Paths of products with BLAKE3 of what they hold without the folder of the inputs, which some name.
fn hashes_of_products(listed: &Value, products: &Path, folder: &str) -> String {
    let listed = listed.as_array().unwrap().iter();
    let hash = |product: &Value| {
        let path = product["path"].as_str().unwrap();
        let bytes = fs::read(products.join(path)).unwrap();
        let mut hasher = blake3::Hasher::new();
        let mut rest = &bytes[..];
        while let Some(at) = position(rest, folder.as_bytes()) {
            hasher.update(&rest[..at]);
            rest = &rest[at + folder.len()..];
        }
        hasher.update(rest);
        format!("{path} {}\n", hasher.finalize().to_hex())
    };
    listed.map(hash).collect()
}

fn position(bytes: &[u8], of: &[u8]) -> Option<usize> {
    let first = of.first()?;
    let mut starts = bytes.iter().enumerate().filter(|(_, byte)| *byte == first);
    starts
        .find(|(at, _)| bytes[*at..].starts_with(of))
        .map(|(at, _)| at)
}

/// The rows of what a run stored in `cache`, one a stage, in `folder` with all input files. Of a stage that runs in rounds the
/// first one counts: what later ones are given follows from it, so that another method would look like other inputs.
///
/// `declared` says which type or file is behind the name of a stage.
pub(crate) fn rows(
    scene: &str,
    folder: &Path,
    cache: &Path,
    declared: &dyn Fn(&str) -> String,
) -> Vec<Row> {
    let products = cache.parent().unwrap();
    let mut by_stage: BTreeMap<String, Vec<Stored>> = BTreeMap::new();
    for stored in all(cache) {
        by_stage
            .entry(stored.stage.clone())
            .or_default()
            .push(stored);
    }
    let row = |(stage, mut stored): (String, Vec<Stored>)| {
        let first = stored.iter().map(Stored::round).min().unwrap();
        stored.retain(|of| of.round() == first);
        let mut methods: Vec<u32> = stored.iter().map(Stored::method).collect();
        methods.dedup();
        let [method] = methods[..] else {
            panic!("{stage}: {methods:?}")
        };
        // Labels may hold places of files: the order is that of the hashes.
        let hashes = stored.iter().map(|of| of.hashes(folder, products));
        let mut hashes: Vec<[String; 2]> = hashes.collect();
        hashes.sort();
        let joined = |at: usize| {
            let texts: Vec<&str> = hashes.iter().map(|of| &*of[at]).collect();
            blake3::hash(texts.concat().as_bytes()).to_hex().to_string()
        };
        Row {
            declared: declared(&stage),
            stage,
            scene: scene.to_owned(),
            method,
            inputs: joined(0),
            output: joined(1),
        }
    };
    by_stage.into_iter().map(row).collect()
}

/// Names of the stages in `cache` with their inputs.
pub(crate) fn inputs(cache: &Path) -> Vec<Stored> {
    all(cache).collect()
}

fn all(cache: &Path) -> impl Iterator<Item = Stored> {
    let entries = fs::read_dir(cache).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    // Hashes of these files are hidden.
    let outputs = paths.filter(|path| {
        !path
            .file_name()
            .unwrap()
            .as_encoded_bytes()
            .starts_with(b".")
    });
    outputs.map(|path| Stored::read(&path))
}
