//! What a stage's output depends on, part by part, so that a re-run can be explained.

use std::{collections::BTreeMap, fmt};

use serde::{Deserialize, Serialize};

/// Value of an output that a stage has yet to make.
const NOT_KNOWN_YET: &str = "not known yet";

/// Everything that enters a stage, by name; equal parts mean an equal output.
///
/// | part | value |
/// |---|---|
/// | `areograph` | version of the program, and of the stage's method |
/// | `key …` | a table of the valid configuration |
/// | `kernel …`, `label …`, `pedr …` | BLAKE3 of a file, kernels with their place in the load order |
/// | `output of …` | BLAKE3 of an earlier stage's output |
///
/// Outputs enter by content: when an earlier stage runs again and gives the same bytes, the later
/// stage stays as it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Parts(BTreeMap<String, String>);

impl Parts {
    /// The parts of a stage whose method, or the layout of whose output, has this number.
    #[must_use]
    pub fn new(method: u32) -> Self {
        let version = format!("{}, method {method}", env!("CARGO_PKG_VERSION"));
        Self(BTreeMap::from([("areograph".to_owned(), version)]))
    }

    /// Adds a table or value of the valid configuration.
    #[must_use]
    pub fn key(mut self, name: &str, value: &impl Serialize) -> Self {
        // Configuration types hold nothing that JSON cannot say; were it so, the text says that.
        let text = serde_json::to_string(value).unwrap_or_else(|error| error.to_string());
        self.0.insert(format!("key {name}"), text);
        self
    }

    /// Adds a file by its hash; further files of one name count as `name (2)` and so on.
    #[must_use]
    pub fn file(mut self, sort: &str, name: &str, blake3: &str) -> Self {
        let mut part = format!("{sort} {name}");
        let mut place = 1;
        while self.0.contains_key(&part) {
            place += 1;
            part = format!("{sort} {name} ({place})");
        }
        self.0.insert(part, blake3.to_owned());
        self
    }

    /// Adds the output of an earlier stage; `None` while that stage itself has to run again.
    #[must_use]
    pub fn output(mut self, stage: &str, blake3: Option<&str>) -> Self {
        self.0.insert(
            format!("output of {stage}"),
            blake3.unwrap_or(NOT_KNOWN_YET).to_owned(),
        );
        self
    }

    /// One hash over all parts.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for (name, value) in &self.0 {
            for text in [name, value] {
                hasher.update(&(text.len() as u64).to_le_bytes());
                hasher.update(text.as_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }

    /// Names of the parts that `earlier` has otherwise, or not, or alone.
    #[must_use]
    pub fn changed_since(&self, earlier: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        for (name, value) in &self.0 {
            match earlier.0.get(name) {
                None => changes.push(format!("{name} is new")),
                Some(_) if value == NOT_KNOWN_YET => changes.push(format!("{name} may change")),
                Some(before) if before != value => changes.push(format!("{name} changed")),
                Some(_) => {}
            }
        }
        let gone = earlier.0.keys().filter(|name| !self.0.contains_key(*name));
        changes.extend(gone.map(|name| format!("{name} is gone")));
        changes
    }
}

/// Why a stage runs, or that it does not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Because {
    /// Nothing moved: the stored output is used.
    Unchanged,
    /// No stored output.
    First,
    /// The user asked for it.
    Forced,
    /// The stored output cannot be read or is not what was stored.
    Damaged,
    /// These parts moved.
    Moved(Vec<String>),
}

impl Because {
    /// Whether the stage has to run.
    #[must_use]
    pub fn runs(&self) -> bool {
        *self != Self::Unchanged
    }
}

impl fmt::Display for Because {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unchanged => formatter.write_str("nothing changed"),
            Self::First => formatter.write_str("no earlier output"),
            Self::Forced => formatter.write_str("forced"),
            Self::Damaged => formatter.write_str("the stored output is damaged"),
            Self::Moved(parts) => formatter.write_str(&parts.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moved_part_is_named() {
        let before = Parts::new(1)
            .key("windows", &[1, 2])
            .file("kernel", "naif0012.tls", "aa")
            .output("tag_times", Some("bb"));
        let same = before.clone();
        assert_eq!(before.fingerprint(), same.fingerprint());
        assert!(same.changed_since(&before).is_empty());
        let after = Parts::new(1)
            .key("windows", &[1, 3])
            .file("kernel", "naif0013.tls", "aa")
            .output("tag_times", None);
        assert_ne!(before.fingerprint(), after.fingerprint());
        assert_eq!(
            after.changed_since(&before),
            [
                "kernel naif0013.tls is new",
                "key windows changed",
                "output of tag_times may change",
                "kernel naif0012.tls is gone",
            ]
        );
    }

    #[test]
    fn another_version_of_the_program_is_a_reason() {
        let stored: Parts = serde_json::from_str(r#"{"areograph": "0.0.1"}"#).unwrap();
        assert_eq!(Parts::new(1).changed_since(&stored), ["areograph changed"]);
    }

    #[test]
    fn files_of_one_name_do_not_hide_each_other() {
        let parts = |first: &str| {
            Parts::new(1)
                .file("pedr", "a.b", first)
                .file("pedr", "a.b", "cc")
        };
        assert_eq!(
            parts("bb").changed_since(&parts("aa")),
            ["pedr a.b changed"]
        );
        assert_eq!(
            Parts::new(2).changed_since(&Parts::new(1)),
            ["areograph changed"]
        );
    }

    #[test]
    fn names_and_values_do_not_run_into_each_other() {
        let one = Parts::new(1).file("pedr", "a", "bc");
        let other = Parts::new(1).file("pedr", "ab", "c");
        assert_ne!(one.fingerprint(), other.fingerprint());
    }
}
