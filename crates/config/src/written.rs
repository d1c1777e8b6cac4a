//! The keys and values of a file as written.

use std::collections::{BTreeMap, BTreeSet};

use super::problems::Rename;

/// The keys and values of a file as written, keys by their present names.
pub(super) struct Written {
    /// BLAKE3 of them in canonical order and spacing.
    pub(super) blake3: String,
    /// Values by their keys, with dots between tables; elements of lists by their `id`, else their place.
    /// The list itself has these names in order. Values are in TOML, so that types are kept: two files
    /// have the same keys and values here only when they have the same hash.
    pub(super) keys: BTreeMap<String, String>,
}

impl Written {
    pub(super) fn of(mut table: toml::Table, renames: &BTreeSet<Rename>) -> Self {
        // Tables after their keys, which are looked up below the name that the file has.
        for rename in renames.iter().rev() {
            give_present_name(&mut table, &rename.table, rename);
        }
        let hash = blake3::hash(table.to_string().as_bytes());
        let mut keys = BTreeMap::new();
        flatten("", &toml::Value::Table(table), &mut keys);
        Self {
            blake3: hash.to_hex().to_string(),
            keys,
        }
    }
}

/// Renames a key of the table `path`, of every entry where that is a list.
fn give_present_name(table: &mut toml::Table, path: &str, rename: &Rename) {
    if path.is_empty() {
        if let Some(value) = table.remove(rename.was) {
            table.insert(rename.name.to_owned(), value);
        }
        return;
    }
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    match table.get_mut(first) {
        Some(toml::Value::Table(below)) => give_present_name(below, rest, rename),
        Some(toml::Value::Array(entries)) => {
            for entry in entries.iter_mut().filter_map(toml::Value::as_table_mut) {
                give_present_name(entry, rest, rename);
            }
        }
        _ => {}
    }
}

fn flatten(path: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
    match value {
        toml::Value::Table(table) if !table.is_empty() || path.is_empty() => {
            for (key, value) in table {
                let dot = if path.is_empty() { "" } else { "." };
                flatten(&format!("{path}{dot}{key}"), value, keys);
            }
        }
        toml::Value::Array(tables) if tables.iter().any(toml::Value::is_table) => {
            let mut names = Vec::with_capacity(tables.len());
            for (place, table) in tables.iter().enumerate() {
                let id = table.get("id").and_then(toml::Value::as_str);
                let name = id.map_or_else(|| (place + 1).to_string(), str::to_owned);
                flatten(&format!("{path}.{name}"), table, keys);
                names.push(name);
            }
            keys.insert(path.to_owned(), toml::Value::from(names).to_string());
        }
        value => {
            keys.insert(path.to_owned(), value.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(text: &str) -> BTreeMap<String, String> {
        let table: toml::Table = toml::from_str(text).unwrap();
        let mut keys = BTreeMap::new();
        flatten("", &toml::Value::Table(table), &mut keys);
        keys
    }

    #[test]
    fn every_value_is_found_under_its_key() {
        let keys = keys(
            "site = \"a\"\n[pedr]\nfiles = [\"x\", \"y\"]\n[pedr.filter]\nclasses = [1]\n[range_check]\n\
             [[images]]\nid = \"two\"\nlines_header = 8\n[[images]]\nid = \"one\"\n",
        );
        let found: Vec<(&str, &str)> = keys.iter().map(|(key, value)| (&**key, &**value)).collect();
        let expected = [
            ("images", "[\"two\", \"one\"]"),
            ("images.one.id", "\"one\""),
            ("images.two.id", "\"two\""),
            ("images.two.lines_header", "8"),
            ("pedr.files", "[\"x\", \"y\"]"),
            ("pedr.filter.classes", "[1]"),
            ("range_check", "{}"),
            ("site", "\"a\""),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn what_changes_the_hash_changes_the_keys() {
        for [a, b] in [
            [
                "[[images]]\nid = \"1\"\n[[images]]\nid = \"2\"",
                "[[images]]\nid = \"2\"\n[[images]]\nid = \"1\"",
            ],
            ["orbit = \"5\"", "orbit = 5"],
            ["limit = 5", "limit = 5.0"],
            ["[pedr.filter]", ""],
        ] {
            assert_ne!(keys(a), keys(b), "{a} and {b}");
        }
    }
}
