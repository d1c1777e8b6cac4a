//! From text to raw values: syntax and shape errors in the same form as all other problems.

use std::collections::BTreeMap;

use toml::de::{DeTable, DeValue};

use super::{problems::Review, raw::RawSite};

/// The keys and values of a file as written.
pub(super) struct Written {
    /// BLAKE3 of them in canonical order and spacing.
    pub(super) blake3: String,
    /// Values by their keys, with dots between tables; elements of lists by their `id`, else their place.
    pub(super) keys: BTreeMap<String, String>,
}

/// The raw values and the keys as written; `None` after reporting what keeps them from being read.
pub(super) fn read(text: &str, review: &mut Review<'_>) -> Option<(RawSite, Written)> {
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    if !syntax_errors.is_empty() {
        for error in syntax_errors {
            review.problem(
                error.span(),
                format!("this is not TOML: {}", error.message()),
            );
        }
        return None;
    }
    let raw = toml::from_str::<RawSite>(text);
    let read = raw.and_then(|raw| Ok((raw, toml::from_str::<toml::Table>(text)?)));
    match read {
        Ok((raw, table)) => {
            let hash = blake3::hash(table.to_string().as_bytes());
            let mut keys = BTreeMap::new();
            flatten("", &toml::Value::Table(table), &mut keys);
            let written = Written {
                blake3: hash.to_hex().to_string(),
                keys,
            };
            Some((raw, written))
        }
        Err(error) => {
            report_shape(document.get_ref(), &error, review);
            None
        }
    }
}

fn flatten(path: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                let dot = if path.is_empty() { "" } else { "." };
                flatten(&format!("{path}{dot}{key}"), value, keys);
            }
        }
        toml::Value::Array(tables) if tables.iter().any(toml::Value::is_table) => {
            for (place, table) in tables.iter().enumerate() {
                let id = table.get("id").and_then(toml::Value::as_str);
                let name = id.map_or_else(|| (place + 1).to_string(), str::to_owned);
                flatten(&format!("{path}.{name}"), table, keys);
            }
        }
        toml::Value::String(text) => {
            keys.insert(path.to_owned(), text.clone());
        }
        value => {
            keys.insert(path.to_owned(), value.to_string());
        }
    }
}

/// Tells of an unknown key or a value of the wrong type.
fn report_shape(document: &DeTable<'_>, error: &toml::de::Error, review: &mut Review<'_>) {
    let Some(span) = error.span() else {
        return review.problem(None, error.message().to_owned());
    };
    let key = path_to(document, span.start).unwrap_or_default().join(".");
    let message = error.message();
    if message.starts_with("unknown field") {
        // `unknown field `a`, expected one of `b`, `c``: every second piece is a name.
        let mut names = message.split('`').skip(1).step_by(2);
        let unknown = names.next().unwrap_or_default();
        let known: Vec<&str> = names.collect();
        review.problem(
            Some(span),
            format!(
                "{key} is an unknown key; expected {}",
                suggestion(unknown, &known)
            ),
        );
    } else if let Some((_, expected)) = message.rsplit_once(", expected ") {
        review.refuse(span, &key, in_toml_words(expected));
    } else {
        review.problem(Some(span), format!("{key}: {message}"));
    }
}

/// `one of a, b, c`, with the nearest of them first when one is near.
pub(super) fn suggestion(written: &str, known: &[&str]) -> String {
    let all = known.join(", ");
    let nearest = known
        .iter()
        .map(|name| (strsim::damerau_levenshtein(&start(written), name), name))
        .min_by_key(|(distance, _)| *distance);
    match nearest {
        Some((distance, name)) if distance <= 2 => format!("{name} (one of {all})"),
        _ => format!("one of {all}"),
    }
}

/// The first characters of a name: enough to compare, whatever the length of the input.
fn start(name: &str) -> String {
    name.chars().take(40).collect()
}

/// What the deserialiser calls the expected type, in words of a TOML file.
fn in_toml_words(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "i64" => "a whole number",
        "a sequence" => "an array",
        other if other.starts_with("struct ") => "a table",
        other => other,
    }
}

/// Keys from the top of the document to the key or value at byte `offset`.
fn path_to(table: &DeTable<'_>, offset: usize) -> Option<Vec<String>> {
    table.iter().find_map(|(key, value)| {
        let below = path_within(value.get_ref(), offset);
        let here = key.span().contains(&offset) || value.span().contains(&offset);
        let rest = below.or_else(|| here.then(Vec::new))?;
        Some([vec![key.get_ref().to_string()], rest].concat())
    })
}

fn path_within(value: &DeValue<'_>, offset: usize) -> Option<Vec<String>> {
    match value {
        DeValue::Table(table) => path_to(table, offset),
        DeValue::Array(items) => items
            .iter()
            .find_map(|item| path_within(item.get_ref(), offset)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_near_names_are_suggested() {
        let known = ["metakernel", "files", "root"];
        assert_eq!(
            suggestion("metakernl", &known),
            "metakernel (one of metakernel, files, root)"
        );
        assert_eq!(suggestion("zzz", &known), "one of metakernel, files, root");
    }

    #[test]
    fn every_value_is_found_under_its_key() {
        let text = "site = \"a\"\n[pedr]\nfiles = [\"x\", \"y\"]\n[pedr.filter]\nclasses = [1]\n\
                    [[images]]\nid = \"one\"\nlines_header = 8\n[[images]]\nid = \"two\"\n";
        let table: toml::Table = toml::from_str(text).unwrap();
        let mut keys = BTreeMap::new();
        flatten("", &toml::Value::Table(table), &mut keys);
        let found: Vec<(&str, &str)> = keys.iter().map(|(key, value)| (&**key, &**value)).collect();
        let expected = [
            ("images.one.id", "one"),
            ("images.one.lines_header", "8"),
            ("images.two.id", "two"),
            ("pedr.files", "[\"x\", \"y\"]"),
            ("pedr.filter.classes", "[1]"),
            ("site", "a"),
        ];
        assert_eq!(found, expected);
    }
}
