//! The inputs of a stage, by name, so that a re-run can be explained.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Called;
use crate::files::{HashedFile, file_name};
use areograph_base::error::Cause;

/// Value of an input that an earlier stage has not made yet.
const NOT_KNOWN_YET: &str = "not known yet";

/// All inputs of a stage by name; equal inputs imply an equal output.
///
/// | input | value |
/// |---|---|
/// | `areograph` | version of the program, and of the stage's method |
/// | `method of …` | number of the method of a stage whose functions this one calls |
/// | `key …` | a value of the valid configuration, or one derived from it; tables by their fields |
/// | `kernel …`, `label …`, `pedr …` | BLAKE3 of a file; where the order matters with its place |
/// | `output of …` | BLAKE3 of an earlier stage's output |
///
/// Outputs enter by content: if an earlier stage runs again and gives the same bytes, the later stage is kept.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    named: BTreeMap<String, String>,
    /// Files behind the inputs, which must not change while the stage runs; not part of the comparison.
    #[serde(skip)]
    files: Vec<PathBuf>,
    /// Prefixes of the names of inputs that are not known yet.
    #[serde(skip)]
    pending: Vec<String>,
}

/// A field of the inputs of a stage.
pub trait Input {
    /// Adds the field to the inputs of the stage, under its name unless it has a better one.
    fn add_to(&self, field: &str, inputs: &mut Inputs);
}

/// Values of the configuration, and values derived from them.
impl<T: Serialize + ?Sized> Input for &T {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        inputs.setting(field, self);
    }
}

impl Input for HashedFile {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        inputs.file(field, &self.path, None, &self.blake3);
    }
}

/// An optional input.
impl<T: Input> Input for Option<T> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        if let Some(input) = self {
            input.add_to(field, inputs);
        }
    }
}

/// A list whose order matters.
#[derive(Debug)]
pub struct InOrder<'a, T>(pub &'a [T]);

impl<T> Clone for InOrder<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for InOrder<'_, T> {}

impl Input for InOrder<'_, HashedFile> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        for (place, file) in self.0.iter().enumerate() {
            inputs.file(field, &file.path, Some(place), &file.blake3);
        }
    }
}

/// An output whose value was requested before it was made.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the output of {0} was used before it was computed")]
#[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
pub(super) struct Pending(pub(super) String);

impl Inputs {
    /// The inputs of a stage whose method, or output layout, has this number.
    #[must_use]
    pub fn new(method: u32) -> Self {
        let version = format!("{}, method {method}", env!("CARGO_PKG_VERSION"));
        Self {
            named: BTreeMap::from([("areograph".to_owned(), version)]),
            files: Vec::new(),
            pending: Vec::new(),
        }
    }

    /// Adds the methods of stages whose functions the stage calls: if one of these changes, so does the stage.
    pub fn calls(&mut self, called: &[Called]) {
        for (stage, method) in called {
            self.named
                .insert(format!("method of {stage}"), method.to_string());
        }
    }

    /// Adds a value of the valid configuration; for a table each field under its own name.
    pub fn setting(&mut self, name: &str, value: &(impl Serialize + ?Sized)) {
        // Configuration types contain only values that JSON can represent; otherwise the text reports it.
        let value =
            serde_json::to_value(value).unwrap_or_else(|error| Value::String(error.to_string()));
        self.flatten(format!("key {name}"), value);
    }

    fn flatten(&mut self, name: String, value: Value) {
        match value {
            Value::Object(members) if !members.is_empty() => {
                for (member, value) in members {
                    self.flatten(format!("{name}.{member}"), value);
                }
            }
            value => {
                self.named.insert(name, value.to_string());
            }
        }
    }

    /// Adds an input that is not known before earlier stages have run; the names of its parts begin with `prefix`.
    pub fn not_known_yet(&mut self, name: &str, prefix: &str) {
        self.named.insert(name.to_owned(), NOT_KNOWN_YET.to_owned());
        self.pending.push(prefix.to_owned());
    }

    /// Adds a file under its name without folders, with its place (from 0) where the order matters; further
    /// files of one name count as `name (2)` and so on.
    pub fn file(&mut self, sort: &str, path: &Path, place: Option<usize>, blake3: &str) {
        let name = file_name(path);
        let mut input = format!("{sort} {name}");
        let mut count = 1;
        while self.named.contains_key(&input) {
            count += 1;
            input = format!("{sort} {name} ({count})");
        }
        let value = place.map_or_else(
            || blake3.to_owned(),
            |place| format!("{}: {blake3}", place + 1),
        );
        self.named.insert(input, value);
        self.files.push(path.to_owned());
    }

    /// Adds the output of an earlier stage; `None` while that stage itself has to run.
    pub fn output(&mut self, label: &str, blake3: Option<&str>) {
        let value = blake3.unwrap_or(NOT_KNOWN_YET).to_owned();
        self.named.insert(format!("output of {label}"), value);
    }

    /// Adds the fingerprint of an earlier stage, for an output that repeats it.
    pub fn fingerprint_of(&mut self, label: &str, fingerprint: Option<&str>) {
        let value = fingerprint.unwrap_or(NOT_KNOWN_YET).to_owned();
        self.named.insert(format!("inputs of {label}"), value);
    }

    /// Whether every input is known.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.named.values().all(|value| value != NOT_KNOWN_YET)
    }

    /// Files behind the inputs.
    pub fn file_paths(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// One hash over all inputs.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for (name, value) in &self.named {
            for text in [name, value] {
                hasher.update(&(text.len() as u64).to_le_bytes());
                hasher.update(text.as_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }

    /// Names of the inputs that differ from the inputs of `earlier`, or exist only here or there.
    #[must_use]
    pub fn changed_since(&self, earlier: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        for (name, value) in &self.named {
            let before = earlier.named.get(name);
            if value == NOT_KNOWN_YET {
                changes.push(format!("{name} may change"));
            } else if before.is_none() {
                changes.push(format!("{name} is new"));
            } else if before != Some(value) {
                changes.push(format!("{name} changed"));
            }
        }
        let gone = earlier.named.keys();
        let pending = |name: &str| self.pending.iter().any(|prefix| name.starts_with(prefix));
        let gone = gone.filter(|name| !self.named.contains_key(*name) && !pending(name));
        changes.extend(gone.map(|name| format!("{name} was removed")));
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hashed(path: &str, blake3: &str) -> HashedFile {
        HashedFile {
            path: path.into(),
            bytes: 1,
            blake3: blake3.to_owned(),
        }
    }

    fn inputs(add: impl FnOnce(&mut Inputs)) -> Inputs {
        let mut inputs = Inputs::new(1);
        add(&mut inputs);
        inputs
    }

    #[test]
    fn the_input_that_changed_is_named() {
        #[derive(Serialize)]
        struct Limits {
            mean_max_m: f64,
            shots_min: u32,
        }
        let made = |mean_max_m, kernel: &str, output| {
            inputs(|inputs| {
                let limits = Limits {
                    mean_max_m,
                    shots_min: 20,
                };
                (&limits).add_to("range_check", inputs);
                InOrder(&[hashed(kernel, "aa")]).add_to("kernel", inputs);
                inputs.output("tag_times", output);
            })
        };
        let before = made(10.0, "a/naif0012.tls", Some("bb"));
        assert!(before.is_complete());
        assert!(
            made(10.0, "b/naif0012.tls", Some("bb"))
                .changed_since(&before)
                .is_empty()
        );
        let after = made(9.0, "a/naif0013.tls", None);
        assert_ne!(before.fingerprint(), after.fingerprint());
        assert!(!after.is_complete());
        assert_eq!(
            after.changed_since(&before),
            [
                "kernel naif0013.tls is new",
                "key range_check.mean_max_m changed",
                "output of tag_times may change",
                "kernel naif0012.tls was removed",
            ]
        );
    }

    #[test]
    fn another_version_of_the_program_is_a_reason() {
        let stored = Inputs {
            named: BTreeMap::from([("areograph".to_owned(), "0.0.1".to_owned())]),
            files: Vec::new(),
            pending: Vec::new(),
        };
        assert_eq!(Inputs::new(1).changed_since(&stored), ["areograph changed"]);
        assert_eq!(
            Inputs::new(2).changed_since(&Inputs::new(1)),
            ["areograph changed"]
        );
    }

    #[test]
    fn a_method_that_is_called_enters() {
        let calls = |method| inputs(|inputs| inputs.calls(&[("match_ties", method)]));
        assert_eq!(
            calls(2).changed_since(&calls(1)),
            ["method of match_ties changed"]
        );
        assert_ne!(calls(2).fingerprint(), calls(1).fingerprint());
    }

    #[test]
    fn files_of_one_name_do_not_hide_each_other_and_their_order_counts() {
        let files = |first: &str| {
            inputs(|inputs| {
                InOrder(&[hashed("x/a.b", first), hashed("y/a.b", "cc")]).add_to("pedr", inputs);
            })
        };
        assert_eq!(
            files("bb").changed_since(&files("aa")),
            ["pedr a.b changed"]
        );
        let alone = inputs(|inputs| InOrder(&[hashed("a.b", "aa")]).add_to("pedr", inputs));
        assert_eq!(files("aa").changed_since(&alone), ["pedr a.b (2) is new"]);
    }

    #[test]
    fn names_and_values_do_not_run_into_each_other() {
        let one = inputs(|inputs| inputs.file("pedr", Path::new("a"), None, "bc"));
        let other = inputs(|inputs| inputs.file("pedr", Path::new("ab"), None, "c"));
        assert_ne!(one.fingerprint(), other.fingerprint());
    }
}
