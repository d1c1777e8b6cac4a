//! Values that differ, key by key.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use areograph_store::manifest::Manifest;

/// Numbers that differ by less than this fraction of the larger one are equal except for rounding.
const ROUNDING_SHARE: f64 = 1e-6;

/// A value that differs between the runs; missing for a run without this value.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// Key; dots separate the names of tables and keys.
    pub what: String,
    /// Value in the first run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a: Option<Value>,
    /// Value in the second run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b: Option<Value>,
}

/// Texts of one run only.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Texts {
    /// Texts only in the first run.
    pub only_in_a: Vec<String>,
    /// Texts only in the second run.
    pub only_in_b: Vec<String>,
}

impl Change {
    /// `B − A` of numbers.
    #[must_use]
    pub fn difference(&self) -> Option<f64> {
        let number = |value: &Option<Value>| value.as_ref().and_then(Value::as_f64);
        Some(number(&self.b)? - number(&self.a)?)
    }
}

impl Change {
    /// Whether both are numbers and equal except for rounding.
    #[must_use]
    pub fn is_rounding(&self) -> bool {
        let size = |value: &Option<Value>| value.as_ref().and_then(Value::as_f64).map(f64::abs);
        match (self.difference(), size(&self.a), size(&self.b)) {
            (Some(difference), Some(a), Some(b)) => difference.abs() < ROUNDING_SHARE * a.max(b),
            _ => false,
        }
    }
}

impl Texts {
    pub(super) fn between(a: &[String], b: &[String]) -> Self {
        let without = |texts: &[String], others: &[String]| {
            let unmatched = texts.iter().filter(|text| !others.contains(text));
            unmatched.cloned().collect()
        };
        Self {
            only_in_a: without(a, b),
            only_in_b: without(b, a),
        }
    }

    /// Whether both runs have the same texts.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.only_in_a.is_empty() && self.only_in_b.is_empty()
    }
}

/// Values of `a` and `b` that differ, in the order of their keys; lists are compared as wholes.
pub(super) fn between(a: &impl Serialize, b: &impl Serialize) -> Vec<Change> {
    let (mut a, mut b) = (flat(a), flat(b));
    let mut keys: Vec<String> = a.keys().chain(b.keys()).cloned().collect();
    keys.sort();
    keys.dedup();
    keys.into_iter()
        .map(|what| Change {
            a: a.remove(&what),
            b: b.remove(&what),
            what,
        })
        .filter(|change| change.a != change.b)
        .collect()
}

fn flat(values: &impl Serialize) -> BTreeMap<String, Value> {
    let mut flat = BTreeMap::new();
    // Values that were read from JSON can be written as JSON.
    let value = serde_json::to_value(values).unwrap_or_default();
    flatten("", value, &mut flat);
    flat
}

fn flatten(path: &str, value: Value, flat: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(members) => {
            for (key, member) in members {
                let dot = if path.is_empty() { "" } else { "." };
                flatten(&format!("{path}{dot}{key}"), member, flat);
            }
        }
        value => {
            flat.insert(path.to_owned(), value);
        }
    }
}

/// Time corrections by name.
pub(super) fn biases(manifest: &Manifest) -> BTreeMap<&str, Value> {
    let entry = |bias: &areograph_store::manifest::BiasEntry| json!({"correction_s": bias.correction_s, "scope": bias.scope, "source": bias.source});
    let biases = manifest.biases.iter();
    biases.map(|bias| (&*bias.name, entry(bias))).collect()
}

/// A value for display, fractions to six decimals or seven digits; a dash for a missing value.
#[must_use]
pub fn text(value: Option<&Value>) -> String {
    match value {
        None => "–".to_owned(),
        Some(Value::String(text)) => text.clone(),
        Some(Value::Number(number)) if number.is_f64() => {
            fraction(number.as_f64().unwrap_or(f64::NAN))
        }
        Some(value) => value.to_string(),
    }
}

fn fraction(value: f64) -> String {
    if value.abs() > 0.0 && value.abs() < 1e-3 {
        return format!("{value:.6e}");
    }
    let digits = format!("{value:.6}");
    let short = digits.trim_end_matches('0').trim_end_matches('.');
    short.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_listed_by_key() {
        let a =
            json!({"limits": {"mean_max_m": 5.0, "shots_min": 10}, "classes": [1], "gone": "x"});
        let b =
            json!({"limits": {"mean_max_m": 9.0, "shots_min": 10}, "classes": [0, 1], "new": true});
        let changes: Vec<String> = between(&a, &b)
            .iter()
            .map(|change| {
                let [a, b] = [&change.a, &change.b].map(|value| text(value.as_ref()));
                format!("{}: {a} → {b}", change.what)
            })
            .collect();
        assert_eq!(
            changes,
            [
                "classes: [1] → [0,1]",
                "gone: x → –",
                "limits.mean_max_m: 5 → 9",
                "new: – → true",
            ]
        );
        assert!(between(&a, &a).is_empty());
        let rounding = |a: Value, b: Value| {
            let (a, b) = (Some(a), Some(b));
            let what = String::new();
            Change { what, a, b }.is_rounding()
        };
        assert!(rounding(json!(71.2), json!(71.200_02)) && rounding(json!(-5e-9), json!(-5e-9)));
        assert!(!rounding(json!(71.2), json!(71.200_1)) && !rounding(json!(0.0), json!(1e-12)));
        assert!(!rounding(json!("a"), json!("b")));
        let fractions =
            [-1.15, 37_000_000.25, 0.104_943_9, 7.4e-9, 0.0].map(|value| text(Some(&json!(value))));
        assert_eq!(
            fractions,
            ["-1.15", "37000000.25", "0.104944", "7.400000e-9", "0"]
        );
    }
}
